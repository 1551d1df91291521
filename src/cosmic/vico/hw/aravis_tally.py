"""Makes frames of the buffers that Aravis filled, and counts them."""

from typing import Final

import numpy as np

from cosmic.frame.clock import Clock
from cosmic.vico.hw.aravis_calls import AravisCalls
from cosmic.vico.hw.aravis_frames import FrameNumbers, FrameTimes
from cosmic.vico.hw.aravis_stream import AravisBuffer
from cosmic.vico.hw.interface import (
    CameraCounters,
    CameraRanges,
    CameraSettings,
    Frame,
    FrameStatus,
    PixelFormat,
    Pixels,
)

# Aravis keeps an incomplete frame for its last packets, for less than this.
_INCOMPLETE_AGE_S: Final = 0.5


class AravisTally:
    """The frames since one start; one thread writes, any reads the counters.

    Attributes
    ----------
    underrun : int
        How often no buffer was free.
    """

    def __init__(self, calls: AravisCalls, clock: Clock) -> None:
        self._calls = calls
        self._clock = clock
        self._completed = self._failed = self.underrun = 0
        self._numbers, self._times = FrameNumbers(), FrameTimes()

    @property
    def counters(self) -> CameraCounters:
        """What became of the frames."""
        return CameraCounters(self._completed, self._failed, self._numbers.lost, self.underrun)

    def frame(self, buffer: AravisBuffer, settings: CameraSettings, ranges: CameraRanges) -> Frame:
        """Return the frame in a buffer, counted; in the thread that receives."""
        before_s = _exposing_s(settings, ranges)
        data = buffer.pixels(settings)
        if not buffer.whole or data is None:
            return self._incomplete(buffer, data, settings, before_s)
        self._completed += 1
        now_s, rate = self._clock.now_s(), self._clock.rate
        age_s = (self._calls.plain("g_get_real_time") * 1000 - buffer.system_ns) / 1e9
        complete_s = self._times.complete_s(now_s, age_s, rate)
        before_s += max(0.0, age_s) + self._times.delay_s(buffer.system_ns, buffer.device_ns)
        return Frame(
            data=data,
            frame_id=self._numbers.whole(buffer.number),
            time_s=complete_s,
            exposed_s=min(now_s - before_s * rate, complete_s),
            device_ns=buffer.device_ns,
            pixel_format=settings.pixel_format,
        )

    def _incomplete(
        self,
        buffer: AravisBuffer,
        data: Pixels | None,
        settings: CameraSettings,
        before_s: float,
    ) -> Frame:
        self._failed += 1
        now_s = self._clock.now_s()
        before_s += _INCOMPLETE_AGE_S
        return Frame(
            data=_blank(settings) if data is None else data,
            frame_id=self._numbers.doubtful(buffer.number),
            time_s=now_s,
            exposed_s=now_s - before_s * self._clock.rate,
            status=FrameStatus.INCOMPLETE,
            pixel_format=settings.pixel_format,
        )


def _exposing_s(settings: CameraSettings, ranges: CameraRanges) -> float:
    """Return the most that lies between the beginning of an exposure and its first packet."""
    reading_s = 0.0 if ranges.rate_hz is None else 1.0 / ranges.rate_hz.high
    return settings.exposure_s + reading_s


def _blank(settings: CameraSettings) -> Pixels:
    shape = (settings.roi.height_px, settings.roi.width_px)
    eight = settings.pixel_format in (PixelFormat.MONO8, PixelFormat.RGB8)
    colour = settings.pixel_format is PixelFormat.RGB8
    data = np.zeros((*shape, 3) if colour else shape, np.uint8 if eight else np.uint16)
    data.flags.writeable = False
    return data
