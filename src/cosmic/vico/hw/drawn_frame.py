"""A frame of a simulated camera: nobody pays for a picture that nobody looks at."""

from collections.abc import Callable
from threading import Lock

from typing_extensions import override

from cosmic.vico.hw.interface import Frame, FrameStatus, PixelFormat, Pixels


class DrawnFrame(Frame):
    """A frame whose pixels are drawn when they are first read; any thread.

    Parameters
    ----------
    data : callable or ndarray
        Draws the pixels, read-only; or the pixels themselves, where it is made from another.
    """

    def __init__(
        self,
        data: Callable[[], Pixels] | Pixels,
        frame_id: int,
        time_s: float,
        exposed_s: float,
        device_ns: int | None = None,
        status: FrameStatus = FrameStatus.COMPLETE,
        pixel_format: PixelFormat = PixelFormat.MONO8,
    ) -> None:
        values = (frame_id, time_s, exposed_s, device_ns, status, pixel_format)
        names = ("frame_id", "time_s", "exposed_s", "device_ns", "status", "pixel_format")
        for name, value in zip(names, values, strict=True):
            object.__setattr__(self, name, value)  # the base is frozen
        object.__setattr__(self, "_source", data)
        object.__setattr__(self, "_drawing", Lock())

    _source: Callable[[], Pixels] | Pixels
    _drawing: Lock

    @property
    @override
    def data(self) -> Pixels:
        """The pixels; see `Frame.data`."""
        with self._drawing:
            source = self._source
            if callable(source):
                source = source()
                object.__setattr__(self, "_source", source)
            return source
