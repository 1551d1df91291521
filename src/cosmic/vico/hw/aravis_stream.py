"""The stream of buffers that Aravis fills, and the pictures in them."""

import ctypes
import math
from ctypes import byref, c_int, c_size_t, c_uint64
from typing import Final

import numpy as np

from cosmic.frame.errors import DeviceError, DeviceFault
from cosmic.vico.hw import aravis_ctypes as arv
from cosmic.vico.hw.aravis_calls import AravisCalls
from cosmic.vico.hw.interface import CameraSettings, PixelFormat, Pixels

_SECONDS_OF_BUFFERS: Final = 0.5
_BUFFERS: Final = (8, 64)
_MEMORY_BYTES: Final = 256_000_000
# Without packet sockets (CAP_NET_RAW) the kernel's default of 200 kB loses most frames; the
# kernel cuts this to net.core.rmem_max.
_SOCKET_BUFFER_BYTES: Final = 8_000_000


def buffers_for(settings: CameraSettings, payload_bytes: int) -> int:
    """Return how many buffers half a second needs, within reason."""
    wanted = max(_BUFFERS[0], min(_BUFFERS[1], math.ceil(settings.rate_hz * _SECONDS_OF_BUFFERS)))
    return max(3, min(wanted, _MEMORY_BYTES // max(1, payload_bytes)))


class AravisStream:
    """An ArvStream with its pool of buffers; one thread at a time.

    Parameters
    ----------
    camera : int
        Address of the ArvCamera; the caller keeps it alive.

    Raises
    ------
    DeviceError
        The camera fails, or another program controls it.
    """

    def __init__(
        self, calls: AravisCalls, camera: int, whom: str, settings: CameraSettings
    ) -> None:
        self._calls = calls
        self._gige = bool(calls.plain("arv_camera_is_gv_device", camera))
        payload = int(calls.checked(whom, "arv_camera_get_payload", camera))
        self._stream = calls.checked(whom, "arv_camera_create_stream", camera, None, None)
        if not self._stream:
            raise DeviceError(f"{whom}: Aravis made no stream", fault=DeviceFault.COMMUNICATION)
        if self._gige:
            fixed = arv.ARV_GV_STREAM_SOCKET_BUFFER_FIXED
            calls.set_int_property(self._stream, "socket-buffer", fixed)
            calls.set_int_property(self._stream, "socket-buffer-size", _SOCKET_BUFFER_BYTES)
        for _ in range(buffers_for(settings, payload)):
            self.push(calls.plain("arv_buffer_new_allocate", payload))

    def pop(self, timeout_s: float) -> int | None:
        """Return the next buffer that was filled, to be pushed back; None after a while."""
        found = self._calls.plain(
            "arv_stream_timeout_pop_buffer", self._stream, round(timeout_s * 1e6)
        )
        return None if found is None else int(found)

    def push(self, buffer: int) -> None:
        """Give a buffer to be filled; it belongs to the stream from now on."""
        self._calls.plain("arv_stream_push_buffer", self._stream, buffer)

    def underruns(self) -> int:
        """Return how often no buffer was free."""
        numbers = [c_uint64() for _ in range(3)]
        self._calls.plain(
            "arv_stream_get_statistics", self._stream, *(byref(each) for each in numbers)
        )
        return numbers[2].value

    def packets(self) -> tuple[int, int]:
        """Return how many packets were asked for again, and how many never came; GigE only."""
        resent, missing = c_uint64(), c_uint64()
        if self._gige:
            self._calls.plain(
                "arv_gv_stream_get_statistics", self._stream, byref(resent), byref(missing)
            )
        return resent.value, missing.value

    def close(self, *, gone: bool = False) -> None:
        """End its thread and free its buffers; `gone`: the camera is."""
        self._calls.release(self._stream, gone=gone)


class AravisBuffer:
    """What is in a buffer that was filled; valid until it is pushed back."""

    def __init__(self, calls: AravisCalls, buffer: int) -> None:
        self._calls = calls
        self._buffer = buffer

    @property
    def whole(self) -> bool:
        """Nothing of it is missing."""
        return bool(self._get("status") == arv.ARV_BUFFER_STATUS_SUCCESS)

    @property
    def number(self) -> int:
        """The frame's number on the wire; a stranger's where the first packet is missing."""
        return int(self._get("frame_id"))

    @property
    def device_ns(self) -> int:
        """The camera's clock."""
        return int(self._get("timestamp"))

    @property
    def system_ns(self) -> int:
        """Time on the clock of this computer (`g_get_real_time`) when its first packet was seen."""
        return int(self._get("system_timestamp"))

    def pixels(self, settings: CameraSettings) -> Pixels | None:
        """Return a copy of the picture, None where it is not of the size in force."""
        layers = 3 if settings.pixel_format is PixelFormat.RGB8 else 1
        eight = settings.pixel_format in (PixelFormat.MONO8, PixelFormat.RGB8)
        pixel_bytes = layers if eight else 2
        width, height = settings.roi.width_px, settings.roi.height_px
        gap = 0
        if self.whole:  # else Aravis does not tell
            if (self._get("image_width"), self._get("image_height")) != (width, height):
                return None
            across, down = c_int(), c_int()
            name = "arv_buffer_get_image_padding"
            self._calls.plain(name, self._buffer, byref(across), byref(down))
            gap = across.value
        line = width * pixel_bytes + gap
        size = c_size_t()
        start = self._calls.plain("arv_buffer_get_data", self._buffer, byref(size))
        if not start or size.value < line * height - gap:
            return None
        shape = (height, width, 3) if layers == 3 else (height, width)
        picture: Pixels = np.empty(shape, np.uint8) if eight else np.empty(shape, np.uint16)
        return _copied(start, line, width * pixel_bytes, picture)

    def _get(self, what: str) -> int:
        return int(self._calls.plain(f"arv_buffer_get_{what}", self._buffer))


def _copied(start: int, line_bytes: int, used_bytes: int, picture: Pixels) -> Pixels:
    if line_bytes == used_bytes:
        ctypes.memmove(picture.ctypes.data, start, picture.nbytes)
    else:
        for row in range(picture.shape[0]):
            to = picture.ctypes.data + row * used_bytes
            ctypes.memmove(to, start + row * line_bytes, used_bytes)
    picture.flags.writeable = False
    return picture
