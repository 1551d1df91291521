"""Pictures as OpenCV has them (blue, green, red) made into those that CoSMic has."""

import cv2
import numpy as np
import numpy.typing as npt

from cosmic.vico.hw.interface import PixelFormat, Pixels, Roi


def formats_of(picture: npt.NDArray[np.generic]) -> tuple[PixelFormat, ...]:
    """Return what a picture can be made into, the format nearest to its own first."""
    if picture.dtype == np.uint16:
        return (PixelFormat.MONO16, PixelFormat.MONO8)
    if picture.ndim == 2:
        return (PixelFormat.MONO8, PixelFormat.RGB8)
    return (PixelFormat.RGB8, PixelFormat.MONO8)


def made_of(picture: npt.NDArray[np.generic], pixel_format: PixelFormat, roi: Roi) -> Pixels:
    """Return a read-only copy of the part `roi` in `pixel_format`."""
    part = picture[roi.y_px : roi.y_px + roi.height_px, roi.x_px : roi.x_px + roi.width_px]
    if part.ndim == 3 and pixel_format is PixelFormat.RGB8:
        code = cv2.COLOR_BGRA2RGB if part.shape[2] == 4 else cv2.COLOR_BGR2RGB
        part = cv2.cvtColor(part, code)
    elif part.ndim == 3:
        code = cv2.COLOR_BGRA2GRAY if part.shape[2] == 4 else cv2.COLOR_BGR2GRAY
        part = cv2.cvtColor(part, code)
    elif pixel_format is PixelFormat.RGB8:
        part = cv2.cvtColor(part, cv2.COLOR_GRAY2RGB)
    if part.dtype == np.uint16 and pixel_format is not PixelFormat.MONO16:
        part = part >> 8
    wide = pixel_format is PixelFormat.MONO16
    data: Pixels = np.array(part, np.uint16 if wide else np.uint8, order="C", copy=True)
    data.flags.writeable = False
    return data
