"""Two pieces of which one slides: a plane between all that they sweep, or a place of touch.

The search of Gilbert, Johnson and Keerthi, run on what the second piece sweeps as seen from the
first. It asks for nothing but the farthest vertices in a direction, so that whatever it ends with
is proved by them: a plane with a gap on one side, two points too close on the other.
"""

import math
from typing import Final

import numpy as np

from cosmic.mico.core.collision.closest import Point, dot, mix, nearest_of
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
