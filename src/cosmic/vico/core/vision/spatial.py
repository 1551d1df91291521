"""A fibre in space: its height along its length from a focal stack, its tilt, its true length.

From above, a fibre that rises looks shorter. Where each part of it is in focus says how high it
lies there, and so how long it is.
"""

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from cosmic.frame.arrays import Floats, Floats32, Mask
from cosmic.frame.errors import ConfigError, NotAvailable
from cosmic.vico.core.vision.focal_stack import FocalStack, vertices
from cosmic.vico.core.vision.smoothing import arc_lengths, resampled
from cosmic.vico.hw.interface import Pixels

PART_WIDTHS: Final = 2.0
PART_PX: Final = 16.0
"""Length of the parts whose height is measured one by one, at least."""
MARGIN_PX: Final = 8.0
BLUR_WIDTHS: Final = 1.0
END_WIDTHS: Final = 1.0
FEWEST_PARTS: Final = 4
CURVED_PARTS: Final = 8
"""From so many parts on a fibre may be bent upwards or downwards as well."""
OUTLIER: Final = 4.0
STEP_PX: Final = 1.0
RESOLVED: Final = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class FibreHeights:
    """How high a fibre lies along its length.

    Attributes
    ----------
    along_px : ndarray, shape (n,)
        Along its centre line, of the middles of the parts measured.
    height_um, std_um : ndarray, shape (n,)
    """

    along_px: Floats
    height_um: Floats
    std_um: Floats


@dataclass(frozen=True, slots=True)
class View:
    """How a point of an image lies in space.

    Attributes
    ----------
    scale_um_px : float
        At `height_um`.
    height_um : float or None
        None: at the mean height of the fibre.
    distance_um : float
        From the plane in focus to the lens' entrance pupil: what lies nearer looks larger, and
        aside of the axis it is looked at askew. Infinite: a telecentric lens, or not known.
    axis_px : (float, float) or None
        Where the lens' axis meets the image; None: in its middle.
    """

    scale_um_px: float
    height_um: float | None = None
    distance_um: float = float("inf")
    axis_px: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class SpatialFibre:
    """A fibre in space.

    Attributes
    ----------
    line_um : ndarray, shape (n, 3)
        x, y from the lens' axis, as in the image, and the height in the stack's own count.
    length_um, length_std_um : float
        Along it. The deviation is that of the heights; those of ends and scale come on top.
    tilt_deg, tilt_std_deg : float
        Of the straight line nearest to it, from the horizontal; along the line upwards positive.
    heights : FibreHeights
    """

    line_um: Floats
    length_um: float
    length_std_um: float
    tilt_deg: float
    tilt_std_deg: float
    heights: FibreHeights


