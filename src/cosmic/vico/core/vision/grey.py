"""Images as machine vision takes them: one layer, 8 or 16 bit."""

from typing import TypeVar, cast

import cv2
import numpy as np
import numpy.typing as npt

from cosmic.frame.arrays import Floats, Floats32
from cosmic.frame.errors import ConfigError
from cosmic.vico.hw.interface import Pixels

FloatsOrFloats32 = TypeVar("FloatsOrFloats32", Floats, Floats32)

LEAST_SIDE_PX = 16
# What OpenCV's remap takes.
MOST_SIDE_PX = 32_766
LAYERS = 3
TOP_LEVEL = 65_535
FEW = 256
"""Of fewer numbers sorting finds the middle soonest."""


def grey_image(image: npt.NDArray[np.generic]) -> Pixels:
    """Return an image in one layer of 8 or 16 bits, in the machine's order of bytes.

    uint8 and uint16 stay as they are. bool becomes 0 and 255. Other whole numbers and floats are
    stretched, evenly, from their smallest finite value (0) to their largest (65535); NaN and
    infinite pixels, and those that a masked array masks, become the median of the rest: a fibre
    that they cut off is doubted. Three layers are weighed as blue, green and red,
    a fourth is left out as opacity. A raw Bayer mosaic cannot be told from a grey image: it is to
    be converted before.

    Raises
    ------
    ConfigError
        It is no array of real numbers of such a shape, is smaller than 16 x 16, longer than 32766
        pixels, or has no finite pixel; the text names dtype and shape.
    """
    if not isinstance(image, np.ndarray):
        raise ConfigError(f"an image is a numpy array, not {type(image).__name__}")
    said = f"{image.dtype} of shape {image.shape}"
    if image.dtype.kind not in "buif":
        raise ConfigError(f"an image has whole numbers, floats or bool as pixels, not {said}")
    if image.ndim not in (2, LAYERS) or image.shape[2:] not in ((), (1,), (3,), (4,)):
        raise ConfigError(
            f"an image has the shape (height, width), or (height, width, n) with 1, 3 or 4 "
            f"layers, not {said}"
        )
    if not min(image.shape[:2]) >= LEAST_SIDE_PX:
        raise ConfigError(
            f"the image of {image.shape[1]} x {image.shape[0]} pixels is too small; fibres are "
            f"looked for from {LEAST_SIDE_PX} x {LEAST_SIDE_PX} on ({said})"
        )
    if not max(image.shape[:2]) <= MOST_SIDE_PX:
        raise ConfigError(
            f"the image is too large; fibres are looked for up to {MOST_SIDE_PX} pixels a side, "
            f"not {said}"
        )
    pixels = _levels(_unmasked(image, said), said)
    if pixels.ndim == LAYERS and pixels.shape[2] == 1:
        pixels = cast("Pixels", np.ascontiguousarray(pixels[:, :, 0]))
    elif pixels.ndim == LAYERS:
        colour = cast("Pixels", np.ascontiguousarray(pixels[:, :, :LAYERS]))
        pixels = cast("Pixels", cv2.cvtColor(colour, cv2.COLOR_BGR2GRAY))
    return pixels


def _unmasked(image: npt.NDArray[np.generic], said: str) -> npt.NDArray[np.generic]:
    if not (isinstance(image, np.ma.MaskedArray) and np.ma.is_masked(image)):
        return image
    seen = image.compressed()
    if not seen.size:
        raise ConfigError(f"the image is masked everywhere: {said}")
    return np.asarray(image.filled(np.median(seen).astype(image.dtype)))


def _levels(image: npt.NDArray[np.generic], said: str) -> Pixels:
    if image.dtype == np.bool_:
        return np.ascontiguousarray(image, dtype=np.uint8) * np.uint8(255)
    if image.dtype.kind == "u" and image.dtype.itemsize <= 2:
        return cast("Pixels", np.ascontiguousarray(image, dtype=image.dtype.newbyteorder("=")))
    with np.errstate(over="ignore"):  # longdouble beyond float64 is as good as infinite
        values = image.astype(np.float64)
    finite = np.isfinite(values)
    if not finite.any():
        raise ConfigError(f"the image has no finite pixel: {said}")
    values[~finite] = np.median(values[finite])
    low, high = float(values.min()), float(values.max())
    # Halved, so that not even the span of the largest floats overflows.
    span = max(0.5 * high - 0.5 * low, float(np.finfo(np.float64).tiny))
    part = np.clip((0.5 * values - 0.5 * low) / span, 0.0, 1.0)
    return np.asarray(np.round(part * TOP_LEVEL), dtype=np.uint16)


def middle(values: npt.NDArray[np.floating]) -> float:
    """Return the median of some numbers, at least one; it is quicker than numpy's."""
    flat = values.flatten()
    half = flat.size // 2
    if flat.size < FEW:
        flat.sort()
    else:
        # One place alone numpy finds several times as fast as two.
        flat.partition(half)
    high = float(flat[half])
    if flat.size % 2:
        return high
    return 0.5 * (float(flat[half - 1] if flat.size < FEW else flat[:half].max()) + high)


def middles(values: FloatsOrFloats32) -> FloatsOrFloats32:
    """Return the median of each row of some numbers, in their own type."""
    ordered = np.sort(values, axis=1)
    half = values.shape[1] // 2
    if values.shape[1] % 2:
        return ordered[:, half]
    return 0.5 * (ordered[:, half - 1] + ordered[:, half])


def quantile(values: npt.NDArray[np.floating], share: float) -> float:
    """Return what a share of some numbers lies below, as numpy's quantile; it is quicker."""
    flat = values.flatten()
    at = (flat.size - 1) * share
    index = int(at)
    flat.partition(index)
    low = flat[index]
    if index + 1 == flat.size:
        return float(low)
    high, part = flat[index + 1 :].min(), at - index
    step = high - low
    return float(high - step * (1.0 - part) if part >= 0.5 else low + step * part)
