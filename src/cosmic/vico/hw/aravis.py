"""GigE Vision and USB3 Vision cameras of all makers, through Aravis 0.8; Linux."""

import logging
import threading
from collections.abc import Callable
from ctypes import byref, c_double, c_int, create_string_buffer
from dataclasses import replace
from typing import Any, Final

from typing_extensions import override

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import DeviceError, DeviceFault, NotConnectedError
from cosmic.frame.plugins import NoOptions
from cosmic.vico.hw import aravis_ctypes as arv
from cosmic.vico.hw.aravis_ctypes import AravisBuffer, AravisCalls, AravisStream
from cosmic.vico.hw.base_camera import BaseCamera, BaseCameraLibrary, Sensor
from cosmic.vico.hw.bus_frames import (
    BAYER,
    FrameNumbers,
    FrameTimes,
    empty_pixels,
    from_bayer,
)
from cosmic.vico.hw.gvcp import QUIET_S, GvcpWatch, ask_camera, controlled
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

_US_PER_S: Final = 1e6
# How cameras of before 2012 call a format. A raw mosaic is taken where there is nothing else.
_OTHER_NAMES: Final = {
    "RGB8Packed": PixelFormat.RGB8,
    **dict.fromkeys(BAYER, PixelFormat.RGB8),
}
# Aravis keeps an incomplete frame for its last packets, for less than this.
_INCOMPLETE_AGE_S: Final = 0.5
_FAKE: Final = b"Fake"
_NOT_REAL: Final = frozenset({"Aravis"})  # the maker that Aravis' own fake cameras name
_VERSION: Final = ("major", "minor", "micro")
_IDENTITY: Final = (
    "arv_camera_get_vendor_name",
    "arv_camera_get_model_name",
    "arv_camera_get_device_serial_number",
)
# The list of devices is one for the whole process.
_discovery: Final = threading.Lock()


