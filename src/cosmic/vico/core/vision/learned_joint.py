"""A learned sign that one fibre ends on a course and another begins.

The hand-made signs of `axial` each look at one thing, and a joint that shows in no single one of
them passes. Here a small convolutional network looks at the pixels themselves: at the strip along
the fibre, straightened and scaled so that every fibre is as wide. It compares each place with the
whole strip, since what is a joint on a smooth fibre is unevenness on a rough one.

Its weights are those of `benchmarks/joint_training.py`, which draws fibres and pairs, finds them,
and learns where on them a drawn fibre ends. Nothing of it is a reason to doubt by itself.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Final

import numpy as np

from cosmic.frame.arrays import Floats, Floats32, Mask
from cosmic.vico.core.vision.axial import LEAST_WIDTH_PX, unshaded
from cosmic.vico.core.vision.grey import middle
from cosmic.vico.core.vision.profiles import Scene, sample
from cosmic.vico.core.vision.refine import Course
from cosmic.vico.core.vision.smoothing import arc_lengths, directions

WEIGHTS_FILE: Final = Path(__file__).with_name("learned_joint.npz")

# Columns of the strip in a width of the fibre; rows across, and how many widths they reach.
PER_WIDTH: Final = 8
ROWS: Final = 23
REACH: Final = 1.15
STRIDE: Final = 2
"""The network's answers are so many columns apart."""
FEWEST_COLUMNS: Final = 6 * PER_WIDTH
LOWEST, HIGHEST = -1.0, 2.0
"""What stands out is cut off there, in multiples of the fibre's contrast: glare, and dirt."""
MOST_TURNED: Final = 1.5
MIRRORED: Final = np.array([1.0] * ROWS + [-1.0, 1.0], np.float32)
"""What becomes of the channels of a strip where its sides are swapped, beside their order."""
LEAST_VARIANCE: Final = 1e-4
IN_ONE_THREAD: Final = 2**18
"""Multiplications that OpenBLAS does by itself. For more it wakes threads that then spin: an image
of 1600 x 1200 took 100 ms of the processor instead of 65."""
NONE_LOGIT: Final = -9.0
CLEAR_LOGIT: Final = 2.0
"""Logits at which the sign is 0 and 1."""


@dataclass(frozen=True, slots=True, eq=False)
class Strip:
    """A fibre straightened, as wide as any other.

    Attributes
    ----------
    levels : ndarray, shape (n, ROWS + 2), float32
        What stands out from the ground along and across, as a multiple of the fibre's contrast,
        and 0 where something else covers it. Then how far its course turns within a width, in
        radians, towards the last row; last, whether nothing else covers it.
    where : ndarray of bool, shape (n / STRIDE,)
        Where a joint would be seen: away from ends, and from what crosses.
    facts : ndarray, shape (5,), float32
        Noise in multiples of the contrast, blur in widths, JPEG, its blocks in widths, and the
        least width that is looked at in widths.
    """

    levels: Floats32
    where: Mask
    facts: Floats32


def clearest(scene: Scene, course: Course) -> float | None:
    """Return how clearly one fibre ends on a course and another begins; 0 where none is seen.

    None where the fibre is too thin or too short to tell.
    """
    found = strip_of(scene, course)
    return None if found is None else clearness(found)


def clearness(strip: Strip) -> float:
    """Return how clear the clearest joint on a strip is."""
    most = float(logits(strip, learned_weights())[strip.where].max())
    return max(0.0, (most - NONE_LOGIT) / (CLEAR_LOGIT - NONE_LOGIT))


def strip_of(scene: Scene, course: Course) -> Strip | None:
    """Return the strip along a course, or None where too little of it is seen to tell."""
    width = course.width
    if width < LEAST_WIDTH_PX:
        return None
    s = arc_lengths(course.line)
    count = STRIDE * int(float(s[-1]) / width * PER_WIDTH / STRIDE)
    if count < FEWEST_COLUMNS:
        return None
    raw = _levels(scene, course, s, count)
    at = (np.arange(count) + 0.5) / count * s[-1]
    free = np.interp(at, s, unshaded(course).astype(np.float64)) > 0.99
    skip = 0.75 * width + 3.0 * course.edge_blur_px
    where = (free & (at > skip) & (at < s[-1] - skip)).reshape(-1, STRIDE).all(axis=1)
    if where.sum() * STRIDE < FEWEST_COLUMNS // 2:
        return None
    across = (np.arange(ROWS) + 0.5) / ROWS * 2.0 * REACH - REACH
    inner = raw[:, np.abs(across) <= 0.3].mean(axis=1)
    typical = middle(inner[free].astype(np.float64))
    if not typical > 0:
        return None
    levels = np.zeros((count, ROWS + 2), np.float32)
    levels[:, :ROWS] = np.clip(raw / np.float32(typical), LOWEST, HIGHEST)
    levels[:, ROWS] = np.clip(_turned(course, s, at), -MOST_TURNED, MOST_TURNED)
    levels[~free] = 0.0
    levels[:, -1] = free
    # Of a cell of the strip, which is the mean of many pixels where a fibre is thick.
    noise = course.noise / typical * min(1.0, np.sqrt(PER_WIDTH * ROWS / (2.0 * REACH)) / width)
    coded = scene.blockiness
    least = LEAST_WIDTH_PX / width
    facts = [noise, course.blur_px / width, coded, coded * least, least]
    return Strip(levels, where, np.minimum(facts, 1.0).astype(np.float32))


