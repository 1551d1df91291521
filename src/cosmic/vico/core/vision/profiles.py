"""Grey levels across a fibre, and the edges in them."""

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from cosmic.frame.arrays import Floats, Floats32, Mask
from cosmic.vico.core.vision.grey import middle, middles
from cosmic.vico.core.vision.smoothing import directions, softened

AT_ONCE: Final = 32000
"""OpenCV takes grey levels at fewer than 32767 rows or columns of points at once."""


@dataclass(frozen=True, slots=True, eq=False)
class Profiles:
    """Cross sections of a fibre.

    Attributes
    ----------
    across : ndarray, shape (m,)
        Points along the normal, pixels.
    height : ndarray, shape (n, m)
        What stands out from the ground at each point of the line; fibre positive.
    clear : ndarray of bool, shape (n, m)
        Whether the point is ground or this fibre, as far as is known.
    noise : float
        Standard deviation of a single pixel of the ground.
    ground, tilt : ndarray, shape (n,)
        Level of the ground under the fibre, and how much it differs between the two sides.
    """

    across: Floats32
    height: Floats32
    clear: Mask
    noise: float
    normals: Floats
    ground: Floats
    tilt: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Edges:
    """Where each cross section has half of its height.

    Attributes
    ----------
    left, right : ndarray, shape (n,)
        Points along the normal; NaN where there is no edge where one is expected.
    contrast : ndarray, shape (n,)
        Height of each cross section.
    mean : ndarray, shape (m,)
        The typical cross section, 1 at its highest.
    cut : bool
        Whether it has not fallen to half of its height where other things cover what is beside it.
    """

    left: Floats
    right: Floats
    contrast: Floats
    mean: Floats
    steepness_px: float
    cut: bool = False


