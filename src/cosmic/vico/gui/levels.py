"""Brightness of an image: histogram, contrast, and which pixels say nothing any more."""

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from cosmic.vico.hw.interface import Pixels

BINS: Final = 256
SAMPLES: Final = 120_000
OVER_RGB: Final = (213, 94, 0)
UNDER_RGB: Final = (86, 180, 233)
GREYED: Final = 0.45

Table = npt.NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class Levels:
    """What is shown black and what white, in counts of the camera."""

    low: float
    high: float


@dataclass(frozen=True, slots=True, eq=False)
class Histogram:
    """How often each brightness occurs, told from a part of the pixels.

    Attributes
    ----------
    shares : ndarray, shape (256,), float64
        Of all pixels, from dark to bright in bins of equal width; their sum is 1.
    full : int
        The brightness of an over-exposed pixel.
    under, over : float
        Share of the pixels that are quite black or over-exposed, in any colour.
    """

    shares: npt.NDArray[np.float64]
    full: int
    under: float
    over: float

    def percentile(self, percent: float) -> float:
        """Return the brightness that `percent` of the pixels do not exceed."""
        index = int(np.searchsorted(np.cumsum(self.shares), percent / 100.0))
        return min(index, BINS - 1) * (self.full + 1) / BINS

    def levels(self, cut_percent: float = 0.3) -> Levels:
        """Return levels that leave `cut_percent` of the pixels black, and as many white."""
        low, high = self.percentile(cut_percent), self.percentile(100.0 - cut_percent)
        least = max(1.0, self.full / 64)  # an image of one grey is not to be noise on the screen
        if high - low < least:
            middle = (low + high) / 2.0
            low, high = middle - least / 2.0, middle + least / 2.0
        return Levels(max(0.0, low), min(float(self.full), high + (self.full + 1) / BINS))


def histogram(data: Pixels, full: int) -> Histogram:
    """Count the brightness of a part of the pixels, evenly spread."""
    step = max(1, int(np.sqrt(data.shape[0] * data.shape[1] / SAMPLES)))
    if data.dtype == np.uint8 and data.ndim == 2 and full == BINS - 1:
        shares = np.bincount(data[::step, ::step].ravel(), minlength=BINS)
        shares = shares / max(1, shares.sum())
        return Histogram(shares, full, float(shares[0]), float(shares[-1]))
    part = np.minimum(data[::step, ::step], full)
    bins = part.astype(np.uint32) * BINS // (full + 1)
    counts = np.bincount(bins.ravel(), minlength=BINS)[:BINS]
    in_all = part[:, :, None] if part.ndim == 2 else part
    over, under = in_all.max(axis=2) >= full, in_all.max(axis=2) == 0
    return Histogram(counts / part.size, full, float(under.mean()), float(over.mean()))


def index_table(full: int) -> Table | None:
    """Return what makes bytes of deeper pixels; None where they are bytes already.

    0 and 255 stand for pixels that are quite black or over-exposed, and for no others.
    """
    if full == 255:
        return None
    counts = np.arange(65536)
    inner = 1 + counts * 254 // (full + 1)
    table = np.clip(inner, 1, 254).astype(np.uint8)
    table[0], table[full:] = 0, 255
    return table


def indices(table: Table, data: Pixels) -> Table:
    """Return the byte that stands for each pixel, by `index_table`."""
    import cv2  # a fifth of the time that numpy takes

    return np.asarray(cv2.LUT(data, table), np.uint8)


def palette(levels: Levels, full: int, *, marks: bool, greyed: bool = False) -> Table:
    """Return the colour of each byte, shape (256, 4): contrast, and marks for lost pixels."""
    counts = np.arange(256) * (full / 255.0)
    shown = np.clip((counts - levels.low) / max(levels.high - levels.low, 1e-9), 0.0, 1.0)
    colours = np.empty((256, 4), np.uint8)
    colours[:, :3] = np.round(255.0 * shown)[:, None]
    if marks:
        colours[0, :3], colours[255, :3] = UNDER_RGB, OVER_RGB
    if greyed:
        colours[:, :3] = (colours[:, :3] * GREYED + 40).astype(np.uint8)
    colours[:, 3] = 255
    return colours


def colour_image(data: Pixels, levels: Levels, *, marks: bool, greyed: bool = False) -> Table:
    """Return an RGB image with its contrast changed, and marks for lost pixels."""
    import cv2  # numpy takes thirty times as long

    grey = palette(levels, 255, marks=False, greyed=greyed)[:, 0]
    shown = cv2.LUT(data, grey)
    if marks:
        red, green, blue = cv2.split(data)
        brightest = np.asarray(cv2.max(cv2.max(red, green), blue))
        for value, colour in ((255, OVER_RGB), (0, UNDER_RGB)):
            mask = (brightest == value).view(np.uint8)
            cv2.copyTo(np.full_like(shown, colour), mask, shown)
    return np.asarray(shown, np.uint8)
