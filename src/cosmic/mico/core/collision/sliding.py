"""Two pieces that slide past each other: the smallest gap over a joint box, exactly bounded.

The distance of two convex bodies is a convex function of how one is shifted against the other.
Wherever it has been measured, the plane normal to the two nearest points bounds it from below
everywhere else (directional conservative advancement). Two such bounds together are a better one.
"""

import math
from dataclasses import dataclass
from itertools import product
from typing import Final

import numpy as np

from cosmic.mico.core.collision.closest import Point, dot, mix, nearest_of
from cosmic.mico.core.collision.fcl_pieces import ConvexPiece, gap_along, separation
from cosmic.mico.core.collision.model import Floats

MOST_STEPS: Final = 30


def decide(
    first: Floats,
    second: Floats,
    shifts: Floats,
    half: Floats,
    margin_um: float,
    guess: Floats | None = None,
) -> tuple[bool, Floats] | None:
    """Return whether a piece clears another anywhere in a box; None where that stays open.

    Parameters
    ----------
    first, second : ndarray, shape (3, n), um
        Vertices in the world with the joints in the middle of the box.
    shifts : ndarray, shape (3, m)
        How the joints shift the second piece against the first.
    half : ndarray, shape (m,)
        Half the widths of the box.
    guess : ndarray, shape (3,), or None
        A direction to begin with.

    Returns
    -------
    tuple of bool and ndarray
        True with the unit vector along which the gap is proved; or False with joint values,
        shape (m,), from the middle of the box, at which the two are no farther apart than the
        margin.
    """
    normal = guess if guess is not None else second.mean(axis=1) - first.mean(axis=1)
    length = math.sqrt(normal @ normal)
    normal = normal / length if length > 0.0 else np.array((1.0, 0.0, 0.0))
    corners: list[Point] = []
    places: list[Floats] = []
    above = math.inf
    for _ in range(MOST_STEPS):
        one, other = normal @ first, normal @ second
        near, far = int(one.argmax()), int(other.argmin())
        slope = normal @ shifts
        below = float(other[far] - one[near] - np.abs(slope) @ half)
        if below > margin_um:
            return True, normal
        if corners and not above - below > 1e-9 * (1.0 + above):
            return None
        place = -half * np.sign(slope)
        x, y, z = (second[:, far] - first[:, near] + shifts @ place).tolist()
        corners.append((x, y, z))
        places.append(place)
        shares = nearest_of(corners)
        point = mix(corners, shares)
        above = math.sqrt(dot(point, point))
        if above <= margin_um:
            return False, np.asarray(sum(share * places[number] for number, share in shares))
        kept = [(corners[number], places[number]) for number, share in shares if share > 0.0]
        corners, places = [corner for corner, _ in kept], [place for _, place in kept]
        if len(kept) == 4:
            return None
        normal = np.array(point) / above
    return None


MOST_QUERIES: Final = 14
"""After so many distances the swept body is built and measured once instead."""
NOTHING_UM: Final = 1e-6
_SHARES: Final = np.linspace(0.0, 1.0, 17)


@dataclass(frozen=True, slots=True)
class Slide:
    """Two pieces, and how the second is shifted against the first.

    Attributes
    ----------
    place_um : ndarray, shape (3,)
        Where the second piece stands in the middle of the box; the first stands there already.
    shifts : ndarray, shape (3, m), um/um
        How joint values shift the second against the first.
    half : ndarray, shape (m,)
        Half the widths of the box.
    start : ndarray, shape (m,)
        Where the joints stand, from the middle of the box.
    lowest, highest : ndarray, shape (m,)
        From `start`: how far the joints can go from where they stand; see `MotionBox.lowest`.
    known : bool
        All joints stand where they are said to.
    """

    first: ConvexPiece
    second: ConvexPiece
    rotation: Floats
    place_um: Floats
    shifts: Floats
    half: Floats
    start: Floats
    lowest: Floats
    highest: Floats
    known: bool


@dataclass(frozen=True, slots=True)
class Finding:
    """Whether two pieces keep their margin; if not, at which joint values they do not.

    Attributes
    ----------
    at : ndarray, shape (m,), or None
        From the middle of the box.
    normal : ndarray, shape (3,), or None
        Direction that proved the gap: a good first guess the next time.
    """

    clear: bool
    at: Floats | None = None
    normal: Floats | None = None


@dataclass(frozen=True, slots=True)
class _Bound:
    """The gap is nowhere less than `value` + `slope` . shift."""

    value: float
    slope: Floats

    def least(self, half: Floats) -> float:
        return float(self.value - np.abs(self.slope) @ half)

    def corner(self, half: Floats, otherwise: Floats) -> Floats:
        """Return where the bound is least; where it is level, the place `otherwise`."""
        level = np.abs(self.slope) <= 1e-12
        return np.asarray(np.where(level, otherwise, -half * np.sign(self.slope)))


