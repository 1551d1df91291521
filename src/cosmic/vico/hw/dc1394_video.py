"""Size, pixel format and rate of an IIDC camera: the scalable mode, or a fixed one."""

import math
from abc import ABC, abstractmethod
from ctypes import byref, c_int, c_uint32
from typing import Final

from typing_extensions import override

from cosmic.frame.errors import DeviceError, DeviceFault
from cosmic.vico.hw import dc1394_ctypes as dc
from cosmic.vico.hw.camera_checks import Sensor
from cosmic.vico.hw.dc1394_calls import Dc1394Handle
from cosmic.vico.hw.interface import PixelFormat, Range, Roi

# IEEE 1394 sends one packet a camera in each cycle of 125 us, at every bus speed.
_CYCLES_PER_S: Final = 8000
_MOST_PACKETS: Final = 65535  # of a frame; the counter of juju, the kernel's driver, is as wide

_CODINGS: Final = {
    PixelFormat.MONO8: dc.DC1394_COLOR_CODING_MONO8,
    PixelFormat.MONO16: dc.DC1394_COLOR_CODING_MONO16,
}
_FIXED: Final = {
    dc.DC1394_VIDEO_MODE_640x480_MONO8: (640, 480, PixelFormat.MONO8),
    dc.DC1394_VIDEO_MODE_640x480_MONO16: (640, 480, PixelFormat.MONO16),
    dc.DC1394_VIDEO_MODE_800x600_MONO8: (800, 600, PixelFormat.MONO8),
    dc.DC1394_VIDEO_MODE_800x600_MONO16: (800, 600, PixelFormat.MONO16),
    dc.DC1394_VIDEO_MODE_1024x768_MONO8: (1024, 768, PixelFormat.MONO8),
    dc.DC1394_VIDEO_MODE_1024x768_MONO16: (1024, 768, PixelFormat.MONO16),
    dc.DC1394_VIDEO_MODE_1280x960_MONO8: (1280, 960, PixelFormat.MONO8),
    dc.DC1394_VIDEO_MODE_1280x960_MONO16: (1280, 960, PixelFormat.MONO16),
    dc.DC1394_VIDEO_MODE_1600x1200_MONO8: (1600, 1200, PixelFormat.MONO8),
    dc.DC1394_VIDEO_MODE_1600x1200_MONO16: (1600, 1200, PixelFormat.MONO16),
}


class Video(ABC):
    """What pictures the camera sends.

    Attributes
    ----------
    sensor : Sensor
        Where a ROI may lie.
    formats : tuple of PixelFormat
    width_px, height_px : Range
        Sizes of a ROI.
    """

    sensor: Sensor
    formats: tuple[PixelFormat, ...]
    width_px: Range
    height_px: Range

    @abstractmethod
    def rates_hz(self, roi: Roi, pixel_format: PixelFormat) -> Range:
        """Return the rates that pictures of a size and format can have."""

    @abstractmethod
    def write(self, roi: Roi, pixel_format: PixelFormat, rate_hz: float) -> None:
        """Put in force what was checked; raises `DeviceError`."""

    @abstractmethod
    def read(self) -> tuple[Roi, PixelFormat, float]:
        """Return ROI, pixel format and rate in force; raises `DeviceError`."""


class ScalableVideo(Video):
    """Format 7, mode 0: any ROI; the rate follows from the size of the packets."""

    def __init__(self, handle: Dc1394Handle) -> None:
        self._handle = handle
        handle.call("dc1394_video_set_mode", _MODE)
        self.formats = self._formats()
        whole = handle.numbers("dc1394_format7_get_max_image_size", _MODE, count=2)
        unit = handle.numbers("dc1394_format7_get_unit_size", _MODE, count=2)
        x, y = handle.numbers("dc1394_format7_get_unit_position", _MODE, count=2)
        # A camera may leave the unit of the position empty: it is that of the size then (IIDC).
        self.sensor = Sensor(whole[0], whole[1], x or unit[0] or 1, y or unit[1] or 1)
        self.width_px = Range(max(1, unit[0]), whole[0], max(1, unit[0]))
        self.height_px = Range(max(1, unit[1]), whole[1], max(1, unit[1]))

    @override
    def rates_hz(self, roi: Roi, pixel_format: PixelFormat) -> Range:
        unit, most = self._packets()
        return Range(
            _rate_hz(_bytes(roi, pixel_format), max(unit, self._least(roi, pixel_format, unit))),
            _rate_hz(_bytes(roi, pixel_format), most),
        )

    @override
    def write(self, roi: Roi, pixel_format: PixelFormat, rate_hz: float) -> None:
        unit, most = self._packets()
        size = _bytes(roi, pixel_format)
        packets = max(1, round(_CYCLES_PER_S / rate_hz))
        packet = min(most, math.ceil(size / packets / unit) * unit)
        self._handle.call(
            "dc1394_format7_set_roi",
            _MODE,
            _CODINGS[pixel_format],
            max(packet, self._least(roi, pixel_format, unit)),
            roi.x_px,
            roi.y_px,
            roi.width_px,
            roi.height_px,
        )

    @override
    def read(self) -> tuple[Roi, PixelFormat, float]:
        coding = c_int()
        parts = [c_uint32() for _ in range(5)]
        self._handle.call(
            "dc1394_format7_get_roi", _MODE, byref(coding), *(byref(each) for each in parts)
        )
        packet, *roi = (each.value for each in parts)
        found = [each for each, code in _CODINGS.items() if code == coding.value]
        if not found:  # set to colour by another program
            roi_found, pixel_format = Roi(*roi), self.formats[0]
            self.write(roi_found, pixel_format, self.rates_hz(roi_found, pixel_format).high)
            return self.read()
        size = _bytes(Roi(*roi), found[0])
        return Roi(*roi), found[0], _rate_hz(size, packet or self._packets()[1])

    def _formats(self) -> tuple[PixelFormat, ...]:
        codings = dc.dc1394color_codings_t()
        self._handle.call("dc1394_format7_get_color_codings", _MODE, byref(codings))
        found = list(codings.codings[: codings.num])
        formats = tuple(each for each, code in _CODINGS.items() if code in found)
        if not formats:
            raise DeviceError(
                f"{self._handle.whom}: its format 7 has neither Mono8 nor Mono16, but codings "
                f"{found}",
                fault=DeviceFault.UNSUPPORTED,
            )
        return formats

    def _packets(self) -> tuple[int, int]:
        name = "dc1394_format7_get_packet_parameters"
        unit, most = self._handle.numbers(name, _MODE, count=2)
        return max(4, unit), max(4, most)

    @staticmethod
    def _least(roi: Roi, pixel_format: PixelFormat, unit: int) -> int:
        """Return the smallest packet with which a frame does not take too many of them."""
        return math.ceil(_bytes(roi, pixel_format) / _MOST_PACKETS / unit) * unit


