"""Where a small part of one image is found on another, to a small part of a pixel."""

import math
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from cosmic.frame.arrays import Floats, Floats32
from cosmic.frame.errors import ConfigError
from cosmic.vico.hw.interface import Pixels, Roi

Pair = tuple[float, float]

SMALLEST_TEMPLATE_PX: Final = 12
ROUNDS: Final = 6
# What interpolation between pixels leaves, whatever the noise.
FLOOR_PX: Final = 0.01
# What noise of variance 1 adds to a squared slope by Sobel's operator (12 / 64), and a quarter
# more for its scatter.
SLOPE_NOISE: Final = 1.25 * 12.0 / 64.0


@dataclass(frozen=True, slots=True)
class Match:
    """Where a template was found.

    Attributes
    ----------
    centre_px : (float, float)
        Of the template, x and y; pixel (0, 0) has its centre at (0.0, 0.0).
    std_px : float
        Standard deviation in the direction known least: large on a straight edge, along it.
    score : float
        Normalised cross-correlation there; 1 for the same image.
    rival : float
        The best score away from there.
    at_rim : bool
        It lies at the rim of where it was looked for, and may be further away.
    """

    centre_px: Pair
    std_px: float
    score: float
    rival: float
    at_rim: bool


class Template:
    """A part of an image to be found again.

    Parameters
    ----------
    image : ndarray, shape (height, width), uint8 or uint16
    region : Roi

    Raises
    ------
    ConfigError
        The region is not within the image, too small, or shows nothing to go by.
    """

    def __init__(self, image: Pixels, region: Roi) -> None:
        right, bottom = region.x_px + region.width_px, region.y_px + region.height_px
        height, width = image.shape[:2]
        inside = 0 <= region.x_px < right <= width and 0 <= region.y_px < bottom <= height
        if not (inside and min(region.width_px, region.height_px) >= SMALLEST_TEMPLATE_PX):
            raise ConfigError(
                f"tracking: the region of {region.width_px} x {region.height_px} px at "
                f"{region.x_px}, {region.y_px} must lie within the image of {width} x {height} "
                f"px and be {SMALLEST_TEMPLATE_PX} px or more; choose another"
            )
        self.pixels: Floats32 = image[region.y_px : bottom, region.x_px : right].astype(np.float32)
        if not float(self.pixels.std()) > 0.5:
            raise ConfigError(
                "tracking: the region has no contrast and cannot be tracked; choose one with "
                "edges in it"
            )
        self.centre_px: Pair = (
            region.x_px + 0.5 * (region.width_px - 1),
            region.y_px + 0.5 * (region.height_px - 1),
        )
        self._gradient_x = _gradient(self.pixels, 1, 0)
        self._gradient_y = _gradient(self.pixels, 0, 1)
        self._slope_noise = SLOPE_NOISE * _noise_variance(self.pixels) * self.pixels.size

    def find(self, image: Pixels, around_px: Pair, reach_px: float) -> Match | None:
        """Look for the template's centre within `reach_px` of a point; None off the image."""
        rows, columns = self.pixels.shape
        left, right = _span(around_px[0], reach_px, columns, image.shape[1])
        top, bottom = _span(around_px[1], reach_px, rows, image.shape[0])
        if right - left < columns or bottom - top < rows:
            return None
        window = image[top:bottom, left:right].astype(np.float32)
        scores = np.asarray(
            cv2.matchTemplate(window, self.pixels, cv2.TM_CCOEFF_NORMED), dtype=np.float32
        )
        _, _, _, (x, y) = cv2.minMaxLoc(scores)
        score = float(scores[y, x])
        at_rim = x in (0, scores.shape[1] - 1) or y in (0, scores.shape[0] - 1)
        middle_x, middle_y = 0.5 * (columns - 1), 0.5 * (rows - 1)
        start = (x + _top(scores[y], x) + middle_x, y + _top(scores[:, x], y) + middle_y)
        point, std_px = self._refine(window, start)
        return Match(
            (float(left + point[0]), float(top + point[1])),
            std_px,
            score,
            _rival(scores, x, y, (columns, rows)),
            at_rim,
        )

    def _refine(self, window: Floats32, start: Pair) -> tuple[Pair, float]:
        """Move the template until it fits best, brightness and contrast left free (Lucas, Kanade).

        The peak of the correlation alone leans towards whole pixels.
        """
        gradients = np.column_stack([self._gradient_x.ravel(), self._gradient_y.ravel()])
        normal = gradients.T @ gradients
        if not np.linalg.cond(normal) < 1e8:
            return start, math.inf
        inverse = np.linalg.inv(normal)
        point = np.array(start)
        variance = 0.0
        for _ in range(ROUNDS):
            error = self._error(window, point)
            variance = float(error @ error) / max(1, error.size - 4)
            step = inverse @ (gradients.T @ error)
            point -= step
            if float(np.abs(step).max()) < 1e-3:
                break
        if not float(np.abs(point - start).max()) <= 1.0:
            return start, math.inf
        # Noise has slopes as well, and along a straight edge no others: they tell nothing.
        known = float(np.linalg.eigvalsh(normal).min()) - self._slope_noise
        std_px = math.sqrt(variance / known) if known > 0.0 else math.inf
        return (float(point[0]), float(point[1])), math.hypot(std_px, FLOOR_PX)

    def _error(self, window: Floats32, point: Floats) -> Floats:
        """Return the image there less the template, at the template's brightness."""
        rows, columns = self.pixels.shape
        there = cv2.getRectSubPix(window, (columns, rows), (float(point[0]), float(point[1])))
        away = there - there.mean()
        mine = self.pixels - self.pixels.mean()
        power = float(np.vdot(away, away))
        gain = float(np.vdot(away, mine)) / power if power > 0.0 else 0.0
        return np.asarray((gain * away - mine).ravel(), dtype=np.float64)


