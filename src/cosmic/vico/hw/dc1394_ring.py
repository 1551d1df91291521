"""The ring of buffers that the kernel fills from IEEE 1394, and the frames in it."""

import ctypes
import math
import select
from ctypes import POINTER, byref
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from cosmic.vico.hw import dc1394_ctypes as dc
from cosmic.vico.hw.dc1394_calls import Dc1394Handle
from cosmic.vico.hw.interface import CameraSettings, PixelFormat, Pixels

_SECONDS_OF_BUFFERS: Final = 0.5
_BUFFERS: Final = (8, 64)


@dataclass(frozen=True, slots=True, eq=False)
class Taken:
    """A frame copied from the ring.

    Attributes
    ----------
    received_us : int
        Time of day (unix) at which the kernel had it.
    ring_full : bool
        All buffers waited to be read, so that the kernel had none for the next frame.
    """

    data: Pixels
    received_us: int
    corrupt: bool
    ring_full: bool


class Dc1394Ring:
    """Makes the ring, and takes frames from it; one thread at a time.

    Raises
    ------
    DeviceError
        No channel or no bandwidth is left on the bus, or no memory.
    """

    def __init__(self, handle: Dc1394Handle, settings: CameraSettings) -> None:
        self._handle = handle
        self._settings = settings
        wanted = math.ceil(settings.rate_hz * _SECONDS_OF_BUFFERS)
        self._buffers = max(_BUFFERS[0], min(_BUFFERS[1], wanted))
        flags = dc.DC1394_CAPTURE_FLAGS_DEFAULT
        handle.call("dc1394_capture_setup", self._buffers, flags)
        self._poll = select.poll()
        file = handle.calls.plain("dc1394_capture_get_fileno", handle.pointer)
        self._poll.register(file, select.POLLIN)

    def take(self, timeout_s: float) -> Taken | None:
        """Return the next frame, None after a while; raises `DeviceError`."""
        frame = self._dequeued()
        if frame is None and self._poll.poll(timeout_s * 1000.0):
            frame = self._dequeued()
        if frame is None:
            return None
        try:
            return self._copied(frame)
        finally:
            self._handle.call("dc1394_capture_enqueue", frame)

    def close(self) -> None:
        """Give the ring, the channel and the bandwidth back."""
        # The answer says nothing of use: it fails for a camera that is gone.
        self._handle.calls.plain("dc1394_capture_stop", self._handle.pointer)

    def _dequeued(self) -> Any:
        frame: Any = POINTER(dc.dc1394video_frame_t)()
        self._handle.call("dc1394_capture_dequeue", dc.DC1394_CAPTURE_POLICY_POLL, byref(frame))
        return frame or None

    def _copied(self, frame: Any) -> Taken:
        found = frame.contents
        eight = self._settings.pixel_format is PixelFormat.MONO8
        width, height = self._settings.roi.width_px, self._settings.roi.height_px
        shape = (height, width)
        data: Pixels = np.zeros(shape, np.uint8) if eight else np.zeros(shape, np.uint16)
        line = width * data.itemsize
        stride = found.stride or line
        fits = tuple(found.size) == (width, height) and stride * height <= found.total_bytes
        if fits and stride == line:
            ctypes.memmove(data.ctypes.data, found.image, data.nbytes)
        elif fits:
            for row in range(height):
                ctypes.memmove(data.ctypes.data + row * line, found.image + row * stride, line)
        if not eight and not found.little_endian:
            data.byteswap(inplace=True)  # IIDC sends the high byte first
        data.flags.writeable = False
        name = "dc1394_capture_is_frame_corrupt"
        corrupt = self._handle.calls.plain(name, self._handle.pointer, frame)
        return Taken(
            data=data,
            received_us=int(found.timestamp),
            corrupt=bool(corrupt) or not fits,
            ring_full=found.frames_behind >= self._buffers - 1,
        )
