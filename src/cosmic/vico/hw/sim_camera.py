"""Simulated cameras: views of the twin, paced by the platform's clock, drawn when looked at."""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from threading import Lock
from typing import Final

import numpy as np
from typing_extensions import override

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import ConfigError, DeviceFault, NotConnectedError
from cosmic.frame.plugins import NoOptions
from cosmic.twin.optics.drawing import Drawing
from cosmic.twin.optics.optics import Optics
from cosmic.twin.optics.settings import SensorSettings
from cosmic.twin.scene import Scene
from cosmic.twin.trigger_line import TriggerLine
from cosmic.vico.hw.base_camera import BaseCamera, BaseCameraLibrary, Sensor, check_values
from cosmic.vico.hw.interface import (
    CameraBackend,
    CameraContext,
    CameraCounters,
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
from cosmic.vico.hw.sim_camera_faults import CameraFaults

XCD_U100: Final = CameraInfo(
    key="Sim", vendor="Sony", model="XCD-U100", serial="1806000", simulated=True
)
BUFFERS: Final = 16
"""So many frames wait for a receiver that is late."""

SLOW_S: Final = 0.5
"""How late frames come with the fault `slow`."""

MISSING_FROM: Final = 0.6
"""Part of the rows after which an incomplete frame is empty."""

# Guesses after the data sheet of the XCD-U100.
_HIGHEST_RATE_HZ: Final = 120.0
_BINNINGS: Final = (1, 2)
_X_STEP_PX: Final = 8
_Y_STEP_PX: Final = 2
_SMALLEST_PX: Final = 16


@dataclass(frozen=True, slots=True)
class Exposure:
    """One frame on its way: with the settings that were in force when its exposure began."""

    frame_id: int
    exposed_s: float
    settings: CameraSettings


class CameraRun:
    """The frames from `start` to `stop`; its owner holds a lock.

    Parameters
    ----------
    buffers : int
        How many frames may wait or be under way.
    line : TriggerLine or None
        What triggers it, with `Trigger.HARDWARE`.
    busy_s : callable
        Returns how long after one exposure's begin the next can begin.

    Attributes
    ----------
    underrun : int
        Frames that found no buffer free when their exposure began.
    """

    def __init__(
        self,
        settings: CameraSettings,
        now_s: float,
        buffers: int,
        *,
        line: TriggerLine | None = None,
        busy_s: Callable[[CameraSettings], float] = lambda _settings: 0.0,
    ) -> None:
        self.settings = settings
        self.underrun = 0
        self._buffers = buffers
        self._waiting: deque[Exposure] = deque()
        self._next_id = 0
        self._next_s = now_s if settings.trigger is Trigger.FREE_RUN else math.inf
        self._line = line if settings.trigger is Trigger.HARDWARE else None
        self._busy_s = busy_s
        self._free_s = now_s

    def first(self, now_s: float) -> Exposure | None:
        """Return the frame that is next to be received, or None before its exposure began."""
        self._advance(now_s)
        return self._waiting[0] if self._waiting else None

    @property
    def next_exposed_s(self) -> float:
        """When the next exposure begins that is not under way."""
        return self._next_s if self._line is None else self._line.next_edge_s(self._free_s)

    def take(self) -> None:
        """Give the buffer of the first frame free."""
        self._waiting.popleft()

    def change(self, settings: CameraSettings, now_s: float) -> None:
        """Go on with other settings from the next exposure on."""
        self._advance(now_s)
        before = self._next_s - 1.0 / self.settings.rate_hz
        if math.isfinite(self._next_s):
            self._next_s = max(before + 1.0 / settings.rate_hz, now_s)
        self.settings = settings

    def expose(self, now_s: float, busy_s: float) -> None:
        """Take one image, when the one before is out of the way.

        Parameters
        ----------
        busy_s : float
            From one exposure's begin to the earliest begin of the next.
        """
        last_s = self._waiting[-1].exposed_s if self._waiting else -math.inf
        self._begin(max(now_s, last_s + busy_s))

    def _advance(self, now_s: float) -> None:
        while self._line is not None and (edge_s := self.next_exposed_s) <= now_s:
            self._begin(edge_s)
            # What comes before it can expose again is not heard.
            self._free_s = edge_s + self._busy_s(self.settings)
        while self._next_s <= now_s:
            if len(self._waiting) >= self._buffers:
                # Nobody receives: nothing but the count changes.
                missed = int((now_s - self._next_s) * self.settings.rate_hz) + 1
                self.underrun += missed
                self._next_id += missed
                self._next_s += missed / self.settings.rate_hz
            else:
                self._begin(self._next_s)
                self._next_s += 1.0 / self.settings.rate_hz

    def _begin(self, exposed_s: float) -> None:
        if len(self._waiting) < self._buffers:
            self._waiting.append(Exposure(self._next_id, exposed_s, self.settings))
        else:
            self.underrun += 1
        self._next_id += 1


class DrawnFrame(Frame):
    """A frame whose pixels are drawn when they are first wanted; any thread.

    Parameters
    ----------
    data : callable
        Draws the pixels, read-only, or begins to; is called once.
    size_px : (int, int) or None
        Width and height of what will be drawn; None where asking for them may wait for it.
    """

    def __init__(
        self,
        data: Callable[[], Drawing | Pixels],
        frame_id: int,
        time_s: float,
        exposed_s: float,
        device_ns: int | None = None,
        status: FrameStatus = FrameStatus.COMPLETE,
        pixel_format: PixelFormat = PixelFormat.MONO8,
        *,
        size_px: tuple[int, int] | None = None,
    ) -> None:
        values = (frame_id, time_s, exposed_s, device_ns, status, pixel_format)
        names = ("frame_id", "time_s", "exposed_s", "device_ns", "status", "pixel_format")
        for name, value in zip(names, values, strict=True):
            object.__setattr__(self, name, value)  # the base is frozen
        object.__setattr__(self, "_source", data)
        object.__setattr__(self, "_drawing", Lock())
        object.__setattr__(self, "_size_px", size_px)

    _size_px: tuple[int, int] | None
    _source: Callable[[], Drawing | Pixels] | Drawing | Pixels
    _drawing: Lock

    @property
    @override
    def ready(self) -> bool:
        source = self._source
        return isinstance(source, np.ndarray) or (not callable(source) and source.ready)

    @property
    @override
    def size_px(self) -> tuple[int, int]:
        return self._size_px or super().size_px

    @override
    def prepare(self) -> None:
        if callable(self._source):
            with self._drawing:
                self._begin()

    @property
    @override
    def data(self) -> Pixels:
        """The pixels; see `Frame.data`."""
        with self._drawing:
            source = self._begin()
            if not isinstance(source, np.ndarray):
                source = source.pixels()
                object.__setattr__(self, "_source", source)
            return source

    def _begin(self) -> Drawing | Pixels:
        source = self._source
        if callable(source):
            source = source()
            object.__setattr__(self, "_source", source)
        return source


class SimulatedCamera(BaseCamera):
    """One simulated camera; made by its library.

    Parameters
    ----------
    view : str
        What it sees, by the name that `Optics` has for it.
    line : TriggerLine or None
        What its trigger input is wired to.

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
        closed: Callable[[BaseCamera], None],
        line: TriggerLine | None = None,
    ) -> None:
        super().__init__(info, clock, closed=closed)
        self._line = line
        self._optics = optics
        self._view = view
        self._faults = faults
        self._pulled = faults.times_pulled(info.key)
        self._run: CameraRun | None = None
        self._last: Frame | None = None
        self._receiver = clock.worker()
        width, height = info.sensor_px
        self._in_force = CameraSettings(
            exposure_s=optics.settings.picture.full_exposure_s,
            gain_db=0.0,
            rate_hz=optics.settings.camera.rate_hz,
            roi=Roi(0, 0, width, height),
        )
        self._opened(info.sensor_px)

    @property
    @override
    def counters(self) -> CameraCounters:
        with self._faults.changed:
            if self._run is not None:
                self._run.first(self._clock.now_s())
                self._underrun = self._run.underrun
            return replace(self._counters, underrun=self._underrun)

    @override
    def _read(self) -> CameraSettings:
        return self._in_force

    @override
    def _read_ranges(self) -> CameraRanges:
        ranges = ranges_of(self._optics.settings.camera, self._settings)
        if self._line is None:
            return ranges
        return replace(ranges, triggers=(*ranges.triggers, Trigger.HARDWARE))

    @override
    def _sensor(self, binning: int) -> Sensor:
        return sensor_of(self._optics.settings.camera, binning)

    @override
    def _fitted(self, asked: CameraSettings) -> CameraSettings:
        return slowed(self._optics.settings.camera, asked, self._settings)

    @override
    def _check_values(self, asked: CameraSettings) -> None:
        ranges = ranges_of(self._optics.settings.camera, asked)
        check_values(self._whom, asked, self._settings, ranges)

    @override
    def _write(self, asked: CameraSettings, present: CameraSettings | None) -> None:
        with self._faults.changed:
            if self._run is not None:
                self._run.change(asked, self._clock.now_s())
            self._in_force = asked
            self._faults.changed.notify_all()

    @override
    def _begin(self) -> None:
        with self._faults.changed:
            self._last = None
            # The receiver is late by the wall: on a fast clock more frames come meanwhile.
            buffers = round(BUFFERS * max(1.0, self._clock.rate))
            self._run = CameraRun(
                self._settings,
                self._clock.now_s(),
                buffers,
                line=self._line,
                busy_s=self._busy_s,
            )

    @override
    def _fetch(self, wait_s: float) -> Frame | None:
        end_s = WALL.now_s() + wait_s
        while True:
            exposure = self._wait(end_s)
            if exposure is None:
                return None
            if not self._faults.strikes("lost", self._info.key, exposure.frame_id):
                return self._frame(exposure)

    @override
    def _fire(self) -> None:
        with self._faults.changed:
            if self._run is None:
                raise self._error("trigger: it takes no images; start it", DeviceFault.STATE)
            self._run.expose(self._clock.now_s(), self._busy_s(self._settings))
            self._faults.changed.notify_all()

    @override
    def _wake(self) -> None:
        with self._faults.changed:
            self._faults.changed.notify_all()

    @override
    def _end(self) -> None:
        with self._faults.changed:
            self._run = None
            self._receiver.idle()

    @override
    def _release(self) -> None:
        """Nothing is held."""

    @override
    def _silence(self) -> str:
        key = self._info.key
        pulled = self._faults.hit("unplugged", key) or self._faults.times_pulled(key) > self._pulled
        return "it was unplugged" if pulled else ""

    def _wait(self, end_s: float) -> Exposure | None:
        """Return the next frame once it has arrived, its buffer given free; None after `end_s`."""
        changed = self._faults.changed
        with changed:
            while self._run is not None and not self._stopping.is_set():
                self._check_going()
                run, now_s = self._run, self._clock.now_s()
                exposure = run.first(now_s)
                due_s = run.next_exposed_s if exposure is None else self._arrives_s(exposure)
                if exposure is not None and due_s <= now_s:
                    run.take()
                    self._underrun = run.underrun
                    self._receiver.busy()  # until it has handed the frame on, and comes again
                    return exposure
                self._receiver.idle()
                left_s = end_s - WALL.now_s()
                if left_s <= 0.0:
                    return None
                # A clock that a test moves has no rate: it looks up every now and then.
                rate = self._clock.rate
                self._clock.wait(changed, min(due_s, now_s + left_s * rate) if rate else due_s)
        return None

    def _check_going(self) -> None:
        """Raise when the camera is gone; the lock of the faults is held."""
        gone = self._silence()
        if gone:
            self._run = None
            self._receiver.idle()
            self._fail(gone)

    def _arrives_s(self, exposure: Exposure) -> float:
        late_s = SLOW_S if self._faults.hit("slow", self._info.key) else 0.0
        settings = exposure.settings
        transfer_s = self._optics.settings.camera.transfer_s
        transit_s = settings.exposure_s + self._readout_s(settings.roi) + transfer_s
        return exposure.exposed_s + transit_s + late_s

    def _busy_s(self, settings: CameraSettings) -> float:
        return max(settings.exposure_s, self._readout_s(settings.roi))

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
            size_px=(settings.roi.width_px, settings.roi.height_px),
        )
        self._last = before or frame
        return frame

    def _draw(self, exposure: Exposure, before: Frame | None, *, whole: bool) -> Drawing | Pixels:
        settings = exposure.settings
        if before is not None:
            return before.data
        with self._clock.at_work():
            drawing = self._optics.expose(
                exposure.exposed_s + 0.5 * settings.exposure_s,
                exposure_s=settings.exposure_s,
                gain_db=settings.gain_db,
                roi=settings.roi,
                binning=settings.binning,
                bits=8 if settings.pixel_format is PixelFormat.MONO8 else 16,
                view=self._view,
            )
        missing_from = None if whole else round(MISSING_FROM * settings.roi.height_px)
        return _Arrived(drawing, self._clock, missing_from)


class SimulatedCameraLibrary(BaseCameraLibrary[SimulatedCamera]):
    """Simulated cameras `Sim1` (the microscope), `Sim2` (the overview), ...; any thread.

    Parameters
    ----------
    scene : Scene or Optics
        What they see.
    clock : Clock
        Paces the frames: the platform's.
    seed : int
        Of the faults.

    Attributes
    ----------
    faults : CameraFaults
        Trouble to inject by name.

    Raises
    ------
    ValueError
        The scene is one of bare stages, without optics.
    """

    def __init__(self, scene: Scene | Optics, clock: Clock, seed: int = 0) -> None:
        optics = scene.optics if isinstance(scene, Scene) else scene
        if optics is None:
            raise ValueError("a scene of bare stages has nothing for cameras to see")
        self._optics = optics
        self._line_of = scene.trigger_line_of if isinstance(scene, Scene) else lambda _key: None
        super().__init__(clock)
        self.faults = CameraFaults(seed)
        self._views = {f"Sim{number}": view for number, view in enumerate(optics.views, start=1)}

    @property
    @override
    def name(self) -> str:
        return "Simulated cameras"

    @override
    def cameras(self) -> tuple[CameraInfo, ...]:
        self._require_open("list the cameras")
        return tuple(
            self._info(key) for key in self._views if not self.faults.hit("unplugged", key)
        )

    @override
    def _open(self, key: str) -> SimulatedCamera:
        there = [info.key for info in self.cameras()]
        if key not in there:
            raise self._not_there(key, there, "Plug it in")
        if self.faults.hit("taken", key) or any(key == each.info.key for each in self._cameras):
            raise NotConnectedError(
                f"{key}: another program has the camera; close it there, then try again "
                f"(there are: {', '.join(there)})",
                fault=DeviceFault.BUSY,
            )
        return SimulatedCamera(
            self._info(key),
            self._optics,
            self._views[key],
            self._clock,
            self.faults,
            closed=self._forget,
            line=self._line_of(key),
        )

    @override
    def _shut(self) -> None:
        """Nothing is held."""

    def _info(self, key: str) -> CameraInfo:
        return replace(
            XCD_U100,
            key=key,
            serial=f"{XCD_U100.serial}{key.removeprefix('Sim')}",
            sensor_px=self._optics.sensor_px,
        )


def sensor_of(camera: SensorSettings, binning: int) -> Sensor:
    """Return where a ROI may lie."""
    known = binning if binning in _BINNINGS else 1
    return Sensor(camera.width_px // known, camera.height_px // known, _X_STEP_PX, _Y_STEP_PX)


def slowed(
    camera: SensorSettings, asked: CameraSettings, in_force: CameraSettings
) -> CameraSettings:
    """Return settings at a rate that a larger ROI allows, unless another rate was asked for."""
    if asked.rate_hz != in_force.rate_hz or asked.roi == in_force.roi:
        return asked
    if not _SMALLEST_PX <= asked.roi.height_px <= camera.height_px:
        return asked
    return replace(asked, rate_hz=min(asked.rate_hz, _highest_hz(camera, asked)))


def _highest_hz(camera: SensorSettings, settings: CameraSettings) -> float:
    rows = max(settings.roi.height_px, _SMALLEST_PX)
    return min(camera.rate_hz * camera.height_px / rows, _HIGHEST_RATE_HZ)


def ranges_of(camera: SensorSettings, settings: CameraSettings) -> CameraRanges:
    """Return what it accepts with the ROI and binning of `settings`: fewer rows are read faster."""
    sensor = sensor_of(camera, settings.binning)
    return CameraRanges(
        exposure_s=Range(20e-6, 10.0),
        gain_db=Range(0.0, 18.0),
        rate_hz=Range(0.1, _highest_hz(camera, settings)),
        width_px=Range(_SMALLEST_PX, sensor.width_px, _X_STEP_PX),
        height_px=Range(_SMALLEST_PX, sensor.height_px, _Y_STEP_PX),
        binnings=_BINNINGS,
        pixel_formats=(PixelFormat.MONO8, PixelFormat.MONO16),
        triggers=(Trigger.FREE_RUN, Trigger.SOFTWARE),
    )


class _Arrived(Drawing):
    """An image as it arrives in the computer, perhaps with its last rows missing."""

    def __init__(self, drawing: Drawing, clock: Clock, missing_from: int | None) -> None:
        self._drawing = drawing
        self._clock = clock
        self._missing_from = missing_from

    @property
    @override
    def ready(self) -> bool:
        return self._drawing.ready

    @override
    def pixels(self) -> Pixels:
        with self._clock.at_work():
            data = self._drawing.pixels()
        if self._missing_from is not None:
            data = data.copy()
            data[self._missing_from :] = 0
        data.flags.writeable = False
        return data


def _make(_options: NoOptions, context: CameraContext) -> CameraLibrary:
    scene = context.scene
    if scene is None or scene.optics is None:
        raise ConfigError("cameras: simulated: a scene is needed")
    return SimulatedCameraLibrary(scene, context.clock, context.seed)


BACKEND: Final = CameraBackend(_make, simulated=True, twin=True)
