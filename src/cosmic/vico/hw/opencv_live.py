"""USB cameras (V4L2, Media Foundation) and network addresses through OpenCV."""

import logging
import math
import threading
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Final

import cv2
from typing_extensions import override

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import ConfigError, DeviceError, DeviceFault, NotConnectedError
from cosmic.vico.hw.interface import Camera, CameraInfo, CameraSettings, Frame, Range
from cosmic.vico.hw.opencv_camera import OpenCvCamera
from cosmic.vico.hw.opencv_film import Raw
from cosmic.vico.hw.opencv_source import Kind, VideoSource

logger = logging.getLogger(__name__)

# After so long without a picture the camera counts as gone.
SILENCE_S: Final = 1.5
EXPOSURES_S: Final = Range(1e-4, 1.0, 1e-4)
RATES_HZ: Final = Range(1.0, 240.0)
# More pictures than a driver keeps ready; after a start they are old.
_KEPT: Final = 5
# A picture that came faster lay ready.
_READY_S: Final = 2e-3
_SLICE_S: Final = 0.02
_EXPOSURE_UNIT_S: Final = 1e-4  # of video4linux's "exposure_time_absolute"
_MANUAL: Final = 1.0  # of its "auto_exposure"
_NEAR: Final = 0.05

MakeCapture = Callable[..., Any]