def heights_along(stack: FocalStack, line_px: Floats, width_px: float) -> FibreHeights:
    """Return how high a fibre lies, part by part along its centre line.

    Raises
    ------
    NotAvailable
        Too little of it is in focus within the stack.
    """
    line = resampled(np.asarray(line_px, dtype=np.float64), STEP_PX)
    along = arc_lengths(line)
    # The tips are edges across, which the line's own profiles do not show.
    inner = (along > END_WIDTHS * width_px) & (along < along[-1] - END_WIDTHS * width_px)
    part = max(PART_PX, PART_WIDTHS * width_px)
    count = int((along[-1] - 2.0 * END_WIDTHS * width_px) / part)
    if count < FEWEST_PARTS:
        raise NotAvailable("heights: the fibre is too short for its height to be measured")
    number = np.minimum((along[inner] - along[inner][0]) / part, count - 0.5).astype(np.intp)
    profiles = _Profiles(line[inner], width_px)
    energy = np.stack([profiles.energy(image, number, count) for image in stack.images])
    found = vertices(stack.heights_um, energy)
    middles = np.bincount(number, along[inner], count) / np.maximum(
        np.bincount(number, minlength=count), 1
    )
    known = np.isfinite(found.height_um) & (found.std_um < RESOLVED * stack.step_um)
    if known.sum() < max(FEWEST_PARTS, count // 3):
        raise NotAvailable(
            f"heights: {int(known.sum())} of {count} parts of the fibre come into focus within the "
            "stack; widen it, light it, or take smaller steps"
        )
    least = 0.02 * stack.step_um
    return FibreHeights(
        middles[known], found.height_um[known], np.maximum(found.std_um[known], least)
    )


def in_space(
    line_px: Floats, heights: FibreHeights, view: View, shape: tuple[int, ...]
) -> SpatialFibre:
    """Return a fibre in space; `shape` is that of the image, rows and columns.

    Raises
    ------
    ConfigError
        The view has no scale, or no distance.
    """
    if not (0.0 < view.scale_um_px < np.inf and view.distance_um > 0.0):
        raise ConfigError(
            f"heights: a scale of {view.scale_um_px} um/px and a distance of {view.distance_um} um "
            "are not a view"
        )
    line = resampled(np.asarray(line_px, dtype=np.float64), STEP_PX)
    along = arc_lengths(line)
    curve = _Curve.through(heights, float(along[-1]))
    height = curve.at(along)
    axis = view.axis_px or (0.5 * (shape[1] - 1), 0.5 * (shape[0] - 1))
    reference = float(height.mean()) if view.height_um is None else view.height_um
    scale = view.scale_um_px * (1.0 - (height - reference) / view.distance_um)
    flat = (line - np.array(axis)) * scale[:, None]
    steps = np.linalg.norm(np.diff(flat, axis=0), axis=1)
    rises = np.diff(height)
    # Noise of the slope would lengthen it: the expected square is taken off.
    middle = 0.5 * (along[1:] + along[:-1])
    spread = curve.slope_variance(middle) * np.diff(along) ** 2
    lengths = np.sqrt(np.maximum(steps**2 + rises**2 - spread, 0.25 * steps**2))
    tilt, tilt_std = _tilt(heights, float(steps.sum()) / float(along[-1]))
    wrong = np.radians(tilt_std)
    part = np.hypot(np.tan(np.radians(tilt)) * wrong, 0.5 * wrong**2)
    return SpatialFibre(
        np.column_stack([flat, height]),
        float(lengths.sum()),
        float(lengths.sum() * part),
        tilt,
        tilt_std,
        heights,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Curve:
    """A polynomial through heights, with the covariance of its coefficients."""

    coefficients: Floats
    covariance: Floats
    middle_px: float
    half_px: float

    @classmethod
    def through(cls, heights: FibreHeights, length_px: float) -> "_Curve":
        middle, half = 0.5 * length_px, max(0.5 * length_px, 1.0)
        at = (heights.along_px - middle) / half
        degree = 2 if len(at) >= CURVED_PARTS else 1
        fitted, spread, rest = cls._fitted(at, heights, np.ones(len(at), bool), degree)
        typical = max(1.4826 * float(np.median(np.abs(rest))), 0.3)
        used = np.abs(rest) <= OUTLIER * typical
        if used.sum() >= degree + 2:
            fitted, spread, rest = cls._fitted(at, heights, used, degree)
        free = max(int(used.sum()) - degree - 1, 1)
        scatter = max(float((rest[used] ** 2).sum()) / free, 1.0)
        return cls(fitted, spread * scatter, middle, half)

    @staticmethod
    def _fitted(
        at: Floats, heights: FibreHeights, used: Mask, degree: int
    ) -> tuple[Floats, Floats, Floats]:
        """Return coefficients, their covariance, and all residuals in deviations."""
        weight = 1.0 / heights.std_um[used]
        fitted, spread = np.polyfit(
            at[used], heights.height_um[used], degree, w=weight, cov="unscaled"
        )
        rest = (heights.height_um - np.polyval(fitted, at)) / heights.std_um
        return np.asarray(fitted), np.asarray(spread), np.asarray(rest)

    def at(self, along_px: Floats) -> Floats:
        return np.asarray(np.polyval(self.coefficients, (along_px - self.middle_px) / self.half_px))

    def slope_variance(self, along_px: Floats) -> Floats:
        """Return the variance of the slope, um^2 for each px^2."""
        degree = len(self.coefficients) - 1
        at = (along_px - self.middle_px) / self.half_px
        columns = [power * at ** (power - 1) for power in range(degree, 0, -1)]
        by = np.stack([*columns, 0.0 * at], axis=1) / self.half_px
        return np.asarray(np.einsum("ni,ij,nj->n", by, self.covariance, by))


def _tilt(heights: FibreHeights, scale_um_px: float) -> tuple[float, float]:
    """Return the tilt of the straight line through heights, and its deviation, degrees."""
    weight = 1.0 / heights.std_um
    along_um = heights.along_px * scale_um_px
    (slope, _), spread = np.polyfit(along_um, heights.height_um, 1, w=weight, cov="unscaled")
    rest = (heights.height_um - np.polyval([slope, _], along_um)) * weight
    scatter = max(float((rest**2).sum()) / max(len(rest) - 2, 1), 1.0)
    std = float(np.sqrt(spread[0, 0] * scatter)) / (1.0 + slope**2)
    return float(np.degrees(np.arctan(slope))), float(np.degrees(std))


class _Profiles:
    """Cross sections of a fibre, a pixel apart along it."""

    def __init__(self, line: Floats, width: float) -> None:
        tangent = np.gradient(line, axis=0)
        tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-9)
        normal = np.column_stack([-tangent[:, 1], tangent[:, 0]])
        reach = (0.5 + BLUR_WIDTHS) * width + MARGIN_PX
        across = np.arange(-np.ceil(reach), np.ceil(reach) + 0.5, 1.0)
        points = line[:, None, :] + across[None, :, None] * normal[:, None, :]
        self._x: Floats32 = points[..., 0].astype(np.float32)
        self._y: Floats32 = points[..., 1].astype(np.float32)

    def energy(self, image: Pixels, number: np.ndarray, count: int) -> Floats:
        """Return the energy of the slope across the fibre, a value for each part of it."""
        values = image.astype(np.float32)
        values /= np.float32(max(float(values.mean()), 1e-6))
        seen = cv2.remap(
            values, self._x, self._y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        ).astype(np.float64)
        sums = np.zeros((count, seen.shape[1]))
        np.add.at(sums, number, seen)
        rows = np.bincount(number, minlength=count)
        mean = sums / rows[:, None]
        slopes = 0.5 * (mean[:, 2:] - mean[:, :-2])
        # What noise adds: from neighbouring sections, which differ by little else.
        steps = np.diff(seen, axis=0) ** 2
        same = np.diff(number) == 0
        pairs = np.maximum(np.bincount(number[:-1][same], minlength=count), 1)
        noise = np.bincount(number[:-1][same], steps[same].mean(axis=1), count) / (2.0 * pairs)
        return np.asarray((slopes**2).sum(axis=1) - 0.5 * noise / rows * slopes.shape[1])
