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

MARGIN_PX: Final = 64.0
"""So far outside an image outlines are cut off: OpenCV's fixed point would overflow."""

_SHIFT: Final = 8

Points = list[list[float]]


def hull(points_px: Floats) -> Floats:
    """Return the convex outline of points, shape (n, 2)."""
    found = cv2.convexHull(points_px.astype(np.float32))
    return np.asarray(found.reshape(-1, 2), dtype=np.float64)


def outline(layer: Layer, corners_px: Floats, sigma_px: float, value: float) -> None:
    """Cover a convex outline, shape (n, 2), with one brightness, its edges blurred."""
    where = patch(layer, corners_px, 1.0, sigma_px)
    if where is None:
        return
    whole = cropped(where.cells(corners_px), where.width, where.height)
    corners = None if whole is None else shrunk(whole, GROWTH_PX)
    if corners is None:
        return
    mask = np.zeros((where.height, where.width), np.uint8)
    fixed = np.round(corners * (1 << _SHIFT)).astype(np.int32)
    cv2.fillConvexPoly(mask, fixed, 255, cv2.LINE_AA, _SHIFT)
    square = (sigma_px / where.cell) ** 2 - EDGE_SIGMA_PX**2
    if square > 0.04:
        cv2.GaussianBlur(mask, (0, 0), math.sqrt(square), mask, borderType=cv2.BORDER_REPLICATE)
    cover(layer, where, mask, value)


def shrunk(corners: Floats, by: float) -> Floats | None:
    """Return a convex outline with each edge moved inwards by `by`; None if nothing is left."""
    points = corners.tolist()
    sides = []
    turn = _area(points)
    for (x0, y0), (x1, y1) in zip(points, [*points[1:], points[0]], strict=True):
        length = math.hypot(x1 - x0, y1 - y0)
        if length > 1e-6:
            # a x + b y >= c inside
            a, b = (y0 - y1) / length, (x1 - x0) / length
            if turn < 0.0:
                a, b = -a, -b
            sides.append((a, b, a * x0 + b * y0 + by))
    return _cut(points, sides)


def cropped(corners: Floats, width: float, height: float) -> Floats | None:
    """Return the part of a convex outline near a rectangle; None if there is none."""
    sides = [
        (1.0, 0.0, -MARGIN_PX),
        (-1.0, 0.0, -width - MARGIN_PX),
        (0.0, 1.0, -MARGIN_PX),
        (0.0, -1.0, -height - MARGIN_PX),
    ]
    return _cut(corners.tolist(), sides)


def _cut(points: Points, sides: list[tuple[float, float, float]]) -> Floats | None:
    """Return what is left of a convex outline on the inner side of some lines."""
    for a, b, c in sides:
        left: Points = []
        x0, y0 = points[-1]
        in0 = a * x0 + b * y0 - c
        for x1, y1 in points:
            in1 = a * x1 + b * y1 - c
            if (in0 >= 0.0) != (in1 >= 0.0):
                part = in0 / (in0 - in1)
                left.append([x0 + part * (x1 - x0), y0 + part * (y1 - y0)])
            if in1 >= 0.0:
                left.append([x1, y1])
            x0, y0, in0 = x1, y1, in1
        if len(left) < 3:
            return None
        points = left
    return np.array(points)


def _area(points: Points) -> float:
    """Return twice the area of an outline; its sign tells which way round it goes."""
    following = [*points[1:], points[0]]
    return sum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in zip(points, following, strict=True))
