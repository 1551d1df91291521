"""IIDC cameras on IEEE 1394 (FireWire), through libdc1394 2.2; Linux."""

import logging
import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from ctypes import POINTER, byref, c_int, c_uint32
from typing import Any, Final

from typing_extensions import override

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import DeviceError, DeviceFault, NotConnectedError
from cosmic.frame.plugins import NoOptions
from cosmic.vico.hw import dc1394_ctypes as dc
from cosmic.vico.hw.base_camera import BaseCamera, BaseCameraLibrary, Sensor, check_values
from cosmic.vico.hw.dc1394_ctypes import Dc1394Calls, Dc1394Handle, Dc1394Ring, Taken
from cosmic.vico.hw.interface import (
    CameraBackend,
    CameraContext,
    CameraInfo,
    CameraLibrary,
    CameraRanges,
    CameraSettings,
    Frame,
    FrameStatus,
    PixelFormat,
    Range,
    Roi,
    Trigger,
)

logger = logging.getLogger(__name__)

_LATE: Final = 1.5  # periods between two frames from which on one is missing
_OLDEST_S: Final = 5.0
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
_MODE: Final = dc.DC1394_VIDEO_MODE_FORMAT7_0


class Dc1394Camera(BaseCamera):
    """One open camera; made by `Dc1394Library.open`.

    Parameters
    ----------
    pointer : pointer to dc1394camera_t
        Becomes this object's.
    shutter_unit_s : float
        What a count of the shutter is worth, for a camera that does not know; 0: nobody knows.

    Notes
    -----
    The bus carries no frame numbers: frames lost are told by the gaps between the times at which
    the kernel received the others, while the camera runs freely.
    """

    def __init__(
        self,
        calls: Dc1394Calls,
        pointer: Any,
        info: CameraInfo,
        clock: Clock,
        *,
        shutter_unit_s: float = 0.0,
        closed: Callable[[BaseCamera], None] | None = None,
    ) -> None:
        super().__init__(info, clock, closed=closed)
        self._calls = calls
        self._ring: Dc1394Ring | None = None
        self._numbers = FrameCount()
        self._pointer = pointer
        self._handle = Dc1394Handle(calls, pointer, self._whom)
        try:
            self._set_speed(bool(pointer.contents.bmode_capable))
            self._video = make_video(self._handle)
            self._shutter = Dc1394Feature(self._handle, dc.DC1394_FEATURE_SHUTTER, shutter_unit_s)
            self._gain = Dc1394Feature(self._handle, dc.DC1394_FEATURE_GAIN, 1.0)
            self._trigger = Dc1394Trigger(self._handle)
            sensor = self._video.sensor
            self._opened((sensor.width_px, sensor.height_px))
        except DeviceError:
            self.close()
            raise

    @override
    def _read(self) -> CameraSettings:
        roi, pixel_format, rate_hz = self._video.read()
        return CameraSettings(
            exposure_s=self._shutter.read(),
            gain_db=self._gain.read(),
            rate_hz=rate_hz,
            roi=roi,
            pixel_format=pixel_format,
            trigger=self._trigger.choice,
        )

    @override
    def _read_ranges(self) -> CameraRanges:
        return self._ranges_for(self._settings)

    @override
    def _check_values(self, asked: CameraSettings) -> None:
        # The rates go with ROI and format.
        check_values(self._whom, asked, self._settings, self._ranges_for(asked))

    @override
    def _sensor(self, binning: int) -> Sensor:
        return self._video.sensor

    @override
    def _write(self, asked: CameraSettings, present: CameraSettings | None) -> None:
        video = (asked.roi, asked.pixel_format, asked.rate_hz)
        if present is None or video != (present.roi, present.pixel_format, present.rate_hz):
            self._write_video(asked)
        if self._shutter.available and (present is None or asked.exposure_s != present.exposure_s):
            self._shutter.write(asked.exposure_s)
        if self._gain.available and (present is None or asked.gain_db != present.gain_db):
            self._gain.write(asked.gain_db)
        if asked.trigger != self._trigger.choice:
            self._trigger.write(asked.trigger)

    @override
    def _begin(self) -> None:
        ring = Dc1394Ring(self._handle, self._settings)
        try:
            self._handle.call("dc1394_video_set_transmission", dc.DC1394_ON)
        except DeviceError:
            ring.close()
            raise
        self._numbers = FrameCount()
        self._ring = ring

    @override
    def _fetch(self, wait_s: float) -> Frame | None:
        if self._ring is None:
            return None
        try:
            taken = self._ring.take(wait_s)
        except DeviceError as exc:
            self._fail(str(exc))
            raise
        return None if taken is None else self._frame(taken)

    @override
    def _fire(self) -> None:
        self._trigger.fire()

    @override
    def _end(self) -> None:
        ring, self._ring = self._ring, None
        try:
            self._handle.call("dc1394_video_set_transmission", dc.DC1394_OFF)
        finally:
            if ring is not None:
                ring.close()

    @override
    def _release(self) -> None:
        self._calls.plain("dc1394_camera_free", self._pointer)

    @override
    def _loss(self) -> str:
        try:
            sending = self._handle.integer("dc1394_video_get_transmission")
        except DeviceError as exc:
            return str(exc)
        if not sending:
            return "it was switched off and on and no longer sends images"
        return ""

    def _set_speed(self, fast: bool) -> None:
        if fast:
            name = "dc1394_video_set_operation_mode"
            self._handle.call(name, dc.DC1394_OPERATION_MODE_1394B)
        speed = dc.DC1394_ISO_SPEED_800 if fast else dc.DC1394_ISO_SPEED_400
        self._handle.call("dc1394_video_set_iso_speed", speed)

    def _ranges_for(self, settings: CameraSettings) -> CameraRanges:
        return CameraRanges(
            exposure_s=self._shutter.bounds(),
            gain_db=self._gain.bounds(),
            rate_hz=self._video.rates_hz(settings.roi, settings.pixel_format),
            width_px=self._video.width_px,
            height_px=self._video.height_px,
            pixel_formats=self._video.formats,
            triggers=self._trigger.choices,
        )

    def _write_video(self, asked: CameraSettings) -> None:
        """Change what the ring of buffers depends on, with the ring taken away meanwhile."""
        with self._receiving:
            ring = self._ring
            if ring is not None:
                self._handle.call("dc1394_video_set_transmission", dc.DC1394_OFF)
                ring.close()
            try:
                self._video.write(asked.roi, asked.pixel_format, asked.rate_hz)
            finally:
                if ring is not None:
                    self._ring = Dc1394Ring(self._handle, asked)
                    self._numbers.pause()
                    self._handle.call("dc1394_video_set_transmission", dc.DC1394_ON)

    def _frame(self, taken: Taken) -> Frame:
        settings, rate = self._settings, self._clock.rate
        free = settings.trigger is Trigger.FREE_RUN
        self._underrun += taken.ring_full
        now_s, real_us = self._clock.now_s(), time.time_ns() // 1000
        age_s = min(max(0.0, (real_us - taken.received_us) / 1e6), _OLDEST_S)
        # On the bus a frame takes up to a period.
        begun_s = age_s + settings.exposure_s + 1.0 / settings.rate_hz
        return Frame(
            data=taken.data,
            frame_id=self._numbers.number(taken.received_us, settings.rate_hz if free else 0.0),
            time_s=now_s - age_s * rate,
            exposed_s=now_s - begun_s * rate,
            status=FrameStatus.INCOMPLETE if taken.corrupt else FrameStatus.COMPLETE,
            pixel_format=settings.pixel_format,
        )


