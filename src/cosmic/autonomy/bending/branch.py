"""A first look at a span without any model: its baseline, its contact, and what went wrong."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from cosmic.autonomy.bending.result import BendingError
from cosmic.autonomy.bending.span import Span
from cosmic.frame.arrays import Floats, Mask

LEAST_POINTS: Final = 6
LEAST_OUT: Final = 4
CLEAR_SIGMAS: Final = 5.0
FREE_PART: Final = 0.125
"""Of a way: the part that the probe is taken to be free on."""


@dataclass(frozen=True, eq=False)
class Points:
    """The usable points of a span, in the order of time.

    Attributes
    ----------
    kept : ndarray of bool
        Which points of the span these are.
    """

    probe_um: Floats
    force_un: Floats
    std_un: Floats
    time_s: Floats
    loading: Mask
    kept: Mask

    @cached_property
    def free_force_un(self) -> Floats:
        """Baseline at each time, from where the probe was farthest from the fibre."""
        ends = []
        for branch in (self.loading, ~self.loading):
            if branch.any():
                probes, forces, times = (
                    values[branch] for values in (self.probe_um, self.force_un, self.time_s)
                )
                free = np.argsort(probes, kind="stable")[: max(2, round(FREE_PART * len(probes)))]
                ends.append((float(np.mean(times[free])), float(np.median(forces[free]))))
        times_s, levels = zip(*sorted(ends), strict=True)
        return np.asarray(np.interp(self.time_s, times_s, levels), dtype=np.float64)

    def but(self, mask: Mask) -> "Points":
        """Return these points without those of `mask`."""
        kept = self.kept.copy()
        kept[np.flatnonzero(self.kept)[mask]] = False
        stay = ~mask
        return Points(
            self.probe_um[stay],
            self.force_un[stay],
            self.std_un[stay],
            self.time_s[stay],
            self.loading[stay],
            kept,
        )


@dataclass(frozen=True, slots=True)
class Rough:
    """One branch as baseline and straight line."""

    hinge_um: float
    k_un_um: float


def points_of(span: Span) -> Points:
    """Return the points of a span that are numbers.

    Raises
    ------
    BendingError
        The arrays differ in length, times fall, or too few points are left.
    """
    count = len(span.probe_um)
    columns = (span.force_un, span.force_std_un, span.time_s, span.loading)
    if any(len(each) != count for each in columns):
        raise BendingError(
            f"the span at {span.nominal_um:g} um has {count} positions, but "
            f"{', '.join(str(len(each)) for each in columns)} forces, deviations, times and "
            "directions: each point needs all of them"
        )
    kept = np.isfinite(span.probe_um) & np.isfinite(span.force_un) & np.isfinite(span.time_s)
    kept &= np.isfinite(span.force_std_un) & (span.force_std_un > 0.0)
    if kept.sum() < LEAST_POINTS:
        raise BendingError(
            f"the span at {span.nominal_um:g} um has {kept.sum()} usable points, and a fit needs "
            f"{LEAST_POINTS}: measure it again with more steps"
        )
    if np.sum(span.loading[kept]) < LEAST_OUT:
        raise BendingError(
            f"the span at {span.nominal_um:g} um has {np.sum(span.loading[kept])} points on the "
            f"way out, and a fit needs {LEAST_OUT}: measure it again with more steps"
        )
    if not (np.diff(span.time_s[kept]) >= 0.0).all():
        raise BendingError(
            f"the span at {span.nominal_um:g} um has times that fall: its points stand in the "
            "order in which they were read"
        )
    for word, branch in (("out", kept & span.loading), ("back", kept & ~span.loading)):
        if branch.sum() > 1 and not np.ptp(span.probe_um[branch]) > 0.0:
            raise BendingError(
                f"the span at {span.nominal_um:g} um: the probe stood at one position all the way "
                f"{word}; look whether its sensor reads, and measure it again"
            )
    return Points(
        span.probe_um[kept],
        span.force_un[kept],
        span.force_std_un[kept],
        span.time_s[kept],
        span.loading[kept],
        kept,
    )


def stuck(points: Points, drift_un_sqrt_s: float) -> Mask:
    """Return where the fibre clings to the probe that goes back, and pulls.

    From the last contact down to where it lets go: the points between are no part of the
    baseline, even where the pull is too small to be seen.
    """
    out, nothing = points.loading, np.zeros(len(points.probe_um), dtype=np.bool_)
    if out.sum() < LEAST_POINTS or out.all():
        return nothing
    free = out & (points.probe_um <= np.quantile(points.probe_um[out], FREE_PART))
    level = float(np.mean(points.force_un[free]))
    waited_s = np.maximum(points.time_s - float(np.mean(points.time_s[free])), 0.0)
    noise = np.sqrt(points.std_un**2 + drift_un_sqrt_s**2 * waited_s)
    pulls = ~out & (points.force_un - level < -CLEAR_SIGMAS * noise)
    if not pulls.any():
        return nothing
    hinge = rough(points, out, np.full(len(points.probe_um), level)).hinge_um
    lowest = float(np.min(points.probe_um[pulls]))
    between = (points.probe_um >= lowest) & (points.probe_um <= hinge)
    return np.asarray(~out & (pulls | between), dtype=np.bool_)


def rough(points: Points, branch: Mask, baseline_un: Floats) -> Rough:
    """Return where a branch has its kink, trying each position; no rise where there is but one."""
    order = np.argsort(points.probe_um[branch], kind="stable")
    travel = points.probe_um[branch][order]
    if not np.ptp(travel) > 0.0:
        return Rough(float(travel[0]), 0.0)
    force = (points.force_un - baseline_un)[branch][order]
    positions = np.unique(np.concatenate([travel, (travel[1:] + travel[:-1]) / 2.0]))[:-1]
    ramp = np.maximum(travel - positions[:, None], 0.0)
    # Of the best line through zero at each position, what it leaves unexplained.
    k = (ramp @ force) / (ramp * ramp).sum(axis=1)
    left = ((force - k[:, None] * ramp) ** 2).sum(axis=1)
    best = int(np.argmin(left))
    return Rough(float(positions[best]), float(k[best]))


def through_highest(points: Points, branch: Mask, baseline_un: Floats, k_un_um: float) -> Rough:
    """Return the branch of a known stiffness that goes through the highest force."""
    height = (points.force_un - baseline_un)[branch]
    highest = int(np.argmax(height))
    return Rough(float(points.probe_um[branch][highest] - height[highest] / k_un_um), k_un_um)


NEAR_RANGE: Final = 0.98
NEIGHBOURS: Final = 3
LOST_PART: Final = 0.4
"""Of the highest force so far: less than this farther out is a force that was lost."""

COMPARED_FROM: Final = 0.2
"""Of the highest force: the lowest at which the ways out and back are compared."""


def touched(points: Points, drift_un_sqrt_s: float) -> bool:
    """Return whether neighbouring points rise clearly above the baseline on the way out."""
    out = points.loading if points.loading.sum() >= NEIGHBOURS else np.ones_like(points.loading)
    order = np.argsort(points.probe_um[out], kind="stable")
    height = (points.force_un - points.free_force_un)[out][order]
    mean = np.convolve(height, np.full(NEIGHBOURS, 1.0 / NEIGHBOURS), mode="valid")
    took_s = float(np.ptp(points.time_s[out]))
    noise = math.hypot(
        float(np.median(points.std_un)) / math.sqrt(NEIGHBOURS), drift_un_sqrt_s * math.sqrt(took_s)
    )
    return bool(np.max(mean) > CLEAR_SIGMAS * noise)


def clear_points(points: Points, travel: Mask) -> int:
    """Return how many points of one way stand clear of the baseline."""
    height = (points.force_un - points.free_force_un)[travel]
    return int(np.sum(height > CLEAR_SIGMAS * points.std_un[travel]))


def saturated(span: Span, range_un: float) -> bool:
    """Return whether any force comes near the end of the sensor's range."""
    forces = span.force_un[np.isfinite(span.force_un)]
    return bool(np.max(np.abs(forces), initial=0.0) >= NEAR_RANGE * range_un)


