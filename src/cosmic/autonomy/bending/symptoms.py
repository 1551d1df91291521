"""What can be seen on a span without any model: force lost, force cut off, force left behind."""

import math
from typing import Final

import numpy as np

from cosmic.autonomy.bending.branch import CLEAR_SIGMAS, Mask, Points, free_force_un
from cosmic.autonomy.bending.result import Floats
from cosmic.autonomy.bending.span import Span

NEAR_RANGE: Final = 0.98
NEIGHBOURS: Final = 3
LEAST_CLEAR: Final = 2
LOST_PART: Final = 0.4
"""Of the highest force so far: less than this farther out is a force that was lost."""

COMPARED_FROM: Final = 0.2
"""Of the highest force: the lowest at which the ways out and back are compared."""


def touched(points: Points, drift_un_sqrt_s: float) -> bool:
    """Return whether neighbouring points rise clearly above the baseline on the way out."""
    out = points.loading if points.loading.sum() >= NEIGHBOURS else np.ones_like(points.loading)
    order = np.argsort(points.way_um[out], kind="stable")
    height = (points.force_un - free_force_un(points))[out][order]
    mean = np.convolve(height, np.full(NEIGHBOURS, 1.0 / NEIGHBOURS), mode="valid")
    took_s = float(np.ptp(points.time_s[out]))
    noise = math.hypot(
        float(np.median(points.std_un)) / math.sqrt(NEIGHBOURS), drift_un_sqrt_s * math.sqrt(took_s)
    )
    return bool(np.max(mean) > CLEAR_SIGMAS * noise)


def rises(points: Points, way: Mask) -> bool:
    """Return whether a few points of one way stand clear of the baseline."""
    height = (points.force_un - free_force_un(points))[way]
    return bool(np.sum(height > CLEAR_SIGMAS * points.std_un[way]) >= LEAST_CLEAR)


def saturated(span: Span, range_un: float) -> bool:
    """Return whether any force comes near the end of the sensor's range."""
    forces = span.force_un[np.isfinite(span.force_un)]
    return bool(np.max(np.abs(forces), initial=0.0) >= NEAR_RANGE * range_un)


def lost_while_pushing(points: Points) -> bool:
    """Return whether the force fell while the probe went on: fibre broken, or passed by."""
    out = points.loading
    height = (points.force_un - free_force_un(points))[out]
    way, std = points.way_um[out], points.std_un[out]
    if len(way) < 3:
        return False
    order = np.argsort(way, kind="stable")
    highest = np.maximum.accumulate(height[order])
    clear = highest > 2.0 * CLEAR_SIGMAS * std[order]
    return bool(np.any(clear & (height[order] < LOST_PART * highest)))


def back_and_forth_percent(points: Points, baseline_un: Floats) -> float:
    """Return the mean force that the way out has more than the way back, of the highest."""
    height = points.force_un - baseline_un
    out, back = points.loading, ~points.loading
    if out.sum() < 3 or back.sum() < 3:
        return math.nan
    order = np.argsort(points.way_um[back], kind="stable")
    way, force = points.way_um[back][order], height[back][order]
    peak = float(np.max(height[out]))
    high = (height[out] > COMPARED_FROM * peak) & (points.way_um[out] <= way[-1])
    if not high.any():
        return math.nan
    there = np.interp(points.way_um[out][high], way, force)
    return 100.0 * float(np.mean(height[out][high] - there)) / peak
