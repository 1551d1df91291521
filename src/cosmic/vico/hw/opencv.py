"""USB cameras, films, folders of images and network addresses through OpenCV."""

import logging
import math
import threading
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import cv2
from typing_extensions import override

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import ConfigError, DeviceFault, NotConnectedError
from cosmic.frame.plugins import NoOptions
from cosmic.vico.hw.base_camera import BaseCamera, BaseCameraLibrary
from cosmic.vico.hw.interface import (
    CameraBackend,
    CameraContext,
    CameraInfo,
    CameraLibrary,
    CameraRanges,
    CameraSettings,
    Frame,
    Kind,
    Range,
    Roi,
    VideoSource,
)
from cosmic.vico.hw.opencv_source import (
    SILENCE_S,
    SYSFS,
    Film,
    MakeCapture,
    Raw,
    attached_devices,
    formats_of,
    made_of,
    open_capture,
    open_film,
)

logger = logging.getLogger(__name__)

_FILM_RATES_HZ: Final = Range(0.01, 1000.0)
_EXPOSURES_S: Final = Range(1e-4, 1.0, 1e-4)
_RATES_HZ: Final = Range(1.0, 240.0)
# More images than a driver keeps ready; after a start they are old.
_KEPT: Final = 5
# An image that came faster lay ready.
_READY_S: Final = 2e-3
_SLICE_S: Final = 0.02
_EXPOSURE_UNIT_S: Final = 1e-4  # of video4linux's "exposure_time_absolute"
_MANUAL: Final = 1.0  # of its "auto_exposure"
_NEAR: Final = 0.05


class OpenCvCamera(BaseCamera):
    """A camera whose ROI and pixel format are made in this computer.

    Parameters
    ----------
    first : ndarray
        An image of it, which tells size and depth.
    """

    exposures_s: Range | None = None
    rates_hz: Range | None = None

    def __init__(
        self,
        info: CameraInfo,
        clock: Clock,
        first: Raw,
        *,
        rate_hz: float,
        closed: Callable[[BaseCamera], None],
    ) -> None:
        super().__init__(info, clock, closed=closed)
        height_px, width_px = first.shape[:2]
        self._formats = formats_of(first)
        self._count_given = 0
        self._in_force = CameraSettings(
            exposure_s=0.0,
            gain_db=0.0,
            rate_hz=rate_hz,
            roi=Roi(0, 0, width_px, height_px),
            pixel_format=self._formats[0],
        )
        self._opened((width_px, height_px))

    @override
    def _read(self) -> CameraSettings:
        return self._in_force

    @override
    def _read_ranges(self) -> CameraRanges:
        width_px, height_px = self._info.sensor_px
        return CameraRanges(
            exposure_s=self.exposures_s,
            gain_db=None,
            rate_hz=self.rates_hz,
            width_px=Range(1, width_px, 1),
            height_px=Range(1, height_px, 1),
            pixel_formats=self._formats,
        )

    @override
    def _begin(self) -> None:
        self._count_given = 0

    @override
    def _end(self) -> None:
        """Nothing is taken that a start would not begin anew."""

    def _made(
        self, raw: Raw, *, time_s: float, exposed_s: float, device_ns: int | None = None
    ) -> Frame:
        if raw.shape[1::-1] != self._info.sensor_px:
            raise self._error(
                f"receive: an image of {raw.shape[1]} x {raw.shape[0]} px came, the first had "
                f"{self._info.sensor_px[0]} x {self._info.sensor_px[1]}; open it again",
                DeviceFault.OTHER,
            )
        number, self._count_given = self._count_given, self._count_given + 1
        return Frame(
            data=made_of(raw, self._settings.pixel_format, self._settings.roi),
            frame_id=number,
            time_s=time_s,
            exposed_s=exposed_s,
            device_ns=device_ns,
            pixel_format=self._settings.pixel_format,
        )


