"""The part of an image that something is drawn on, coarser where it is badly out of focus.

Layers are uint16: brightness times a scale that their owner chooses. Image coordinates are x, y
in pixels; a pixel's centre has whole numbers.
"""

from dataclasses import dataclass
from typing import Final, cast

import cv2
import numpy as np
import numpy.typing as npt

from cosmic.frame.arrays import ByteMask, Floats

Layer = npt.NDArray[np.uint16]
Single = npt.NDArray[np.float32]

REACH: Final = 3.0
"""Blur is followed so many standard deviations far."""

COARSE_SIGMA: Final = 6.0
"""Beyond this blur, pixels, things are drawn on a coarser grid."""

FINE_SIGMA: Final = 2.5
"""Blur that is left on the coarser grid."""


@dataclass(frozen=True, slots=True)
class Patch:
    """A rectangle of a layer, in cells of `cell` x `cell` pixels."""

    cell: int
    x: int
    y: int
    width: int
    height: int
    rows: slice
    columns: slice

    def cells(self, points_px: Floats) -> Floats:
        """Return image coordinates as coordinates in the patch."""
        return np.asarray((points_px + 0.5) / self.cell - (self.x + 0.5, self.y + 0.5))

    def fine(self, values: Single | ByteMask) -> Single | ByteMask:
        """Return values of the patch for each pixel of the layer in it."""
        if self.cell == 1:
            return values
        size = self.width * self.cell, self.height * self.cell
        whole = cv2.resize(values, size, interpolation=cv2.INTER_LINEAR)
        height = self.rows.stop - self.rows.start
        width = self.columns.stop - self.columns.start
        found = whole[:height, :width]
        return cast("Single | ByteMask", found)


def patch(layer: Layer, points_px: Floats, reach_px: float, sigma_px: float) -> Patch | None:
    """Return the part of a layer around points, or None where they lie outside."""
    cell = int(sigma_px / FINE_SIGMA) if sigma_px > COARSE_SIGMA else 1
    height, width = layer.shape
    reach = reach_px + REACH * sigma_px + cell
    low, high = points_px.min(axis=0) - reach, points_px.max(axis=0) + reach
    if not (high[0] >= 0.0 and high[1] >= 0.0 and low[0] <= width and low[1] <= height):
        return None
    x, y = (max(int(each), 0) // cell for each in low)
    right = min(int(high[0]) + 1, width)
    bottom = min(int(high[1]) + 1, height)
    columns, rows = -(-right // cell) - x, -(-bottom // cell) - y
    if columns < 1 or rows < 1:
        return None
    return Patch(
        cell,
        x,
        y,
        columns,
        rows,
        slice(y * cell, min((y + rows) * cell, height)),
        slice(x * cell, min((x + columns) * cell, width)),
    )


def darken(layer: Layer, where: Patch, passed: Single) -> None:
    """Let only a part of the light through, shape of the patch, 0 to 1."""
    fine = where.fine(passed)
    part = layer[where.rows, where.columns]
    layer[where.rows, where.columns] = cv2.multiply(part, fine, dtype=cv2.CV_16U)


def cover(layer: Layer, where: Patch, mask: ByteMask, value: float) -> None:
    """Put one brightness over the layer where the mask, shape of the patch, says 255."""
    above = where.fine(mask).astype(np.uint16)
    part = layer[where.rows, where.columns]
    beneath = cv2.multiply(part, np.uint16(255) - above, scale=1.0 / 255.0)
    layer[where.rows, where.columns] = cv2.scaleAdd(above, value / 255.0, beneath)