class LiveCamera(OpenCvCamera):
    """A camera that goes on by itself.

    Exposure and rate are offered where the device tells its own, and read back: a device that
    makes something else of a value has refused it. How many pictures were lost, OpenCV does not
    tell.

    Parameters
    ----------
    capture : object
        An opened cv2.VideoCapture.
    reopen : callable
        Opens another; for addresses, whose line keeps old pictures.
    """

    def __init__(
        self,
        info: CameraInfo,
        source: VideoSource,
        capture: Any,
        clock: Clock,
        *,
        reopen: Callable[[], Any],
        closed: Callable[[Camera], None],
    ) -> None:
        self._capture = capture
        self._source = source
        self._reopen = reopen
        self._reading = threading.Lock()
        self._empty_s = clock.now_s()
        self._heard_s = WALL.now_s()
        self._stale = 0
        self._is_device = source.kind is Kind.DEVICE
        self._can_wait = self._is_device and capture.getBackendName() == "V4L2"
        there, first = capture.read()
        if not there:
            capture.release()
            raise NotConnectedError(
                f"{info.key}: it opens but sends no picture; close other programs that use it",
                fault=DeviceFault.COMMUNICATION,
            )
        rate_hz = float(capture.get(cv2.CAP_PROP_FPS))
        rate_hz = rate_hz if math.isfinite(rate_hz) and rate_hz > 0.0 else 0.0
        super().__init__(info, clock, first, rate_hz=rate_hz, closed=closed)
        self._has_rate = self._is_device and rate_hz > 0.0
        self._has_exposure = self._is_device and self._take_over_exposure()
        self._settings = self._read_back(self._settings)

    @override
    def receive(self, timeout_s: float) -> Frame | None:
        end_s = WALL.now_s() + timeout_s
        while True:
            with self._changed:
                if not self._running:
                    return None
            raw = self._grabbed(end_s - WALL.now_s())
            with self._changed:
                if not self._running:
                    return None
                if raw is not None and self._stale <= 0:
                    return self._frame(raw)
            if raw is None and WALL.now_s() >= end_s:
                return None

    @override
    def _exposures_s(self) -> Range | None:
        return EXPOSURES_S if self._has_exposure else None

    @override
    def _rates_hz(self) -> Range | None:
        return RATES_HZ if self._has_rate else None

    @override
    def _apply(self, settings: CameraSettings) -> CameraSettings:
        before = self._settings
        if settings.rate_hz != before.rate_hz:
            self._set("rate", cv2.CAP_PROP_FPS, settings.rate_hz, before.rate_hz)
        if settings.exposure_s != before.exposure_s:
            counts, old = settings.exposure_s / _EXPOSURE_UNIT_S, before.exposure_s
            try:
                self._set("exposure", cv2.CAP_PROP_EXPOSURE, counts, old / _EXPOSURE_UNIT_S)
            except ConfigError:
                self._capture.set(cv2.CAP_PROP_FPS, before.rate_hz)
                raise
        return self._read_back(settings)

    @override
    def _begin(self) -> None:
        if not self._is_device:
            self._capture.release()
            self._capture = self._reopen()
        self._stale = _KEPT if self._is_device else 0
        self._empty_s = self._clock.now_s()
        self._heard_s = WALL.now_s()

    @override
    def _release(self) -> None:
        with self._reading:
            self._capture.release()

    def _grabbed(self, left_s: float) -> Raw | None:
        """Return a picture, None when there is none yet; raises `DeviceError` when it is gone."""
        before_s, asked_s = self._clock.now_s(), WALL.now_s()
        with self._reading:
            there, raw = self._read(left_s)
        now_s = WALL.now_s()
        if there:
            self._heard_s = now_s
            waited = now_s - asked_s > _READY_S
            # Pictures that lay ready are older than this look.
            self._stale = 0 if waited and self._stale < _KEPT else self._stale - 1
            if waited:
                self._empty_s = before_s
            return raw
        if not self._can_wait or now_s - self._heard_s > SILENCE_S:
            raise self._lost()
        self._empty_s = before_s
        return None

    def _read(self, left_s: float) -> tuple[bool, Raw | None]:
        if not self._can_wait:
            # OpenCV waits by itself here, until a picture comes or SILENCE_S is over.
            there, raw = self._capture.read()
            return bool(there), raw
        wait_s = max(1e-3, min(left_s, _SLICE_S))
        try:
            ready, _ = type(self._capture).waitAny([self._capture], timeoutNs=int(wait_s * 1e9))
            if not ready:
                return False, None
            there, raw = self._capture.retrieve()
        except cv2.error as exc:
            logger.info("%s: %s", self._info.key, exc)
            self._heard_s = -math.inf
            return False, None
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

    def _lost(self) -> DeviceError:
        self.stop()
        return self._error(
            f"receive: no picture for {SILENCE_S:g} s, or the line was cut; check its cable and "
            f"power, then open it again",
            DeviceFault.COMMUNICATION,
        )

    def _take_over_exposure(self) -> bool:
        """Return whether the exposure can be set by hand, and see to it that it is."""
        if float(self._capture.get(cv2.CAP_PROP_EXPOSURE)) <= 0.0:
            return False
        self._capture.set(cv2.CAP_PROP_AUTO_EXPOSURE, _MANUAL)
        return float(self._capture.get(cv2.CAP_PROP_AUTO_EXPOSURE)) == _MANUAL

    def _set(self, what: str, prop: int, wanted: float, before: float) -> None:
        """Set a property and compare: OpenCV returns True for values that nothing came of."""
        slack = 0.5 if prop == cv2.CAP_PROP_EXPOSURE else 0.0  # it counts in whole numbers
        self._capture.set(prop, wanted)
        made = float(self._capture.get(prop))
        if not abs(made - wanted) <= _NEAR * abs(wanted) + slack:
            self._capture.set(prop, before)
            raise ConfigError(
                f"{self._info.key}: {what}: the camera made {made:g} of {wanted:g} (in its own "
                f"unit), so it does not take this value; try another"
            )

    def _read_back(self, settings: CameraSettings) -> CameraSettings:
        changes: dict[str, Any] = {}
        if self._has_rate:
            changes["rate_hz"] = float(self._capture.get(cv2.CAP_PROP_FPS))
        if self._has_exposure:
            counts = float(self._capture.get(cv2.CAP_PROP_EXPOSURE))
            changes["exposure_s"] = counts * _EXPOSURE_UNIT_S
        return replace(settings, **changes)


def open_capture(source: VideoSource, make: MakeCapture) -> Any:
    """Open a device or an address.

    Raises
    ------
    NotConnectedError
        It does not open.
    """
    if source.kind is Kind.DEVICE:
        capture = make(source.device)
        if capture.isOpened() and source.size_px is not None:
            capture.set(cv2.CAP_PROP_FRAME_WIDTH, source.size_px[0])
            capture.set(cv2.CAP_PROP_FRAME_HEIGHT, source.size_px[1])
    else:
        limit_ms = int(SILENCE_S * 1000)
        capture = make(
            source.address,
            cv2.CAP_FFMPEG,
            [
                cv2.CAP_PROP_OPEN_TIMEOUT_MSEC,
                limit_ms,
                cv2.CAP_PROP_READ_TIMEOUT_MSEC,
                limit_ms,
            ],
        )
    if not capture.isOpened():
        capture.release()
        raise NotConnectedError(
            f"{source.address}: the {source.kind} does not open; check that it is there and that "
            f"no other program uses it",
            fault=DeviceFault.COMMUNICATION,
        )
    return capture