class FilmCamera(OpenCvCamera):
    """A film or a folder of images, played on the platform's clock; none is ever left out.

    At its end, unless it loops, nothing more comes.
    """

    rates_hz = _FILM_RATES_HZ

    def __init__(
        self, source: VideoSource, film: Film, clock: Clock, closed: Callable[[BaseCamera], None]
    ) -> None:
        rate_hz = source.rate_hz or film.rate_hz
        super().__init__(source.info, clock, film.first, rate_hz=rate_hz, closed=closed)
        self._film = film
        self._loop = source.loop
        self._paced = source.paced
        self._due_s = math.inf
        self._due_changed = threading.Condition()

    @override
    def _write(self, asked: CameraSettings, present: CameraSettings | None) -> None:
        with self._due_changed:
            # The image that is under way comes in the time of the new rate.
            due_s = self._due_s + 1.0 / asked.rate_hz - 1.0 / self._in_force.rate_hz
            self._due_s = max(due_s, self._clock.now_s())
            self._in_force = asked
            self._due_changed.notify_all()

    @override
    def _begin(self) -> None:
        super()._begin()
        self._film.rewind()
        self._due_s = self._clock.now_s() + 1.0 / self._settings.rate_hz

    @override
    def _fetch(self, wait_s: float) -> Frame | None:
        with self._due_changed:
            if not self._wait_until_due(wait_s):
                return None
            raw = self._next_raw()
            if raw is None:
                logger.info("%s: end of the film", self._whom)
                self._due_s = math.inf
                return None
            period_s = 1.0 / self._in_force.rate_hz
            due_s = self._due_s if self._paced else self._clock.now_s()
            self._due_s = due_s + period_s
            return self._made(raw, time_s=due_s, exposed_s=due_s - period_s)

    @override
    def _wake(self) -> None:
        with self._due_changed:
            self._due_changed.notify_all()

    @override
    def _release(self) -> None:
        self._film.close()

    def _next_raw(self) -> Raw | None:
        raw = self._film.read()
        if raw is None and self._loop:
            self._film.rewind()
            raw = self._film.read()
        return raw

    def _wait_until_due(self, wait_s: float) -> bool:
        """Return whether the next image is due within `wait_s` of wall time."""
        end_s = WALL.now_s() + wait_s
        while not self._stopping.is_set():
            now_s = self._clock.now_s()
            due_s = self._due_s if self._paced or self._due_s == math.inf else now_s
            if due_s <= now_s:
                return True
            left_s = end_s - WALL.now_s()
            if left_s <= 0.0:
                return False
            rate = self._clock.rate
            until_s = min(due_s, now_s + left_s * rate) if rate else due_s
            self._clock.wait(self._due_changed, until_s)
        return False


class LiveCamera(OpenCvCamera):
    """A camera that goes on by itself.

    Exposure and rate are offered where the device tells its own, and read back: a device that
    makes something else of a value has refused it. How many images were lost, OpenCV does not
    tell.

    Parameters
    ----------
    capture : object
        An opened cv2.VideoCapture.
    reopen : callable
        Opens another; for addresses, whose line keeps old images.
    """

    slice_s = _SLICE_S
    quiet_s = SILENCE_S

    def __init__(
        self,
        info: CameraInfo,
        source: VideoSource,
        capture: Any,
        clock: Clock,
        *,
        reopen: Callable[[], Any],
        closed: Callable[[BaseCamera], None],
    ) -> None:
        self._capture = capture
        self._reopen = reopen
        self._empty_s = clock.now_s()
        self._stale = 0
        self._is_device = source.kind is Kind.DEVICE
        self._can_wait = self._is_device and capture.getBackendName() == "V4L2"
        there, first = capture.read()
        if not there:
            capture.release()
            raise NotConnectedError(
                f"{info.key}: it opens but sends no image; close other programs that use it",
                fault=DeviceFault.COMMUNICATION,
            )
        rate_hz = float(capture.get(cv2.CAP_PROP_FPS))
        rate_hz = rate_hz if math.isfinite(rate_hz) and rate_hz > 0.0 else 0.0
        if self._is_device and rate_hz > 0.0:
            self.rates_hz = _RATES_HZ
        if self._is_device and self._take_over_exposure():
            self.exposures_s = _EXPOSURES_S
        super().__init__(info, clock, first, rate_hz=rate_hz, closed=closed)

    @override
    def _read(self) -> CameraSettings:
        settings = self._in_force
        if self.rates_hz is not None:
            settings = replace(settings, rate_hz=float(self._capture.get(cv2.CAP_PROP_FPS)))
        if self.exposures_s is not None:
            counts = float(self._capture.get(cv2.CAP_PROP_EXPOSURE))
            settings = replace(settings, exposure_s=counts * _EXPOSURE_UNIT_S)
        return settings

    @override
    def _write(self, asked: CameraSettings, present: CameraSettings | None) -> None:
        rate_changes = present is None or asked.rate_hz != present.rate_hz
        if self.rates_hz is not None and rate_changes:
            self._set("rate", cv2.CAP_PROP_FPS, asked.rate_hz)
        exposure_changes = present is None or asked.exposure_s != present.exposure_s
        if self.exposures_s is not None and exposure_changes:
            self._set("exposure", cv2.CAP_PROP_EXPOSURE, asked.exposure_s / _EXPOSURE_UNIT_S)
        self._in_force = asked

    @override
    def _begin(self) -> None:
        super()._begin()
        if not self._is_device:
            self._capture.release()
            self._capture = self._reopen()
        self._stale = _KEPT if self._is_device else 0
        self._empty_s = self._clock.now_s()

    @override
    def _fetch(self, wait_s: float) -> Frame | None:
        raw = self._grabbed(wait_s)
        return None if raw is None or self._stale > 0 else self._frame(raw)

    @override
    def _release(self) -> None:
        self._capture.release()

    @override
    def _loss(self) -> str:
        return f"no image for {SILENCE_S:g} s, or the line was cut"

    def _grabbed(self, wait_s: float) -> Raw | None:
        """Return an image, None when there is none yet; raises `DeviceError` when it is gone."""
        before_s, asked_s = self._clock.now_s(), WALL.now_s()
        there, raw = self._read_raw(wait_s)
        now_s = WALL.now_s()
        if there:
            self._heard_s = now_s
            waited = now_s - asked_s > _READY_S
            # Images that lay ready are older than this look.
            self._stale = 0 if waited and self._stale < _KEPT else self._stale - 1
            if waited:
                self._empty_s = before_s
            return raw
        if not self._can_wait:
            self._fail(self._loss())
        self._empty_s = before_s
        return None

    def _read_raw(self, wait_s: float) -> tuple[bool, Raw | None]:
        if not self._can_wait:
            # OpenCV waits by itself here, until an image comes or SILENCE_S is over.
            there, raw = self._capture.read()
            return bool(there), raw
        try:
            wait_ns = int(max(1e-3, wait_s) * 1e9)
            ready, _ = type(self._capture).waitAny([self._capture], timeoutNs=wait_ns)
            if not ready:
                return False, None
            there, raw = self._capture.retrieve()
        except cv2.error as exc:
            self._fail(str(exc))
            raise
        return bool(there), raw

    def _frame(self, raw: Raw) -> Frame:
        exposure_s = self._settings.exposure_s
        rate_hz = self._settings.rate_hz
        period_s = 1.0 / rate_hz if rate_hz > 0.0 else _SLICE_S
        stamp_ms = float(self._capture.get(cv2.CAP_PROP_POS_MSEC)) if self._is_device else 0.0
        return self._made(
            raw,
            time_s=self._clock.now_s(),
            # Exposed, read out and sent within two periods before the driver was seen empty.
            exposed_s=self._empty_s - exposure_s - 2.0 * period_s,
            device_ns=int(stamp_ms * 1e6) if stamp_ms > 0.0 else None,
        )

    def _take_over_exposure(self) -> bool:
        """Return whether the exposure can be set by hand, and see to it that it is."""
        if float(self._capture.get(cv2.CAP_PROP_EXPOSURE)) <= 0.0:
            return False
        self._capture.set(cv2.CAP_PROP_AUTO_EXPOSURE, _MANUAL)
        return float(self._capture.get(cv2.CAP_PROP_AUTO_EXPOSURE)) == _MANUAL

    def _set(self, what: str, prop: int, wanted: float) -> None:
        """Set a property and compare: OpenCV returns True for values that nothing came of."""
        slack = 0.5 if prop == cv2.CAP_PROP_EXPOSURE else 0.0  # it counts in whole numbers
        self._capture.set(prop, wanted)
        made = float(self._capture.get(prop))
        if not abs(made - wanted) <= _NEAR * abs(wanted) + slack:
            raise ConfigError(
                f"{self._whom}: {what}: the camera made {made:g} of {wanted:g} (in its own "
                f"unit), so it does not take this value; try another"
            )


