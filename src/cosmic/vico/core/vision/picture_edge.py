"""Where the picture ends before the image does: a round field, a frame, a missing tile.

A fibre ends there as sharply as at its own end. But the ground on both sides of it changes at once
as well: by a step, or it has no noise any more, as where something was filled in.
"""

from typing import Final

import numpy as np

from cosmic.frame.arrays import ByteMask, Floats
from cosmic.vico.core.vision.ends import EndKind, bent, leaving
from cosmic.vico.core.vision.grey import middle
from cosmic.vico.core.vision.profiles import Scene, sample
from cosmic.vico.core.vision.refine import Course
from cosmic.vico.core.vision.smoothing import directions

CUT: Final = "the ground changes at one of its ends: the picture may end there, and cut it off"

SHARE: Final = 0.2
"""Of the fibre's contrast, from which a step of the ground counts."""
TIMES: Final = 6.0
"""Standard deviations of noise from which it does."""
REACH_WIDTHS: Final = 2.5
"""How far before and behind the end it is looked for: the rim may be aslant."""
SOFT_PX: Final = 3.0
"""Over which the rim of a picture may be blurred by itself, to each side."""


def is_cut(scene: Scene, course: Course, explained: ByteMask, *, compressed: bool) -> bool:
    """Return whether the ground changes at a free end of a fibre, on both of its sides.

    Parameters
    ----------
    explained : ndarray, shape of the reduced image, uint8
        Where fibres lie, this one and the others.
    compressed : bool
        A block of a JPEG has no noise either.
    """
    return any(
        _changes(scene, course, at, explained, compressed=compressed)
        for at, end in zip((0, -1), course.ends, strict=True)
        if end.kind is EndKind.FREE
    )


def _changes(
    scene: Scene, course: Course, at: int, explained: ByteMask, *, compressed: bool
) -> bool:
    line = course.line if at else course.line[::-1]
    size = max(6, round(0.8 * course.width))
    gap = round(SOFT_PX + course.edge_blur_px)
    reach = round(REACH_WIDTHS * course.width) + gap + size
    axis = bent(line, leaving(line, course.width), np.arange(-reach, reach + 1.0))
    tangent = directions(axis)
    normal = np.column_stack([-tangent[:, 1], tangent[:, 0]])
    # Beyond what is painted of the fibre itself.
    first = 0.5 * course.width + max(2.0 * course.edge_blur_px + 2.0, 4.0 * scene.factor)
    across = (first + np.arange(float(size)))[:, None, None]
    sides = [_side(scene, axis + side * across * normal, explained) for side in (-1.0, 1.0)]
    contrast = middle(course.contrast[course.good]) if course.good.any() else 1.0
    noise = max(course.noise, 0.3 * scene.step) / np.sqrt(0.5 * size * size)
    least = max(SHARE * contrast, TIMES * noise)
    steps = [_step(side, size, gap) for side in sides]
    if all(step > least for step in steps) or all(step < -least for step in steps):
        return True
    return not compressed and all(_goes_still(scene, side, size) for side in sides)


def _side(scene: Scene, points: Floats, explained: ByteMask) -> Floats:
    """Return the ground at points (rows, columns, 2), NaN beyond the image and on fibres."""
    x, y = (points[..., axis].astype(np.float32) for axis in (0, 1))
    right, bottom = scene.corner
    free = (x >= 0) & (x <= right) & (y >= 0) & (y <= bottom)
    columns, rows = (np.rint(scene.reduced_by_axis(each)).astype(int) for each in (x, y))
    last_row, last_column = np.array(explained.shape) - 1
    free &= explained[np.clip(rows, 0, last_row), np.clip(columns, 0, last_column)] == 0
    return np.where(free, sample(scene.image, x, y).astype(np.float64), np.nan)


def _step(side: Floats, size: int, gap: int) -> float:
    """Return the largest change between stretches of `size` with a gap between them, signed."""
    free = np.isfinite(side)
    count = _sums(free.sum(axis=0, dtype=np.float64), size)
    total = _sums(np.where(free, side, 0.0).sum(axis=0), size)
    means = np.where(2 * count > size * len(side), total / np.maximum(count, 1.0), np.nan)
    found = means[size + 2 * gap :] - means[: -size - 2 * gap]
    known = found[np.isfinite(found)]
    return float(known[np.argmax(np.abs(known))]) if len(known) else 0.0


def _sums(values: Floats, size: int) -> Floats:
    padded = np.concatenate([[0.0], np.cumsum(values)])
    return np.asarray(padded[size:] - padded[:-size])


def _goes_still(scene: Scene, side: Floats, size: int) -> bool:
    """Return whether ground with noise turns to ground of one level, no end of the range."""
    before, behind = side[:, :size], side[:, -size:]
    if not (np.isfinite(before).all() and np.isfinite(behind).all()):
        return False
    if np.ptp(behind) > 0.0 or np.ptp(before) == 0.0:
        return False
    return float(scene.image.min()) < float(behind[0, 0]) < float(scene.image.max())
