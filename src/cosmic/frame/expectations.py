"""What somebody waits for on a fast clock: who brings it in pieces ends a piece there."""

import math
from bisect import bisect_right, insort
from threading import Lock
from typing import Final

from cosmic.frame.events import Event

MOST: Final = 64
"""So many times that nobody has come to are kept; the latest ones go first."""


class Expectations:
    """Times at which somebody wants what there is by then; any thread.

    On a clock that runs faster than the wall samples come in longer pieces, and who waits for some
    would wait for the end of a piece, which a real platform does not know.

    Attributes
    ----------
    added : Event
        There is one more, at this time.
    """

    def __init__(self) -> None:
        self.added: Event[float] = Event("an expectation")
        self._lock = Lock()
        self._times_s: list[float] = []

    def add(self, time_s: float) -> None:
        """Want what there is at `time_s`."""
        if not math.isfinite(time_s):
            return
        with self._lock:
            insort(self._times_s, time_s)
            del self._times_s[MOST:]
        self.added.emit(time_s)

    def next_s(self, after_s: float) -> float:
        """Return the nearest one after `after_s`, inf for none; forgets those before."""
        if not self._times_s:
            return math.inf
        with self._lock:
            del self._times_s[: bisect_right(self._times_s, after_s)]
            return self._times_s[0] if self._times_s else math.inf
