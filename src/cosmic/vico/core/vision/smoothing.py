"""A curve through uncertain points: as smooth as they allow, across gaps as well."""

from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy.linalg.lapack import dpbsv
from scipy.ndimage import correlate1d, median_filter, minimum_filter1d

from cosmic.frame.arrays import Floats

ORDER = 3
KERNEL_DEVIATIONS = 4.0
"""So far out a Gaussian kernel goes."""


class UndeterminedError(Exception):
    """Points of which too few count to say where a curve of such stiffness runs."""


def smooth(values: Floats, weights: Floats, wave: float) -> Floats:
    """Return values (n, k) smoothed with weights (n); `wave` samples is what is halved.

    The third difference is kept small (Whittaker, Henderson), so that arcs are left as they are
    and gaps are bridged with an even change of curvature.

    Raises
    ------
    UndeterminedError
        Too few of them have a weight.
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
    right = values * (weights + 1e-9)[:, None]
    _, found, failed = dpbsv(bands, right, lower=True, overwrite_ab=True)
    if failed:
        raise UndeterminedError(
            f"{np.count_nonzero(weights)} of {count} points count, for {wave:.0f} points a wave"
        )
    return np.asarray(found)


def softened(values: Floats, sigma: float) -> Floats:
    """Return values after a Gaussian filter along their last axis, the ends repeated outside."""
    found = np.empty(values.shape)
    correlate1d(values, _gaussian(sigma), output=found, mode="nearest")
    return found


@lru_cache(maxsize=64)
def _gaussian(sigma: float) -> Floats:
    """Return a Gaussian kernel, which nobody changes."""
    reach = int(KERNEL_DEVIATIONS * sigma + 0.5)
    kernel = np.exp(-0.5 / (sigma * sigma) * np.arange(-reach, reach + 1) ** 2)
    kernel /= kernel.sum()
    kernel.flags.writeable = False
    return np.asarray(kernel)


def levelled(values: Floats, size: int) -> Floats:
    """Return the median of `size` values around each, the ends repeated outside."""
    found = np.empty_like(values)
    median_filter(values, size, output=found, mode="nearest")
    return found


def eroded(flags: npt.NDArray[np.bool_], reach: int) -> npt.NDArray[np.bool_]:
    """Return where all flags up to `reach` away are set, and none of these lies outside."""
    found = np.empty(flags.shape, np.uint8)
    minimum_filter1d(flags.view(np.uint8), 2 * reach + 1, output=found, mode="constant", cval=0)
    return found.view(np.bool_)


def arc_lengths(line: Floats) -> Floats:
    """Return the length from the start to each point, along the chords."""
    steps = line[1:] - line[:-1]
    found = np.zeros(len(line))
    np.cumsum(np.sqrt(np.einsum("ij,ij->i", steps, steps)), out=found[1:])
    return found


def resampled(line: Floats, step: float, multiple: int = 1) -> Floats:
    """Return points about `step` apart along a smooth curve through the points of a line.

    The number of intervals is a multiple of `multiple`.
    """
    s = arc_lengths(line)
    keep = np.concatenate([[True], np.diff(s) > 1e-6])
    s, line = s[keep], line[keep]
    if len(line) < 2:
        return line
    count = multiple * max(1, round(float(s[-1]) / step / multiple)) + 1
    at = np.linspace(0.0, float(s[-1]), count)
    if len(line) < ORDER + 1:
        return np.column_stack([np.interp(at, s, line[:, axis]) for axis in (0, 1)])
    return _curve(s, line, at)


def _curve(s: Floats, line: Floats, at: Floats) -> Floats:
    """Return a cubic through points at `s` with the slopes of parabolas (Catmull, Rom)."""
    gap = np.diff(s)[:, None]
    chord = np.diff(line, axis=0) / gap
    slope = np.empty_like(line)
    slope[1:-1] = (gap[1:] * chord[:-1] + gap[:-1] * chord[1:]) / (gap[1:] + gap[:-1])
    slope[0] = 2.0 * chord[0] - slope[1]
    slope[-1] = 2.0 * chord[-1] - slope[-2]
    index = np.clip(np.searchsorted(s, at, side="right") - 1, 0, len(gap) - 1)
    width = gap[index]
    part = (at - s[index])[:, None] / width
    rest = 1.0 - part
    after = index + 1
    first, last = line.take(index, axis=0), line.take(after, axis=0)
    mean_slope = chord.take(index, axis=0)
    bend = rest * (slope.take(index, axis=0) - mean_slope)
    bend -= part * (slope.take(after, axis=0) - mean_slope)
    return np.asarray(rest * first + part * last + part * rest * width * bend)


def directions(line: Floats) -> Floats:
    """Return the unit tangent at each point."""
    tangent = np.empty_like(line)
    tangent[1:-1] = line[2:] - line[:-2]
    tangent[0], tangent[-1] = line[1] - line[0], line[-1] - line[-2]
    norm = np.sqrt(np.einsum("ij,ij->i", tangent, tangent))
    return np.asarray(tangent / np.maximum(norm, 1e-9)[:, None])