class Dc1394Library(BaseCameraLibrary[Dc1394Camera]):
    """libdc1394 2.2; any thread.

    Parameters
    ----------
    clock : Clock
        Stamps the frames: the platform's.
    shutter_unit_s : float
        Seconds a count of the shutter, for cameras that know no absolute values (their manual
        says it); 0 makes their exposure unavailable.
    library : ctypes.CDLL or object
        What tests put in the library's position.

    Raises
    ------
    NotConnectedError
        libdc1394 is not installed, or finds no FireWire at all.
    """

    def __init__(
        self, clock: Clock = WALL, *, shutter_unit_s: float = 0.0, library: object = None
    ) -> None:
        super().__init__(clock)
        self._shutter_unit_s = shutter_unit_s
        self._calls = Dc1394Calls(dc.load_library() if library is None else library)
        self._known: dict[str, CameraInfo] = {}
        self._context: int | None = self._calls.plain("dc1394_new")
        if not self._context:
            raise NotConnectedError(
                "libdc1394 finds no FireWire: is there a card, with its kernel module "
                "firewire-ohci, and may you write to /dev/fw*?",
                fault=DeviceFault.COMMUNICATION,
            )

    @property
    @override
    def name(self) -> str:
        return "libdc1394 2.2"  # the library cannot tell its version

    @override
    def cameras(self) -> tuple[CameraInfo, ...]:
        with self._lock:
            return tuple(self._found().values())

    @override
    def _open(self, key: str) -> Dc1394Camera:
        found = self._found()
        pointer = self._pointer(key) if key in found else None
        if not pointer:
            raise self._not_there(key, found, "Check cable, power and the rights to /dev/fw*")
        return Dc1394Camera(
            self._calls,
            pointer,
            found[key],
            self._clock,
            shutter_unit_s=self._shutter_unit_s,
            closed=self._forget,
        )

    @override
    def _shut(self) -> None:
        self._calls.plain("dc1394_free", self._context)

    def _found(self) -> dict[str, CameraInfo]:
        """Return the cameras on the bus; one is asked for its name when it is seen first."""
        self._require_open("list the cameras")
        listed = POINTER(dc.dc1394camera_list_t)()
        name = "dc1394_camera_enumerate"
        self._calls.checked("libdc1394", name, self._context, byref(listed))
        try:
            ids = [listed.contents.ids[index] for index in range(listed.contents.num)]
            keys = [_key(each.guid, each.unit) for each in ids]
        finally:
            self._calls.plain("dc1394_camera_free_list", listed)
        for key in keys:
            if key not in self._known:
                self._known[key] = self._described(key)
        return {key: self._known[key] for key in keys}

    def _described(self, key: str) -> CameraInfo:
        pointer = self._pointer(key)
        if not pointer:
            return CameraInfo(key, vendor="", model="", serial=key)
        try:
            vendor, model = (
                (text or b"").decode(errors="replace").strip()
                for text in (pointer.contents.vendor, pointer.contents.model)
            )
        finally:
            self._calls.plain("dc1394_camera_free", pointer)
        return CameraInfo(key, vendor=vendor, model=model, serial=key)

    def _pointer(self, key: str) -> Any:
        guid, _, unit = key.partition("-")
        name = "dc1394_camera_new_unit"
        return self._calls.plain(name, self._context, int(guid, 16), int(unit or 0)) or None


