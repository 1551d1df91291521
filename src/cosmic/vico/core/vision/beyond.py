"""What goes on beyond an end: a fibre that thins or fades there is not whole.

Rays leave an end in all directions. Where something narrow and fainter than the fibre goes on, the
rays along it differ from those beside them, near the end and further away alike; in the direction
the fibre comes from they are left out, and so is what belongs to other fibres.
"""

from typing import Final

import numpy as np
from scipy.ndimage import maximum_filter1d, median_filter

from cosmic.frame.arrays import ByteMask, Floats, Mask
from cosmic.vico.core.vision.ends import EndKind, bent, leaving
from cosmic.vico.core.vision.grey import middle
from cosmic.vico.core.vision.profiles import Scene, sample, within
from cosmic.vico.core.vision.refine import STEP_PX, Course
from cosmic.vico.core.vision.smoothing import directions

GOES_ON = "something thinner or fainter goes on beyond an end: it may be a part of a fibre"
SOFT = "an end is less sharp than the image, so that the fibre may go on"
COVERED = "something of the other shade than the fibre lies at an end, and may cover a part of it"

RAYS: Final = 144
AHEAD_DEG: Final = 80.0
BACK_DEG: Final = 125.0
FEWEST_RAYS: Final = 30
AROUND: Final = 45
"""Rays among which one must stand out."""
# Standard deviations among the rays, and a share of the fibre's contrast, from which it counts.
TIMES: Final = 5.0
SHARE: Final = 0.07
# How far an end is blurred: by the image, by a slanting or round cut.
SOFT_BLURS: Final = 3.0
SOFT_WIDTHS: Final = 0.6
# Of the fibre's contrast, from which what lies before an end is something.
COVER_SHARE: Final = 0.04
# The same on an image as JPEG, which leaves seams of its own around what is dark.
COMPRESSED_COVER_SHARE: Final = 0.1
# Widths from an end within which the ground beside it is looked at, and to where it may slope.
BESIDE: Final = (1.0, 4.0)
DEEP_WIDTHS: Final = 12.0


def goes_on(scene: Scene, course: Course, explained: ByteMask) -> float:
    """Return how clearly something goes on beyond an end; from 1 on it counts.

    Parameters
    ----------
    explained : ndarray, shape of the reduced image, uint8
        Where fibres lie, this one and the others.
    """
    found = [0.0]
    for at, end in zip((0, -1), course.ends, strict=True):
        if end.kind is EndKind.FREE:
            found.append(_rays(scene, course, at, explained))
    return max(found)


def soft(course: Course) -> float:
    """Return how much less sharp an end is than image and cut make it; from 1 on it counts."""
    blur = course.edge_blur_px
    usual = SOFT_BLURS * blur + SOFT_WIDTHS * course.width
    return max([0.0, *(end.soft_px / usual for end in course.ends if end.kind is EndKind.FREE)])


def is_covered(scene: Scene, course: Course, *, compressed: bool) -> bool:
    """Return whether the ground before a free end is lighter than beside a darker fibre.

    (Darker, for a lighter one.) What sharpening leaves before an end it leaves beside it as well.
    """
    contrast = middle(course.contrast[course.good]) if course.good.any() else 1.0
    size = max(4.0, 0.8 * course.width)
    first = 1.5 * course.edge_blur_px + 1.0
    share = COMPRESSED_COVER_SHARE if compressed else COVER_SHARE
    least = max(share * contrast, TIMES * course.noise / size)
    away = first + np.arange(size)
    for at, end in zip((0, -1), course.ends, strict=True):
        if end.kind is not EndKind.FREE:
            continue
        line = course.line if at else course.line[::-1]
        half = max(1.0, 0.4 * course.width)
        before = _level(scene, line, away, np.arange(-half, half + 0.5))
        # Two points at least show where it runs: JPEG leaves things thinner than a pixel.
        inner = -BESIDE[0] * course.width - np.arange(max(2.0, course.width * np.ptp(BESIDE)))
        beside = [
            _level(scene, line, inner, side * (0.5 * course.width + away)) for side in (-1.0, 1.0)
        ]
        ground = scene.sign * (course.ground if at else course.ground[::-1])
        further = float(away.mean()) + 0.5 * sum(BESIDE) * course.width
        if min(beside) + further * _slope(ground, course.width) - before > least:
            return True
    return False


