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

import cv2
import numpy as np
import numpy.typing as npt

from cosmic.frame.arrays import Floats, Floats32
from cosmic.frame.errors import ConfigError, NotAvailable
from cosmic.vico.core.vision.grey import grey_image

BINS: Final = 40
TILE_PX: Final = 128
MOST_TILES: Final = 32
OVERLAP: Final = 4.0
HIGHEST: Final = 0.35
"""Cycles per pixel: above, lenses pass little but noise."""
NOISE_FROM: Final = 0.42
NOISE_TIMES: Final = 4.0
FEWEST_BINS: Final = 4
FEWEST_IMAGES: Final = 4
LARGEST_STD: Final = 0.5
"""Of the distance between the two images: less sure is no answer."""
TOO_LITTLE: Final = "focus: the images show too little detail to compare their blur"


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
    images = [_relative(each) for each in (one, other)]
    corners = _detailed(images)
    return _difference(*(_Spectra.of(each, corners) for each in images))


def calibrate(images: Sequence[tuple[float, npt.NDArray[np.generic]]]) -> DefocusModel:
    """Return the model from images of the same things at some positions of the focus.

    Those so far off that they show no detail are left out.

    Raises
    ------
    ConfigError
        There are fewer than four positions.
    NotAvailable
        The images tell nothing: too little detail, or the blur does not grow.
    """
    if len({place for place, _ in images}) < FEWEST_IMAGES:
        raise ConfigError(f"focus: {FEWEST_IMAGES} positions or more are needed, not {len(images)}")
    seen = [(place, _relative(each)) for place, each in images]
    corners = _detailed([each for _, each in seen])
    spectra = [(place, _Spectra.of(each, corners)) for place, each in seen]
    _, sharpest = max(spectra, key=lambda each: each[1].detail)
    found = []
    for place, each in spectra:
        try:
            found.append((place, 0.0 if each is sharpest else _difference(each, sharpest)[0]))
        except NotAvailable:
            continue
    if len({place for place, _ in found}) < FEWEST_IMAGES:
        raise NotAvailable(TOO_LITTLE)
    places, blurs = np.array(found, dtype=np.float64).T
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


def _relative(image: npt.NDArray[np.generic]) -> Floats32:
    """Return brightness as a part of the mean."""
    grey = grey_image(image).astype(np.float32)
    return np.asarray(grey / np.float32(max(float(grey.mean()), 1e-6)), dtype=np.float32)