def _key(guid: int, unit: int) -> str:
    return f"{guid:016x}" + (f"-{unit}" if unit else "")


class Dc1394Feature:
    """One number that can be set: in its own unit where the camera knows it, else in counts.

    Parameters
    ----------
    unit : float
        What one count is worth, for a camera without absolute values; 0 where nobody knows, which
        makes the feature unavailable.
    """

    def __init__(self, handle: Dc1394Handle, feature: int, unit: float) -> None:
        self._handle = handle
        self._feature = feature
        self._unit = unit
        self._absolute = False
        self.available = bool(handle.integer("dc1394_feature_is_present", feature))
        if not self.available:
            return
        handle.call("dc1394_feature_set_mode", feature, dc.DC1394_FEATURE_MODE_MANUAL)
        self._absolute = bool(handle.integer("dc1394_feature_has_absolute_control", feature))
        if self._absolute:
            handle.call("dc1394_feature_set_absolute_control", feature, dc.DC1394_ON)
        self.available = self._absolute or unit > 0.0

    def bounds(self) -> Range | None:
        """Return what it accepts, None where it cannot be set."""
        if not self.available:
            return None
        if self._absolute:
            name = "dc1394_feature_get_absolute_boundaries"
            return Range(*self._handle.floats(name, self._feature, count=2))
        name = "dc1394_feature_get_boundaries"
        low, high = self._handle.numbers(name, self._feature, count=2)
        return Range(low * self._unit, high * self._unit, self._unit)

    def read(self) -> float:
        """Return the value in force; 0 where there is none."""
        if not self.available:
            return 0.0
        if self._absolute:
            return self._handle.floats("dc1394_feature_get_absolute_value", self._feature)[0]
        return self._handle.numbers("dc1394_feature_get_value", self._feature)[0] * self._unit

    def write(self, value: float) -> None:
        """Set it; the caller has checked that it is available and within bounds."""
        if self._absolute:
            self._handle.call("dc1394_feature_set_absolute_value", self._feature, value)
        else:
            counts = round(value / self._unit)
            self._handle.call("dc1394_feature_set_value", self._feature, counts)


