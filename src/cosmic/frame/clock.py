"""The only source of time.

Physics, procedures, time stamps and motion time-outs use the platform's clock, which may run
faster than the wall. Dead-man, lease, stale-data and thread limits use `WALL`.
"""

import sys
import threading
import time
from abc import abstractmethod
from collections.abc import Generator
from contextlib import contextmanager
from typing import Final, Protocol

from typing_extensions import override

from cosmic.frame.time_scale import (
    Expectations,
    Horizon,
    ScaledHorizon,
    ScaledWorker,
    TimeScale,
    Worker,
)


def wall_now_s() -> float:
    """Return the seconds since some moment; never goes back."""
    # On Windows Python's monotonic time moves in steps of 15.6 ms before 3.13.
    return time.perf_counter() if sys.platform == "win32" else time.monotonic()


class Clock(Protocol):
    """A monotonic time in seconds and a way to wait for it; any thread."""

    @property
    @abstractmethod
    def rate(self) -> float:
        """Platform seconds per second of the wall; 0 where a test moves the time."""

    @abstractmethod
    def now_s(self) -> float:
        """Return the time in seconds since the clock was made; never goes back."""

    @abstractmethod
    def wait(self, condition: threading.Condition, until_s: float) -> None:
        """Wait on `condition`, which the caller holds, until notified or until `until_s`.

        May return early; the caller checks what it waits for, as with any condition.
        """

    @abstractmethod
    def sleep(self, duration_s: float) -> None:
        """Block the calling thread for `duration_s` of this clock's time."""

    def wall_s(self) -> float:
        """Return the time of the wall, for what is done so often by it; a test moves both."""
        return wall_now_s()

    @property
    def rate_reached(self) -> float:
        """Platform seconds per second of the wall that were reached of late."""
        return self.rate

    @property
    def expectations(self) -> Expectations | None:
        """What is waited for in a hurry; None: nobody is hurried by this clock."""
        return None

    def expect(self, time_s: float) -> None:
        """Want what there is at `time_s` then, however long the pieces are in which it comes."""
        if self.expectations is not None:
            self.expectations.add(time_s)

    def horizon(self) -> Horizon:
        """Return the horizon of somebody who must keep up with this time, if it waits for any."""
        return Horizon()

    def worker(self, *, leads: bool = False) -> Worker:  # noqa: ARG002 - for clocks with a rate
        """Return somebody whose work takes wall time, whatever the rate.

        Parameters
        ----------
        leads : bool
            A procedure: from now on until it is closed, this clock runs at its rate only while
            all workers are idle.
        """
        return Worker()

    @contextmanager
    def at_work(self) -> Generator[None]:
        """Have what is done inside take wall time, while a procedure is under way."""
        worker = self.worker()
        worker.busy()
        try:
            yield
        finally:
            worker.close()


class RatedClock(Clock):
    """A clock that runs `rate` times as fast as the wall.

    While a procedure is under way that is the most: it runs as the wall does while a worker is
    busy, and from when a thread that waits is due until it goes on. See `cosmic.frame.time_scale`.

    Parameters
    ----------
    rate : float
        Seconds for each second of the wall.
    waits : bool
        It waits for who must keep up with it: for a platform of which no part is real.

    Raises
    ------
    ValueError
        `rate` is not a positive finite number.
    """

    def __init__(self, rate: float = 1.0, *, waits: bool = False) -> None:
        if not 0.0 < rate < 1e6:
            raise ValueError(f"a clock's rate must lie between 0 and 1e6, got {rate!r}")
        self._rate = rate
        self._start_s = wall_now_s()
        self._waits = waits
        # Nobody can be hurried by a clock that is no faster than the wall.
        self._accelerated = rate > 1.0
        self._time_scale = TimeScale(rate, wall_now_s) if waits or self._accelerated else None
        self._expectations = Expectations() if self._accelerated else None

    @property
    @override
    def rate(self) -> float:
        return self._rate

    @override
    def now_s(self) -> float:
        if self._time_scale is not None:
            return self._time_scale.now_s()
        return (wall_now_s() - self._start_s) * self._rate

    @override
    def wait(self, condition: threading.Condition, until_s: float) -> None:
        time_scale = self._time_scale
        if time_scale is None:
            left_s = (until_s - self.now_s()) / self._rate
            if left_s > 0.0:
                condition.wait(min(left_s, threading.TIMEOUT_MAX))
            return
        token = object()
        left_s = time_scale.begin_wait(token, condition, until_s)
        if left_s > 0.0:
            try:
                condition.wait(min(left_s, threading.TIMEOUT_MAX))
            finally:
                time_scale.end_wait(token)

    @override
    def sleep(self, duration_s: float) -> None:
        if self._time_scale is None:
            if duration_s > 0.0:
                time.sleep(duration_s / self._rate)
            return
        until_s = self.now_s() + duration_s
        condition = threading.Condition()
        with condition:
            while self.now_s() < until_s:
                self.wait(condition, until_s)

    @override
    def worker(self, *, leads: bool = False) -> Worker:
        if self._time_scale is None or not self._accelerated:
            return Worker()
        return ScaledWorker(self._time_scale, leads=leads)

    @property
    @override
    def expectations(self) -> Expectations | None:
        return self._expectations

    @property
    @override
    def rate_reached(self) -> float:
        return self._rate if self._time_scale is None else self._time_scale.reached

    @override
    def horizon(self) -> Horizon:
        return (
            ScaledHorizon(self._time_scale)
            if self._time_scale is not None and self._waits
            else Horizon()
        )


class WallClock(RatedClock):
    """Real time."""

    def __init__(self) -> None:
        super().__init__(1.0)


class ManualClock(Clock):
    """A clock that a test moves.

    Parameters
    ----------
    auto_advance : bool
        True: whoever waits moves the time itself, so that a single thread runs as fast as it
        can (lock-step). False: waiting threads wait until another thread calls `advance`.
    """

    def __init__(self, *, auto_advance: bool = False) -> None:
        self._auto = auto_advance
        self._now_s = 0.0
        self._lock = threading.Condition()
        self._waiting: list[threading.Condition] = []

    @property
    @override
    def rate(self) -> float:
        return 0.0

    @override
    def now_s(self) -> float:
        with self._lock:
            return self._now_s

    @override
    def wall_s(self) -> float:
        return self.now_s()

    def advance(self, duration_s: float) -> None:
        """Move the time forward by `duration_s` and wake whoever waits."""
        if not 0.0 <= duration_s < float("inf"):
            raise ValueError(f"time moves forward by a finite step, got {duration_s!r}")
        with self._lock:
            self._now_s += duration_s
            waiting = list(self._waiting)
            self._lock.notify_all()
        for condition in waiting:
            with condition:
                condition.notify_all()

    @override
    def wait(self, condition: threading.Condition, until_s: float) -> None:
        with self._lock:
            left_s = until_s - self._now_s
            if left_s > 0.0 and self._auto and until_s < float("inf"):
                self._now_s = until_s
                self._lock.notify_all()
                return
            if left_s <= 0.0:
                return
            self._waiting.append(condition)
        try:
            # A step of the time between the look above and this wait is caught by the poll.
            condition.wait(0.05)
        finally:
            with self._lock:
                self._waiting.remove(condition)

    @override
    def sleep(self, duration_s: float) -> None:
        with self._lock:
            until_s = self._now_s + duration_s
            if self._auto:
                self._now_s = max(self._now_s, until_s)
                self._lock.notify_all()
                return
            while self._now_s < until_s:
                self._lock.wait()


WALL: Final[Clock] = WallClock()
