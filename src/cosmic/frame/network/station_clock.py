"""The platform clock of another station, as far as it can be known from here."""

from collections.abc import Sequence
from dataclasses import dataclass
from threading import Condition, Lock

from typing_extensions import override

from cosmic.frame.clock import WALL, Clock


@dataclass(frozen=True, slots=True)
class Reading:
    """What a clock elsewhere said, asked for and answered at these times of the wall."""

    station_s: float
    asked_s: float
    answered_s: float


class StationClock(Clock):
    """Follows the clock that dates the samples at their station; any thread.

    It is never behind that clock, and ahead of it by at most the time that the best of the last
    answers took on its way: what is dated later than `now_s` was sampled after the call. It goes
    back only when the station was started anew.
    """

    def __init__(self) -> None:
        self._lock = Lock()
        self._rate = 1.0
        self._offset_s = 0.0
        self._newest_s = -float("inf")
        self._uncertain_s = float("inf")

    @property
    @override
    def rate(self) -> float:
        return self._rate

    @property
    def uncertain_s(self) -> float:
        """How far it may be ahead; infinite before the first answer."""
        return self._uncertain_s

    @override
    def now_s(self) -> float:
        with self._lock:
            now_s = self._offset_s + WALL.now_s() * self._rate
            self._newest_s = max(now_s, self._newest_s)
            return self._newest_s

    def forget(self, rate: float) -> None:
        """Begin anew with the clock of another start, which makes `rate` seconds a second."""
        with self._lock:
            self._rate = rate or 1.0  # 0 where a test moves the time
            self._newest_s, self._uncertain_s = -float("inf"), float("inf")

    def take(self, readings: Sequence[Reading]) -> None:
        """Follow the best of some readings: the one that took the least time on its way."""
        if not readings:
            return
        best = min(readings, key=lambda each: each.answered_s - each.asked_s)
        with self._lock:
            self._uncertain_s = (best.answered_s - best.asked_s) * self._rate
            # It may have been made right at the question, or just before the answer came.
            self._offset_s = best.station_s + self._uncertain_s - best.answered_s * self._rate

    @override
    def wait(self, condition: Condition, until_s: float) -> None:
        WALL.wait(condition, WALL.now_s() + (until_s - self.now_s()) / self._rate)

    @override
    def sleep(self, duration_s: float) -> None:
        WALL.sleep(duration_s / self._rate)