def _detailed(images: Sequence[Floats32]) -> list[tuple[int, int]]:
    """Return corners of the tiles in which the images show most; raises `ConfigError`.

    A fibre covers a hundredth of an image: elsewhere there is only noise.
    """
    shapes = {each.shape for each in images}
    if len(shapes) > 1:
        first, second = sorted(shapes)[:2]
        raise ConfigError(
            f"focus: images of {first} and {second} cannot be compared; take both with the same "
            "ROI and binning"
        )
    rows, columns = images[0].shape
    side = min(TILE_PX, rows, columns)
    energy = np.zeros((rows, columns), np.float32)
    for each in images:
        band = cv2.GaussianBlur(each, (0, 0), 2.0) - cv2.GaussianBlur(each, (0, 0), 10.0)
        energy += band**2
    whole = cv2.integral(energy)
    corners = [
        (y, x)
        for y in range(0, rows - side + 1, side // 2)
        for x in range(0, columns - side + 1, side // 2)
    ]
    power = [
        float(whole[y + side, x + side] - whole[y, x + side] - whole[y + side, x] + whole[y, x])
        for y, x in corners
    ]
    ranked = sorted(range(len(corners)), key=lambda each: -power[each])[:MOST_TILES]
    return [corners[each] for each in ranked]


@dataclass(frozen=True, slots=True, eq=False)
class _Spectra:
    """How much detail the tiles of an image have, by frequency.

    Attributes
    ----------
    power : ndarray, shape (tiles, BINS)
    number : ndarray, shape (BINS,)
        How many values each is the mean of.
    floor : float
        What is noise.
    """

    frequency: Floats
    power: Floats
    number: Floats
    floor: float

    @classmethod
    def of(cls, image: Floats32, corners: Sequence[tuple[int, int]]) -> "_Spectra":
        side = min(TILE_PX, *image.shape)
        tiles = np.stack([image[y : y + side, x : x + side] for y, x in corners]).astype(np.float64)
        tiles -= tiles.mean(axis=(1, 2), keepdims=True)
        window = np.outer(np.hanning(side), np.hanning(side))
        found = np.abs(np.fft.rfft2(tiles * window)) ** 2
        radius = np.hypot(np.fft.fftfreq(side)[:, None], np.fft.rfftfreq(side)[None, :]).ravel()
        index = np.minimum((radius * 2.0 * BINS).astype(np.intp), BINS - 1)
        count = np.bincount(index, minlength=BINS).astype(np.float64)
        safe = np.maximum(count, 1.0)
        power = np.stack([np.bincount(index, each.ravel(), BINS) / safe for each in found])
        frequency = np.bincount(index, radius, BINS) / safe
        count[0] = 0.0  # the light's own slope
        floor = float(np.median(power[:, frequency > NOISE_FROM]))
        return cls(frequency, np.maximum(power, 1e-30), count, floor)

    @property
    def detail(self) -> float:
        """Weight of fine detail, larger for a sharper image of the same things."""
        clear = np.maximum(self.power - self.floor, 0.0).sum(axis=0) * (self.frequency < HIGHEST)
        return float((self.number * clear * self.frequency**2).sum())


def _difference(first: _Spectra, second: _Spectra) -> tuple[float, float]:
    """Return the difference of squared blurs that most tiles agree in.

    Dust on the sensor is sharp on every image; what lies at other heights differs otherwise.
    """
    found = [
        each
        for one, other in zip(first.power, second.power, strict=True)
        if (each := _of_tile(one, other, first, second)) is not None
    ]
    if not found:
        raise NotAvailable(TOO_LITTLE)
    slopes, stds = np.array(found).T
    order = np.argsort(slopes)
    weight = np.cumsum(stds[order] ** -2)
    middle = float(slopes[order][np.searchsorted(weight, 0.5 * weight[-1])])
    spread = 1.4826 * float(np.median(np.abs(slopes - middle)))
    near = np.abs(slopes - middle) <= 3.0 * np.hypot(spread, stds)
    weights = stds[near] ** -2
    mean = float((slopes[near] * weights).sum() / weights.sum())
    # Tiles overlap, by half each way.
    scatter = float((weights * (slopes[near] - mean) ** 2).sum() / weights.sum())
    number = max(1.0, near.sum() / OVERLAP)
    std = np.hypot(np.sqrt(scatter / number), np.sqrt(OVERLAP / weights.sum()))
    return mean, float(std)


def _of_tile(
    one: Floats, other: Floats, first: _Spectra, second: _Spectra
) -> tuple[float, float] | None:
    """Return the difference in one tile and its deviation; None where it shows too little."""
    used = (first.frequency < HIGHEST) & (first.number > 0)
    used &= (one > NOISE_TIMES * first.floor) & (other > NOISE_TIMES * second.floor)
    # From the lowest on without a gap: beyond, the first zero of a lens' disc says nothing.
    used[1:] &= np.cumprod(used[1:]).astype(bool)
    if used.sum() < FEWEST_BINS:
        return None
    ratio = np.log(one[used] - first.floor) - np.log(other[used] - second.floor)
    against = -4.0 * np.pi**2 * first.frequency[used] ** 2
    number = first.number[used]
    # The level is free: how bright the lamp is says nothing.
    mean = float((number * against).sum() / number.sum())
    level = float((number * ratio).sum() / number.sum())
    across = float((number * (against - mean) ** 2).sum())
    slope = float((number * (against - mean) * (ratio - level)).sum()) / across
    rest = ratio - level - slope * (against - mean)
    scatter = float((number * rest**2).sum()) / max(int(used.sum()) - 2, 1)
    return slope, float(np.sqrt(max(scatter, 1e-12) / across))
