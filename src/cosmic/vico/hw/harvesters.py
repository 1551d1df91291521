"""Cameras of any vendor through a GenTL producer, by the harvesters package (extra `gentl`)."""

import logging
import os
import signal
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from typing_extensions import override

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import (
    ConfigError,
    DeviceError,
    DeviceFault,
    NotConnectedError,
    needs_extra,
)
from cosmic.frame.plugins import NoOptions
from cosmic.vico.hw.base_camera import BaseCamera, BaseCameraLibrary, Sensor
from cosmic.vico.hw.bus_frames import BAYER, FrameNumbers, empty_pixels, from_bayer
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
    Pixels,
    Range,
    Roi,
    Trigger,
)

logger = logging.getLogger(__name__)

_BUFFERS: Final = 8
_POLL_S: Final = 0.002
# The package tells a wait of zero as one without end.
_AT_ONCE_S: Final = 1e-4
_UNKNOWN_PERIOD_S: Final = 0.1
_MOST_LOST: Final = 10_000
_EXPOSURE: Final = ("ExposureTime", "ExposureTimeAbs")
_GAIN: Final = ("Gain",)
_RATE: Final = ("AcquisitionFrameRate", "AcquisitionFrameRateAbs")
_BINNING: Final = ("BinningHorizontal", "BinningVertical")

# What a camera may call a format that CoSMic has; the first that it has is taken.
_CODES: Final = {
    PixelFormat.MONO8: ("Mono8",),
    PixelFormat.MONO10: ("Mono10",),
    PixelFormat.MONO12: ("Mono12",),
    PixelFormat.MONO16: ("Mono16",),
    # A raw mosaic where there is nothing else: its colours are made here.
    PixelFormat.RGB8: ("RGB8", "RGB8Packed", "BGR8", "BGR8Packed", "RGBa8", "BGRa8", *BAYER),
}
# Cameras that choose exposure and gain themselves refuse to be told.
_PREPARE: Final = (
    ("ExposureAuto", "Off"),
    ("GainAuto", "Off"),
    ("AcquisitionMode", "Continuous"),
    ("TriggerSelector", "FrameStart"),
    ("AcquisitionFrameRateEnable", True),
)
_FORMATS: Final = {code: each for each, codes in _CODES.items() for code in codes}


