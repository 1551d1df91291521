"""Tools from above: convex outlines that hide what is below them."""

import math
from typing import Final

import cv2
import numpy as np

from cosmic.twin.optics.canvas import Floats, Layer, cover, patch

GROWTH_PX: Final = 0.71
"""OpenCV 5.0 draws smooth polygons larger than asked for by this at each edge: measured."""

EDGE_SIGMA_PX: Final = 0.45
"""Blur that their edges have already."""

FARTHEST_PX: Final = 8000.0
"""Coordinates beyond would overflow OpenCV's fixed point."""

_SHIFT: Final = 8


def hull(points_px: Floats) -> Floats:
    """Return the convex outline of points, shape (n, 2)."""
    found = cv2.convexHull(points_px.astype(np.float32))
    return np.asarray(found.reshape(-1, 2), dtype=np.float64)


def outline(layer: Layer, corners_px: Floats, sigma_px: float, value: float) -> None:
    """Cover a convex outline, shape (n, 2), with one brightness, its edges blurred."""
    where = patch(layer, corners_px, 1.0, sigma_px)
    if where is None:
        return
    corners = shrunk(where.cells(corners_px), GROWTH_PX)
    if corners is None:
        return
    mask = np.zeros((where.height, where.width), np.uint8)
    fixed = np.clip(corners, -FARTHEST_PX, FARTHEST_PX) * (1 << _SHIFT)
    cv2.fillConvexPoly(mask, np.round(fixed).astype(np.int32), 255, cv2.LINE_AA, _SHIFT)
    square = (sigma_px / where.cell) ** 2 - EDGE_SIGMA_PX**2
    if square > 0.04:
        cv2.GaussianBlur(mask, (0, 0), math.sqrt(square), mask, borderType=cv2.BORDER_REPLICATE)
    cover(layer, where, mask, value)


def shrunk(corners: Floats, by: float) -> Floats | None:
    """Return a convex outline with each edge moved inwards by `by`; None if nothing is left."""
    along = np.roll(corners, -1, axis=0) - corners
    lengths = np.hypot(along[:, 0], along[:, 1])
    kept = lengths > 1e-3
    if kept.sum() < 3:
        return None
    corners, along = corners[kept], along[kept] / lengths[kept][:, None]
    arms = corners - corners.mean(axis=0)
    turn = arms[:, 0] * along[:, 1] - arms[:, 1] * along[:, 0]
    if np.abs(turn).min() <= by:
        return None
    inwards = np.stack([-along[:, 1], along[:, 0]], axis=1) * np.sign(turn[0])
    moved = corners + inwards * by
    # Each corner lies where two moved edges cross.
    before, direction = np.roll(moved, 1, axis=0), np.roll(along, 1, axis=0)
    cross = direction[:, 0] * along[:, 1] - direction[:, 1] * along[:, 0]
    cross = np.where(np.abs(cross) < 1e-9, np.inf, cross)
    gap = moved - before
    way = (gap[:, 0] * along[:, 1] - gap[:, 1] * along[:, 0]) / cross
    return np.asarray(before + direction * way[:, None])