def _levels(scene: Scene, course: Course, s: Floats, count: int) -> Floats32:
    """Return what stands out from the ground, the mean of each cell of the strip."""
    # No two points that are averaged, or left beside each other, lie more than a pixel apart.
    along_cell = int(np.ceil(course.width / PER_WIDTH))
    across_cell = int(np.ceil(2.0 * REACH * course.width / ROWS))
    at = (np.arange(count * along_cell) + 0.5) / (count * along_cell) * s[-1]
    points = ROWS * across_cell
    across = ((np.arange(points) + 0.5) / points * 2.0 - 1.0) * REACH * course.width
    tangent = directions(course.line)
    x, y, along_x, along_y, ground = (
        np.interp(at, s, values).astype(np.float32)[:, None]
        for values in (*course.line.T, *tangent.T, course.ground)
    )
    away = across.astype(np.float32)[None, :]
    values = sample(scene.image, x - away * along_y, y + away * along_x) - ground
    cells = values.reshape(count, along_cell, ROWS, across_cell).mean(axis=(1, 3))
    return np.asarray(np.float32(scene.sign) * cells, dtype=np.float32)


def _turned(course: Course, s: Floats, at: Floats) -> Floats:
    """Return how far a course turns within a width around some points, in radians."""
    angle = np.unwrap(np.arctan2(*directions(course.line).T[::-1]))
    half = 0.5 * course.width
    return np.asarray(np.interp(at + half, s, angle) - np.interp(at - half, s, angle))


@cache
def learned_weights() -> Mapping[str, Floats32]:
    """Return the weights of the network, read once."""
    with np.load(WEIGHTS_FILE) as file:
        return {name: file[name].astype(np.float32) for name in file.files}


def logits(strip: Strip, weights: Mapping[str, Floats32]) -> Floats32:
    """Return the logit of a joint at every second column of a strip.

    Either end may be the first one, and either side the left one: it is the mean of all four.
    """
    ends = np.stack([strip.levels, strip.levels[::-1]])
    sides = ends[:, :, [*range(ROWS)[::-1], ROWS, ROWS + 1]] * MIRRORED
    where = np.stack([strip.where, strip.where[::-1]])
    found = _answers(
        np.concatenate([ends, sides]), np.concatenate([where, where]), strip.facts, weights
    )
    return np.asarray(found[0] + found[1, ::-1] + found[2] + found[3, ::-1]) * np.float32(0.25)


def _answers(
    levels: Floats32, where: Mask, facts: Floats32, weights: Mapping[str, Floats32]
) -> Floats32:
    """Return the network's answers to strips of one length, shape (strips, n / STRIDE)."""
    near = _convolved(levels, weights, "first", stride=STRIDE)
    near += _convolved(near, weights, "second")
    # What the fibre is like on the whole.
    share = where[:, :, None] / where.sum(axis=1)[:, None, None].astype(np.float32)
    mean = (near * share).sum(axis=1)
    spread = np.sqrt((((near - mean[:, None]) ** 2) * share).sum(axis=1) + LEAST_VARIANCE)
    whole = np.concatenate([mean, spread, np.tile(facts, (len(mean), 1))], axis=1)
    whole = np.maximum(whole @ weights["whole"] + weights["whole_bias"], 0.0)
    scale, shift = np.split(whole @ weights["context"] + weights["context_bias"], 2, axis=1)
    far = np.maximum(near * (1.0 + scale[:, None]) + shift[:, None], 0.0)
    far += _convolved(far, weights, "third", apart=2)
    far += _convolved(far, weights, "fourth", apart=4)
    return np.asarray((far @ weights["last"] + weights["last_bias"])[:, :, 0], dtype=np.float32)


def _convolved(
    values: Floats32, weights: Mapping[str, Floats32], name: str, *, stride: int = 1, apart: int = 1
) -> Floats32:
    """Return strips (strips, n, channels) after a layer with a kernel (taps, channels, outputs)."""
    kernel = weights[name]
    strips, n, channels = values.shape
    before = apart * ((len(kernel) - 1) // 2)
    padded = np.zeros((strips, n + apart * (len(kernel) - 1), channels), np.float32)
    padded[:, before : before + n] = values
    count = strips * -(-n // stride)
    # In parts that do not wake other threads.
    size = max(1, IN_ONE_THREAD // kernel.size)
    parts = -(-count // size)
    flat = np.zeros((parts * size, len(kernel) * channels), np.float32)
    rows = flat[:count].reshape(strips, -1, len(kernel), channels)
    for tap in range(len(kernel)):
        rows[:, :, tap] = padded[:, apart * tap :][:, :n:stride]
    product = flat.reshape(parts, size, -1) @ kernel.reshape(-1, kernel.shape[2])
    found = product.reshape(-1, kernel.shape[2])[:count]
    found += weights[f"{name}_bias"]
    np.maximum(found, 0.0, out=found)
    return np.asarray(found.reshape(strips, -1, kernel.shape[2]))