class HarvestersCamera(BaseCamera):
    """One open camera; made by its library.

    The package waits in native code without letting other threads run, so it is asked every 2 ms
    and never waits itself.

    Parameters
    ----------
    acquirer : object
        The package's ImageAcquirer.
    errors : tuple of exception types
        What the package raises.
    """

    def __init__(
        self,
        info: CameraInfo,
        acquirer: Any,
        clock: Clock,
        *,
        errors: tuple[type[Exception], ...],
        closed: Callable[[BaseCamera], None],
    ) -> None:
        super().__init__(info, clock, closed=closed)
        self._acquirer = acquirer
        self._errors: tuple[type[Exception], ...] = errors
        # One thread at a time in the package, and none for long.
        self._package = threading.Lock()
        self._numbers = FrameNumbers(_MOST_LOST)
        self._incomplete = 0
        self._empty_s = 0.0
        try:
            self._features = Features(acquirer.remote_device.node_map, errors)
            self._opened(self._features.sensor_px)
        except errors as exc:
            self.close()
            raise self._error(f"open: {exc}", DeviceFault.UNSUPPORTED) from exc
        self._answers = self._port_answers()

    def count_incomplete(self) -> None:
        """Count a frame with parts missing; called by the package while it is asked for one."""
        self._incomplete += 1

    @override
    def _read(self) -> CameraSettings:
        return self._features.settings()

    @override
    def _read_ranges(self) -> CameraRanges:
        return self._features.ranges()

    @override
    def _sensor(self, binning: int) -> Sensor:
        return self._features.sensor(binning)

    @override
    def _write(self, asked: CameraSettings, present: CameraSettings | None) -> None:
        try:
            with self._package:
                self._features.apply(asked)
        except self._errors as exc:
            raise self._error(f"configure: {exc}", DeviceFault.PARAMETER) from exc

    @override
    def _begin(self) -> None:
        self._numbers = FrameNumbers(_MOST_LOST)
        self._incomplete = 0
        self._empty_s = self._clock.now_s()
        try:
            self._acquirer.start()
        except self._errors as exc:
            raise self._error(
                f"start: {exc}; close other programs that use it", DeviceFault.COMMUNICATION
            ) from exc

    @override
    def _fetch(self, wait_s: float) -> Frame | None:
        end_s = WALL.now_s() + wait_s
        while True:
            try:
                with self._package:
                    frame = self._poll()
            except self._errors as exc:
                self._fail(str(exc))
                raise
            if frame is not None or WALL.now_s() >= end_s or self._stopping.wait(_POLL_S):
                return frame

    @override
    def _fire(self) -> None:
        try:
            with self._package:
                self._features.fire()
        except self._errors as exc:
            raise self._error(f"trigger: {exc}", DeviceFault.COMMUNICATION) from exc

    @override
    def _end(self) -> None:
        try:
            self._acquirer.stop()
        except self._errors as exc:
            raise self._error(f"stop: {exc}", DeviceFault.COMMUNICATION) from exc

    @override
    def _release(self) -> None:
        try:
            self._acquirer.destroy()
        except self._errors as exc:
            logger.warning("%s: close: %s", self._whom, exc)

    @override
    def _loss(self) -> str:
        """Notice a camera that is gone, of which many producers say nothing."""
        with self._package:
            return "it does not answer" if self._answers and not self._port_answers() else ""

    def _port_answers(self) -> bool:
        failures: tuple[type[Exception], ...] = (*self._errors, AttributeError, TypeError)
        try:
            self._acquirer.remote_device.port.read(0, 4)
        except failures:
            return False
        return True

    def _poll(self) -> Frame | None:
        """Return the next frame if one is there."""
        incomplete = self._incomplete
        buffer = self._acquirer.try_fetch(timeout=_AT_ONCE_S)
        if buffer is not None:
            try:
                return self._frame(buffer)
            finally:
                buffer.queue()
        if self._incomplete > incomplete:
            data = empty_pixels(self._settings)
            number = self._numbers.doubtful()
            pixel_format = self._settings.pixel_format
            return self._made(data, pixel_format, number, FrameStatus.INCOMPLETE)
        # Taken after the look: what comes later was complete later.
        self._empty_s = max(self._empty_s, self._clock.now_s() - _POLL_S)
        return None

    def _frame(self, buffer: Any) -> Frame:
        data, pixel_format = pixels_of(buffer, self._whom)
        device_ns = None
        with suppress(*self._errors):  # its clock may not be offered, or its unit be unknown
            device_ns = int(buffer.timestamp_ns)
        number = self._numbers.whole(int(buffer.frame_id))
        return self._made(data, pixel_format, number, FrameStatus.COMPLETE, device_ns)

    def _made(
        self,
        data: Pixels,
        pixel_format: PixelFormat,
        number: int,
        status: FrameStatus,
        device_ns: int | None = None,
    ) -> Frame:
        rate_hz, exposure_s = self._settings.rate_hz, self._settings.exposure_s
        period_s = 1.0 / rate_hz if rate_hz > 0.0 else _UNKNOWN_PERIOD_S
        data.flags.writeable = False
        return Frame(
            data=data,
            frame_id=number,
            time_s=self._clock.now_s(),
            # It may have waited in the queue since that was last seen empty, and is read out
            # within a period.
            exposed_s=self._empty_s - exposure_s - period_s,
            device_ns=device_ns,
            status=status,
            pixel_format=pixel_format,
        )