class AravisCamera(BaseCamera):
    """One open camera; made by `AravisLibrary.open`.

    Parameters
    ----------
    camera : int
        Address of the ArvCamera, which becomes this object's.
    address : str
        IP address of a GigE Vision camera, "" for others.
    """

    quiet_s = 0.0  # the watch knows by itself when to ask

    def __init__(
        self,
        calls: AravisCalls,
        camera: int,
        info: CameraInfo,
        address: str,
        clock: Clock,
        closed: Callable[[BaseCamera], None],
    ) -> None:
        super().__init__(info, clock, closed=closed)
        self._calls = calls
        self._camera = camera
        self._address = address
        self._stream: AravisStream | None = None
        self._watch: GvcpWatch | None = None
        self._numbers, self._times = FrameNumbers(), FrameTimes()
        self._device = calls.plain("arv_camera_get_device", camera)
        self._control_lost = False
        self._asked_s = WALL.now_s()
        self._handler = arv.ControlLostHandler(self._on_control_lost)
        self._handler_id = calls.plain(
            "g_signal_connect_data", self._device, b"control-lost", self._handler, None, None, 0
        )
        try:
            self._features = AravisFeatures(calls, camera, self._whom)
            self._opened(self._features.sensor_px)
        except DeviceError:
            self.close()
            raise

    @property
    def packets(self) -> tuple[int, int]:
        """How many packets were asked for again since `start`, and how many never came; GigE."""
        with self._lock:
            return (0, 0) if self._stream is None else self._stream.packets()

    @override
    def _read(self) -> CameraSettings:
        return self._features.settings()

    @override
    def _read_ranges(self) -> CameraRanges:
        return self._features.ranges(self._settings.binning)

    @override
    def _sensor(self, binning: int) -> Sensor:
        return self._features.sensor(binning)

    @override
    def _write(self, asked: CameraSettings, present: CameraSettings | None) -> None:
        self._features.write(asked, present)

    @override
    def _begin(self) -> None:
        stream = AravisStream(self._calls, self._camera, self._whom, self._settings.rate_hz)
        try:
            self._calls.checked(self._whom, "arv_camera_start_acquisition", self._camera)
        except DeviceError:
            stream.close()
            raise
        self._numbers, self._times = FrameNumbers(), FrameTimes()
        self._asked_s = WALL.now_s()
        if self._address:
            self._watch = GvcpWatch(self._address, self._asked_s)
        self._stream = stream

    @override
    def _fetch(self, wait_s: float) -> Frame | None:
        stream = self._stream
        address = stream.pop(wait_s) if stream is not None else None
        if stream is None or address is None:
            return None
        frame = self._frame(AravisBuffer(self._calls, address))
        stream.push(address)
        self._underrun = stream.underruns()
        self._asked_s = WALL.now_s()
        if self._watch is not None:
            self._watch.alive(self._asked_s)
        return frame

    @override
    def _fire(self) -> None:
        self._calls.checked(self._whom, "arv_camera_software_trigger", self._camera)

    @override
    def _end(self) -> None:
        stream, self._stream = self._stream, None
        watch, self._watch = self._watch, None
        if watch is not None:
            watch.close()
        try:
            self._require("stop")
            self._calls.checked(self._whom, "arv_camera_stop_acquisition", self._camera)
        finally:
            if stream is not None:
                stream.close(gone=self._failure is not None)

    @override
    def _release(self) -> None:
        self._calls.plain("g_signal_handler_disconnect", self._device, self._handler_id)
        gone = self._failure is not None or bool(self._silence())
        self._calls.release(self._camera, gone=gone)

    @override
    def _silence(self) -> str:
        return ask_camera(self._address) if self._address else ""

    @override
    def _loss(self) -> str:
        if self._control_lost:
            return "Aravis lost control of it"
        now_s = WALL.now_s()
        if self._watch is not None:
            return self._watch.poll(now_s)
        if now_s - self._asked_s < QUIET_S:
            return ""
        self._asked_s = now_s
        try:  # the first bytes of the camera's memory, which every kind has
            self._calls.checked(
                self._whom, "arv_device_read_memory", self._device, 0, 4, create_string_buffer(4)
            )
        except DeviceError as exc:
            return str(exc)
        return ""

    def _on_control_lost(self, _device: int | None, _data: int | None) -> None:
        """Note it; in a thread of Aravis."""
        self._control_lost = True

    def _frame(self, buffer: AravisBuffer) -> Frame:
        settings = self._settings
        mosaic = self._features.mosaic_of(settings.pixel_format)
        if mosaic:
            raw = buffer.pixels(replace(settings, pixel_format=PixelFormat.MONO8))
            data = None if raw is None else from_bayer(raw, mosaic)
            if data is not None:
                data.flags.writeable = False
        else:
            data = buffer.pixels(settings)
        # The most that lies between the beginning of an exposure and its first packet.
        rates = self._ranges.rate_hz
        before_s = settings.exposure_s + (0.0 if rates is None else 1.0 / rates.high)
        now_s, rate = self._clock.now_s(), self._clock.rate
        if not buffer.whole or data is None:
            blank = empty_pixels(settings)
            blank.flags.writeable = False
            return Frame(
                data=blank if data is None else data,
                frame_id=self._numbers.doubtful(buffer.number),
                time_s=now_s,
                exposed_s=now_s - (before_s + _INCOMPLETE_AGE_S) * rate,
                status=FrameStatus.INCOMPLETE,
                pixel_format=settings.pixel_format,
            )
        age_s = (self._calls.plain("g_get_real_time") * 1000 - buffer.system_ns) / 1e9
        complete_s = self._times.complete_s(now_s, age_s, rate)
        before_s += max(0.0, age_s) + self._times.delay_s(buffer.system_ns, buffer.device_ns)
        return Frame(
            data=data,
            frame_id=self._numbers.whole(buffer.number),
            time_s=complete_s,
            exposed_s=min(now_s - before_s * rate, complete_s),
            device_ns=buffer.device_ns,
            pixel_format=settings.pixel_format,
        )


