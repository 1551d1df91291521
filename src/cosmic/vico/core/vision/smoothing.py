"""A curve through uncertain points: as smooth as they allow, across gaps as well."""

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import solveh_banded

from cosmic.vico.core.vision.grey import Floats

ORDER = 3


def smooth(values: Floats, weights: Floats, wave: float) -> Floats:
    """Return values (n, k) smoothed with weights (n); `wave` samples is what is halved.

    The third difference is kept small (Whittaker, Henderson), so that arcs are left as they are
    and gaps are bridged with an even change of curvature.
    """
    count = len(values)
    if count <= ORDER + 1:
        return values
    strength = (2.0 * np.sin(np.pi / max(wave, 2.5))) ** (-2 * ORDER)
    stencil = np.array([-1.0, 3.0, -3.0, 1.0])
    bands = np.zeros((ORDER + 1, count))
    for first in range(ORDER + 1):
        for last in range(first, ORDER + 1):
            product = strength * stencil[first] * stencil[last]
            bands[last - first, first : count - ORDER + first] += product
    bands[0] += weights + 1e-9
    lower = np.zeros_like(bands)
    for offset in range(ORDER + 1):
        lower[offset, : count - offset] = bands[offset, : count - offset]
    right = values * (weights + 1e-9)[:, None]
    return np.asarray(solveh_banded(lower, right, lower=True, check_finite=False))


def arc_lengths(line: Floats) -> Floats:
    """Return the length from the start to each point, along the chords."""
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def resampled(line: Floats, step: float, multiple: int = 1) -> Floats:
    """Return points about `step` apart along a spline; a multiple of intervals if asked for."""
    s = arc_lengths(line)
    keep = np.concatenate([[True], np.diff(s) > 1e-6])
    s, line = s[keep], line[keep]
    if len(line) < 2:
        return line
    count = multiple * max(1, round(float(s[-1]) / step / multiple)) + 1
    at = np.linspace(0.0, float(s[-1]), count)
    if len(line) < ORDER + 1:
        return np.column_stack([np.interp(at, s, line[:, axis]) for axis in (0, 1)])
    return np.asarray(CubicSpline(s, line)(at))


def directions(line: Floats) -> Floats:
    """Return the unit tangent at each point."""
    tangent = np.gradient(line, axis=0)
    norm = np.linalg.norm(tangent, axis=1, keepdims=True)
    return np.asarray(tangent / np.maximum(norm, 1e-9))
