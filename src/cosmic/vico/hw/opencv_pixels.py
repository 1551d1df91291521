"""Pictures as OpenCV has them (blue, green, red) made into those that CoSMic has."""

from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from cosmic.vico.hw.interface import PixelFormat, Pixels, Roi


def formats_of(picture: Pixels) -> tuple[PixelFormat, ...]:
    """Return what a picture can be made into, the format nearest to its own first."""
    if picture.dtype == np.uint16:
        return (PixelFormat.MONO16, PixelFormat.MONO8)
    if picture.ndim == 2:
        return (PixelFormat.MONO8, PixelFormat.RGB8)
    return (PixelFormat.RGB8, PixelFormat.MONO8)


def made_of(picture: Pixels, pixel_format: PixelFormat, roi: Roi) -> Pixels:
    """Return a read-only copy of the part `roi` in `pixel_format`."""
    part = picture[roi.y_px : roi.y_px + roi.height_px, roi.x_px : roi.x_px + roi.width_px]
    shaped = _layers(part, colour=pixel_format is PixelFormat.RGB8)
    wide = pixel_format is PixelFormat.MONO16
    if shaped.dtype == np.uint16 and not wide:
        shaped = shaped >> 8
    data: Any = np.array(shaped, np.uint16 if wide else np.uint8, order="C")
    data.flags.writeable = False
    pixels: Pixels = data
    return pixels


def _layers(part: Pixels, *, colour: bool) -> npt.NDArray[Any]:
    if part.ndim == 2:
        return cv2.cvtColor(part, cv2.COLOR_GRAY2RGB) if colour else part
    clear = part.shape[2] == 4
    if colour:
        return cv2.cvtColor(part, cv2.COLOR_BGRA2RGB if clear else cv2.COLOR_BGR2RGB)
    return cv2.cvtColor(part, cv2.COLOR_BGRA2GRAY if clear else cv2.COLOR_BGR2GRAY)
