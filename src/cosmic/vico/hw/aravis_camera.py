"""A GigE Vision or USB3 Vision camera, through Aravis."""

import logging
import threading
from ctypes import create_string_buffer
from dataclasses import replace
from typing import Final

from typing_extensions import override

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import ConfigError, DeviceError, DeviceFault, NotAvailable
from cosmic.vico.hw import aravis_ctypes as arv
from cosmic.vico.hw.aravis_calls import AravisCalls
from cosmic.vico.hw.aravis_features import AravisFeatures
from cosmic.vico.hw.aravis_gvcp import QUIET_S, GvcpWatch, ask_camera
from cosmic.vico.hw.aravis_stream import AravisBuffer, AravisStream
from cosmic.vico.hw.aravis_tally import AravisTally
from cosmic.vico.hw.camera_checks import check_settings
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

# How long `stop` may have to wait for a `receive`.
_SLICE_S: Final = 0.05


class AravisCamera(Camera):
    """One open camera; made by `AravisLibrary.open`.

    Parameters
    ----------
    camera : int
        Address of the ArvCamera, which becomes this object's.
    info : CameraInfo
        Its sensor size is filled in.
    address : str
        IP address of a GigE Vision camera, "" for others.
    clock : Clock
        The platform's.

    Notes
    -----
    Calls to the camera take turns by a lock. `receive` does not hold it while it waits.
    """

    def __init__(
        self, calls: AravisCalls, camera: int, info: CameraInfo, address: str, clock: Clock
    ) -> None:
        self._calls = calls
        self._camera = camera
        self._clock = clock
        self._whom = f"camera {info.key}"
        self._lock = threading.RLock()
        self._receiving = threading.Lock()
        self._stream: AravisStream | None = None
        self._watch: GvcpWatch | None = None
        self._address = address
        self._failure: DeviceError | None = None
        self._closed = False
        self._begin_counting()
        self._device = calls.plain("arv_camera_get_device", camera)
        self._control_lost = False
        self._handler = arv.ControlLostHandler(self._on_control_lost)
        self._handler_id = calls.plain(
            "g_signal_connect_data", self._device, b"control-lost", self._handler, None, None, 0
        )
        try:
            self._features = AravisFeatures(calls, camera, self._whom)
            self._settings = self._features.settings()
            self._ranges = self._features.ranges(self._settings.binning)
        except DeviceError:
            self.close()
            raise
        sensor = self._features.sensor_px
        self._info = replace(info, sensor_px=sensor)

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

    @property
    def packets(self) -> tuple[int, int]:
        """How many packets were asked for again since `start`, and how many never came; GigE."""
        with self._lock:
            return (0, 0) if self._stream is None else self._stream.packets()

    @override
    def configure(self, settings: CameraSettings) -> CameraSettings:
        with self._lock:
            self._require_answer()
            present = self._settings
            check_settings(
                self._whom,
                settings,
                present,
                self._ranges,
                self._features.sensor(settings.binning),
                running=self._stream is not None,
            )
            if settings == present:
                return present
            try:
                self._features.write(settings, present)
            except ConfigError:
                self._settings = self._features.settings()
                raise
            self._settings = self._features.settings()
            self._ranges = self._features.ranges(self._settings.binning)
            logger.info("%s: %s", self._whom, self._settings)
            return self._settings

    @override
    def start(self) -> None:
        with self._lock:
            self._require_answer()
            if self._stream is not None:
                raise DeviceError(f"{self._whom} takes pictures already", fault=DeviceFault.STATE)
            stream = AravisStream(self._calls, self._camera, self._whom, self._settings)
            try:
                self._calls.checked(self._whom, "arv_camera_start_acquisition", self._camera)
            except DeviceError:
                stream.close()
                raise
            self._begin_counting()
            self._last_sign_s = WALL.now_s()
            if self._address:
                self._watch = GvcpWatch(self._address, self._last_sign_s)
            self._stream = stream

    @override
    def receive(self, timeout_s: float) -> Frame | None:
        until_s = WALL.now_s() + timeout_s
        while True:
            with self._receiving:
                stream = self._stream
                if self._failure is not None:
                    raise self._failure
                if stream is None:
                    return None
                left_s = until_s - WALL.now_s()
                buffer = stream.pop(max(0.0, min(left_s, _SLICE_S)))
                if buffer is not None:
                    found = AravisBuffer(self._calls, buffer)
                    frame = self._tally.frame(found, self._settings, self._ranges)
                    stream.push(buffer)
                    self._tally.underrun = stream.underruns()
                    self._note_life()
                    return frame
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
            self._require_answer()
            self._calls.checked(self._whom, "arv_camera_software_trigger", self._camera)

    @override
    def stop(self) -> None:
        with self._lock:
            with self._receiving:  # a `receive` that waits gives it back within a slice
                stream, self._stream = self._stream, None
                watch, self._watch = self._watch, None
            if watch is not None:
                watch.close()
            if stream is None:
                return
            try:
                self._require_answer()
                self._calls.checked(self._whom, "arv_camera_stop_acquisition", self._camera)
            except DeviceError as exc:
                logger.warning("%s did not hear that it shall stop: %s", self._whom, exc)
            finally:
                stream.close(gone=self._failure is not None)

    @override
    def close(self) -> None:
        with self._lock:
            if self._closed:
                return
            self.stop()
            self._closed = True
            self._calls.plain("g_signal_handler_disconnect", self._device, self._handler_id)
            gone = self._failure is not None or bool(self._address and ask_camera(self._address))
            self._calls.release(self._camera, gone=gone)

    def _require_answer(self) -> None:
        """Raise unless it is open and there."""
        if self._closed:
            raise DeviceError(f"{self._whom} is closed; open it again", fault=DeviceFault.STATE)
        if self._failure is None and self._address:
            self._fail(ask_camera(self._address))
        if self._failure is not None:
            raise self._failure

    def _fail(self, reason: str) -> None:
        """Note that it is gone, if there is a reason to think so."""
        if reason:
            self._failure = DeviceError(
                f"{self._whom} is gone: {reason}. Check cable and power; open it again",
                fault=DeviceFault.COMMUNICATION,
            )

    def _begin_counting(self) -> None:
        self._tally = AravisTally(self._calls, self._clock)
        self._last_sign_s = WALL.now_s()

    def _note_life(self) -> None:
        self._last_sign_s = WALL.now_s()
        if self._watch is not None:
            self._watch.alive(self._last_sign_s)

    def _look_for_life(self) -> None:
        """Raise when the camera is gone; no frame has come for a slice."""
        now_s = WALL.now_s()
        reason = "Aravis lost control of it" if self._control_lost else ""
        if not reason and self._watch is not None:
            reason = self._watch.poll(now_s)
        elif not reason and now_s - self._last_sign_s >= QUIET_S:
            reason = self._ask_device()
        self._fail(reason)
        if self._failure is not None:
            raise self._failure

    def _ask_device(self) -> str:
        """Read the first bytes of the camera's memory, which every kind has."""
        self._last_sign_s = WALL.now_s()
        try:
            self._calls.checked(
                self._whom, "arv_device_read_memory", self._device, 0, 4, create_string_buffer(4)
            )
        except DeviceError as exc:
            return str(exc)
        return ""

    def _on_control_lost(self, _device: int | None, _data: int | None) -> None:
        """Note it; in a thread of Aravis."""
        self._control_lost = True
