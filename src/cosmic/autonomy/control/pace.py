"""A fixed period on the wall clock: absolute deadlines, and how well they are kept."""

import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from threading import Condition, Lock
from typing import Final

import numpy as np
import numpy.typing as npt

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.platform_services import run_thread_first

BIN_S: Final = 1e-4
HALF_BINS: Final = 50
KEPT: Final = 8192
"""Of so many newest periods the percentiles are taken."""
SWITCH_S: Final = 0.0005


@dataclass(frozen=True, eq=False, slots=True)
class PaceStatistics:
    """How well a period is kept; wall seconds.

    Attributes
    ----------
    period_s : float
        What it should be.
    cycles : int
        How many there were.
    missed : int
        Periods that were left out, because the one before took too long.
    period_p50_s, period_p99_s, longest_s : float
        From the begin of one cycle to that of the next; nan before the second.
    deviation_p99_s : float
        Difference between that and the period, without sign.
    late_p99_s : float
        How long after its deadline a cycle begins.
    histogram : ndarray, shape (100,), int64
        Cycles by the difference between period and what it should be, 0.1 ms a bin from -5 to
        5 ms; the outermost bins hold what lies beyond.
    """

    period_s: float
    cycles: int
    missed: int
    period_p50_s: float
    period_p99_s: float
    longest_s: float
    deviation_p99_s: float
    late_p99_s: float
    histogram: npt.NDArray[np.int64]


class PaceMeter:
    """Counts and measures the periods of a loop; written by one thread, read by any."""

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self._lock = Lock()
        self._periods_s = np.empty(KEPT)
        self._late_s = np.empty(KEPT)
        self._count = 0
        self._missed = 0
        self._longest_s = math.nan
        self._bins = np.zeros(2 * HALF_BINS, dtype=np.int64)

    def note(self, period_s: float, late_s: float, missed: int) -> None:
        """Take one cycle."""
        bin_ = math.floor((period_s - self._period_s) / BIN_S) + HALF_BINS
        with self._lock:
            at = self._count % KEPT
            self._periods_s[at], self._late_s[at] = period_s, late_s
            self._count += 1
            self._missed += missed
            self._longest_s = period_s if self._count == 1 else max(self._longest_s, period_s)
            self._bins[min(max(bin_, 0), 2 * HALF_BINS - 1)] += 1

    def statistics(self) -> PaceStatistics:
        """Return what was measured so far."""
        with self._lock:
            held = min(self._count, KEPT)
            periods_s, late_s = self._periods_s[:held].copy(), self._late_s[:held].copy()
            count, missed, longest_s = self._count, self._missed, self._longest_s
            bins = self._bins.copy()
        bins.flags.writeable = False
        off_s = np.abs(periods_s - self._period_s)
        return PaceStatistics(
            period_s=self._period_s,
            cycles=count,
            missed=missed,
            period_p50_s=_percentile(periods_s, 50.0),
            period_p99_s=_percentile(periods_s, 99.0),
            longest_s=longest_s,
            deviation_p99_s=_percentile(off_s, 99.0),
            late_p99_s=_percentile(late_s, 99.0),
            histogram=bins,
        )


def _percentile(values: npt.NDArray[np.float64], percent: float) -> float:
    return float(np.percentile(values, percent)) if values.size else math.nan


class LoopTimer:
    """Wakes one thread at absolute times, so that nothing adds up.

    What was missed is counted and left out; there is no catching up.
    """

    def __init__(self, period_s: float, clock: Clock = WALL) -> None:
        self._period_s = period_s
        self._clock = clock
        self._wake = Condition()
        self._ended = False
        self.meter = PaceMeter(period_s)
        self._last_s = self._next_s = 0.0

    def begin(self) -> None:
        """Begin to count from now."""
        self._last_s = self._clock.now_s()
        self._next_s = self._last_s + self._period_s

    def wait(self) -> float:
        """Wait for the next deadline; returns the seconds since the last, 0.0 at the end."""
        with self._wake:
            while not self._ended and self._clock.now_s() < self._next_s:
                self._clock.wait(self._wake, self._next_s)
        if self._ended:
            return 0.0
        now_s = self._clock.now_s()
        late_s, period_s = now_s - self._next_s, now_s - self._last_s
        missed = int(late_s / self._period_s)
        self._last_s = now_s
        self._next_s += (1 + missed) * self._period_s
        self.meter.note(period_s, late_s, missed)
        return period_s

    def end(self) -> None:
        """Wake the thread for good; any thread."""
        with self._wake:
            self._ended = True
            self._wake.notify_all()


def ask_real_time(priority: int) -> str:
    """Ask the system to run the calling thread before all others; returns "" or why it does not.

    What the thread starts runs as usual again.
    """
    reason = run_thread_first(priority)
    return reason and f"no real-time priority ({reason}); periods may be missed under load"


_switching = Lock()
_quick: list[float] = []


@contextmanager
def quick_switching() -> Iterator[None]:
    """Have Python's threads give way sooner while the block runs, in any number of threads.

    As Python starts, a thread that computes keeps all others from running for 5 ms, a whole period.
    """
    with _switching:
        _quick.append(sys.getswitchinterval())
        sys.setswitchinterval(min(SWITCH_S, _quick[0]))
    try:
        yield
    finally:
        with _switching:
            before_s = _quick[0]
            _quick.pop()
            if not _quick:
                sys.setswitchinterval(before_s)
