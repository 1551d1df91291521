"""How old a command is, judged by its receiver alone, without clocks that agree.

Every answer of a station carries its clock's reading. The client adds the time that has passed on
its own clock since, and so knows a time at which the station's clock surely is by now: the answer
took its time as well. A command says by that reckoning until when it may be begun. The station
compares with its own clock only, so delays on the way make a command older, never younger.
"""

from threading import Lock
from typing import Final

from cosmic.frame.clock import Clock
from cosmic.frame.network.errors import CommandExpired

_DRIFT: Final = 2e-4
_WINDOW: Final = 1024


class StationTime:
    """A client's reckoning of the station's clock, never ahead of it; any thread."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._lock = Lock()
        self._offset_s: float | None = None
        self._noted_s = 0.0

    def note(self, stamp_s: float) -> None:
        """Note the reading that an answer carried."""
        now_s = self._clock.now_s()
        with self._lock:
            offset_s = stamp_s - now_s
            if self._offset_s is not None:
                # Two quartzes differ by less than the drift allowed for.
                offset_s = max(offset_s, self._offset_s - _DRIFT * (now_s - self._noted_s))
            self._offset_s, self._noted_s = offset_s, now_s

    def forget(self) -> None:
        """Begin anew: it is another station, or the same one started again."""
        with self._lock:
            self._offset_s = None

    def now_s(self) -> float:
        """Return a time that the station's clock has surely reached; -inf before any answer."""
        now_s = self._clock.now_s()
        with self._lock:
            if self._offset_s is None:
                return float("-inf")
            return now_s + self._offset_s - _DRIFT * (now_s - self._noted_s)


class SequenceGuard:
    """Lets each number of a session pass once, though not always in order; any thread."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._newest = 0
        self._seen: set[int] = set()

    def check(self, number: int) -> None:
        """Note `number`.

        Raises
        ------
        CommandExpired
            It was here before, or is too far behind to know.
        """
        with self._lock:
            if number in self._seen or number <= self._newest - _WINDOW:
                raise CommandExpired(f"command {number} came a second time and was not carried out")
            self._seen.add(number)
            self._newest = max(self._newest, number)
            if len(self._seen) > 2 * _WINDOW:
                self._seen = {each for each in self._seen if each > self._newest - _WINDOW}


def check_age(clock: Clock, until_s: float, what: str) -> None:
    """Raise when `clock` is past `until_s`.

    Raises
    ------
    CommandExpired
        It is, or `until_s` is no number.
    """
    late_s = clock.now_s() - until_s
    if not late_s <= 0.0:
        raise CommandExpired(f"{what} came {late_s:.1f} s too late and was not carried out")
