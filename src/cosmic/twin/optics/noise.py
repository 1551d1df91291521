"""Noise of the sensor, made once and cut out anew for each image, and the sensor's range."""

import random
from typing import Final

import cv2
import numpy as np

from cosmic.frame.arrays import Pixels
from cosmic.twin.optics.canvas import Layer

MARGIN_PX: Final = 192
"""So many points across and down from which an image's noise may be cut."""

ZERO: Final = 32768
ONE: Final = 6000.0
"""What stands for no noise in the bank, and for one standard deviation."""

WHITE: Final = 255 * 64
"""Brightness of a layer at which the sensor is full."""


class Noise:
    """A bank of noise.

    Parameters
    ----------
    width_px, height_px : int
        Of the largest image.
    """

    def __init__(self, *, width_px: int, height_px: int, seed: int) -> None:
        self._seed = seed
        self._size = height_px + MARGIN_PX, width_px + MARGIN_PX
        self._bank: Layer | None = None

    def expose(self, layer: Layer, sigma: float, black: float, at_s: float, bits: int) -> Pixels:
        """Return a layer as the sensor gives it, uint8 or uint16; the layer is used up.

        Parameters
        ----------
        sigma, black : float
            Noise and black level, in the layer's units.
        at_s : float
            The same time gives the same noise.
        """
        noise = self._cut(layer.shape, at_s)
        part = sigma / ONE
        cv2.addWeighted(layer, 1.0, noise, part, black - part * ZERO, layer)
        if bits == 8:
            return np.asarray(cv2.convertScaleAbs(layer, alpha=255.0 / WHITE), dtype=np.uint8)
        cv2.addWeighted(layer, 65535.0 / WHITE, layer, 0.0, 0.0, layer)
        return layer

    def _cut(self, shape: tuple[int, ...], at_s: float) -> Layer:
        if self._bank is None:
            rng = np.random.default_rng([self._seed, 0x4E])
            bell = rng.standard_normal(self._size, dtype=np.float32)
            self._bank = np.clip(ZERO + ONE * bell, 0.0, 65535.0).astype(np.uint16)
        chance = random.Random(f"{self._seed} {at_s!r}")
        height, width = self._size
        row = chance.randint(0, height - shape[0])
        column = chance.randint(0, width - shape[1])
        return self._bank[row : row + shape[0], column : column + shape[1]]
