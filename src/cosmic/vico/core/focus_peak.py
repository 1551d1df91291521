"""Where a curve of sharpness has its peak, and how sure that is."""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

ROUGHEST: Final = 0.5
LEAST_SIGNIFICANCE: Final = 3.0


def around_peak(sweep: Sequence[tuple[float, float]], least: float) -> list[tuple[float, float]]:
    """Return the run of points about the best that are at least `least`, and five at least."""
    best = int(np.argmax([measure for _, measure in sweep]))
    first = last = best
    while first > 0 and sweep[first - 1][1] >= least:
        first -= 1
    while last < len(sweep) - 1 and sweep[last + 1][1] >= least:
        last += 1
    return list(sweep[min(first, max(0, best - 2)) : max(last, best + 2) + 1])


def rough(sweep: Sequence[tuple[float, float]]) -> bool:
    """Return whether neighbours differ as noise does (von Neumann's ratio, 1 for pure noise)."""
    measures = np.array([measure for _, measure in sweep])
    return bool(np.mean(np.diff(measures) ** 2) > ROUGHEST * 2.0 * measures.var(ddof=1))


def vertex(points: Sequence[tuple[float, float]]) -> tuple[float, float] | None:
    """Return the top of the parabola through the logarithms and its standard deviation.

    None where the points make none.
    """
    positions, measures = np.array(points, dtype=np.float64).T
    if len(positions) < 4 or measures.min() <= 0.0:
        return None
    middle, width = positions.mean(), np.ptp(positions)
    design = np.vander((positions - middle) / width, 3)
    inverse = np.linalg.pinv(design.T @ design)
    curve = inverse @ design.T @ np.log(measures)
    error = np.log(measures) - design @ curve
    second, first = float(curve[0]), float(curve[1])
    covariance = inverse * float(error @ error) / (len(positions) - 3)
    if not second < -LEAST_SIGNIFICANCE * math.sqrt(float(covariance[0, 0])):
        return None
    slope = np.array([first / (2.0 * second**2), -1.0 / (2.0 * second), 0.0])
    std = math.sqrt(float(slope @ covariance @ slope))
    return float(middle - width * first / (2.0 * second)), float(width * std)
