"""Pixels into FFmpeg's frames and out of them, without any conversion of FFmpeg's own.

PyAV's conversions stretch grey values between "full" and "limited" range, so planes are copied.
"""

from typing import TYPE_CHECKING, Any, Final, cast

import numpy as np
import numpy.typing as npt

from cosmic.vico.hw.interface import Pixels

if TYPE_CHECKING:
    import av

RED, GREEN, BLUE = 0, 1, 2
_GREY_CHROMA: Final = 128
_BYTES: Final = "u1"
_MONO: Final = {"gray": _BYTES, "gray16le": "<u2"}
_YUV: Final = {"yuvj420p", "yuv420p", "yuvj422p", "yuv422p", "yuvj444p", "yuv444p"}


def to_video_frame(data: Pixels, coded: str) -> "av.VideoFrame":
    """Return a frame in FFmpeg's pixel format `coded` with the pixels of `data`."""
    import av

    height, width = data.shape[:2]
    if coded == "yuvj444p":
        layers = np.ascontiguousarray(data, dtype=np.uint8)
        frame = av.VideoFrame.from_ndarray(layers, format="rgb24")
        return frame.reformat(format=coded, dst_color_range="JPEG")
    frame = av.VideoFrame(width, height, coded)
    if coded in _MONO:
        _plane(frame, 0, _MONO[coded])[:] = data
    elif coded == "bgr0":
        four = _plane(frame, 0, _BYTES, 4)
        four[:, :, :3] = data[:, :, ::-1]
        four[:, :, 3] = 0
    elif coded == "gbrp":
        for plane, layer in enumerate((GREEN, BLUE, RED)):
            _plane(frame, plane, _BYTES)[:] = data[:, :, layer]
    else:
        _plane(frame, 0, _BYTES)[:] = data
        for plane in (1, 2):
            _plane(frame, plane, _BYTES)[:] = _GREY_CHROMA
    return frame


def from_video_frame(frame: "av.VideoFrame", *, colour: bool) -> Pixels:
    """Return the pixels of a frame, as they were given to `to_video_frame`; a copy."""
    coded = frame.format.name
    if coded in _MONO:
        lines = _plane(frame, 0, _MONO[coded])
        return lines.astype(lines.dtype.newbyteorder("="))
    if coded in {"bgr0", "bgra"}:
        return np.ascontiguousarray(_plane(frame, 0, _BYTES, 4)[:, :, 2::-1])
    if coded == "gbrp":
        green, blue, red = (_plane(frame, each, _BYTES) for each in range(3))
        return np.dstack([red, green, blue])
    if coded in _YUV and not colour:
        return _plane(frame, 0, _BYTES).copy()
    return cast("Pixels", frame.to_ndarray(format="rgb24"))


def _plane(frame: "av.VideoFrame", number: int, dtype: str, layers: int = 1) -> npt.NDArray[Any]:
    """Return a view of a plane, without the padding at the end of its lines."""
    plane = frame.planes[number]
    lines = np.frombuffer(cast("Any", plane), dtype).reshape(plane.height, -1)
    lines = lines[:, : plane.width * layers]
    return lines.reshape(plane.height, plane.width, layers) if layers > 1 else lines
