"""Makes frames of what came from IEEE 1394, and counts them."""

import time
from typing import Final

from cosmic.frame.clock import Clock
from cosmic.vico.hw.dc1394_ring import Taken
from cosmic.vico.hw.interface import (
    CameraCounters,
    CameraSettings,
    Frame,
    FrameStatus,
    Trigger,
)

_LATE: Final = 1.5  # periods between two frames from which on one is missing
_OLDEST_S: Final = 5.0


class Dc1394Tally:
    """The frames since one start; one thread writes, any reads the counters."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._count = FrameCount()
        self._completed = self._failed = self._underrun = 0

    @property
    def counters(self) -> CameraCounters:
        """What became of the frames."""
        return CameraCounters(self._completed, self._failed, self._count.lost, self._underrun)

    def pause(self) -> None:
        """Take the next gap for what it is: the camera was stopped on purpose."""
        self._count.pause()

    def frame(self, taken: Taken, settings: CameraSettings) -> Frame:
        """Return what was taken as a frame, counted; in the thread that receives."""
        rate = self._clock.rate
        free = settings.trigger is Trigger.FREE_RUN
        frame_id = self._count.number(taken.received_us, settings.rate_hz if free else 0.0)
        self._completed += not taken.corrupt
        self._failed += taken.corrupt
        self._underrun += taken.ring_full
        now_s, real_us = self._clock.now_s(), time.clock_gettime_ns(time.CLOCK_REALTIME) // 1000
        age_s = min(max(0.0, (real_us - taken.received_us) / 1e6), _OLDEST_S)
        # On the bus a frame takes up to a period.
        begun_s = age_s + settings.exposure_s + 1.0 / settings.rate_hz
        return Frame(
            data=taken.data,
            frame_id=frame_id,
            time_s=now_s - age_s * rate,
            exposed_s=now_s - begun_s * rate,
            status=FrameStatus.INCOMPLETE if taken.corrupt else FrameStatus.COMPLETE,
            pixel_format=settings.pixel_format,
        )


class FrameCount:
    """Numbers frames by the times at which they were received."""

    def __init__(self) -> None:
        self.lost = 0
        self._next = 0
        self._last_us: int | None = None

    def pause(self) -> None:
        """Take the next gap for what it is: the camera was stopped on purpose."""
        self._last_us = None

    def number(self, received_us: int, rate_hz: float) -> int:
        """Return the number of a frame; with a rate of 0 no gap is a loss."""
        if self._last_us is not None and rate_hz > 0.0:
            periods = (received_us - self._last_us) * rate_hz / 1e6
            missing = round(periods) - 1 if periods > _LATE else 0
            self.lost += missing
            self._next += missing
        self._last_us = received_us
        self._next += 1
        return self._next - 1
