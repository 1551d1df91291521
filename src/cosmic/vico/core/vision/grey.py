"""Images as machine vision takes them: one layer, 8 or 16 bit."""

from typing import cast

import cv2
import numpy as np
import numpy.typing as npt

from cosmic.frame.errors import ConfigError
from cosmic.vico.hw.interface import Pixels

Floats = npt.NDArray[np.float64]
Floats32 = npt.NDArray[np.float32]
Mask = npt.NDArray[np.uint8]

LEAST_SIDE_PX = 16
LAYERS = 3


def grey_image(image: npt.NDArray[np.generic]) -> Pixels:
    """Return an image in one layer; three layers are weighed as blue, green, red.

    Raises
    ------
    ConfigError
        It is no array of 8 or 16 bit pixels, or too small to hold a fibre.
    """
    if not isinstance(image, np.ndarray):
        raise ConfigError(f"an image is a numpy array, not {type(image).__name__}")
    if image.dtype not in (np.uint8, np.uint16):
        raise ConfigError(
            f"an image has uint8 or uint16 pixels, not {image.dtype}; convert it first, so that "
            "its grey levels are whole numbers"
        )
    if image.ndim != 2 and not (image.ndim == LAYERS and image.shape[2] == LAYERS):
        raise ConfigError(
            f"an image has the shape (height, width) or (height, width, 3), not {image.shape}"
        )
    if not min(image.shape[:2]) >= LEAST_SIDE_PX:
        raise ConfigError(
            f"the image of {image.shape[1]} x {image.shape[0]} pixels is too small; fibres are "
            f"looked for from {LEAST_SIDE_PX} x {LEAST_SIDE_PX} on"
        )
    pixels = cast("Pixels", image)
    if pixels.ndim == LAYERS:
        pixels = cast("Pixels", cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY))
    return pixels


def middle(values: npt.NDArray[np.floating]) -> float:
    """Return the median of some numbers, at least one; for few it is quicker than numpy's."""
    half = values.size // 2
    if values.size % 2:
        return float(np.partition(values, half, axis=None)[half])
    pair = np.partition(values, (half - 1, half), axis=None)[half - 1 : half + 1]
    return 0.5 * (float(pair[0]) + float(pair[1]))
