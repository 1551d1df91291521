"""A simulated camera: a view of the twin, paced by the platform's clock, drawn when received."""

import logging
from collections.abc import Callable
from dataclasses import replace
from typing import Final

from typing_extensions import override

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import DeviceError, DeviceFault, NotAvailable, NotConnectedError
from cosmic.twin.optics.optics import Optics
from cosmic.vico.hw.camera_checks import check_settings
from cosmic.vico.hw.drawn_frame import DrawnFrame
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
    Roi,
    Trigger,
)
from cosmic.vico.hw.sim_camera_faults import CameraFaults
from cosmic.vico.hw.sim_camera_features import ranges_of, sensor_of, slowed
from cosmic.vico.hw.sim_camera_run import BUFFERS, CameraRun, Exposure

logger = logging.getLogger(__name__)

SLOW_S: Final = 0.5
"""How late frames come with the fault `slow`."""

MISSING_FROM: Final = 0.6
"""Part of the rows after which an incomplete frame is empty."""


class SimulatedCamera(Camera):
    """One simulated camera; made by its library.

    Parameters
    ----------
    view : str
        What it sees, by the name that `Optics` has for it.
    released : callable
        Called once at `close`.

    Notes
    -----
    A frame that found no buffer counts as an underrun at once, and as lost as well when the next
    one has come and shows the gap.
    """

    def __init__(
        self,
        info: CameraInfo,
        optics: Optics,
        view: str,
        clock: Clock,
        faults: CameraFaults,
        *,
        released: Callable[[], None],
    ) -> None:
        self._info = info
        self._optics = optics
        self._view = view
        self._clock = clock
        self._faults = faults
        self._released = released
        self._pulled = faults.times_pulled(info.key)
        self._closed = False
        self._run: CameraRun | None = None
        self._underrun = 0
        self._counters = CameraCounters()
        self._last: Frame | None = None
        self._receiver = clock.worker()
        width, height = info.sensor_px
        self._settings = CameraSettings(
            exposure_s=optics.settings.picture.full_exposure_s,
            gain_db=0.0,
            rate_hz=optics.settings.camera.rate_hz,
            roi=Roi(0, 0, width, height),
        )

    @property
    @override
    def info(self) -> CameraInfo:
        return self._info

    @property
    @override
    def ranges(self) -> CameraRanges:
        return ranges_of(self._optics.settings.camera, self._settings)

    @property
    @override
    def settings(self) -> CameraSettings:
        return self._settings

    @property
    @override
    def counters(self) -> CameraCounters:
        with self._faults.changed:
            if self._run is not None:
                self._run.first(self._clock.now_s())
                self._underrun = self._run.underrun
            return replace(self._counters, underrun=self._underrun)

    @override
    def configure(self, settings: CameraSettings) -> CameraSettings:
        with self._faults.changed:
            self._check_there("configure")
            camera = self._optics.settings.camera
            settings = slowed(camera, settings, self._settings)
            check_settings(
                self._info.key,
                settings,
                self._settings,
                ranges_of(camera, settings),
                sensor_of(camera, settings.binning),
                running=self._run is not None,
            )
            if self._run is not None:
                self._run.change(settings, self._clock.now_s())
                self._faults.changed.notify_all()
            self._settings = settings
        logger.debug("%s: %s", self._info.key, settings)
        return settings

    @override
    def start(self) -> None:
        with self._faults.changed:
            self._check_there("start")
            if self._run is not None:
                raise self._error("start: it takes pictures already", DeviceFault.STATE)
            self._counters = CameraCounters()
            self._underrun, self._last = 0, None
            # The receiver is late by the wall: on a fast clock more frames come meanwhile.
            buffers = round(BUFFERS * max(1.0, self._clock.rate))
            self._run = CameraRun(self._settings, self._clock.now_s(), buffers)

    @override
    def receive(self, timeout_s: float) -> Frame | None:
        end_s = WALL.now_s() + timeout_s
        while True:
            run, exposure = self._wait(end_s)
            if run is None or exposure is None:
                return None
            if self._faults.strikes("lost", self._info.key, exposure.frame_id):
                continue
            return self._counted(run, self._frame(exposure))

    @override
    def trigger(self) -> None:
        with self._faults.changed:
            self._check_there("trigger")
            if self._settings.trigger is not Trigger.SOFTWARE:
                raise NotAvailable(
                    f"{self._info.key}: trigger: {self._settings.trigger} is in force; "
                    f"configure the camera for the software trigger first"
                )
            if self._run is None:
                raise self._error("trigger: it takes no pictures; start it", DeviceFault.STATE)
            settings = self._settings
            busy_s = max(settings.exposure_s, self._readout_s(settings.roi))
            self._run.expose(self._clock.now_s(), busy_s)
            self._faults.changed.notify_all()

    @override
    def stop(self) -> None:
        with self._faults.changed:
            self._run = None
            self._receiver.idle()
            self._faults.changed.notify_all()

    @override
    def close(self) -> None:
        self.stop()
        with self._faults.changed:
            closed, self._closed = self._closed, True
        if not closed:
            self._released()

    # ------------------------------------------------------------------ frames

    def _wait(self, end_s: float) -> tuple[CameraRun | None, Exposure | None]:
        """Return the next frame once it has arrived, its buffer given free; None after `end_s`."""
        changed = self._faults.changed
        with changed:
            run = self._run
            while run is not None and self._run is run:
                self._check_going()
                now_s = self._clock.now_s()
                exposure = run.first(now_s)
                due_s = run.next_exposed_s if exposure is None else self._arrives_s(exposure)
                if exposure is not None and due_s <= now_s:
                    run.take()
                    self._underrun = run.underrun
                    self._receiver.busy()  # until it has handed the frame on, and comes again
                    return run, exposure
                self._receiver.idle()
                left_s = end_s - WALL.now_s()
                if left_s <= 0.0:
                    return None, None
                # A clock that a test moves has no rate: it looks up every now and then.
                rate = self._clock.rate
                self._clock.wait(changed, min(due_s, now_s + left_s * rate) if rate else due_s)
        return None, None

    def _arrives_s(self, exposure: Exposure) -> float:
        late_s = SLOW_S if self._faults.hit("slow", self._info.key) else 0.0
        settings = exposure.settings
        transfer_s = self._optics.settings.camera.transfer_s
        way_s = settings.exposure_s + self._readout_s(settings.roi) + transfer_s
        return exposure.exposed_s + way_s + late_s

    def _readout_s(self, roi: Roi) -> float:
        return self._optics.settings.camera.readout_s * roi.height_px / self._info.sensor_px[1]

    def _frame(self, exposure: Exposure) -> Frame:
        key, settings = self._info.key, exposure.settings
        whole = not self._faults.strikes("incomplete", key, exposure.frame_id)
        before = self._last if self._faults.hit("frozen", key) else None
        camera = self._optics.settings.camera
        fast = 1.0 + 1e-6 * camera.clock_drift_ppm
        frame = DrawnFrame(
            lambda: self._draw(exposure, before, whole=whole),
            frame_id=exposure.frame_id,
            time_s=self._arrives_s(exposure),
            exposed_s=exposure.exposed_s,
            device_ns=round(1e9 * (camera.clock_offset_s + exposure.exposed_s * fast)),
            status=FrameStatus.COMPLETE if whole else FrameStatus.INCOMPLETE,
            pixel_format=settings.pixel_format,
        )
        self._last = before or frame
        return frame

    def _draw(self, exposure: Exposure, before: Frame | None, *, whole: bool) -> Pixels:
        settings = exposure.settings
        if before is not None:
            data = before.data
        else:
            with self._clock.at_work():
                data = self._optics.render(
                    exposure.exposed_s + 0.5 * settings.exposure_s,
                    exposure_s=settings.exposure_s,
                    gain_db=settings.gain_db,
                    roi=settings.roi,
                    binning=settings.binning,
                    bits=8 if settings.pixel_format is PixelFormat.MONO8 else 16,
                    view=self._view,
                )
        if not whole:
            data = data.copy()
            data[round(MISSING_FROM * settings.roi.height_px) :] = 0
        data.flags.writeable = False
        return data

    def _counted(self, run: CameraRun, frame: Frame) -> Frame | None:
        with self._faults.changed:
            if self._run is not run:
                return None
            good = frame.status is FrameStatus.COMPLETE
            completed = self._counters.completed + good
            failed = self._counters.failed + (not good)
            lost = frame.frame_id + 1 - completed - failed
            self._counters = CameraCounters(completed, failed, lost)
        return frame

    # ------------------------------------------------------------------ troubles

    def _check_going(self) -> None:
        try:
            self._check_there("receive")
        except DeviceError:
            self._run = None
            self._receiver.idle()
            raise

    def _check_there(self, call: str) -> None:
        """Raise unless the camera is there; the lock is held."""
        key = self._info.key
        if self._closed:
            raise self._error(f"{call}: it was closed; open it again", DeviceFault.STATE)
        if self._faults.hit("unplugged", key) or self._faults.times_pulled(key) > self._pulled:
            raise NotConnectedError(
                f"{key}: {call}: the camera is gone; check its cable and power, then open it again",
                fault=DeviceFault.COMMUNICATION,
            )

    def _error(self, text: str, fault: DeviceFault) -> DeviceError:
        return DeviceError(f"{self._info.key}: {text}", fault=fault)
