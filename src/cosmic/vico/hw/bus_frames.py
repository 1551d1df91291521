"""Numbers, times, buffers and colours of frames that come over a bus, for drivers of cameras."""

import ctypes
import math
from typing import Final

import cv2
import numpy as np

from cosmic.vico.hw.interface import CameraSettings, Pixels, array_of

_SECONDS_OF_BUFFERS: Final = 0.5
_BUFFERS: Final = (8, 64)
_MEMORY_BYTES: Final = 256_000_000
_WRAP: Final = 65536
_PLAUSIBLE_GAP: Final = 1000
_OLDEST_S: Final = 5.0
# Two crystals differ by less than this; the smallest delay seen is forgotten as slowly.
_DRIFT: Final = 2e-4


BAYER: Final = {
    "BayerRG8": cv2.COLOR_BayerRGGB2RGB,
    "BayerGR8": cv2.COLOR_BayerGRBG2RGB,
    "BayerGB8": cv2.COLOR_BayerGBRG2RGB,
    "BayerBG8": cv2.COLOR_BayerBGGR2RGB,
}
"""GenICam's names of raw colour mosaics, by the first two pixels of the first row."""


def from_bayer(mosaic: Pixels, code: str) -> Pixels:
    """Return the colours of a raw mosaic, red first, shape (height, width, 3)."""
    return np.asarray(cv2.cvtColor(mosaic, BAYER[code]), dtype=np.uint8)


class FrameNumbers:
    """Makes numbers without end of the frame numbers on the wire: a gap is a loss.

    GigE Vision counts in 16 bit from 1 and leaves 0 out; some cameras do not, and USB3 Vision and
    the extended form of GigE Vision count in 64 bit. An incomplete frame whose first packet was
    lost bears the number of a frame that was in its buffer before.

    Parameters
    ----------
    most_lost : int
        A longer gap is taken for a camera that counts anew; 0: none is.
    """

    def __init__(self, most_lost: int = 0) -> None:
        self._most_lost = most_lost
        self._next = 0
        self._anchor: tuple[int, int] | None = None  # number on the wire, number given
        self._has_zero = False

    def whole(self, raw: int) -> int:
        """Return the number of a frame that came whole."""
        number = self._given(raw)
        if number is None or (self._most_lost and number - self._next > self._most_lost):
            number = self._next
        self._has_zero |= raw == 0
        self._anchor = (raw, number)
        self._next = number + 1
        return number

    def doubtful(self, raw: int | None = None) -> int:
        """Return the number of an incomplete frame; the next one in order if it cannot be."""
        number = None if raw is None else self._given(raw)
        if number is None or number >= self._next + _PLAUSIBLE_GAP:
            number = self._next
        self._next = number + 1
        return number

    def _given(self, raw: int) -> int | None:
        if self._anchor is None:
            return None
        last, number = self._anchor
        step = raw - last
        if step < -_WRAP // 2 and last < _WRAP:
            step += _WRAP if self._has_zero or raw == 0 else _WRAP - 1
        return number + step if number + step >= self._next else None


class FrameTimes:
    """Tells when a frame was complete and when its exposure began, on the platform's clock.

    Aravis stamps a frame with this computer's time when its first packet is seen. What delays
    that (a busy computer) shows as a growing distance to the camera's own clock, and is taken off.
    """

    def __init__(self) -> None:
        self._transfer_s = _OLDEST_S
        self._nearest: tuple[int, int] | None = None  # smallest distance of the clocks, when; ns

    def complete_s(self, now_s: float, age_s: float, rate: float) -> float:
        """Return when it was complete, if it is `now_s` and its first packet came `age_s` ago."""
        age_s = min(max(age_s, 0.0), _OLDEST_S)
        self._transfer_s = min(self._transfer_s, age_s)
        return now_s - (age_s - self._transfer_s) * rate

    def delay_s(self, system_ns: int, device_ns: int) -> float:
        """Return how much later than others its first packet was seen, by the camera's clock."""
        distance = system_ns - device_ns
        if device_ns == 0:
            return 0.0
        if self._nearest is None:
            self._nearest = (distance, device_ns)
            return 0.0
        nearest, when = self._nearest
        nearest += round(max(0, device_ns - when) * _DRIFT)
        if abs(distance - nearest) > _OLDEST_S * 1e9:  # one of the clocks was set
            nearest = distance
        self._nearest = (min(nearest, distance), device_ns)
        return max(0.0, (distance - nearest) / 1e9)


def buffers_for(rate_hz: float, payload_bytes: int) -> int:
    """Return how many buffers half a second needs, within reason."""
    wanted = max(_BUFFERS[0], min(_BUFFERS[1], math.ceil(rate_hz * _SECONDS_OF_BUFFERS)))
    return max(3, min(wanted, _MEMORY_BYTES // max(1, payload_bytes)))


def empty_pixels(settings: CameraSettings) -> Pixels:
    """Return black pixels of the size and format of `settings`, still writeable."""
    shape, kind = array_of(settings)
    return np.zeros(shape, np.uint8) if kind is np.uint8 else np.zeros(shape, np.uint16)


def copy_rows(start: int, stride_bytes: int, to: Pixels) -> None:
    """Copy the pixels at an address, whose rows begin `stride_bytes` apart."""
    row_bytes = to.nbytes // to.shape[0]
    if stride_bytes == row_bytes:
        ctypes.memmove(to.ctypes.data, start, to.nbytes)
        return
    for row in range(to.shape[0]):
        ctypes.memmove(to.ctypes.data + row * row_bytes, start + row * stride_bytes, row_bytes)