class FixedVideo(Video):
    """The largest of the fixed modes; of its few rates the next one below what is asked."""

    def __init__(self, handle: Dc1394Handle, modes: list[int]) -> None:
        self._handle = handle
        known = {mode: _FIXED[mode] for mode in modes if mode in _FIXED}
        if not known:
            raise DeviceError(
                f"{handle.whom}: it has neither format 7 nor a fixed mode in Mono8 or Mono16, but "
                f"modes {modes}",
                fault=DeviceFault.UNSUPPORTED,
            )
        width, height = max((wide, high) for wide, high, _ in known.values())
        self._modes = {
            kind: mode for mode, (w, h, kind) in known.items() if (w, h) == (width, height)
        }
        self.formats = tuple(each for each in _CODINGS if each in self._modes)
        self.sensor = Sensor(width, height)
        self.width_px, self.height_px = Range(width, width, 1), Range(height, height, 1)
        self._handle.call("dc1394_video_set_mode", self._modes[self.formats[0]])

    @override
    def rates_hz(self, roi: Roi, pixel_format: PixelFormat) -> Range:
        rates = sorted(self._rates(pixel_format))
        return Range(rates[0], rates[-1])

    @override
    def write(self, roi: Roi, pixel_format: PixelFormat, rate_hz: float) -> None:
        rates = self._rates(pixel_format)
        # Never faster than asked, so that the exposure still fits into the period.
        slower = [each for each in rates if each <= rate_hz * 1.01]
        rate = max(slower, default=min(rates))
        self._handle.call("dc1394_video_set_mode", self._modes[pixel_format])
        self._handle.call("dc1394_video_set_framerate", rates[rate])

    @override
    def read(self) -> tuple[Roi, PixelFormat, float]:
        mode = self._handle.integer("dc1394_video_get_mode")
        code = self._handle.integer("dc1394_video_get_framerate")
        rate_hz = 1.875 * 2.0 ** (code - dc.DC1394_FRAMERATE_1_875)
        roi = Roi(0, 0, self.sensor.width_px, self.sensor.height_px)
        return roi, _FIXED[mode][2], rate_hz

    def _rates(self, pixel_format: PixelFormat) -> dict[float, int]:
        found = dc.dc1394framerates_t()
        name = "dc1394_video_get_supported_framerates"
        self._handle.call(name, self._modes[pixel_format], byref(found))
        codes = list(found.framerates[: found.num])
        return {1.875 * 2.0 ** (code - dc.DC1394_FRAMERATE_1_875): code for code in codes}


def make_video(handle: Dc1394Handle) -> Video:
    """Return the scalable mode where the camera has it, else the largest fixed one."""
    modes = dc.dc1394video_modes_t()
    handle.call("dc1394_video_get_supported_modes", byref(modes))
    found = list(modes.modes[: modes.num])
    return ScalableVideo(handle) if _MODE in found else FixedVideo(handle, found)


_MODE: Final = dc.DC1394_VIDEO_MODE_FORMAT7_0


def _bytes(roi: Roi, pixel_format: PixelFormat) -> int:
    return roi.width_px * roi.height_px * (1 if pixel_format is PixelFormat.MONO8 else 2)


def _rate_hz(size: int, packet: int) -> float:
    return _CYCLES_PER_S / max(1, math.ceil(size / packet))
