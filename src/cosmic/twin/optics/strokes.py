"""Fibres, scratches and dust: what lets light through in part."""

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Final

import cv2
import numpy as np

from cosmic.frame.arrays import Floats
from cosmic.twin.optics.canvas import REACH, Layer, Patch, Single, darken, patch

STEPS: Final = 16
"""Steps a pixel in tables over a distance."""

FAR: Final = 1e9

TOLERANCE: Final = 0.02
"""Nodes of a line that lie so near to the straight one between others, cells, are left out."""

FAINTEST: Final = 0.01
"""A speck that takes less of the light is not drawn."""


@dataclass(frozen=True, slots=True)
class Shade:
    """How much light passes the walls of a fibre and its hollow middle.

    Attributes
    ----------
    wall_part : float
        How much of the width the two walls take.
    """

    wall: float
    lumen: float
    wall_part: float


def stroke(layer: Layer, line_px: Floats, half_px: float, sigma_px: float, shade: Shade) -> None:
    """Darken a layer along a line with square ends.

    Parameters
    ----------
    line_px : ndarray, shape (n, 2), float64
        The middle of the stroke.
    half_px : float
        Half its width.
    sigma_px : float
        Standard deviation of its blur.
    """
    where = patch(layer, line_px, half_px, sigma_px)
    if where is None:
        return
    sigma = round(sigma_px / where.cell, 2)
    table = _profile(round(half_px / where.cell, 2), sigma, shade)
    reach = len(table) / STEPS
    line = _pieces(where.cells(line_px), reach)
    distance, ends = _distances(where, line, reach, sigma)
    index = np.minimum(distance * STEPS, len(table) - 1).astype(np.int32)
    darken(layer, where, 1.0 - table[index] * ends)


def speck(layer: Layer, point_px: Floats, radius_px: float, sigma_px: float, passes: float) -> None:
    """Darken a layer in a soft round spot; blur makes it wider and fainter."""
    square = radius_px * radius_px
    spread = math.sqrt(0.5 * square + sigma_px * sigma_px)
    peak = (1.0 - passes) * square / (2.0 * spread * spread)
    if peak < FAINTEST:
        return
    where = patch(layer, point_px[None, :], 0.0, spread)
    if where is None:
        return
    ((x, y),) = where.cells(point_px[None, :])
    per_cell = -0.5 * (where.cell / spread) ** 2
    across = np.exp(per_cell * (np.arange(where.width, dtype=np.float32) - x) ** 2)
    down = np.exp(per_cell * (np.arange(where.height, dtype=np.float32) - y) ** 2)
    darken(layer, where, (1.0 - peak * np.outer(down, across)).astype(np.float32))


@lru_cache(maxsize=256)
def _profile(half: float, sigma: float, shade: Shade) -> Single:
    """Return the light taken away at distances from the middle of a blurred stroke."""
    count = int((half + REACH * sigma + 1.0) * STEPS) + 2
    distances = (np.arange(count) + 0.5) / STEPS
    inner = half * (1.0 - shade.wall_part)
    taken = (1.0 - shade.wall) * _band(distances, half, sigma)
    taken += (shade.wall - shade.lumen) * _band(distances, inner, sigma)
    taken[-1] = 0.0
    return taken.astype(np.float32)


def _band(distances: Floats, half: float, sigma: float) -> Floats:
    """Return what is left of a band of one after blurring."""
    return _risen((half - distances) / sigma) - _risen((-half - distances) / sigma)


def _risen(values: Floats) -> Floats:
    """Return the integral of the Gaussian bell up to values."""
    return np.array([0.5 * math.erfc(-each / math.sqrt(2.0)) for each in values.ravel()]).reshape(
        values.shape
    )


_EDGE_AT: Final = np.linspace(-4.0, 4.0, 129)
_EDGE: Final = _risen(_EDGE_AT)


def _pieces(line: Floats, reach: float) -> Floats:
    """Return a line with as few nodes as show it, but with short oblique pieces.

    Each piece is drawn in the rectangle around it, which is mostly empty around a long oblique one.
    """
    middle = line.mean(axis=0)
    few = cv2.approxPolyDP((line - middle).astype(np.float32), TOLERANCE, False)
    nodes = few.reshape(-1, 2).astype(np.float64) + middle
    lengths = np.abs(np.diff(nodes, axis=0)).min(axis=1)
    counts = np.maximum(np.ceil(lengths / (2.0 * reach)), 1.0).astype(int)
    if counts.max(initial=1) == 1:
        return np.asarray(nodes)
    parts = [
        first + np.arange(count)[:, None] / count * (second - first)
        for first, second, count in zip(nodes[:-1], nodes[1:], counts.tolist(), strict=True)
    ]
    return np.concatenate([*parts, nodes[-1:]])


def _distances(where: Patch, line: Floats, reach: float, sigma: float) -> tuple[Single, Single]:
    """Return the distance of each cell from a line, and how much of its square ends is there."""
    nearest = np.full((where.height, where.width), FAR, np.float32)
    ends = np.ones_like(nearest)
    nodes = line.tolist()  # for two numbers no array is worth it
    last = len(nodes) - 2
    for number, (first, second) in enumerate(pairwise(nodes)):
        ahead, aside = second[0] - first[0], second[1] - first[1]
        length = math.hypot(ahead, aside)
        if length < 1e-9:
            continue
        box = _box(where, first, second, reach)
        if box is None:
            continue
        rows, columns = box
        x = np.arange(columns.start, columns.stop, dtype=np.float32) - np.float32(first[0])
        y = np.arange(rows.start, rows.stop, dtype=np.float32)[:, None] - np.float32(first[1])
        ux, uy = np.float32(ahead / length), np.float32(aside / length)
        along, across = x * ux + y * uy, y * ux - x * uy
        low = -FAR if number == 0 else 0.0
        high = FAR if number == last else length
        beyond = along - np.minimum(np.maximum(along, low), high)
        distance = np.sqrt(across * across + beyond * beyond)
        part = nearest[box]
        if number in (0, last):
            inside = _edges(along, length, sigma, first=number == 0, last=number == last)
            ends[box] = np.where(distance < part, inside, ends[box])
        np.minimum(part, distance, out=part)
    return nearest, ends


def _edges(along: Single, length: float, sigma: float, *, first: bool, last: bool) -> Single:
    """Return how far points along a segment lie inside a fibre's square ends, 0 to 1."""
    inside = np.ones_like(along)
    if first:
        inside *= np.interp(along / sigma, _EDGE_AT, _EDGE).astype(np.float32)
    if last:
        inside *= np.interp((length - along) / sigma, _EDGE_AT, _EDGE).astype(np.float32)
    return inside


def _box(
    where: Patch, first: list[float], second: list[float], reach: float
) -> tuple[slice, slice] | None:
    (x0, y0), (x1, y1) = first, second
    left, top = max(int(min(x0, x1) - reach), 0), max(int(min(y0, y1) - reach), 0)
    right = min(int(max(x0, x1) + reach) + 2, where.width)
    bottom = min(int(max(y0, y1) + reach) + 2, where.height)
    if not (left < right and top < bottom):
        return None
    return slice(top, bottom), slice(left, right)
