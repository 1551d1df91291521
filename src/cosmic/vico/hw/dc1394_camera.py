"""An IIDC camera on IEEE 1394 (FireWire), through libdc1394."""

import logging
import threading
from dataclasses import replace
from typing import Any, Final

from typing_extensions import override

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import ConfigError, DeviceError, DeviceFault, NotAvailable
from cosmic.vico.hw import dc1394_ctypes as dc
from cosmic.vico.hw.camera_checks import check_settings
from cosmic.vico.hw.dc1394_calls import Dc1394Calls, Dc1394Handle, as_refusal
from cosmic.vico.hw.dc1394_features import Dc1394Feature, Dc1394Trigger
from cosmic.vico.hw.dc1394_ring import Dc1394Ring
from cosmic.vico.hw.dc1394_tally import Dc1394Tally
from cosmic.vico.hw.dc1394_video import make_video
from cosmic.vico.hw.interface import (
    Camera,
    CameraCounters,
    CameraInfo,
    CameraRanges,
    CameraSettings,
    Frame,
    Trigger,
)

logger = logging.getLogger(__name__)

_SLICE_S: Final = 0.05
_QUIET_S: Final = 0.5


class Dc1394Camera(Camera):
    """One open camera; made by `Dc1394Library.open`.

    Parameters
    ----------
    pointer : pointer to dc1394camera_t
        Becomes this object's.
    shutter_unit_s : float
        What a count of the shutter is worth, for a camera that does not know; 0: nobody knows.
    clock : Clock
        The platform's.

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
    ) -> None:
        self._calls = calls
        self._whom = f"camera {info.key}"
        self._clock = clock
        self._lock = threading.RLock()
        self._receiving = threading.Lock()
        self._ring: Dc1394Ring | None = None
        self._failure: DeviceError | None = None
        self._closed = False
        self._pointer = pointer
        self._handle = Dc1394Handle(calls, pointer, self._whom)
        self._begin_counting()
        try:
            self._set_speed(bool(pointer.contents.bmode_capable))
            self._video = make_video(self._handle)
            self._shutter = Dc1394Feature(self._handle, dc.DC1394_FEATURE_SHUTTER, shutter_unit_s)
            self._gain = Dc1394Feature(self._handle, dc.DC1394_FEATURE_GAIN, 1.0)
            self._trigger = Dc1394Trigger(self._handle)
            self._settings = self._read()
        except DeviceError:
            self.close()
            raise
        sensor = self._video.sensor
        self._info = replace(info, sensor_px=(sensor.width_px, sensor.height_px))
        self._ranges = self._ranges_for(self._settings)

    @property
    @override
    def info(self) -> CameraInfo:
        return self._info

    @property
    @override
    def ranges(self) -> CameraRanges:
        return self._ranges

    @property
    @override
    def settings(self) -> CameraSettings:
        return self._settings

    @property
    @override
    def counters(self) -> CameraCounters:
        return self._tally.counters

    @override
    def configure(self, settings: CameraSettings) -> CameraSettings:
        with self._lock:
            self._require()
            present, sensor = self._settings, self._video.sensor
            running = self._ring is not None
            # First whether ROI and format make sense, then the rates that go with them.
            check_settings(
                self._whom,
                replace(settings, rate_hz=present.rate_hz, exposure_s=present.exposure_s),
                present,
                self._ranges,
                sensor,
                running=running,
            )
            ranges = self._ranges_for(settings)
            check_settings(self._whom, settings, present, ranges, sensor, running=running)
            if settings == present:
                return present
            try:
                self._write(settings, present)
            except DeviceError as exc:
                refusal = as_refusal(exc)
                if isinstance(refusal, ConfigError):
                    self._write(present, None)
                raise refusal from exc
            self._settings = self._read()
            self._ranges = self._ranges_for(self._settings)
            logger.info("%s: %s", self._whom, self._settings)
            return self._settings

    @override
    def start(self) -> None:
        with self._lock:
            self._require()
            if self._ring is not None:
                raise DeviceError(f"{self._whom} takes pictures already", fault=DeviceFault.STATE)
            ring = Dc1394Ring(self._handle, self._settings)
            try:
                self._handle.call("dc1394_video_set_transmission", dc.DC1394_ON)
            except DeviceError:
                ring.close()
                raise
            self._begin_counting()
            self._ring = ring

    @override
    def receive(self, timeout_s: float) -> Frame | None:
        until_s = WALL.now_s() + timeout_s
        while True:
            with self._receiving:
                if self._failure is not None:
                    raise self._failure
                if self._ring is None:
                    return None
                left_s = until_s - WALL.now_s()
                found = self._next(self._ring, max(0.0, min(left_s, _SLICE_S)))
                if found is not None:
                    self._last_sign_s = WALL.now_s()
                    return found
                self._look_for_life()
            if left_s <= _SLICE_S:
                return None

    @override
    def trigger(self) -> None:
        if self._settings.trigger is not Trigger.SOFTWARE:
            raise NotAvailable(
                f"{self._whom}: the trigger is {self._settings.trigger}, not software; "
                f"configure it first"
            )
        with self._lock:
            self._require()
            self._trigger.fire()

    @override
    def stop(self) -> None:
        with self._lock:
            with self._receiving:  # a `receive` that waits gives it back within a slice
                ring, self._ring = self._ring, None
            if ring is None:
                return
            try:
                self._handle.call("dc1394_video_set_transmission", dc.DC1394_OFF)
            except DeviceError as exc:
                logger.warning("%s did not hear that it shall stop: %s", self._whom, exc)
            ring.close()

    @override
    def close(self) -> None:
        with self._lock:
            if self._closed:
                return
            self.stop()
            self._closed = True
            self._calls.plain("dc1394_camera_free", self._pointer)

    def _require(self) -> None:
        if self._closed:
            raise DeviceError(f"{self._whom} is closed; open it again", fault=DeviceFault.STATE)
        if self._failure is not None:
            raise self._failure

    def _begin_counting(self) -> None:
        self._tally = Dc1394Tally(self._clock)
        self._last_sign_s = WALL.now_s()

    def _set_speed(self, fast: bool) -> None:
        if fast:
            name = "dc1394_video_set_operation_mode"
            self._handle.call(name, dc.DC1394_OPERATION_MODE_1394B)
        speed = dc.DC1394_ISO_SPEED_800 if fast else dc.DC1394_ISO_SPEED_400
        self._handle.call("dc1394_video_set_iso_speed", speed)

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

    def _write(self, asked: CameraSettings, present: CameraSettings | None) -> None:
        """Put settings in force, those that differ; all of them where `present` is None."""
        video = (asked.roi, asked.pixel_format, asked.rate_hz)
        if present is None or video != (present.roi, present.pixel_format, present.rate_hz):
            self._write_video(asked)
        if self._shutter.available and (present is None or asked.exposure_s != present.exposure_s):
            self._shutter.write(asked.exposure_s)
        if self._gain.available and (present is None or asked.gain_db != present.gain_db):
            self._gain.write(asked.gain_db)
        if asked.trigger != self._trigger.choice:
            self._trigger.write(asked.trigger)

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
                    self._tally.pause()
                    self._handle.call("dc1394_video_set_transmission", dc.DC1394_ON)

    def _next(self, ring: Dc1394Ring, timeout_s: float) -> Frame | None:
        try:
            taken = ring.take(timeout_s)
        except DeviceError as exc:
            self._fail(str(exc))
            raise self._failure or exc from exc
        if taken is None:
            return None
        return self._tally.frame(taken, self._settings)

    def _look_for_life(self) -> None:
        """Raise when the camera is gone or was reset; no frame has come for a while."""
        if WALL.now_s() - self._last_sign_s < _QUIET_S:
            return
        self._last_sign_s = WALL.now_s()
        try:
            sending = self._handle.integer("dc1394_video_get_transmission")
        except DeviceError as exc:
            self._fail(str(exc))
        else:
            if not sending:
                self._fail("it was switched off and on, and has forgotten that it should send")
        if self._failure is not None:
            raise self._failure

    def _fail(self, reason: str) -> None:
        self._failure = DeviceError(
            f"{self._whom} is gone: {reason}. Check cable and power; open it again",
            fault=DeviceFault.COMMUNICATION,
        )