class HarvestersLibrary(BaseCameraLibrary[HarvestersCamera]):
    """The GenTL producers of `producers`; any thread.

    Parameters
    ----------
    clock : Clock
        Stamps the frames: the platform's.
    producers : sequence of Path
        The vendors' ``.cti`` files; see `installed_producers`.

    Raises
    ------
    NotConnectedError
        The package is not installed, or a file is not there.
    """

    def __init__(self, clock: Clock = WALL, *, producers: Sequence[Path | str]) -> None:
        super().__init__(clock)
        self._core = _harvesters()
        self._errors = (self._core.GenTL_GenericException, self._core.GenApi_GenericException)
        self._listed: tuple[CameraInfo, ...] = ()
        self._producers = tuple(Path(each) for each in producers)
        for each in self._producers:
            if not each.is_file():
                raise NotConnectedError(
                    f"GenTL: there is no producer {each}; install the vendor's driver and give "
                    f"the path of its .cti file",
                    fault=DeviceFault.COMMUNICATION,
                )
        self._harvester: Any = self._core.Harvester()
        for each in self._producers:
            self._harvester.add_file(str(each))

    @property
    @override
    def name(self) -> str:
        names = ", ".join(each.name for each in self._producers)
        return f"GenTL ({names or 'no producer'})"

    @override
    def cameras(self) -> tuple[CameraInfo, ...]:
        with self._lock:
            self._require_open("list the cameras")
            # Looking for cameras anew makes harvesters drop the ones that are open.
            if not self._cameras:
                self._harvester.update()
                found = [each.property_dict for each in self._harvester.device_info_list]
                self._listed = tuple(_info(each) for each in found)
            return self._listed

    @override
    def _open(self, key: str) -> HarvestersCamera:
        listed = {each.key: each for each in self.cameras()}
        if key not in listed:
            raise self._not_there(key, listed, "Check its cable, and the vendor's producer")
        acquirer = self._acquirer(key)
        camera = HarvestersCamera(
            listed[key], acquirer, self._clock, errors=self._errors, closed=self._forget
        )
        acquirer.add_callback(
            acquirer.Events.INCOMPLETE_BUFFER, _Incomplete(camera.count_incomplete)
        )
        return camera

    @override
    def _shut(self) -> None:
        self._harvester.reset()

    def _acquirer(self, key: str) -> Any:
        keys = self._core.ParameterKey
        # The package waits in native code without letting other threads run: it must not wait.
        config = self._core.ParameterSet(
            {
                keys.TIMEOUT_PERIOD_ON_UPDATE_EVENT_DATA_CALL: 0,
                keys.NUM_BUFFERS_FOR_FETCH_CALL: _BUFFERS,
                keys.ENABLE_AUTO_CHUNK_DATA_UPDATE: False,
            }
        )
        before = signal.getsignal(signal.SIGINT)
        try:
            return self._harvester.create({"id_": key}, config=config)
        except (*self._errors, ValueError) as exc:
            raise NotConnectedError(
                f"GenTL: the camera {key!r} does not open: {exc}; close other programs that use "
                f"it, and check its cable",
                fault=DeviceFault.COMMUNICATION,
            ) from exc
        finally:
            # It takes Ctrl-C for itself when called in the main thread.
            if threading.current_thread() is threading.main_thread():
                signal.signal(signal.SIGINT, before)


def installed_producers() -> tuple[Path, ...]:
    """Return the producers in the folders that the vendors' installers have named (GenTL 1.5)."""
    folders = os.environ.get("GENICAM_GENTL64_PATH", "").split(os.pathsep)
    return tuple(file for each in folders if each for file in sorted(Path(each).glob("*.cti")))


class _Incomplete:
    """Hands the package's word on to a camera."""

    def __init__(self, count: Callable[[], None]) -> None:
        self._count = count

    def emit(self, context: object = None) -> None:  # noqa: ARG002 - the package's signature
        """Count a frame with parts missing."""
        self._count()


def _harvesters() -> Any:
    try:
        from harvesters import core
    except ImportError as exc:
        raise NotConnectedError(
            needs_extra("A GenTL camera", "gentl"),
            fault=DeviceFault.UNSUPPORTED,
        ) from exc
    return core


def _info(found: dict[str, Any]) -> CameraInfo:
    def text(name: str) -> str:
        return str(found.get(name) or "")

    return CameraInfo(
        key=text("id_"),
        vendor=text("vendor"),
        model=text("model"),
        serial=text("serial_number"),
    )


