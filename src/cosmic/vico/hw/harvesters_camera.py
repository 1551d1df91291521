"""One camera behind a GenTL producer, by the harvesters package."""

import logging
import threading
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Final

import numpy as np
from typing_extensions import override

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import DeviceError, DeviceFault, NotAvailable
from cosmic.vico.hw.camera_checks import check_settings
from cosmic.vico.hw.harvesters_features import Features
from cosmic.vico.hw.harvesters_frames import BlockNumbers, pixels_of
from cosmic.vico.hw.interface import (
    Camera,
    CameraCounters,
    CameraInfo,
    CameraRanges,
    CameraSettings,
    Frame,
    FrameStatus,
    PixelFormat,
    Pixels,
    Trigger,
)

logger = logging.getLogger(__name__)

POLL_S: Final = 0.002
# The package tells a wait of zero as one without end.
_AT_ONCE_S: Final = 1e-4
_HEARTBEAT_S: Final = 0.5
_UNKNOWN_PERIOD_S: Final = 0.1


class HarvestersCamera(Camera):
    """One open camera; made by its library.

    The package waits in native code without letting other threads run, so it is asked every 2 ms
    and never waits itself.

    Parameters
    ----------
    acquirer : object
        The package's ImageAcquirer.
    errors : tuple of exception types
        What the package raises.
    closed : callable
        Told when it is closed.
    """

    def __init__(
        self,
        info: CameraInfo,
        acquirer: Any,
        clock: Clock,
        *,
        errors: tuple[type[Exception], ...],
        closed: Callable[["HarvestersCamera"], None],
    ) -> None:
        self._acquirer = acquirer
        self._clock = clock
        self._errors: tuple[type[Exception], ...] = errors
        self._told_closed = closed
        self._features = Features(acquirer.remote_device.node_map, errors)
        self._info = replace(info, sensor_px=self._features.sensor_px)
        self._settings = self._features.settings()
        self._counters = CameraCounters()
        self._changed = threading.Condition()
        self._running = False
        self._closed = False
        self._numbers = BlockNumbers()
        self._empty_s = 0.0
        self._heard_s = 0.0
        self._answers = self._port_answers()

    @property
    @override
    def info(self) -> CameraInfo:
        return self._info

    @property
    @override
    def ranges(self) -> CameraRanges:
        with self._changed:
            self._check_open("ranges")
            return self._features.ranges()

    @property
    @override
    def settings(self) -> CameraSettings:
        return self._settings

    @property
    @override
    def counters(self) -> CameraCounters:
        return self._counters

    @override
    def configure(self, settings: CameraSettings) -> CameraSettings:
        with self._changed:
            self._check_open("configure")
            check_settings(
                self._info.key,
                settings,
                self._settings,
                self._features.ranges(),
                self._features.sensor(settings.binning),
                running=self._running,
            )
            try:
                self._features.apply(settings)
            except self._errors as exc:
                self._put_back()
                raise self._error(f"configure: {exc}", DeviceFault.PARAMETER) from exc
            self._settings = self._features.settings()
            return self._settings

    @override
    def start(self) -> None:
        with self._changed:
            self._check_open("start")
            if self._running:
                return
            self._counters = CameraCounters()
            self._numbers = BlockNumbers()
            self._empty_s = self._clock.now_s()
            self._heard_s = WALL.now_s()
            try:
                self._acquirer.start()
            except self._errors as exc:
                raise self._error(
                    f"start: {exc}; close other programs that use it", DeviceFault.COMMUNICATION
                ) from exc
            self._running = True

    @override
    def receive(self, timeout_s: float) -> Frame | None:
        end_s = WALL.now_s() + timeout_s
        with self._changed:
            while self._running:
                frame = self._poll()
                left_s = end_s - WALL.now_s()
                if frame is not None or left_s <= 0.0:
                    return frame
                self._changed.wait(min(POLL_S, left_s))
        return None

    @override
    def trigger(self) -> None:
        with self._changed:
            self._check_open("trigger")
            if self._settings.trigger is not Trigger.SOFTWARE:
                raise NotAvailable(
                    f"{self._info.key}: trigger: the trigger in force is "
                    f"{self._settings.trigger}; choose the software trigger first"
                )
            try:
                self._features.fire()
            except self._errors as exc:
                raise self._error(f"trigger: {exc}", DeviceFault.COMMUNICATION) from exc

    @override
    def stop(self) -> None:
        with self._changed:
            if not self._running:
                return
            self._running = False
            self._changed.notify_all()
            try:
                self._acquirer.stop()
            except self._errors as exc:
                logger.warning("%s: stop: %s", self._info.key, exc)

    @override
    def close(self) -> None:
        with self._changed:
            if self._closed:
                return
            self.stop()
            self._closed = True
            try:
                self._acquirer.destroy()
            except self._errors as exc:
                logger.warning("%s: close: %s", self._info.key, exc)
        self._told_closed(self)

    def tell_incomplete(self) -> None:
        """Count a frame with parts missing; called by the package while it is asked for one."""
        self._counters = replace(self._counters, failed=self._counters.failed + 1)

    def _poll(self) -> Frame | None:
        """Return the next frame if one is there; the lock is held."""
        failed = self._counters.failed
        try:
            buffer = self._acquirer.try_fetch(timeout=_AT_ONCE_S)
        except self._errors as exc:
            raise self._lost(str(exc)) from exc
        if buffer is None:
            if self._counters.failed > failed:
                return self._incomplete()
            # Taken after the look: what comes later was complete later.
            self._check_alive()
            self._empty_s = max(self._empty_s, self._clock.now_s() - POLL_S)
            return None
        self._heard_s = WALL.now_s()
        try:
            return self._frame(buffer)
        except self._errors as exc:
            raise self._lost(str(exc)) from exc
        finally:
            buffer.queue()

    def _frame(self, buffer: Any) -> Frame:
        data, pixel_format = pixels_of(buffer, self._info.key)
        lost = self._numbers.advance(int(buffer.frame_id))
        counters = self._counters
        self._counters = replace(
            counters, completed=counters.completed + 1, lost=counters.lost + lost
        )
        return self._made(data, pixel_format, FrameStatus.COMPLETE, self._device_ns(buffer))

    def _incomplete(self) -> Frame:
        roi = self._settings.roi
        empty = np.zeros((roi.height_px, roi.width_px), np.uint8)
        empty.flags.writeable = False
        self._numbers.skip()
        return self._made(empty, PixelFormat.MONO8, FrameStatus.INCOMPLETE, None)

    def _made(
        self,
        data: Pixels,
        pixel_format: PixelFormat,
        status: FrameStatus,
        device_ns: int | None,
    ) -> Frame:
        rate_hz, exposure_s = self._settings.rate_hz, self._settings.exposure_s
        period_s = 1.0 / rate_hz if rate_hz > 0.0 else _UNKNOWN_PERIOD_S
        return Frame(
            data=data,
            frame_id=self._numbers.last,
            time_s=self._clock.now_s(),
            # It may have waited in the queue since that was last seen empty, and is read out
            # within a period.
            exposed_s=self._empty_s - exposure_s - period_s,
            device_ns=device_ns,
            status=status,
            pixel_format=pixel_format,
        )

    def _device_ns(self, buffer: Any) -> int | None:
        try:
            return int(buffer.timestamp_ns)
        except self._errors:  # its clock is not offered, or its unit is unknown
            return None

    def _check_alive(self) -> None:
        """Notice a camera that is gone, of which many producers say nothing."""
        now_s = WALL.now_s()
        if not self._answers or now_s - self._heard_s < _HEARTBEAT_S:
            return
        self._heard_s = now_s
        if not self._port_answers():
            raise self._lost("it does not answer")

    def _port_answers(self) -> bool:
        failures: tuple[type[Exception], ...] = (*self._errors, AttributeError, TypeError)
        try:
            self._acquirer.remote_device.port.read(0, 4)
        except failures:
            return False
        return True

    def _lost(self, why: str) -> DeviceError:
        self.stop()
        return self._error(
            f"receive: {why}; check its cable and power, then open it again",
            DeviceFault.COMMUNICATION,
        )

    def _put_back(self) -> None:
        try:
            self._features.apply(self._settings)
        except self._errors as exc:
            logger.warning("%s: the settings before are not back: %s", self._info.key, exc)
            self._settings = self._features.settings()

    def _check_open(self, call: str) -> None:
        if self._closed:
            raise self._error(f"{call}: it was closed; open it again", DeviceFault.STATE)

    def _error(self, text: str, fault: DeviceFault) -> DeviceError:
        return DeviceError(f"{self._info.key}: {text}", fault=fault)
