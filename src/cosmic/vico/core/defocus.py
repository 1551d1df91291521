"""Where an image would be sharp, from two images out of focus by different amounts.

Defocus takes away fine detail: of two images of the same things, the ratio of their power spectra
falls with the square of the frequency by the difference of their squared blurs. The squared blur
grows with the square of the distance from focus, so that two images and the growth, which is
calibrated once for a zoom position, give the distance. Brightness and a shift between the images do
not matter; things at several heights do.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from cosmic.frame.errors import ConfigError, NotAvailable
from cosmic.vico.core.vision.grey import Floats, grey_image

BINS: Final = 40
HIGHEST: Final = 0.35
"""Cycles per pixel: above, lenses pass little but noise."""
NOISE_FROM: Final = 0.42
NOISE_TIMES: Final = 4.0
FEWEST_BINS: Final = 5
FEWEST_IMAGES: Final = 4
LARGEST_STD: Final = 0.5
"""Of the distance between the two images: less sure is no answer."""


@dataclass(frozen=True, slots=True)
class DefocusModel:
    """How the blur grows with the distance from focus.

    Attributes
    ----------
    growth : float
        Squared blur (variance of the point spread, px^2) for each squared unit of focus.
    growth_std : float
    """

    growth: float
    growth_std: float


@dataclass(frozen=True, slots=True)
class InFocus:
    """Where it would be sharp, in the unit of the focus positions."""

    position: float
    std: float


def blur_difference(
    one: npt.NDArray[np.generic], other: npt.NDArray[np.generic]
) -> tuple[float, float]:
    """Return the squared blur of the first image less that of the second, px^2, and its deviation.

    Raises
    ------
    ConfigError
        The images are of different shapes.
    NotAvailable
        They show too little detail.
    """
    first, second = grey_image(one), grey_image(other)
    if first.shape != second.shape:
        raise ConfigError(
            f"focus: images of {first.shape} and {second.shape} cannot be compared; take both with "
            "the same ROI and binning"
        )
    frequency, power_one, weight = _spectrum(first.astype(np.float64))
    _, power_other, _ = _spectrum(second.astype(np.float64))
    floors = [float(np.median(each[frequency > NOISE_FROM])) for each in (power_one, power_other)]
    used = (frequency < HIGHEST) & (weight > 0)
    for power, floor in zip((power_one, power_other), floors, strict=True):
        used &= power > NOISE_TIMES * floor
    if used.sum() < FEWEST_BINS:
        raise NotAvailable("focus: the images show too little detail to compare their blur")
    ratio = np.log(power_one[used] - floors[0]) - np.log(power_other[used] - floors[1])
    against = -4.0 * np.pi**2 * frequency[used] ** 2
    number = weight[used]
    slope = float((number * against * ratio).sum() / (number * against**2).sum())
    rest = ratio - slope * against
    scatter = float((number * rest**2).sum() / number.sum()) * number.sum() / (used.sum() - 1)
    std = float(np.sqrt(scatter / (number * against**2).sum()))
    return slope, std


def calibrate(images: Sequence[tuple[float, npt.NDArray[np.generic]]]) -> DefocusModel:
    """Return the model from images of the same things at some positions of the focus.

    Raises
    ------
    ConfigError
        There are fewer than four positions.
    NotAvailable
        The images tell nothing: too little detail, or the blur does not grow.
    """
    places = np.array([place for place, _ in images], dtype=np.float64)
    if len(set(places.tolist())) < FEWEST_IMAGES:
        raise ConfigError(f"focus: {FEWEST_IMAGES} positions or more are needed, not {len(places)}")
    first = images[0][1]
    blurs = np.array([0.0, *(blur_difference(each, first)[0] for _, each in images[1:])])
    middle, width = float(places.mean()), float(np.ptp(places))
    curve, spread = np.polyfit((places - middle) / width, blurs, 2, cov="unscaled")
    rest = blurs - np.polyval(curve, (places - middle) / width)
    noise = float(rest @ rest) / max(1, len(places) - 3)
    growth, std = float(curve[0]) / width**2, float(np.sqrt(noise * spread[0, 0])) / width**2
    if not growth > 3.0 * std:
        raise NotAvailable("focus: the blur does not grow with the distance; take them farther off")
    return DefocusModel(growth, std)


def in_focus(
    one: tuple[float, npt.NDArray[np.generic]],
    other: tuple[float, npt.NDArray[np.generic]],
    model: DefocusModel,
) -> InFocus:
    """Return where it is sharp, from two images with their positions.

    Raises
    ------
    ConfigError
        Both were taken at one position, or are of different shapes.
    NotAvailable
        They show too little, or leave the position open.
    """
    apart = one[0] - other[0]
    if apart == 0.0:
        raise ConfigError("focus: two images at one position say nothing; move the focus between")
    difference, std = blur_difference(one[1], other[1])
    offset = difference / (2.0 * model.growth * apart)
    error = np.hypot(
        std / (2.0 * model.growth * abs(apart)), offset * model.growth_std / model.growth
    )
    if not error < LARGEST_STD * abs(apart):
        raise NotAvailable("focus: two images leave the position open; take them farther apart")
    return InFocus(0.5 * (one[0] + other[0]) - offset, float(error))


def _spectrum(values: Floats) -> tuple[Floats, Floats, Floats]:
    """Return frequencies in cycles per pixel, mean power there, and how many values it is of."""
    rows, columns = values.shape
    window = np.outer(np.hanning(rows), np.hanning(columns))
    level = float(values.mean())
    found = np.abs(np.fft.rfft2((values - level) / max(level, 1e-9) * window)) ** 2
    radius = np.hypot(np.fft.fftfreq(rows)[:, None], np.fft.rfftfreq(columns)[None, :])
    index = np.minimum((radius * 2.0 * BINS).astype(np.intp), BINS - 1).ravel()
    count = np.bincount(index, minlength=BINS).astype(np.float64)
    total = np.bincount(index, found.ravel(), BINS)
    mean = np.bincount(index, radius.ravel(), BINS)
    safe = np.maximum(count, 1.0)
    # The lowest is the light's own slope.
    count[0] = 0.0
    return mean / safe, np.maximum(total / safe, 1e-30), count