class Features:
    """Reads and writes a node map; what a camera has not is left out.

    Parameters
    ----------
    node_map : object
        The camera's.
    errors : tuple of exception types
        What it raises.
    """

    def __init__(self, node_map: Any, errors: tuple[type[Exception], ...]) -> None:
        self._map = node_map
        self._errors: tuple[type[Exception], ...] = (*errors, AttributeError)
        for name, value in _PREPARE:
            self._try_set(name, value)
        self._codes = self._find_codes()
        self.sensor_px = self._sensor_px()

    def settings(self) -> CameraSettings:
        """Read what is in force; exposure, gain and rate are 0 where the camera cannot tell."""
        return CameraSettings(
            exposure_s=self._number(_EXPOSURE) * 1e-6,
            gain_db=self._number(_GAIN),
            rate_hz=self._number(_RATE),
            roi=Roi(
                x_px=int(self._number(("OffsetX",))),
                y_px=int(self._number(("OffsetY",))),
                width_px=int(self._number(("Width",))),
                height_px=int(self._number(("Height",))),
            ),
            binning=self.binning(),
            pixel_format=self._pixel_format(),
            trigger=self._trigger(),
        )

    def ranges(self) -> CameraRanges:
        """Read what the camera accepts now."""
        exposure_us = self._range(_EXPOSURE)
        return CameraRanges(
            exposure_s=exposure_us
            and Range(exposure_us.low * 1e-6, exposure_us.high * 1e-6, exposure_us.step * 1e-6),
            gain_db=self._range(_GAIN),
            rate_hz=self._range(_RATE),
            width_px=self._size("Width", self.sensor_px[0] // self.binning()),
            height_px=self._size("Height", self.sensor_px[1] // self.binning()),
            binnings=self._binnings(),
            pixel_formats=tuple(self._codes) or (PixelFormat.MONO8,),
            triggers=self._triggers(),
        )

    def sensor(self, binning: int) -> Sensor:
        """Return where a ROI may lie with `binning`."""
        width_px, height_px = self.sensor_px
        steps = [self._range((name,)) for name in ("OffsetX", "OffsetY")]
        # Without an offset only the corner itself is left.
        x_step, y_step = (int(each.step) or 1 if each else 2**31 for each in steps)
        scale = max(binning, 1)
        return Sensor(width_px // scale, height_px // scale, x_step, y_step)

    def apply(self, wanted: CameraSettings) -> None:
        """Write settings that were checked, what differs only; raises the package's errors."""
        now = self.settings()
        if wanted.binning != now.binning:
            self._clear_offsets()
            for name in _BINNING:
                self._set(name, wanted.binning)
            now = self.settings()
        if wanted.roi != now.roi:
            self._clear_offsets()
            self._set("Width", wanted.roi.width_px)
            self._set("Height", wanted.roi.height_px)
            for name, value in (("OffsetX", wanted.roi.x_px), ("OffsetY", wanted.roi.y_px)):
                if value:
                    self._set(name, value)
        if wanted.pixel_format is not now.pixel_format:
            self._set("PixelFormat", self._codes[wanted.pixel_format])
        if wanted.trigger is not now.trigger:
            self._set_trigger(wanted.trigger)
        # The slower rate comes before the longer exposure, and the other way round.
        rate = (_RATE, wanted.rate_hz, now.rate_hz)
        exposure = (_EXPOSURE, wanted.exposure_s * 1e6, now.exposure_s * 1e6)
        order = (exposure, rate) if wanted.rate_hz > now.rate_hz else (rate, exposure)
        gain = (_GAIN, wanted.gain_db, now.gain_db)
        for names, number, before in (*order, gain):
            if number != before:
                self._set(self._first(names), number)

    def fire(self) -> None:
        """Take one image, with the software trigger."""
        self._map.TriggerSoftware.execute()

    def binning(self) -> int:
        """Return the binning in force."""
        return int(self._number(_BINNING[:1])) or 1

    def _first(self, names: tuple[str, ...]) -> str:
        return next((each for each in names if self._value(each) is not None), names[0])

    def _value(self, name: str) -> Any:
        try:
            return getattr(self._map, name).value
        except self._errors:
            return None

    def _number(self, names: tuple[str, ...]) -> float:
        return float(self._value(self._first(names)) or 0.0)

    def _range(self, names: tuple[str, ...]) -> Range | None:
        try:
            node = getattr(self._map, self._first(names))
            low, high = float(node.min), float(node.max)
        except self._errors:
            return None
        try:
            step = float(node.inc)
        except self._errors:  # many numbers have none
            step = 0.0
        return Range(low, high, step)

    def _size(self, name: str, whole: int) -> Range:
        found = self._range((name,)) or Range(whole, whole, 1.0)
        return replace(found, high=float(whole))

    def _set(self, name: str, value: object) -> None:
        logger.debug("GenTL: %s = %s", name, value)
        getattr(self._map, name).value = value

    def _try_set(self, name: str, value: object) -> None:
        try:
            self._set(name, value)
        except self._errors:
            logger.debug("GenTL: %s is not there or fixed", name)

    def _clear_offsets(self) -> None:
        for name in ("OffsetX", "OffsetY"):
            if self._value(name):
                self._set(name, 0)

    def _symbols(self, name: str) -> tuple[str, ...]:
        try:
            return tuple(str(each) for each in getattr(self._map, name).symbolics)
        except self._errors:
            return ()

    def _find_codes(self) -> dict[PixelFormat, str]:
        there = self._symbols("PixelFormat")
        found = {
            pixel_format: next((code for code in codes if code in there), "")
            for pixel_format, codes in _CODES.items()
        }
        return {each: code for each, code in found.items() if code}

    def _pixel_format(self) -> PixelFormat:
        now = self._value("PixelFormat")
        for pixel_format, codes in _CODES.items():
            # A mosaic stays only where its colours are to be had in no other way.
            if now in codes and (now not in BAYER or now == self._codes.get(pixel_format)):
                return pixel_format
        if not self._codes:
            return PixelFormat.MONO8
        # A camera wakes up in a format that CoSMic does not read, or not at first.
        first = next(iter(self._codes))
        self._set("PixelFormat", self._codes[first])
        return first

    def _sensor_px(self) -> tuple[int, int]:
        whole = (self._value("SensorWidth"), self._value("SensorHeight"))
        if all(whole):
            return int(whole[0]), int(whole[1])
        binning = self.binning()
        width_px, height_px = (
            int(self._value(f"{side}Max") or self._highest(side)) for side in ("Width", "Height")
        )
        return width_px * binning, height_px * binning

    def _highest(self, name: str) -> float:
        found = self._range((name,))
        return found.high if found else 0.0

    def _binnings(self) -> tuple[int, ...]:
        found = [self._range((name,)) for name in _BINNING]
        if found[0] is None or found[1] is None:
            return (1,)
        highest = int(min(found[0].high, found[1].high))
        step = int(found[0].step) or 1
        return tuple(range(1, highest + 1, step)) or (1,)

    def _triggers(self) -> tuple[Trigger, ...]:
        sources = self._symbols("TriggerSource")
        triggers = [Trigger.FREE_RUN]
        if "On" in self._symbols("TriggerMode"):
            if "Software" in sources and hasattr(self._map, "TriggerSoftware"):
                triggers.append(Trigger.SOFTWARE)
            if any(each.startswith("Line") for each in sources):
                triggers.append(Trigger.HARDWARE)
        return tuple(triggers)

    def _trigger(self) -> Trigger:
        if self._value("TriggerMode") != "On":
            return Trigger.FREE_RUN
        software = self._value("TriggerSource") == "Software"
        return Trigger.SOFTWARE if software else Trigger.HARDWARE

    def _set_trigger(self, trigger: Trigger) -> None:
        if trigger is Trigger.FREE_RUN:
            self._set("TriggerMode", "Off")
            return
        lines = [each for each in self._symbols("TriggerSource") if each.startswith("Line")]
        self._set("TriggerSource", "Software" if trigger is Trigger.SOFTWARE else lines[0])
        self._set("TriggerMode", "On")


def pixels_of(buffer: Any, name: str) -> tuple[Pixels, PixelFormat]:
    """Copy the first image of a GenTL buffer, which is the driver's again afterwards.

    Raises
    ------
    DeviceError
        It holds no image in a format that CoSMic reads.
    """
    for component in buffer.payload.components:
        code = str(component.data_format)
        if code in _FORMATS and component.data is not None:
            return _shaped(component, code), _FORMATS[code]
    formats = ", ".join(str(each.data_format) for each in buffer.payload.components)
    raise DeviceError(
        f"{name}: receive: it sends {formats or 'nothing'}, which CoSMic does not read; choose "
        f"another pixel format",
        fault=DeviceFault.UNSUPPORTED,
    )


def _shaped(component: Any, code: str) -> Pixels:
    height, width = int(component.height), int(component.width)
    flat = np.asarray(component.data)
    if code in BAYER:
        return from_bayer(flat[: height * width].reshape(height, width), code)
    if _FORMATS[code] is not PixelFormat.RGB8:
        return flat[: height * width].reshape(height, width).copy()
    layers = 4 if "a8" in code else 3
    image = flat[: height * width * layers].reshape(height, width, layers)[:, :, :3]
    if code.startswith("BGR"):
        image = image[:, :, ::-1]
    return np.ascontiguousarray(image) if layers == 4 or code[0] == "B" else image.copy()


def _make(_options: NoOptions, context: CameraContext) -> CameraLibrary:
    producers = context.producers or installed_producers()
    if not producers:
        raise ConfigError(
            "cameras: harvesters: no GenTL producer is installed (GENICAM_GENTL64_PATH names "
            "none): install the vendor's driver, or name its .cti file under producers"
        )
    return HarvestersLibrary(context.clock, producers=producers)


BACKEND: Final = CameraBackend(_make)
