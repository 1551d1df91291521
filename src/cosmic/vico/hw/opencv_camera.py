"""What cameras through OpenCV share, and the one that plays a film."""

import logging
import math
import threading
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import replace
from typing import Final

from typing_extensions import override

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import DeviceError, DeviceFault, NotAvailable
from cosmic.vico.hw.camera_checks import Sensor, check_settings
from cosmic.vico.hw.interface import (
    Camera,
    CameraCounters,
    CameraInfo,
    CameraRanges,
    CameraSettings,
    Frame,
    Range,
    Roi,
)
from cosmic.vico.hw.opencv_film import Film, Raw
from cosmic.vico.hw.opencv_pixels import formats_of, made_of
from cosmic.vico.hw.opencv_source import VideoSource

logger = logging.getLogger(__name__)

FILM_RATES_HZ: Final = Range(0.01, 1000.0)


class OpenCvCamera(Camera):
    """A camera whose ROI and pixel format are made in this computer.

    Parameters
    ----------
    first : ndarray
        A picture of it, which tells size and depth.
    closed : callable
        Told when it is closed.
    """

    def __init__(
        self,
        info: CameraInfo,
        clock: Clock,
        first: Raw,
        *,
        rate_hz: float,
        closed: Callable[[Camera], None],
    ) -> None:
        height_px, width_px = first.shape[:2]
        self._clock = clock
        self._info = replace(info, sensor_px=(width_px, height_px))
        self._formats = formats_of(first)
        self._told_closed = closed
        self._settings = CameraSettings(
            exposure_s=0.0,
            gain_db=0.0,
            rate_hz=rate_hz,
            roi=Roi(0, 0, width_px, height_px),
            pixel_format=self._formats[0],
        )
        self._counters = CameraCounters()
        self._changed = threading.Condition()
        self._running = False
        self._closed = False

    @property
    @override
    def info(self) -> CameraInfo:
        return self._info

    @property
    @override
    def ranges(self) -> CameraRanges:
        width_px, height_px = self._info.sensor_px
        return CameraRanges(
            exposure_s=self._exposures_s(),
            gain_db=None,
            rate_hz=self._rates_hz(),
            width_px=Range(1, width_px, 1),
            height_px=Range(1, height_px, 1),
            pixel_formats=self._formats,
        )

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
                self.ranges,
                Sensor(*self._info.sensor_px),
                running=self._running,
            )
            self._settings = self._apply(settings)
            self._changed.notify_all()
            return self._settings

    @override
    def start(self) -> None:
        with self._changed:
            self._check_open("start")
            if self._running:
                return
            self._counters = CameraCounters()
            self._begin()
            self._running = True

    @override
    def trigger(self) -> None:
        raise NotAvailable(f"{self._info.key}: trigger: it runs freely and has no trigger")

    @override
    def stop(self) -> None:
        with self._changed:
            self._running = False
            self._changed.notify_all()

    @override
    def close(self) -> None:
        self.stop()
        with self._changed:
            if self._closed:
                return
            self._closed = True
        self._release()
        self._told_closed(self)

    @abstractmethod
    def _exposures_s(self) -> Range | None: ...

    @abstractmethod
    def _rates_hz(self) -> Range | None: ...

    @abstractmethod
    def _apply(self, settings: CameraSettings) -> CameraSettings:
        """Put checked settings in force; the lock is held."""

    @abstractmethod
    def _begin(self) -> None:
        """Begin at the first picture; the lock is held."""

    @abstractmethod
    def _release(self) -> None:
        """Give back what was opened."""

    def _made(self, raw: Raw, *, time_s: float, exposed_s: float, device_ns: int | None) -> Frame:
        if raw.shape[1::-1] != self._info.sensor_px:
            raise self._error(
                f"receive: a picture of {raw.shape[1]} x {raw.shape[0]} px came, the first had "
                f"{self._info.sensor_px[0]} x {self._info.sensor_px[1]}; open it again",
                DeviceFault.OTHER,
            )
        done = self._counters.completed
        self._counters = replace(self._counters, completed=done + 1)
        return Frame(
            data=made_of(raw, self._settings.pixel_format, self._settings.roi),
            frame_id=done,
            time_s=time_s,
            exposed_s=exposed_s,
            device_ns=device_ns,
            pixel_format=self._settings.pixel_format,
        )

    def _check_open(self, call: str) -> None:
        if self._closed:
            raise self._error(f"{call}: it was closed; open it again", DeviceFault.STATE)

    def _error(self, text: str, fault: DeviceFault) -> DeviceError:
        return DeviceError(f"{self._info.key}: {text}", fault=fault)


class FilmCamera(OpenCvCamera):
    """A film or a folder of pictures, played on the platform's clock; none is ever left out.

    At its end, unless it loops, nothing more comes.
    """

    def __init__(
        self, source: VideoSource, film: Film, clock: Clock, closed: Callable[[Camera], None]
    ) -> None:
        rate_hz = source.rate_hz or film.rate_hz
        super().__init__(source.info, clock, film.first, rate_hz=rate_hz, closed=closed)
        self._film = film
        self._loop = source.loop
        self._paced = source.paced
        self._due_s = math.inf

    @override
    def receive(self, timeout_s: float) -> Frame | None:
        with self._changed:
            if not self._wait_until_due(timeout_s):
                return None
            try:
                raw = self._next()
                if raw is None:
                    logger.info("%s: the film is at its end", self._info.key)
                    self._due_s = math.inf
                    return None
                period_s = 1.0 / self._settings.rate_hz
                due_s = self._due_s if self._paced else self._clock.now_s()
                self._due_s = due_s + period_s
                return self._made(raw, time_s=due_s, exposed_s=due_s - period_s, device_ns=None)
            except DeviceError:
                self._running = False
                raise

    @override
    def _exposures_s(self) -> Range | None:
        return None

    @override
    def _rates_hz(self) -> Range | None:
        return FILM_RATES_HZ

    @override
    def _apply(self, settings: CameraSettings) -> CameraSettings:
        # The picture that is under way comes in the time of the new rate.
        due_s = self._due_s + 1.0 / settings.rate_hz - 1.0 / self._settings.rate_hz
        self._due_s = max(due_s, self._clock.now_s())
        return settings

    @override
    def _begin(self) -> None:
        self._film.rewind()
        self._due_s = self._clock.now_s() + 1.0 / self._settings.rate_hz

    @override
    def _release(self) -> None:
        with self._changed:
            self._film.close()

    def _next(self) -> Raw | None:
        raw = self._film.read()
        if raw is None and self._loop:
            self._film.rewind()
            raw = self._film.read()
        return raw

    def _wait_until_due(self, timeout_s: float) -> bool:
        """Return whether the next picture is due within `timeout_s` of wall time."""
        end_s = WALL.now_s() + timeout_s
        while self._running:
            now_s = self._clock.now_s()
            due_s = self._due_s if self._paced or self._due_s == math.inf else now_s
            if due_s <= now_s:
                return True
            left_s = end_s - WALL.now_s()
            if left_s <= 0.0:
                return False
            rate = self._clock.rate
            until_s = min(due_s, now_s + left_s * rate) if rate else due_s
            self._clock.wait(self._changed, until_s)
        return False