def guess_holds(slide: Slide, normal: Floats, margin_um: float) -> bool:
    """Return True when `normal` alone proves the gap, without measuring a distance."""
    slide.second.put(slide.rotation, slide.place_um)
    gap = gap_along(slide.first, slide.second, normal)
    return bool(gap - np.abs(normal @ slide.shifts) @ slide.half > margin_um)


def smallest_gap(slide: Slide, margin_um: float, guess: Floats | None = None) -> Finding:
    """Decide whether the gap stays above `margin_um` over the whole box."""
    first, second = slide.first, slide.second
    second.put(slide.rotation, slide.place_um)
    answer = decide(first.world_um(), second.world_um(), slide.shifts, slide.half, margin_um, guess)
    if answer is not None and answer[0]:
        return Finding(clear=True, normal=answer[1])
    if slide.known:
        second.put(slide.rotation, slide.place_um + slide.shifts @ slide.start)
        found = separation(first, second)
        if found.gap_um > 0.0 and leaves(slide, np.array(found.normal)):
            return Finding(clear=True)
    if answer is not None:
        return Finding(clear=False, at=answer[1])
    return by_advancement(slide, margin_um)


def by_advancement(slide: Slide, margin_um: float) -> Finding:
    """Decide the same by distances at several places, where the quick way leaves it open."""
    half, at = slide.half, slide.start
    best: _Bound | None = None
    closest, closest_gap = at, np.inf
    for _ in range(MOST_QUERIES):
        slide.second.put(slide.rotation, slide.place_um + slide.shifts @ at)
        found = separation(slide.first, slide.second)
        normal = np.array(found.normal)
        slope = normal @ slide.shifts
        if not found.gap_um > margin_um:
            return Finding(clear=False, at=at)
        if found.gap_um < closest_gap:
            closest, closest_gap = at, found.gap_um
        bound = _Bound(found.gap_um - float(slope @ at), slope)
        mixed = bound
        if best is not None and not bound.least(half) > margin_um:
            mixed = _mix(best, bound, half)
        if mixed.least(half) > margin_um:
            return Finding(clear=True, normal=normal)
        at = _next_place(best, bound, half, at)
        best = mixed
    return _by_hull(slide, margin_um, closest)


def leaves(slide: Slide, normal: Floats, *, strictly: bool = False) -> bool:
    """Return True for a movement that goes nowhere against `normal`, the nearest way apart.

    The gap of two convex bodies is then nowhere less than where the movement begins. `strictly`
    it also goes along it.
    """
    slope = normal @ slide.shifts
    low, high = slope * slide.lowest, slope * slide.highest
    if not float(np.minimum(low, high).sum()) >= -NOTHING_UM:
        return False
    return not strictly or float(np.maximum(low, high).sum()) > NOTHING_UM


def _mix(one: _Bound, other: _Bound, half: Floats) -> _Bound:
    """Return the best of the bounds that lie between two."""
    slopes = np.outer(1.0 - _SHARES, one.slope) + np.outer(_SHARES, other.slope)
    values = (1.0 - _SHARES) * one.value + _SHARES * other.value
    best = int(np.argmax(values - np.abs(slopes) @ half))
    return _Bound(float(values[best]), slopes[best])


def _next_place(best: _Bound | None, newest: _Bound, half: Floats, at: Floats) -> Floats:
    """Return where to measure next: where what is known so far allows the smallest gap."""
    there = newest.corner(half, at)
    if best is None:
        return there
    here = best.corner(half, at)
    # Along the line between both corners, one bound rises while the other falls.
    lead_here = (newest.value + newest.slope @ here) - (best.value + best.slope @ here)
    lead_there = (newest.value + newest.slope @ there) - (best.value + best.slope @ there)
    if not lead_here * lead_there < 0.0:
        return np.asarray((there + at) / 2.0 if np.array_equal(there, at) else there)
    share = lead_here / (lead_here - lead_there)
    return np.asarray(here + share * (there - here))


def _by_hull(slide: Slide, margin_um: float, closest: Floats) -> Finding:
    """Measure once, from the first piece to all that the second sweeps."""
    used = slide.half > 0.0
    signs = np.array(list(product((-1.0, 1.0), repeat=int(used.sum()))))
    corners = (signs * slide.half[used]) @ slide.shifts[:, used].T
    slide.second.put(slide.rotation, slide.place_um)
    found = separation(slide.first, slide.second.swept(corners))
    clear = found.gap_um > margin_um
    return Finding(clear=clear, at=None if clear else closest, normal=np.array(found.normal))