class Dc1394Trigger:
    """What starts an exposure."""

    def __init__(self, handle: Dc1394Handle) -> None:
        self._handle = handle
        self._sources = self._find_sources()
        self.choices = tuple(each for each in Trigger if each in {Trigger.FREE_RUN, *self._sources})
        self.choice = Trigger.FREE_RUN
        if self._sources:
            handle.call("dc1394_external_trigger_set_power", dc.DC1394_OFF)

    def write(self, choice: Trigger) -> None:
        """Put one of the choices in force."""
        if choice is Trigger.FREE_RUN:
            self._handle.call("dc1394_external_trigger_set_power", dc.DC1394_OFF)
        else:
            source = self._sources[choice]
            self._handle.call("dc1394_external_trigger_set_mode", dc.DC1394_TRIGGER_MODE_0)
            self._handle.call("dc1394_external_trigger_set_source", source)
            self._handle.call("dc1394_external_trigger_set_power", dc.DC1394_ON)
        self.choice = choice

    def fire(self) -> None:
        """Trigger by software."""
        self._handle.call("dc1394_software_trigger_set_power", dc.DC1394_ON)

    def _find_sources(self) -> dict[Trigger, int]:
        handle = self._handle
        if not handle.integer("dc1394_feature_is_present", dc.DC1394_FEATURE_TRIGGER):
            return {}
        found = dc.dc1394trigger_sources_t()
        try:
            handle.call("dc1394_external_trigger_get_supported_sources", byref(found))
        except DeviceError:
            return {}  # IIDC before 1.31 knows no sources
        codes = list(found.sources[: found.num])
        lines = [each for each in codes if each != dc.DC1394_TRIGGER_SOURCE_SOFTWARE]
        sources = {Trigger.HARDWARE: min(lines)} if lines else {}
        if dc.DC1394_TRIGGER_SOURCE_SOFTWARE in codes:
            sources[Trigger.SOFTWARE] = dc.DC1394_TRIGGER_SOURCE_SOFTWARE
        return sources


class Video(ABC):
    """What images the camera sends.

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
        """Return the rates that images of a size and format can have."""

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


def _bytes(roi: Roi, pixel_format: PixelFormat) -> int:
    return roi.width_px * roi.height_px * (1 if pixel_format is PixelFormat.MONO8 else 2)


def _rate_hz(size: int, packet: int) -> float:
    return _CYCLES_PER_S / max(1, math.ceil(size / packet))


class FrameCount:
    """Numbers frames by the times at which they were received."""

    def __init__(self) -> None:
        self._next = 0
        self._last_us: int | None = None
        self._last_wall_s = 0.0

    def pause(self) -> None:
        """Take the next gap for what it is: the camera was stopped on purpose."""
        self._last_us = None

    def number(self, received_us: int, rate_hz: float) -> int:
        """Return the number of a frame; with a rate of 0 no gap is a loss."""
        now_wall_s = WALL.now_s()
        if self._last_us is not None and rate_hz > 0.0:
            gap_s, passed_s = (received_us - self._last_us) / 1e6, now_wall_s - self._last_wall_s
            if abs(gap_s - passed_s) > _OLDEST_S:  # the date of the computer was set
                gap_s = passed_s
            periods = gap_s * rate_hz
            missing = round(periods) - 1 if periods > _LATE else 0
            self._next += missing
        self._last_us, self._last_wall_s = received_us, now_wall_s
        self._next += 1
        return self._next - 1


def _make(_options: NoOptions, context: CameraContext) -> CameraLibrary:
    return Dc1394Library(context.clock)


BACKEND: Final = CameraBackend(_make)