def sample(image: Floats32, x: Floats32, y: Floats32) -> Floats32:
    """Return grey levels at points, shape (n, m), the border repeated outside."""
    longer = int(np.argmax(x.shape))
    if x.shape[longer] > AT_ONCE:
        count = -(-x.shape[longer] // AT_ONCE)
        parts = zip(*(np.array_split(each, count, axis=longer) for each in (x, y)), strict=True)
        return np.concatenate([sample(image, *part) for part in parts], axis=longer)
    found = cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(found, dtype=np.float32)


def within(scene: "Scene", x: Floats32, y: Floats32) -> Mask:
    """Return which points lie on the image."""
    right, bottom = scene.corner + 0.5
    return np.asarray((x >= -0.5) & (x <= right) & (y >= -0.5) & (y <= bottom))


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """An image at full size with what was found on it at reduced size.

    Attributes
    ----------
    image : ndarray, float32
    taken : ndarray, float32
        1 where something stands out, reduced by `factor`.
    sign : float
        1 for fibres lighter than the ground, -1 for darker ones.
    step : float
        One of 256 levels of the range that the image uses.
    blockiness : float
        By how much more neighbours differ across borders of 8 x 8 pixels than elsewhere: JPEG.
    """

    image: Floats32
    taken: Floats32
    factor: int
    sign: float
    step: float = 1.0
    blockiness: float = 0.0

    @property
    def corner(self) -> Floats:
        """The largest x and y."""
        rows, columns = self.image.shape
        return np.array([columns - 1.0, rows - 1.0])

    def full(self, points: Floats) -> Floats:
        """Return points of the reduced image in full-size pixels."""
        return points * self.factor + 0.5 * (self.factor - 1)

    def reduced(self, points: Floats) -> Floats:
        """Return full-size points in pixels of the reduced image."""
        return (points - 0.5 * (self.factor - 1)) / self.factor

    def reduced_by_axis(self, points: Floats32) -> Floats32:
        """Return full-size x, or y, in pixels of the reduced image."""
        shift, factor = np.float32(0.5 * (self.factor - 1)), np.float32(self.factor)
        return np.asarray((points - shift) / factor)


def cross_sections(
    scene: Scene, line: Floats, width: float, reach: float, margin: float = 2.0
) -> Profiles:
    """Return the cross sections at the points of a line; ground begins `margin` off an edge."""
    tangent = directions(line)
    normals = np.column_stack([-tangent[:, 1], tangent[:, 0]])
    spacing = 0.5 if width < 12 else 1.0
    count = int(np.ceil(reach / spacing))
    across = (np.arange(-count, count + 1) * spacing).astype(np.float32)
    x, y = (
        (line[:, axis, None] + across[None, :] * normals[:, axis, None]).astype(np.float32)
        for axis in (0, 1)
    )
    values = sample(scene.image, x, y)
    inside = np.abs(across) < 0.5 * width + margin
    clear = np.ones(values.shape, np.bool_)
    beside = int(np.argmax(inside))
    if scene.taken.size > 1:
        for part in (slice(beside), slice(len(across) - beside, None)):
            at = (scene.reduced_by_axis(each[:, part]) for each in (x, y))
            clear[:, part] = sample(scene.taken, *at) < 0.25
    if (line < reach + 1.0).any() or (line > scene.corner - reach - 1.0).any():
        clear &= within(scene, x, y)
    ground, tilt, noise = ground_of(values, clear & ~inside[None, :], across)
    height = np.float32(scene.sign) * (values - ground)
    return Profiles(
        across, height, clear, noise, normals, ground[:, count].astype(np.float64), tilt
    )


def ground_of(values: Floats32, free: Mask, across: Floats32) -> tuple[Floats32, Floats, float]:
    """Return the ground under each cross section, sloping from side to side, and its noise."""
    raw = np.empty((4, len(values)))
    for number, side in enumerate((across < 0, across > 0)):
        part = (free & side[None, :]).astype(np.float32)
        raw[number] = np.einsum("ij,ij->i", values, part)
        raw[number + 2] = part.sum(axis=1)
    soft = softened(raw, 6.0)
    sides, seen = soft[:2], soft[2:]
    levels = [total / np.maximum(count, 1e-9) for total, count in zip(sides, seen, strict=True)]
    both = (sides[0] + sides[1]) / np.maximum(seen[0] + seen[1], 1e-9)
    # Where no ground is seen at all, what is seen elsewhere along the fibre serves.
    if not (seen[0] + seen[1] > 0.5).all() and (seen[0] + seen[1] > 0.5).any():
        known = np.flatnonzero(seen[0] + seen[1] > 0.5)
        both = np.interp(np.arange(len(both)), known, both[known])
    levels = [np.where(count > 0.5, level, both) for level, count in zip(levels, seen, strict=True)]
    reach = float(np.abs(across).max())
    share = np.clip(across / (1.4 * reach) + 0.5, 0.0, 1.0)[None, :].astype(np.float32)
    low, high = (level[:, None].astype(np.float32) for level in levels)
    ground = low + (high - low) * share
    thin = max(1, len(values) // 60)
    spread = np.abs(values[::thin] - ground[::thin])[free[::thin]]
    noise = 1.4826 * middle(spread) if len(spread) else 0.0
    return ground, np.abs(levels[1] - levels[0]), noise


def along(profiles: Profiles, sigma: float) -> Floats32:
    """Return the height of cross sections averaged along the fibre, where it is clear."""
    height = np.where(profiles.clear, profiles.height, np.float32(0.0))
    size = 2 * int(np.ceil(3.0 * sigma)) + 1
    weights = cv2.getGaussianKernel(size, sigma, cv2.CV_32F)
    one = np.ones((1, 1), np.float32)
    found = cv2.sepFilter2D(height, -1, one, weights, borderType=cv2.BORDER_REPLICATE)
    return np.asarray(found, dtype=np.float32)


def box_centres(profiles: Profiles, height: Floats32, width: float, reach: float) -> Floats:
    """Return where a box of the fibre's width fits best into each cross section."""
    across = profiles.across
    spacing = across[1] - across[0]
    total = np.cumsum(np.pad(height, ((0, 0), (1, 0))), axis=1)
    size = max(1, round(width / spacing))
    sums = total[:, size:] - total[:, :-size]
    middles = (across[: sums.shape[1]] + across[size - 1 :][: sums.shape[1]]) / 2
    sums = np.where(np.abs(middles)[None, :] <= reach, sums, -np.inf)
    best = np.argmax(sums, axis=1)
    return np.asarray(middles[best])


def typical_section(height: Floats32, good: Mask) -> Floats:
    """Return the median cross section, 1 at its highest."""
    rows = height[good] if good.any() else height
    rows = rows[:: len(rows) // 100 + 1]
    typical = middles(rows.T)
    return np.asarray(typical / max(float(typical.max()), 1e-9))


def level_crossing(mean: Floats, across: Floats32, level: float, side: int) -> float:
    """Return the outermost point on one side at which the typical section has a level."""
    x, y = across[::side], mean[::side]
    above = np.nonzero(y[:-1] >= level)[0]
    above = above[side * x[above] > -0.5 * side * x[-1]]
    for index in above[::-1]:
        if y[index + 1] < level:
            share = (y[index] - level) / (y[index] - y[index + 1])
            return float(x[index] + share * (x[index + 1] - x[index]))
    return float("nan")


def find_edges(profiles: Profiles, height: Floats32, good: Mask, width: float) -> Edges:
    """Return the outer edges of each cross section at half of its height."""
    across = profiles.across
    near = np.abs(across) < 0.8 * width + 3.0
    mean = np.where(near, typical_section(height, good), 0.0)
    weight = mean / max(float((mean**2).sum()), 1e-9)
    contrast = (height @ weight.astype(np.float32)).astype(np.float64)
    contrast = softened(contrast, 3.0)
    whole = np.maximum(contrast, 1e-6)[:, None].astype(np.float32)
    expected = [level_crossing(mean, across, 0.5, side) for side in (-1, 1)]
    found = [
        edge_near(height, whole, across, point, side, 0.35 * width + 2.0)
        for point, side in zip(expected, (-1, 1), strict=True)
    ]
    inner = [level_crossing(mean, across, 0.75, side) for side in (-1, 1)]
    outer = [level_crossing(mean, across, 0.25, side) for side in (-1, 1)]
    steep = float(np.nanmean(np.abs(np.subtract(outer, inner)))) if np.isfinite(inner).any() else 0
    cut = any(
        _is_cut(profiles, good, point, side) for point, side in zip(expected, (-1, 1), strict=True)
    )
    return Edges(found[0], found[1], contrast, mean, steep / 1.349, cut)


def _is_cut(profiles: Profiles, good: Mask, point: float, side: int) -> bool:
    """Return whether what lies right beyond an edge is covered on most of the length."""
    beyond = np.flatnonzero(side * (profiles.across - point) > 0.0)
    if not len(beyond) or not good.any():
        return False
    column = profiles.clear[good, beyond[0] if side > 0 else beyond[-1]]
    return float(column.mean()) < 0.5


def edge_near(
    height: Floats32, whole: Floats32, across: Floats32, point: float, side: int, most: float
) -> Floats:
    """Return where each section falls below half of `whole`, outwards, nearest to a point.

    NaN where it does so nowhere within `most` of it.
    """
    start = across[:-1] if side > 0 else across[1:]
    away = np.abs(start - np.float32(point))
    near = np.flatnonzero(away <= most)
    if not near.size:
        return np.full(len(height), np.nan)
    part = slice(int(near[0]), int(near[-1]) + 1)
    scaled = height[:, part.start : part.stop + 1] / whole
    inner, outer = (scaled[:, :-1], scaled[:, 1:]) if side > 0 else (scaled[:, 1:], scaled[:, :-1])
    falls = (inner >= 0.5) & (outer < 0.5)
    apart = np.where(falls, away[None, part], np.float32(np.inf))
    best = np.argmin(apart, axis=1)
    rows = np.arange(len(scaled))
    high = inner[rows, best]
    drop = np.maximum(high - outer[rows, best], 1e-9)
    share = (high - 0.5) / drop * (across[1] - across[0])
    found = (start[part][best] + side * share).astype(np.float64)
    return np.where(np.isfinite(apart[rows, best]), found, np.nan)
