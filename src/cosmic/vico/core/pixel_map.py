"""From the platform to the image and back: a map that knows how sure it is."""

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from cosmic.frame.arrays import Floats

Pair = tuple[float, float]
Matrix = tuple[Pair, Pair]


@dataclass(frozen=True, slots=True)
class PixelMap:
    """Where a point on the platform is seen in the image, for one zoom and one height.

    Pixels are those of the whole sensor, unbinned; (0, 0) is the middle of the upper left one.
    `for_window` gives the map for images of a part of the sensor, or binned.

    Attributes
    ----------
    matrix_px_um : two rows of two
        What a move of the platform does in the image.
    centre_um, centre_px : (float, float)
        Mean of the points it was measured with, and where that is seen.
    noise_px : float
        Standard deviation of one coordinate of one point that was tracked.
    leverage_um2 : two rows of two
        Inverse of the sum of squares of the measured points about their mean; 1/um^2.
    points : int
        How many points it rests on.
    axis_px, bend_px2 : (float, float), float
        The lens moves what lies r pixels from there outwards by `bend_px2` times r cubed.
    """

    matrix_px_um: Matrix
    centre_um: Pair
    centre_px: Pair
    noise_px: float
    leverage_um2: Matrix
    points: int
    axis_px: Pair = (0.0, 0.0)
    bend_px2: float = 0.0

    @property
    def scale_um_px(self) -> float:
        """Size of a pixel; the mean of both directions."""
        return 1.0 / math.sqrt(abs(_determinant(self.matrix_px_um)))

    @property
    def scale_part(self) -> float:
        """Standard deviation of the scale, as a part of it."""
        (xx, _), (_, yy) = self.leverage_um2
        return self.noise_px * self.scale_um_px * math.sqrt(0.5 * max(xx + yy, 0.0))

    @property
    def rotation_rad(self) -> float:
        """Angle of the platform's x axis in the image, from right towards down."""
        (a, _), (c, _) = self.matrix_px_um
        return math.atan2(c, a)

    @property
    def mirrored(self) -> bool:
        """Whether the platform is seen as in a mirror.

        Seen from above, x to the right and y away from the operator is x to the right and y up,
        which is against the image's rows: a negative determinant is the straight view.
        """
        return _determinant(self.matrix_px_um) > 0.0

    @property
    def anisotropy(self) -> float:
        """How much longer a move is seen in one direction than in the other; 0 is alike."""
        large, small = np.linalg.svd(np.array(self.matrix_px_um), compute_uv=False)
        return float(large / small - 1.0)

    def to_px(self, platform_um: npt.ArrayLike) -> Floats:
        """Return where points are seen; shape (..., 2), as x, y."""
        away = np.asarray(platform_um, dtype=np.float64) - self.centre_um
        straight = np.asarray(away @ np.array(self.matrix_px_um).T + self.centre_px)
        return bent(straight, self.axis_px, self.bend_px2)

    def to_um(self, image_px: npt.ArrayLike) -> Floats:
        """Return which points are seen at points of the image; shape (..., 2), as x, y."""
        seen = np.asarray(image_px, dtype=np.float64)
        return self.straight_um(straightened(seen, self.axis_px, self.bend_px2))

    def straight_um(self, straight_px: Floats) -> Floats:
        """Return which points a lens that bends nothing would show at points of the image."""
        away = straight_px - self.centre_px
        return np.asarray(away @ np.linalg.inv(np.array(self.matrix_px_um)).T + self.centre_um)

    def std_um(self, image_px: npt.ArrayLike) -> Floats:
        """Return the standard deviation of a coordinate of `to_um` due to this map; shape (...).

        It grows away from where the map was measured. What the point in the image is unsure by
        comes on top: multiply that by `scale_um_px`.
        """
        away = self.to_um(image_px) - self.centre_um
        leverage = np.einsum("...i,ij,...j", away, np.array(self.leverage_um2), away)
        spread = np.sqrt(1.0 / self.points + np.maximum(leverage, 0.0))
        return np.asarray(self.noise_px * self.scale_um_px * spread)

    def for_window(self, *, x_px: int = 0, y_px: int = 0, binning: int = 1) -> "PixelMap":
        """Return the map for images read from `x_px`, `y_px` on, in binned pixels."""
        middle = 0.5 * (binning - 1)
        (u_px, v_px), (axis_x_px, axis_y_px) = self.centre_px, self.axis_px
        matrix = np.array(self.matrix_px_um) / binning
        return replace(
            self,
            matrix_px_um=as_matrix(matrix),
            centre_px=((u_px - middle) / binning - x_px, (v_px - middle) / binning - y_px),
            noise_px=self.noise_px / binning,
            axis_px=((axis_x_px - middle) / binning - x_px, (axis_y_px - middle) / binning - y_px),
            bend_px2=self.bend_px2 * binning**2,
        )