def displacement(before: Pixels, after: Pixels, region: Roi, reach_px: float) -> Match | None:
    """Return where the part of `before` in `region` is on `after`, at most `reach_px` away.

    Raises
    ------
    ConfigError
        The region makes no template.
    """
    template = Template(before, region)
    return template.find(after, template.centre_px, reach_px)


def _gradient(pixels: Floats32, x: int, y: int) -> Floats:
    # Sobel's sums count eight for a grey level a pixel.
    return np.asarray(cv2.Sobel(pixels, cv2.CV_64F, x, y, ksize=3, scale=0.125))


def _noise_variance(pixels: Floats32) -> float:
    """Return the variance of a pixel's noise (Immerkaer's mask, with a median against edges)."""
    mask = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], dtype=np.float32)
    rough = cv2.filter2D(pixels, cv2.CV_32F, mask)[1:-1, 1:-1]
    return (float(np.median(np.abs(rough))) / (0.6745 * 6.0)) ** 2


def _span(middle: float, reach: float, size: int, limit: int) -> tuple[int, int]:
    first = math.floor(middle - 0.5 * (size - 1) - reach)
    last = math.ceil(middle + 0.5 * (size - 1) + reach) + 1
    return max(0, first), min(limit, last)


def _top(values: Floats32, index: int) -> float:
    """Return how far the top of the parabola through three values is from the middle one."""
    if not 0 < index < len(values) - 1:
        return 0.0
    before, here, after = (float(each) for each in values[index - 1 : index + 2])
    bend = before - 2.0 * here + after
    return 0.5 * (before - after) / bend if bend < 0.0 else 0.0


def _rival(scores: Floats32, x: int, y: int, size: tuple[int, int]) -> float:
    across, down = (max(4, each // 3) for each in size)
    others = scores.copy()
    others[max(0, y - down) : y + down + 1, max(0, x - across) : x + across + 1] = -1.0
    return float(others.max())
