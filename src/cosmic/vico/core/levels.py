"""Contrast, histogram and saturation of an image, from a part of its pixels."""

from dataclasses import dataclass
from typing import Final, cast

import cv2
import numpy as np
import numpy.typing as npt

from cosmic.frame.errors import ConfigError
from cosmic.vico.hw.interface import PixelFormat, Pixels

ENOUGH_PIXELS: Final = 150_000
MOST_BINS: Final = 4096

FULL_SCALE: Final = {
    PixelFormat.MONO8: 255,
    PixelFormat.RGB8: 255,
    PixelFormat.MONO10: 1023,
    PixelFormat.MONO12: 4095,
    PixelFormat.MONO16: 65535,
}


@dataclass(frozen=True, slots=True, eq=False)
class Levels:
    """How the grey levels of an image are spread.

    Attributes
    ----------
    counts : ndarray, shape (bins,), float32
        Pixels a bin, of those looked at. Read-only.
    bin_width : int
        Grey levels a bin.
    pixels : int
        How many were looked at, all layers together.
    full_scale : int
        The highest level of the format.
    dark_share, bright_share : float
        Part of the pixels in the lowest and in the highest bin: under- and over-exposed.
    """

    counts: npt.NDArray[np.float32]
    bin_width: int
    pixels: int
    full_scale: int
    dark_share: float
    bright_share: float

    def percentile(self, percent: float) -> float:
        """Return the level below which `percent` of the pixels lie, to a part of a bin.

        Raises
        ------
        ConfigError
            Not between 0 and 100.
        """
        if not 0.0 <= percent <= 100.0:
            raise ConfigError(f"levels: {percent:g} % is no percentile; it lies from 0 to 100")
        below = np.cumsum(self.counts)
        wanted = percent / 100.0 * self.pixels
        index = min(int(np.searchsorted(below, wanted)), len(below) - 1)
        count = float(self.counts[index])
        part = (wanted - (float(below[index]) - count)) / count if count > 0.0 else 0.0
        return min((index + part) * self.bin_width, float(self.full_scale))

    def stretch(self, low_percent: float = 0.5, high_percent: float = 99.5) -> tuple[float, float]:
        """Return the levels to be shown as black and white; never the same one."""
        low, high = self.percentile(low_percent), self.percentile(high_percent)
        return (low, high) if high - low >= 1.0 else (low, low + 1.0)


def measure_levels(data: Pixels, pixel_format: PixelFormat) -> Levels:
    """Return how the grey levels of an image are spread, looking at some 150 000 pixels.

    Raises
    ------
    ConfigError
        The pixels are not those of the format.
    """
    full_scale = FULL_SCALE[pixel_format]
    wanted = np.uint8 if full_scale == 255 else np.uint16
    if data.dtype != wanted or data.ndim not in (2, 3) or data.size == 0:
        raise ConfigError(
            f"levels: {pixel_format} has pixels of {np.dtype(wanted)}, not {data.dtype} in the "
            f"shape {data.shape}; give the frame's own format"
        )
    height, width = data.shape[:2]
    step = max(1, round((height * width / ENOUGH_PIXELS) ** 0.5))
    part = cast("Pixels", np.ascontiguousarray(data[::step, ::step]).reshape(-1))
    bins = min(full_scale + 1, MOST_BINS)
    counts = cv2.calcHist([part], [0], None, [bins], [0.0, full_scale + 1.0])
    counts = np.asarray(counts, dtype=np.float32).reshape(-1)
    counts.flags.writeable = False
    return Levels(
        counts,
        (full_scale + 1) // bins,
        part.size,
        full_scale,
        float(counts[0]) / part.size,
        float(counts[-1]) / part.size,
    )


def over_exposed(data: Pixels, pixel_format: PixelFormat) -> npt.NDArray[np.bool_]:
    """Return which pixels are at the highest level, in any layer; shape (height, width)."""
    full = np.asarray(data >= FULL_SCALE[pixel_format])
    return np.asarray(full.any(axis=2)) if full.ndim == 3 else full
