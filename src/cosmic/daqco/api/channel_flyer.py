"""Every sample of a channel between two moments, for plans that fly it."""

import math
from collections import deque
from collections.abc import Iterator
from threading import Lock
from typing import Final

import numpy as np

from cosmic.daqco.core.chunk import DataChunk, Values
from cosmic.frame.clock import Clock
from cosmic.frame.errors import NotAvailable, RecordingError
from cosmic.frame.plan_shape import EventPage, PlanStatus, unix_of_platform_s

LARGEST_PAGE: Final = 10_000
MOST_SAMPLES: Final = 5_000_000


def samples_of(chunk: DataChunk, channel: str, since_s: float) -> Values:
    """Return the values of a channel sampled from `since_s` of platform time on, in its unit.

    Raises
    ------
    NotAvailable
        The channel is not among those acquired.
    """
    if channel not in chunk.channels:
        raise NotAvailable(f"{channel}: it is not among the active channels; make it active")
    row = chunk.channels.index(channel)
    first = math.ceil((since_s - chunk.time_s) * chunk.rate_hz - 1e-6)
    values: Values = chunk.scales[row].apply(chunk.volts[row, max(0, first) :])
    return values


class ChannelFlyer:
    """Collects a channel from now on; `take` in the acquisition thread, the rest in any.

    Attributes
    ----------
    begun, ended : PlanStatus
        The first sample is there; no more are wanted.
    """

    def __init__(self, channel: str, key: str, clock: Clock) -> None:
        self.begun = PlanStatus(f"beginning to collect {channel}")
        self.ended = PlanStatus(f"collecting {channel}")
        self._channel, self._key = channel, key
        self._rate = clock.rate or 1.0
        self._clock = clock
        self._since_s = clock.now_s()
        self._since_unix_s = unix_of_platform_s(clock, self._since_s)
        self._until_s = math.inf
        self._next: int | None = None
        self._kept = 0
        self._parts: deque[tuple[Values, Values]] = deque()
        self._lock = Lock()

    def take(self, chunk: DataChunk) -> None:
        """Keep what belongs to the flight; raises `RecordingError` where samples are missing."""
        if self.ended.done:
            return
        values = samples_of(chunk, self._channel, self._since_s)
        if self._next not in (None, chunk.first_sample):
            raise RecordingError(f"{self._channel}: samples before {chunk.first_sample} were lost")
        self._next = chunk.first_sample + chunk.samples
        numbers = np.arange(chunk.samples - len(values), chunk.samples)
        times_s = chunk.time_s + numbers / chunk.rate_hz
        wanted = times_s <= self._until_s
        if wanted.any():
            self._keep(times_s[wanted], values[wanted])
            self.begun.finish()
        if chunk.end_time_s > self._until_s:
            self.begun.finish()
            self.ended.finish()

    def _keep(self, times_s: Values, values: Values) -> None:
        with self._lock:
            self._parts.append((times_s, values))
            self._kept += len(values)
            too_many = self._kept > MOST_SAMPLES
        if too_many:
            text = "too many samples wait to be collected; collect meanwhile, or make a recording"
            raise RecordingError(f"{self._channel}: {text}")

    def complete(self) -> PlanStatus:
        """Take nothing that is sampled from now on; returns `ended`."""
        self._until_s = min(self._until_s, self._clock.now_s())
        return self.ended

    def abandon(self, error: Exception) -> None:
        """End it badly."""
        self.begun.fail(error)
        self.ended.fail(error)

    def pages(self) -> Iterator[EventPage]:
        """Yield and forget what has come before the call."""
        with self._lock:
            parts = list(self._parts)
            self._parts.clear()
            self._kept = 0
        if not parts:
            return
        times_s = np.concatenate([each[0] for each in parts])
        values = np.concatenate([each[1] for each in parts])
        for first in range(0, len(values), LARGEST_PAGE):
            part = slice(first, first + LARGEST_PAGE)
            yield self._page(times_s[part], values[part])

    def _page(self, times_s: Values, values: Values) -> EventPage:
        unix_s = (self._since_unix_s + (times_s - self._since_s) / self._rate).tolist()
        time_key = f"{self._key}_time_s"
        return {
            "time": unix_s,
            "data": {self._key: values.tolist(), time_key: times_s.tolist()},
            "timestamps": {self._key: unix_s, time_key: unix_s},
        }
