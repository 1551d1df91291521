"""A wire from a counter of a board to the trigger input of a camera."""

import math
from collections import deque
from dataclasses import dataclass
from threading import Lock
from typing import Final

_REMEMBERED: Final = 32
_ROUNDING: Final = 1e-9


@dataclass(slots=True)
class _Train:
    first_s: float
    period_s: float
    until_s: float = math.inf

    def next_edge_s(self, from_s: float) -> float:
        turns = math.ceil((from_s - self.first_s) / self.period_s - _ROUNDING)
        edge_s = self.first_s + max(0, turns) * self.period_s
        return edge_s if edge_s < self.until_s else math.inf


class TriggerLine:
    """Rises again and again while a counter drives it; any thread."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._trains: deque[_Train] = deque(maxlen=_REMEMBERED)

    def drive(self, first_s: float, period_s: float) -> None:
        """Rise at `first_s` of the platform's time, and every `period_s` from then on."""
        with self._lock:
            self._end(first_s)
            self._trains.append(_Train(first_s, period_s))

    def rest(self, now_s: float) -> None:
        """Rise no more from `now_s` on."""
        with self._lock:
            self._end(now_s)

    def next_edge_s(self, from_s: float) -> float:
        """Return when it rises at `from_s` or next after; infinite while nothing drives it."""
        with self._lock:
            return min((each.next_edge_s(from_s) for each in self._trains), default=math.inf)

    def _end(self, now_s: float) -> None:
        if self._trains:
            last = self._trains[-1]
            last.until_s = min(last.until_s, now_s)