def lost_while_pushing(points: Points, position_std_um: float) -> bool:
    """Return whether the force fell while the probe went on: fibre broken, or passed by.

    `position_std_um` is how well positions are known: where a stiff span is touched again, the same
    position reads another force.
    """
    out = points.loading
    height = (points.force_un - points.free_force_un)[out]
    travel, std = points.probe_um[out], points.std_un[out]
    if len(travel) < 3:
        return False
    order = np.argsort(travel, kind="stable")
    travel, height, std = travel[order], height[order], std[order]
    nearer = np.searchsorted(travel, travel - CLEAR_SIGMAS * position_std_um, side="right")
    highest = np.concatenate([[-np.inf], np.maximum.accumulate(height)])[nearer]
    clear = highest > 2.0 * CLEAR_SIGMAS * std
    return bool(np.any(clear & (height < LOST_PART * highest)))


def back_and_forth_percent(points: Points, baseline_un: Floats) -> float:
    """Return the mean force that the way out has more than the way back, of the highest."""
    height = points.force_un - baseline_un
    out, back = points.loading, ~points.loading
    if out.sum() < 3 or back.sum() < 3:
        return math.nan
    order = np.argsort(points.probe_um[back], kind="stable")
    travel, force = points.probe_um[back][order], height[back][order]
    peak = float(np.max(height[out]))
    high = (height[out] > COMPARED_FROM * peak) & (points.probe_um[out] <= travel[-1])
    if not high.any():
        return math.nan
    there = np.interp(points.probe_um[out][high], travel, force)
    return 100.0 * float(np.mean(height[out][high] - there)) / peak
