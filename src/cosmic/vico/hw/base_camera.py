"""What the cameras of every driver share: settings, counting, state, and noticing a loss.

A driver derives its camera from `BaseCamera` and its list of cameras from `BaseCameraLibrary`,
and overrides the few methods that speak to the vendor's library. Everything that the `Camera`
Protocol promises and that no library does by itself stands here once.
"""

import logging
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import ClassVar, Final, Generic, TypeVar

from typing_extensions import override

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import (
    ConfigError,
    DeviceError,
    DeviceFault,
    NotAvailable,
    NotConnectedError,
)
from cosmic.vico.hw.interface import (
    Camera,
    CameraCounters,
    CameraInfo,
    CameraLibrary,
    CameraRanges,
    CameraSettings,
    Frame,
    FrameStatus,
    Range,
    Roi,
    Trigger,
)

logger = logging.getLogger(__name__)

# An exposure of exactly one period is accepted, whatever the last digit of 1 / rate.
_ROUNDING: Final = 1e-6


class BaseCamera(Camera, ABC):
    """One open camera; a driver overrides what is abstract, and more where its library can more.

    Parameters
    ----------
    info : CameraInfo
        Its sensor size is filled in by `_opened`.
    clock : Clock
        The platform's.
    closed : callable or None
        Called once, after the camera was given back.

    Attributes
    ----------
    slice_s : float
        The longest that `_fetch` waits at a time, and so about the longest that `stop` does.
    quiet_s : float
        After so long without a frame `_loss` is asked, again and again.

    Notes
    -----
    Two locks: `_lock` is held by every command, `_receiving` while a frame is fetched. Whoever
    takes both takes `_lock` first. After a failure the camera is of no more use than to be closed;
    whoever owns it opens it anew.
    """

    slice_s: ClassVar[float] = 0.05
    quiet_s: ClassVar[float] = 0.5

    _settings: CameraSettings
    _ranges: CameraRanges

    def __init__(
        self,
        info: CameraInfo,
        clock: Clock,
        *,
        closed: "Callable[[BaseCamera], None] | None" = None,
    ) -> None:
        self._info = info
        self._clock = clock
        self._whom = f"camera {info.key}"
        self._on_closed = closed
        self._lock = threading.RLock()
        self._receiving = threading.Lock()
        self._stopping = threading.Event()
        self._running = False
        self._closed = False
        self._failure: DeviceError | None = None
        self._counters = CameraCounters()
        self._underrun = 0
        self._heard_s = WALL.now_s()

    def _opened(self, sensor_px: tuple[int, int]) -> None:
        """Note what the camera is and has in force; at the end of a driver's constructor."""
        self._info = replace(self._info, sensor_px=sensor_px)
        self._read_back()

    # --- what a driver overrides ----------------------------------------------------------------

    @abstractmethod
    def _read(self) -> CameraSettings:
        """Read what is in force; raises `DeviceError`."""

    @abstractmethod
    def _read_ranges(self) -> CameraRanges:
        """Return what is accepted with the settings just read; raises `DeviceError`."""

    @abstractmethod
    def _write(self, asked: CameraSettings, present: CameraSettings | None) -> None:
        """Put checked settings in force, what differs from `present`; all of them where it is None.

        Raises
        ------
        DeviceError
            What the library said. `DeviceFault.PARAMETER` and `UNSUPPORTED` are refusals: what
            was in force before is put back.
        """

    @abstractmethod
    def _begin(self) -> None:
        """Begin to take images; raises `DeviceError` with everything given back."""

    @abstractmethod
    def _fetch(self, wait_s: float) -> Frame | None:
        """Return the next frame, numbered from 0 without gaps but for losses; None after a while.

        `_receiving` is held. What waits in Python waits on `_stopping`, to end at once. An
        underrun is counted in `_underrun`.

        Raises
        ------
        DeviceError
            The camera failed; nothing is fetched from it again.
        """

    @abstractmethod
    def _end(self) -> None:
        """End taking images, and give back what `_begin` took, whatever fails."""

    @abstractmethod
    def _release(self) -> None:
        """Give the camera back; it does not run."""

    def _sensor(self, binning: int) -> "Sensor":
        """Return where a ROI may lie with a binning that the camera has."""
        width_px, height_px = self._info.sensor_px
        return Sensor(width_px // binning, height_px // binning)

    def _check_values(self, asked: CameraSettings) -> None:
        """Refuse exposure, gain and rate; ROI, binning and format have been checked."""
        check_values(self._whom, asked, self._settings, self._ranges)

    def _fitted(self, asked: CameraSettings) -> CameraSettings:
        """Return settings with what follows from others made to fit."""
        return asked

    def _fire(self) -> None:
        """Take one image by software; only where `Trigger.SOFTWARE` is in force."""
        raise NotImplementedError

    def _wake(self) -> None:
        """Wake a `_fetch` that waits on a lock of its own: `_stopping` is set."""

    def _silence(self) -> str:
        """Return why the camera cannot be commanded, "" if it can; asked before a command."""
        return ""

    def _loss(self) -> str:
        """Return why no frames come any more, "" where nothing is wrong; `_receiving` is held."""
        return ""

    # --- what every camera does -----------------------------------------------------------------

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
        return self._counters

    @override
    def configure(self, settings: CameraSettings) -> CameraSettings:
        with self._lock:
            self._require("configure")
            asked, present = self._fitted(settings), self._settings
            self._check(asked)
            if asked == present:
                return present
            try:
                self._write(asked, present)
            except (DeviceError, ConfigError) as exc:
                refusal = as_refusal(exc)
                if isinstance(refusal, ConfigError):
                    self._put_back(present)
                raise refusal from exc
            self._read_back()
            logger.info("%s takes images with %s", self._whom, self._settings)
            return self._settings

    @override
    def start(self) -> None:
        with self._lock:
            self._require("start")
            if self._running:
                raise self._error("it takes images already", DeviceFault.STATE)
            self._counters = CameraCounters()
            self._underrun = 0
            self._stopping.clear()
            self._begin()
            self._heard_s = WALL.now_s()
            self._running = True

    @override
    def receive(self, timeout_s: float) -> Frame | None:
        end_s = WALL.now_s() + timeout_s
        while True:
            with self._receiving:
                if self._failure is not None:
                    raise self._failure
                if not self._running or self._stopping.is_set():
                    return None
                left_s = end_s - WALL.now_s()
                frame = self._next(max(0.0, min(left_s, self.slice_s)))
                if frame is not None:
                    return frame
            if left_s <= self.slice_s:
                return None

    @override
    def trigger(self) -> None:
        with self._lock:
            self._require("trigger")
            if Trigger.SOFTWARE not in self._ranges.triggers:
                raise NotAvailable(f"{self._whom}: trigger: it has no software trigger")
            if self._settings.trigger is not Trigger.SOFTWARE:
                raise NotAvailable(
                    f"{self._whom}: trigger: {self._settings.trigger} is in force, not software; "
                    f"configure it first"
                )
            self._fire()

    @override
    def stop(self) -> None:
        with self._lock:
            self._stopping.set()
            self._wake()
            with self._receiving:  # a `receive` that waits gives it back within a slice
                was_running, self._running = self._running, False
            if was_running:
                try:
                    self._end()
                except DeviceError as exc:
                    logger.warning("%s did not answer the stop: %s", self._whom, exc)

    @override
    def close(self) -> None:
        with self._lock:
            if self._closed:
                return
            self.stop()
            self._closed = True
            self._release()
        if self._on_closed is not None:
            self._on_closed(self)

    # --- inside ---------------------------------------------------------------------------------

    def _check(self, asked: CameraSettings) -> None:
        """Refuse what the camera does not accept; first what its other ranges depend on."""
        check_choices(self._whom, asked, self._ranges)
        check_roi(self._whom, asked.roi, self._ranges, self._sensor(asked.binning))
        if self._running:
            check_unchanged(self._whom, asked, self._settings)
        self._check_values(asked)

    def _put_back(self, before: CameraSettings) -> None:
        """Put in force again what was, after a refusal half way."""
        try:
            self._write(before, None)
        except (DeviceError, ConfigError) as exc:
            logger.warning("%s: the previous settings could not be restored: %s", self._whom, exc)
        self._read_back()

    def _read_back(self) -> None:
        self._settings = self._read()
        self._ranges = self._read_ranges()

    def _next(self, wait_s: float) -> Frame | None:
        """Return the next frame, counted; raises when the camera is gone."""
        try:
            frame = self._fetch(wait_s)
        except DeviceError as exc:
            self._failure = exc
            raise
        if frame is not None:
            self._count(frame)
            self._heard_s = WALL.now_s()
        elif WALL.now_s() - self._heard_s >= self.quiet_s:
            self._heard_s = WALL.now_s()
            self._fail(self._loss())
        return frame

    def _count(self, frame: Frame) -> None:
        whole = frame.status is FrameStatus.COMPLETE
        completed = self._counters.completed + whole
        failed = self._counters.failed + (not whole)
        lost = frame.frame_id + 1 - completed - failed
        self._counters = CameraCounters(completed, failed, lost, self._underrun)

    def _require(self, call: str) -> None:
        """Raise unless the camera is open and there."""
        if self._closed:
            raise self._error(f"{call}: it is closed; open it again", DeviceFault.STATE)
        if self._failure is None:
            self._fail(self._silence())
        else:
            raise self._failure

    def _fail(self, reason: str) -> None:
        """Note that the camera is gone and raise, if there is a reason to think so."""
        if reason:
            self._failure = NotConnectedError(
                f"{self._whom} is gone: {reason}. Check cable and power; open it again",
                fault=DeviceFault.COMMUNICATION,
            )
            raise self._failure

    def _error(self, text: str, fault: DeviceFault) -> DeviceError:
        return DeviceError(f"{self._whom}: {text}", fault=fault)


C = TypeVar("C", bound=BaseCamera)


class BaseCameraLibrary(CameraLibrary, ABC, Generic[C]):
    """The cameras of one driver, with those that are open; any thread.

    Parameters
    ----------
    clock : Clock
        Stamps the frames: the platform's.
    """

    def __init__(self, clock: Clock = WALL) -> None:
        self._clock = clock
        self._lock = threading.RLock()
        self._cameras: list[C] = []
        self._closed = False

    @abstractmethod
    def _open(self, key: str) -> C:
        """Open a camera, with `_forget` told when it is closed; raises `NotConnectedError`."""

    @abstractmethod
    def _shut(self) -> None:
        """Give the vendor's library back; every camera is closed."""

    @override
    def open(self, key: str) -> C:
        with self._lock:
            self._require_open("open")
            camera = self._open(key)
            self._cameras.append(camera)
        logger.info("camera %s opened", key)
        return camera

    @override
    def close(self) -> None:
        with self._lock:
            if self._closed:
                return
            self._closed = True
            cameras = tuple(self._cameras)
        for camera in cameras:  # without the lock: each tells that it is closed
            camera.close()
        self._shut()

    def _forget(self, camera: BaseCamera) -> None:
        with self._lock:
            self._cameras = [each for each in self._cameras if each is not camera]

    def _require_open(self, call: str) -> None:
        if self._closed:
            raise NotConnectedError(
                f"{self.name}: {call}: the library was closed", fault=DeviceFault.STATE
            )

    def _not_there(
        self,
        key: str,
        found: Iterable[str],
        advice: str,
        fault: DeviceFault = DeviceFault.COMMUNICATION,
    ) -> NotConnectedError:
        return NotConnectedError(
            f"{self.name} cannot open a camera {key!r}; it finds: {', '.join(found) or 'none'}. "
            f"{advice}",
            fault=fault,
        )


# --- settings -----------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Sensor:
    """Where a ROI may lie.

    Attributes
    ----------
    width_px, height_px : int
        Of the whole sensor with the binning asked for.
    x_step_px, y_step_px : int
        A ROI's corner lies on multiples of these.
    """

    width_px: int
    height_px: int
    x_step_px: int = 1
    y_step_px: int = 1


def check_choices(name: str, asked: CameraSettings, ranges: CameraRanges) -> None:
    """Refuse a binning, a format or a trigger that a camera has not; raises `ConfigError`."""
    _check_choice(name, "binning", asked.binning, ranges.binnings)
    _check_choice(name, "pixel format", asked.pixel_format, ranges.pixel_formats)
    _check_choice(name, "trigger", asked.trigger, ranges.triggers)


def check_values(
    name: str, asked: CameraSettings, in_force: CameraSettings, ranges: CameraRanges
) -> None:
    """Refuse an exposure, a gain or a rate out of range; what cannot be set must stay as it is.

    Raises
    ------
    ConfigError
        A value is refused, or the exposure is longer than the frame period.
    """
    _check_value(name, "exposure", "s", asked.exposure_s, in_force.exposure_s, ranges.exposure_s)
    _check_value(name, "gain", "dB", asked.gain_db, in_force.gain_db, ranges.gain_db)
    _check_value(name, "rate", "Hz", asked.rate_hz, in_force.rate_hz, ranges.rate_hz)
    _check_period(name, asked, ranges)


def check_roi(name: str, roi: Roi, ranges: CameraRanges, sensor: Sensor) -> None:
    """Refuse a ROI off the sensor, too small, or between the steps; raises `ConfigError`."""
    sides = (
        ("x", roi.x_px, roi.width_px, sensor.width_px, sensor.x_step_px, ranges.width_px),
        ("y", roi.y_px, roi.height_px, sensor.height_px, sensor.y_step_px, ranges.height_px),
    )
    for axis, start, size, whole, start_step, sizes in sides:
        side = (
            f"{name}: ROI: {'width' if axis == 'x' else 'height'} {size!r} px at {axis} {start!r}"
        )
        if not sizes.low <= size <= whole:
            raise ConfigError(f"{side}: the camera takes {sizes.low:g} to {whole} px")
        if not 0 <= start <= whole - size:
            raise ConfigError(
                f"{side} reaches off the sensor of {sensor.width_px} x {sensor.height_px} px: "
                f"{axis} may lie between 0 and {whole - size}"
            )
        if start % start_step:
            raise ConfigError(f"{side}: {axis} must be a multiple of {start_step}")
        if sizes.step and (size - sizes.low) % sizes.step:
            raise ConfigError(
                f"{side}: the size goes from {sizes.low:g} px up in steps of {sizes.step:g}"
            )


def _check_value(
    name: str, what: str, unit: str, asked: float, in_force: float, allowed: Range | None
) -> None:
    if allowed is None:
        if asked != in_force:
            raise ConfigError(
                f"{name}: {what} {asked:g} {unit}: this camera's {what} cannot be set; "
                f"leave it at {in_force:g}"
            )
    elif not allowed.low <= asked <= allowed.high:
        raise ConfigError(
            f"{name}: {what} {asked:g} {unit}: the camera takes "
            f"{allowed.low:g} to {allowed.high:g} {unit}"
        )


def _check_choice(name: str, what: str, asked: object, choices: tuple[object, ...]) -> None:
    if asked not in choices:
        raise ConfigError(
            f"{name}: {what} {asked}: the camera has {', '.join(str(each) for each in choices)}"
        )


def _check_period(name: str, asked: CameraSettings, ranges: CameraRanges) -> None:
    if ranges.exposure_s is None or ranges.rate_hz is None:
        return
    if not asked.exposure_s * asked.rate_hz <= 1.0 + _ROUNDING:
        raise ConfigError(
            f"{name}: exposure {asked.exposure_s:g} s is longer than the frame period of "
            f"{1.0 / asked.rate_hz:g} s: expose shorter, or lower the rate of {asked.rate_hz:g} Hz"
        )


def check_unchanged(name: str, asked: CameraSettings, in_force: CameraSettings) -> None:
    """Refuse what cannot change while images are taken; raises `DeviceFault.BUSY`."""
    fixed = (
        ("ROI", asked.roi, in_force.roi),
        ("binning", asked.binning, in_force.binning),
        ("pixel format", asked.pixel_format, in_force.pixel_format),
        ("trigger", asked.trigger, in_force.trigger),
    )
    for what, wanted, present in fixed:
        if wanted != present:
            raise DeviceError(
                f"{name}: the {what} cannot change while images are taken; stop it first",
                fault=DeviceFault.BUSY,
            )


def as_refusal(error: DeviceError | ConfigError) -> DeviceError | ConfigError:
    """Return what a failed setting means: a value not accepted, or a camera that fails."""
    refused = (DeviceFault.PARAMETER, DeviceFault.UNSUPPORTED)
    if isinstance(error, DeviceError) and error.fault in refused:
        return ConfigError(str(error))
    return error