def _slope(ground: Floats, width: float) -> float:
    """Return by how much the ground changes in a pixel towards an end; 0 where it is short.

    The light of an image falls off to a side. What is measured lies where the ground beside the
    end is, and further inside, so that it does not show what covers the end.
    """
    near, far, deepest = (
        max(0, len(ground) - int(each * width / STEP_PX)) for each in (*BESIDE, DEEP_WIDTHS)
    )
    beside, inside = ground[far:near], ground[deepest:far]
    if not 0 < len(beside) <= len(inside):
        return 0.0
    apart_px = 0.5 * STEP_PX * (len(beside) + len(inside))
    return (middle(beside) - middle(inside)) / apart_px


def _level(scene: Scene, line: Floats, along: Floats, across: Floats) -> float:
    """Return how far what lies along, and across, from an end stands out as the fibre does."""
    axis = bent(line, leaving(line, float(len(across))), along)
    tangent = directions(axis)
    normal = np.column_stack([-tangent[:, 1], tangent[:, 0]])
    points = axis[:, None] + across[None, :, None] * normal[:, None]
    x, y = (points[..., n].astype(np.float32) for n in (0, 1))
    inside = within(scene, x, y)
    if not inside.any():
        return 0.0
    return scene.sign * middle(sample(scene.image, x, y)[inside].astype(np.float64))


def _rays(scene: Scene, course: Course, at: int, explained: ByteMask) -> float:
    line = course.line if at else course.line[::-1]
    count = min(max(round(0.6 * course.width), 3), max(3, len(line) // 3))
    out = line[-1] - line[-1 - min(count, len(line) - 1)]
    blur = course.edge_blur_px
    first = 0.5 * course.width + 2.0 * blur + 2.0
    size = max(8.0, 1.2 * course.width)
    radii = first + np.arange(0.0, 2.0 * size)
    turns = np.linspace(-np.pi, np.pi, RAYS, endpoint=False)
    angles = np.arctan2(out[1], out[0]) + turns
    x = (line[-1, 0] + radii[:, None] * np.cos(angles)).astype(np.float32)
    y = (line[-1, 1] + radii[:, None] * np.sin(angles)).astype(np.float32)
    right, bottom = scene.corner
    free = (x >= 0) & (x <= right) & (y >= 0) & (y <= bottom)
    free &= (
        sample(explained.astype(np.float32), scene.reduced_by_axis(x), scene.reduced_by_axis(y))
        < 0.1
    )
    values = (scene.sign * sample(scene.image, x, y)).astype(np.float64)
    half = len(radii) // 2
    near, far = (_means(values[part], free[part]) for part in (slice(half), slice(half, None)))
    known = np.isfinite(near) & np.isfinite(far) & (np.abs(turns) < np.radians(BACK_DEG))
    if known.sum() < FEWEST_RAYS:
        return 0.0
    ahead = known & (np.abs(turns) < np.radians(AHEAD_DEG))
    if not ahead.any():
        return 0.0
    near, far = _above(near, known), _above(far, known)
    both = np.minimum(near, _widest(far))
    spread = max(_spread(near[known]), _spread(far[known]))
    contrast = middle(course.contrast[course.good]) if course.good.any() else 1.0
    return float(both[ahead].max()) / max(TIMES * spread, SHARE * contrast)


def _means(values: Floats, free: Mask) -> Floats:
    """Return the mean of each ray as far as it is free; NaN where less than half is."""
    count = free.sum(axis=0)
    total = np.where(free, values, 0.0).sum(axis=0)
    mean = np.where(2 * count > len(values), total / np.maximum(count, 1), np.nan)
    # Neighbouring rays show the same pixels near the end.
    padded = np.concatenate([mean[-1:], mean, mean[:1]])
    return np.asarray((padded[:-2] + padded[1:-1] + padded[2:]) / 3.0)


def _above(mean: Floats, known: Mask) -> Floats:
    """Return how far rays lie above those around them, light that falls off taken away."""
    filled = np.where(known, mean, middle(mean[known]))
    order = np.flatnonzero(known)
    filled = np.interp(np.arange(RAYS), order, filled[order])
    return np.asarray(np.where(known, filled - median_filter(filled, AROUND), -np.inf))


def _widest(values: Floats) -> Floats:
    """Return the largest of each ray and its neighbours: what goes on may bend."""
    return np.asarray(maximum_filter1d(values, 2 * (RAYS // 30) + 1, mode="wrap"))


def _spread(values: Floats) -> float:
    """Return a robust standard deviation."""
    return 1.4826 * middle(np.abs(values - middle(values)))