class AravisFeatures:
    """What can be set at one camera; one thread at a time.

    Parameters
    ----------
    camera : int
        Address of the ArvCamera; the caller keeps it alive.
    whom : str
        The camera, for texts.

    Raises
    ------
    DeviceError
        The camera fails, or has no pixel format that is understood.
    """

    def __init__(self, calls: AravisCalls, camera: int, whom: str) -> None:
        self._calls = calls
        self._camera = camera
        self._whom = whom
        self._trigger = Trigger.FREE_RUN
        self._has = {
            name: bool(self._get(f"arv_camera_is_{name}_available"))
            for name in ("exposure_time", "gain", "frame_rate", "binning", "region_offset")
        }
        self._formats = self._pixel_formats()
        self._hardware_line = self._find_hardware_line()
        self._has_software = bool(self._get("arv_camera_is_software_trigger_supported"))
        self._prepare()
        self.sensor_px = self._sensor_size()

    def settings(self) -> CameraSettings:
        """Read what is in force."""
        binning = self._pair("arv_camera_get_binning")[0] if self._has["binning"] else 1
        return CameraSettings(
            exposure_s=self._float("exposure_time") / _US_PER_S,
            gain_db=self._float("gain"),
            rate_hz=self._float("frame_rate"),
            roi=self._roi(),
            binning=max(1, binning),
            pixel_format=self._format() or PixelFormat.MONO8,
            trigger=self._trigger,
        )

    def ranges(self, binning: int) -> CameraRanges:
        """Read what the camera accepts now."""
        sensor = self.sensor(binning)
        exposure = self._bounds("exposure_time")
        return CameraRanges(
            exposure_s=exposure
            and Range(exposure.low / _US_PER_S, exposure.high / _US_PER_S, exposure.step),
            gain_db=self._bounds("gain"),
            rate_hz=self._bounds("frame_rate"),
            width_px=self._size("width", sensor.width_px),
            height_px=self._size("height", sensor.height_px),
            binnings=self._binnings(),
            pixel_formats=tuple(self._formats),
            triggers=self._triggers(),
        )

    def sensor(self, binning: int) -> Sensor:
        """Return where a ROI may lie with a binning, which need not be one that it has."""
        binning = max(1, binning)
        width, height = self.sensor_px
        steps = (1, 1)
        if self._has["region_offset"]:
            steps = (
                max(1, self._get("arv_camera_get_x_offset_increment")),
                max(1, self._get("arv_camera_get_y_offset_increment")),
            )
        return Sensor(width // binning, height // binning, *steps)

    def write(self, asked: CameraSettings, present: CameraSettings | None) -> None:
        """Put settings in force, what differs from `present`; all of them where it is None."""
        self._write_image(asked, present)
        rate_changes = present is None or asked.rate_hz != present.rate_hz
        # A longer exposure needs the lower rate first, and the other way round.
        slower = rate_changes and asked.rate_hz < self._float("frame_rate")
        if slower:
            self._set("frame_rate", asked.rate_hz)
        if present is None or asked.exposure_s != present.exposure_s:
            self._set("exposure_time", asked.exposure_s * _US_PER_S)
        if rate_changes and not slower:
            self._set("frame_rate", asked.rate_hz)
        if present is None or asked.gain_db != present.gain_db:
            self._set("gain", asked.gain_db)
        # Setting the rate makes Aravis switch triggers off at some cameras.
        if asked.trigger != self._trigger or (rate_changes and asked.trigger != Trigger.FREE_RUN):
            self._set_trigger(asked.trigger)

    def _write_image(self, asked: CameraSettings, present: CameraSettings | None) -> None:
        binning_changes = present is None or asked.binning != present.binning
        if self._has["binning"] and binning_changes:
            self._call("arv_camera_set_binning", asked.binning, asked.binning)
        if present is None or asked.pixel_format != present.pixel_format:
            self._set_format(asked.pixel_format)
        if present is None or asked.roi != present.roi or binning_changes:
            roi = asked.roi
            self._call("arv_camera_set_region", roi.x_px, roi.y_px, roi.width_px, roi.height_px)

    def _set_trigger(self, trigger: Trigger) -> None:
        if trigger is Trigger.FREE_RUN:
            self._call("arv_camera_clear_triggers")
        else:
            source = "Software" if trigger is Trigger.SOFTWARE else self._hardware_line
            self._call("arv_camera_set_trigger", source.encode())
        self._trigger = trigger

    def _prepare(self) -> None:
        self._call("arv_camera_set_acquisition_mode", arv.ARV_ACQUISITION_MODE_CONTINUOUS)
        if self._has["exposure_time"] and self._get("arv_camera_is_exposure_auto_available"):
            self._call("arv_camera_set_exposure_time_auto", arv.ARV_AUTO_OFF)
        if self._has["gain"] and self._get("arv_camera_is_gain_auto_available"):
            self._call("arv_camera_set_gain_auto", arv.ARV_AUTO_OFF)
        if self._hardware_line or self._has_software:
            self._call("arv_camera_clear_triggers")
        if self._wire() not in self._formats.values():
            self._set_format(next(iter(self._formats)))

    def _pixel_formats(self) -> dict[PixelFormat, str]:
        name = "arv_camera_dup_available_pixel_formats_as_strings"
        found = self._calls.strings(self._whom, name, self._camera)
        # The last of several names stays: the format itself, rather than a mosaic.
        understood = {_understood(each): each for each in sorted(found, key=_directness)}
        formats = {each: understood[each] for each in PixelFormat if each in understood}
        if not formats:
            raise DeviceError(
                f"{self._whom}: none of its pixel formats is understood: it has "
                f"{', '.join(found) or 'none'}; understood are {', '.join(PixelFormat)}",
                fault=DeviceFault.UNSUPPORTED,
            )
        return formats

    def _find_hardware_line(self) -> str:
        if not self._get_feature("TriggerSource"):
            return ""
        name = "arv_camera_dup_available_trigger_sources"
        sources = self._calls.strings(self._whom, name, self._camera)
        return next((each for each in sorted(sources) if each.startswith("Line")), "")

    def _triggers(self) -> tuple[Trigger, ...]:
        found = [Trigger.FREE_RUN]
        if self._has_software:
            found.append(Trigger.SOFTWARE)
        if self._hardware_line:
            found.append(Trigger.HARDWARE)
        return tuple(found)

    def _sensor_size(self) -> tuple[int, int]:
        width, height = self._pair("arv_camera_get_sensor_size")
        if width > 0 and height > 0:
            return width, height
        roi = self._roi()
        return (
            self._pair("arv_camera_get_width_bounds")[1] + roi.x_px,
            self._pair("arv_camera_get_height_bounds")[1] + roi.y_px,
        )

    def _roi(self) -> Roi:
        parts = [c_int() for _ in range(4)]
        self._call("arv_camera_get_region", *(byref(part) for part in parts))
        return Roi(*(part.value for part in parts))

    def _size(self, side: str, whole: int) -> Range:
        low, _ = self._pair(f"arv_camera_get_{side}_bounds")
        step = max(1, self._get(f"arv_camera_get_{side}_increment"))
        return Range(max(1, low), whole, step)

    def _binnings(self) -> tuple[int, ...]:
        if not self._has["binning"]:
            return (1,)
        both = []
        for axis in ("x", "y"):
            low, high = self._pair(f"arv_camera_get_{axis}_binning_bounds")
            step = max(1, self._get(f"arv_camera_get_{axis}_binning_increment"))
            both.append(set(range(max(1, low), high + 1, step)))
        return tuple(sorted(both[0] & both[1])) or (1,)

    def mosaic_of(self, pixel_format: PixelFormat) -> str:
        """Return the GenICam name of the raw mosaic that a format is made of; empty: of none."""
        name = self._formats.get(pixel_format, "")
        return name if name in BAYER else ""

    def _wire(self) -> str:
        answer: bytes = self._get("arv_camera_get_pixel_format_as_string") or b""
        return answer.decode()

    def _format(self) -> PixelFormat | None:
        return _understood(self._wire())

    def _set_format(self, pixel_format: PixelFormat) -> None:
        name = self._formats[pixel_format].encode()
        self._call("arv_camera_set_pixel_format_from_string", name)

    def _bounds(self, feature: str) -> Range | None:
        if not self._has[feature]:
            return None
        name = f"arv_camera_get_{feature}_bounds"
        low, high = self._calls.pair(self._whom, name, self._camera, c_double)
        return Range(low, high)

    def _float(self, feature: str) -> float:
        return float(self._get(f"arv_camera_get_{feature}")) if self._has[feature] else 0.0

    def _set(self, feature: str, value: float) -> None:
        if self._has[feature]:
            self._call(f"arv_camera_set_{feature}", value)

    def _get_feature(self, name: str) -> bool:
        found = self._calls.checked(
            self._whom, "arv_camera_is_feature_available", self._camera, name.encode()
        )
        return bool(found)

    def _get(self, name: str) -> Any:
        return self._calls.checked(self._whom, name, self._camera)

    def _call(self, name: str, *args: object) -> None:
        self._calls.checked(self._whom, name, self._camera, *args)

    def _pair(self, name: str) -> tuple[int, int]:
        return self._calls.pair(self._whom, name, self._camera)


class AravisLibrary(BaseCameraLibrary[AravisCamera]):
    """Aravis 0.8; any thread.

    Parameters
    ----------
    clock : Clock
        Stamps the frames: the platform's.
    packet_bytes : int
        Size of GigE Vision's packets; 0 leaves what the camera has, and lets Aravis make it
        smaller where the network does not carry it. 8000 and more needs jumbo frames.
    fake : bool
        Also offer the fake camera that Aravis has inside, Fake_1, without a network.
    library : ctypes.CDLL or object
        What tests put in Aravis' position.

    Raises
    ------
    NotConnectedError
        Aravis is not installed; the text says which package it is in.
    """

    def __init__(
        self,
        clock: Clock = WALL,
        *,
        packet_bytes: int = 0,
        fake: bool = False,
        library: object = None,
    ) -> None:
        super().__init__(clock)
        self._packet_bytes = packet_bytes
        self._calls = AravisCalls(arv.load_library() if library is None else library)
        self._fake = fake
        if fake:
            self._calls.plain("arv_enable_interface", _FAKE)

    @property
    @override
    def name(self) -> str:
        parts = [self._calls.plain(f"arv_get_{part}_version") for part in _VERSION]
        return f"Aravis {'.'.join(str(part) for part in parts)}"

    @override
    def cameras(self) -> tuple[CameraInfo, ...]:
        with _discovery:
            self._calls.plain("arv_update_device_list")
            count = self._calls.plain("arv_get_n_devices")
            return tuple(self._described(index) for index in range(count))

    @override
    def _open(self, key: str) -> AravisCamera:
        handle = self._handle(key)
        try:
            info, address = self._identity(key, handle)
            self._take(key, handle, address)
        except DeviceError:
            self._calls.release(handle)
            raise
        return AravisCamera(self._calls, handle, info, address, self._clock, self._forget)

    @override
    def _shut(self) -> None:
        if self._fake:
            self._calls.plain("arv_disable_interface", _FAKE)

    def _handle(self, key: str) -> int:
        """Return a new ArvCamera."""
        # Left to itself Aravis takes the first network card over which the camera answers, which
        # need not be the one that its images can come back by; a full list settles that.
        addresses = self._addresses()
        if key not in addresses:
            addresses = self._addresses(anew=True)
        text, fault = "", DeviceFault.COMMUNICATION
        if key in addresses and self._is_free(key, addresses[key]):
            try:
                with _discovery:
                    return int(self._calls.checked(f"camera {key}", "arv_camera_new", key.encode()))
            except DeviceError as exc:
                text, fault = f" ({exc})", exc.fault
        raise self._not_there(
            key,
            self._addresses(anew=key in addresses),
            f"Check cable, power and, with GigE Vision, the network addresses{text}",
            fault,
        )

    def _addresses(self, *, anew: bool = False) -> dict[str, str]:
        """Return the address of each camera, "" where it has none."""
        if anew:
            self.cameras()
        with _discovery:
            count = self._calls.plain("arv_get_n_devices")
            return {
                self._text("id", index): self._text("address", index)
                if self._text("protocol", index) == "GigEVision"
                else ""
                for index in range(count)
            }

    def _is_free(self, key: str, address: str) -> bool:
        """Return whether a camera answers; raises where another program controls it.

        Aravis itself takes five seconds to find out either.
        """
        if not address:
            return True
        taken = controlled(address)
        if taken:
            raise _taken(key)
        return taken is not None

    def _identity(self, key: str, handle: int) -> tuple[CameraInfo, str]:
        """Return which camera it is, and its IP address if it has one."""
        vendor, model, serial = (
            (self._calls.checked(f"camera {key}", name, handle) or b"").decode(errors="replace")
            for name in _IDENTITY
        )
        info = CameraInfo(key, vendor, model, serial, simulated=vendor in _NOT_REAL)
        if not self._calls.plain("arv_camera_is_gv_device", handle):
            return info, ""
        device = self._calls.plain("arv_camera_get_device", handle)
        place = self._calls.plain("arv_gv_device_get_device_address", device)
        inet = self._calls.plain("g_inet_socket_address_get_address", place)
        return info, self._calls.owned_text("g_inet_address_to_string", inet)

    def _take(self, key: str, handle: int, address: str) -> None:
        """Make sure that a camera on the network is ours, and set its packets."""
        if not address:
            return
        device = self._calls.plain("arv_camera_get_device", handle)
        if not self._calls.plain("arv_gv_device_is_controller", device):
            raise _taken(key)
        if self._packet_bytes:
            name = "arv_camera_gv_set_packet_size"
            self._calls.checked(f"camera {key}", name, handle, self._packet_bytes)

    def _described(self, index: int) -> CameraInfo:
        vendor = self._text("vendor", index)
        return CameraInfo(
            key=self._text("id", index),
            vendor=vendor,
            model=self._text("model", index),
            serial=self._text("serial_nbr", index),
            simulated=vendor in _NOT_REAL,
        )

    def _text(self, what: str, index: int) -> str:
        found: bytes | None = self._calls.plain(f"arv_get_device_{what}", index)
        return (found or b"").decode(errors="replace")


def _directness(name: str) -> int:
    """Return how little is to be done to make one of our formats of what has a GenICam name."""
    return 0 if name in BAYER else 2 if name in set(PixelFormat) else 1


def _understood(name: str) -> PixelFormat | None:
    """Return the format of a GenICam name, None where it is none of ours."""
    if name in set(PixelFormat):
        return PixelFormat(name)
    return _OTHER_NAMES.get(name)


def _taken(key: str) -> NotConnectedError:
    return NotConnectedError(
        f"camera {key} is controlled by another program or computer, or was until a few seconds "
        f"ago; close it there",
        fault=DeviceFault.OVERRIDDEN,
    )


def _make(_options: NoOptions, context: CameraContext) -> CameraLibrary:
    return AravisLibrary(context.clock, packet_bytes=context.packet_bytes)


BACKEND: Final = CameraBackend(_make)
