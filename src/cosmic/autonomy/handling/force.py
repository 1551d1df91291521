"""The force as procedures want it: the mean of samples taken at rest."""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from threading import Condition
from typing import Final

import numpy as np

from cosmic.daqco.api.daqco import Daqco
from cosmic.daqco.core.chunk import DataChunk
from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import ConfigError, DeviceTimeout, NotAvailable
from cosmic.frame.events import Event, Unsubscribe

KEPT_S: Final = 5.0
LIMIT_WALL_S: Final = 15.0
"""How long samples may fail to come, wall time."""


@dataclass(frozen=True, slots=True)
class ForceMean:
    """The mean of a force over a short time.

    Attributes
    ----------
    mean_un, std_un : float
        The mean, and the standard deviation of the mean.
    time_s : float
        Middle of that time, platform clock.
    """

    mean_un: float
    std_un: float
    time_s: float
    samples: int

    @property
    def spread_un(self) -> float:
        """Standard deviation of one reading."""
        return self.std_un * math.sqrt(self.samples)


class ForceWatch:
    """Keeps the last samples of a force channel; any thread.

    Raises
    ------
    ConfigError
        There is no such channel.
    """

    def __init__(self, daqco: Daqco, channel: str, clock: Clock) -> None:
        if channel not in daqco.channels:
            known = ", ".join(daqco.channels) or "none"
            raise ConfigError(f"there is no force channel {channel!r}; the platform has: {known}")
        self._daqco = daqco
        self._channel = channel
        self.clock = clock
        self._chunks: deque[DataChunk] = deque()
        self._changed = Condition()
        self._taken: Event[[]] = Event()
        self._peak_un = 0.0
        self._forget: Callable[[], None] | None = None

    @property
    def running(self) -> bool:
        """Samples are being acquired."""
        return self._daqco.running

    @property
    def gone(self) -> bool:
        """Samples are being acquired, and none of the force is among them."""
        return self._daqco.running and self._channel not in self._daqco.channels

    @property
    def problem(self) -> str:
        """Why no samples come, as far as acquisition knows."""
        if self.gone:
            return f"there is no channel {self._channel} any more: renamed, or switched off"
        return self._daqco.problem or "acquisition gives no reason"

    def open(self) -> None:
        """Begin to keep samples; harmless the second time."""
        if self._forget is None:
            self._forget = self._daqco.subscribe(self._take)

    def close(self) -> None:
        """End it; harmless the second time."""
        if self._forget is not None:
            self._forget()
            self._forget = None

    def _take(self, chunk: DataChunk) -> None:
        if self._channel not in chunk.channels:
            return  # `problem` says so to whoever waits
        values = chunk.values[chunk.channels.index(self._channel)]
        with self._changed:
            self._peak_un = max(self._peak_un, float(np.abs(values).max()))
            self._chunks.append(chunk)
            while self._chunks and chunk.end_time_s - self._chunks[0].end_time_s > KEPT_S:
                self._chunks.popleft()
            self._changed.notify_all()
        self._taken.emit()

    def take_peak_un(self) -> float:
        """Return the largest reading, either sign, since this was called last."""
        with self._changed:
            peak, self._peak_un = self._peak_un, 0.0
        return peak

    def farthest_un(self, low_un: float, high_un: float) -> float | None:
        """Return the newest reading that lies farthest beyond two bounds; None: none does."""
        with self._changed:
            if not self._chunks:
                return None
            chunk = self._chunks[-1]
        values = chunk.values[chunk.channels.index(self._channel)]
        low, high = float(values.min()), float(values.max())
        beyond = high if high - high_un >= low_un - low else low
        return None if low_un <= beyond <= high_un else beyond

    def subscribe(self, listener: Callable[[], object]) -> Unsubscribe:
        """Call `listener()` after each chunk; returns the function that ends it."""
        return self._taken.subscribe(listener)

    def between(self, since_s: float, until_s: float) -> ForceMean | None:
        """Return the mean over a time; None while not all of it was sampled."""
        with self._changed:
            if not self._chunks or self._chunks[-1].end_time_s < until_s:
                return None
            chunks = [each for each in self._chunks if each.end_time_s > since_s]
        found = []
        for chunk in chunks:
            first = max(0, math.ceil((since_s - chunk.time_s) * chunk.rate_hz))
            last = min(chunk.samples, math.floor((until_s - chunk.time_s) * chunk.rate_hz) + 1)
            if last > first:
                found.append(chunk.values[chunk.channels.index(self._channel)][first:last])
        if not found:
            return None
        values = np.concatenate(found)
        count = int(values.size)
        spread = float(values.std(ddof=1)) if count > 1 else 0.0
        middle_s = 0.5 * (since_s + until_s)
        return ForceMean(float(values.mean()), spread / math.sqrt(count), middle_s, count)

    def wanted(self, seconds: float, *, settle_s: float = 0.0) -> "ForceWanted":
        """Return what to wait for: the mean over `seconds`, from `settle_s` after now."""
        return ForceWanted(self, self.clock.now_s() + settle_s, seconds)

    def wait_for_chunk(self, timeout_s: float) -> None:
        """Wait for the next chunk, or for `timeout_s` of wall time."""
        with self._changed:
            self._changed.wait(timeout_s)


class ForceWanted:
    """The mean force over a time to come; to be yielded by an operation."""

    def __init__(self, watch: ForceWatch, since_s: float, seconds: float) -> None:
        self._watch = watch
        self._since_s = since_s
        self._until_s = since_s + seconds
        clock = watch.clock
        clock.expect(self._until_s)
        ahead_s = max(0.0, self._until_s - clock.now_s()) / (clock.rate or 1.0)
        self._late_wall_s = WALL.now_s() + ahead_s + LIMIT_WALL_S
        self._mean: ForceMean | None = None
        self._ran = watch.running
        self._callbacks: list[Callable[[ForceWanted], object]] = []
        self._forget: Callable[[], None] | None = None

    @property
    def done(self) -> bool:
        """Sampled whole, or given up."""
        if self._mean is None:
            self._mean = self._watch.between(self._since_s, self._until_s)
        if self._mean is not None or WALL.now_s() > self._late_wall_s:
            return True
        return self._ended()

    def _ended(self) -> bool:
        """Return whether acquisition ran when this was wanted, and no force comes any more."""
        self._ran = self._ran or self._watch.running
        return (self._ran and not self._watch.running) or self._watch.gone

    def add_callback(self, callback: Callable[["ForceWanted"], object]) -> None:
        """Call `callback(self)` at the end, in the thread of the acquisition."""
        self._callbacks.append(callback)
        if self._forget is None:
            self._forget = self._watch.subscribe(self._look)

    def _look(self) -> None:
        if self.done:
            self.cancel()
            for each in self._callbacks:
                each(self)

    def wait(self, timeout_s: float | None = None) -> ForceMean:
        """Wait for it, and return it.

        Raises
        ------
        NotAvailable
            No samples come.
        DeviceTimeout
            It did not end within `timeout_s` of wall time.
        """
        until_wall_s = math.inf if timeout_s is None else WALL.now_s() + timeout_s
        while not self.done:
            left_s = until_wall_s - WALL.now_s()
            if left_s <= 0.0:
                raise DeviceTimeout(f"no mean force after {timeout_s:g} s")
            self._watch.wait_for_chunk(min(left_s, 0.05))
        if self._mean is None:
            raise NotAvailable(
                f"no samples of the force came: {self._watch.problem}; look whether acquisition "
                "runs"
            )
        return self._mean

    def cancel(self) -> None:
        """Want it no longer."""
        if self._forget is not None:
            self._forget()
            self._forget = None