class OpenCvLibrary(BaseCameraLibrary[OpenCvCamera]):
    """What OpenCV's VideoCapture reads; any thread.

    Parameters
    ----------
    clock : Clock
        The platform's: stamps frames and paces films.
    sources : sequence of VideoSource, str or Path
        What is listed besides the devices that Linux knows, with how it is played. The path of
        a film or a folder (played again and again) and an address open without being named here.
    sysfs : Path
        Where Linux lists video devices.
    make_capture : callable
        cv2.VideoCapture, or what tests put in its position for devices and addresses.
    """

    def __init__(
        self,
        clock: Clock = WALL,
        *,
        sources: Sequence[VideoSource | str | Path] = (),
        sysfs: Path = SYSFS,
        make_capture: MakeCapture = cv2.VideoCapture,
    ) -> None:
        super().__init__(clock)
        self._sysfs = sysfs
        self._make_capture = make_capture
        made = [
            each if isinstance(each, VideoSource) else VideoSource(str(each)) for each in sources
        ]
        self._sources = {each.address: each for each in made}

    @property
    @override
    def name(self) -> str:
        return f"OpenCV {cv2.__version__}"

    @override
    def cameras(self) -> tuple[CameraInfo, ...]:
        attached = {each.key: each for each in attached_devices(self._sysfs)}
        named = {each.address: each.info for each in self._sources.values() if each.is_there}
        return tuple({**named, **attached}.values())

    @override
    def _open(self, key: str) -> OpenCvCamera:
        listed = {each.key: each for each in self.cameras()}
        source = self._sources.get(key, VideoSource(key, loop=True))
        if key not in listed and not _can_be_tried(source):
            raise self._not_there(key, listed, "Check its cable, or the path")
        if source.kind in (Kind.FILM, Kind.IMAGES):
            return FilmCamera(source, open_film(source), self._clock, self._forget)

        def opened() -> object:
            return open_capture(source, self._make_capture)

        info = listed.get(key, source.info)
        return LiveCamera(info, source, opened(), self._clock, reopen=opened, closed=self._forget)

    @override
    def _shut(self) -> None:
        """Nothing is held but the cameras."""


def _can_be_tried(source: VideoSource) -> bool:
    return source.kind is Kind.ADDRESS or (source.kind is not Kind.DEVICE and source.is_there)


def _make(_options: NoOptions, context: CameraContext) -> CameraLibrary:
    return OpenCvLibrary(context.clock, sources=context.sources)


BACKEND: Final = CameraBackend(_make)