STRAIGHTENED: Final = 8
"""Rounds in which what a lens bends is put straight; each leaves a tenth of the rest at most."""


def bent(straight_px: Floats, axis_px: Pair, bend_px2: float) -> Floats:
    """Return where a lens shows what a straight map has at points of the image; shape (..., 2)."""
    if not bend_px2:
        return straight_px
    away = straight_px - axis_px
    square = (away * away).sum(axis=-1, keepdims=True)
    return np.asarray(straight_px + away * (bend_px2 * square))


def straightened(seen_px: Floats, axis_px: Pair, bend_px2: float) -> Floats:
    """Return what `bent` makes of it; shape (..., 2)."""
    straight = seen_px
    for _ in range(STRAIGHTENED if bend_px2 else 0):
        straight = seen_px - (bent(straight, axis_px, bend_px2) - straight)
    return straight


def _determinant(matrix: Matrix) -> float:
    (a, b), (c, d) = matrix
    return a * d - b * c


def as_matrix(values: Floats) -> Matrix:
    """Return a 2 x 2 array as rows."""
    (a, b), (c, d) = values.tolist()
    return (a, b), (c, d)


def as_pair(values: Floats) -> Pair:
    """Return an array of two as a pair."""
    x, y = values.tolist()
    return x, y


def between(first: PixelMap, second: PixelMap, share: float) -> PixelMap:
    """Return the map `share` of the way from `first` to `second`, 0 to 1.

    The scale goes evenly in its logarithm, as zoom lenses are built. The point on the optical
    axis stays the same while the scale changes, so that every other goes with the size of a pixel.
    """
    one, other = np.array(first.matrix_px_um), np.array(second.matrix_px_um)
    log_one = 0.5 * math.log(abs(np.linalg.det(one)))
    log_other = 0.5 * math.log(abs(np.linalg.det(other)))
    log_scale = (1.0 - share) * log_one + share * log_other
    shape = (1.0 - share) * one / math.exp(log_one) + share * other / math.exp(log_other)
    matrix = shape * (math.exp(log_scale) / math.sqrt(abs(np.linalg.det(shape))))
    seen_px = 0.5 * (np.array(first.centre_px) + np.array(second.centre_px))
    size = [math.exp(-each) for each in (log_one, log_scale, log_other)]
    alike = math.isclose(size[0], size[2], rel_tol=1e-3)
    weight = share if alike else (size[1] - size[0]) / (size[2] - size[0])
    point_um = (1.0 - weight) * first.straight_um(seen_px) + weight * second.straight_um(seen_px)
    unsure = max(first, second, key=lambda each: float(np.trace(each.leverage_um2)))
    return PixelMap(
        as_matrix(matrix),
        as_pair(point_um),
        as_pair(seen_px),
        max(first.noise_px, second.noise_px),
        unsure.leverage_um2,
        min(first.points, second.points),
        second.axis_px if second.bend_px2 else first.axis_px,
        (1.0 - share) * first.bend_px2 + share * second.bend_px2,
    )
