"""How fast a simulated time runs: many times as fast as the wall, but not while somebody thinks.

What takes time on the simulated platform may be over sooner on the wall. What takes computing time
may not: it takes as long on a real platform, and does not become longer there because the rest is
hurried. So while a procedure is under way the time runs at its rate only as long as everybody
waits for it, and as the wall does while somebody is at work.

What a busy computer is late with is no trouble of the platform either: who must keep up with the
time says how far it may go, and it waits there for everybody at once. And who brings something in
pieces, which are longer on a fast clock, ends one where somebody waits for it.
"""

import math
import threading
from bisect import bisect_right, insort
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final

from typing_extensions import override

from cosmic.frame.events import Event

LOOK_S: Final = 0.02
"""How often somebody looks again who waits while others work, and may miss their end; wall time."""
LATE_S: Final = 0.0005
"""How much too late somebody may wake who is not woken for it, wall time."""
LONGEST_HOLD_S: Final = 3.0
"""The time waits so long and then goes on without all who were silent meanwhile, wall time."""
MOST_EXPECTED: Final = 64
"""So many times that nobody has come to are kept; the latest ones go first."""
REACHED_EVERY_S: Final = 0.25
REACHED_MARKS: Final = 8
"""The rate reached is that of the last two seconds."""


class Horizon:
    """How far the time may go before somebody has kept up; any thread. This one is for ever."""

    def move_to(self, until_s: float) -> None:  # noqa: ARG002 - for clocks that wait
        """Let the time go to `until_s`, inf for without end."""
        return

    def close(self) -> None:
        """Be no limit any more; harmless the second time."""
        return


class Worker:
    """Somebody whose work takes wall time; any thread. This one works on a clock without a rate."""

    def busy(self) -> None:
        """Say that it is at work; harmless the second time."""
        return

    def idle(self) -> None:
        """Say that it waits; harmless the second time."""
        return

    def close(self) -> None:
        """Say that there will be no more of it."""
        return


@dataclass(frozen=True, slots=True)
class _Wait:
    """Somebody waits on `condition` until `due_s`, and looks again at `look_wall_s`."""

    condition: threading.Condition
    due_s: float
    look_wall_s: float


class TimeScale:
    """A time that runs `rate` times as fast as the wall, and never slower than the smaller of both.

    It does not run beyond the nearest horizon, and does not make up for it later. After
    `LONGEST_HOLD_S` at a horizon that does not move it goes on without the one whose it is, and
    without all who said nothing meanwhile, until they do again: who hangs must not stop everybody
    for ever, nor for as many times as long as there are others that wait for it.

    It is bound to the wall only while there is a worker that leads: one who waits for the time,
    and whose next step depends on when it comes. Then it runs like the wall while a worker is
    busy, and from when one who waits is due until that one goes on.

    Parameters
    ----------
    rate : float
        Seconds for each second of the wall.
    wall_s : callable
        Tells the time of the wall.
    """

    def __init__(self, rate: float, wall_s: Callable[[], float]) -> None:
        self._rate = rate
        self._read_wall_s = wall_s
        self._lock = threading.Lock()
        self._wall_s = wall_s()
        self._now_s = 0.0
        self._leading = 0
        self._busy = 0
        self._waits: dict[object, _Wait] = {}
        self._slow = min(rate, 1.0)
        self._horizons: dict[object, float] = {}
        self._heard_wall_s: dict[object, float] = {}
        self._limit_s = math.inf
        self._held_wall_s: float | None = None
        self._marks = deque([(self._wall_s, 0.0)], maxlen=REACHED_MARKS)

    @property
    def reached(self) -> float:
        """Seconds for each second of the wall, over the last two of them."""
        with self._lock:
            now_s = self._settle()
            wall_s, then_s = self._marks[0]
            passed_s = self._wall_s - wall_s
            return (now_s - then_s) / passed_s if passed_s > 0.1 else self._rate

    def move_horizon(self, token: object, until_s: float | None) -> None:
        """Let the time run to `until_s` as far as `token` goes; None: it has no horizon."""
        with self._lock:
            now_s = self._settle()
            before_s, held = self._limit_s, self._held_wall_s is not None
            if until_s is None or until_s == math.inf:
                self._forget(token)
            else:
                self._horizons[token], self._heard_wall_s[token] = until_s, self._wall_s
            self._limit_s = min(self._horizons.values(), default=math.inf)
            if self._limit_s <= before_s:
                return
            self._held_wall_s = None
            late = [each for each in self._waits.values() if self._late(each, now_s)]
        if held:
            _wake(late)

    def now_s(self) -> float:
        """Return the time; while another thread brings it up to the wall, what it was before.

        That thread may have to wait for the interpreter, and a stop reads the time.
        """
        if not self._lock.acquire(blocking=False):
            return self._now_s
        try:
            return self._settle()
        finally:
            self._lock.release()

    def begin_wait(self, token: object, condition: threading.Condition, until_s: float) -> float:
        """Note that somebody waits for `until_s`; return how long to wait, in wall time.

        Who waits too long keeps the time from hurrying on, no more; who wakes too early, waits on.
        While there is a worker that leads, only who is due next need wake in time: the time runs
        as the wall does from then until that one goes on, and works or waits again.
        """
        with self._lock:
            now_s = self._settle()
            left_s = until_s - now_s
            if left_s <= 0.0:
                return 0.0
            wait_s = left_s / self._rate
            if self._held_wall_s is not None:
                wait_s += LOOK_S  # and is woken when the time goes on
            following = self._following()
            if self._leading and (self._busy or (following and following.due_s < until_s)):
                wait_s = max(wait_s, min(left_s, LOOK_S))
            self._waits[token] = _Wait(condition, until_s, self._wall_s + wait_s)
            late = self._woken(now_s)
        _wake(each for each in late if each.due_s < until_s)
        return wait_s

    def end_wait(self, token: object) -> None:
        """Note that it goes on."""
        with self._lock:
            self._settle()
            self._waits.pop(token, None)

    def change(self, *, busy: int = 0, leading: int = 0) -> None:
        """Count workers in and out, and wake who would wait too long from now on."""
        with self._lock:
            now_s = self._settle()
            self._busy += busy
            self._leading += leading
            late = self._woken(now_s)
        _wake(late)

    def _following(self) -> _Wait | None:
        """Return who is due next."""
        return min(self._waits.values(), key=lambda each: each.due_s, default=None)

    def _woken(self, now_s: float) -> list[_Wait]:
        """Return who would wake too late, where it matters: nobody is at work."""
        if self._busy:
            return []
        following = self._following()
        if self._leading and following is not None:
            return [following] if self._late(following, now_s) else []
        return [each for each in self._waits.values() if self._late(each, now_s)]

    def _late(self, wait: _Wait, now_s: float) -> bool:
        due_wall_s = self._wall_s + (wait.due_s - now_s) / self._rate
        return wait.look_wall_s > due_wall_s + LATE_S

    def _settle(self) -> float:
        """Bring the time up to the wall, with what was in force since the last time; locked."""
        wall_s = self._read_wall_s()
        passed_s, self._wall_s = wall_s - self._wall_s, wall_s
        fast_s = passed_s
        if self._leading and self._busy:
            fast_s = 0.0
        elif self._leading:
            due_s = min((each.due_s for each in self._waits.values()), default=math.inf)
            ahead_s = due_s - self._now_s
            fast_s = min(passed_s, max(0.0, ahead_s / self._rate))
        self._go_on(fast_s * self._rate + (passed_s - fast_s) * self._slow)
        if wall_s - self._marks[-1][0] >= REACHED_EVERY_S:
            self._marks.append((wall_s, self._now_s))
        return self._now_s

    def _go_on(self, by_s: float) -> None:
        """Move the time on, but not beyond the nearest horizon while that is waited for."""
        to_s = self._now_s + by_s
        if to_s < self._limit_s:
            self._now_s, self._held_wall_s = to_s, None
            return
        if self._held_wall_s is None:
            self._held_wall_s = self._wall_s
        if self._wall_s - self._held_wall_s <= LONGEST_HOLD_S:
            self._now_s = max(self._now_s, self._limit_s)
            return
        for token, until_s in list(self._horizons.items()):
            silent = self._heard_wall_s[token] <= self._held_wall_s
            if silent or until_s <= max(self._limit_s, self._now_s):
                self._forget(token)
        self._limit_s = min(self._horizons.values(), default=math.inf)
        self._held_wall_s = None

    def _forget(self, token: object) -> None:
        self._horizons.pop(token, None)
        self._heard_wall_s.pop(token, None)


def _wake(waits: Iterable[_Wait]) -> None:
    for wait in waits:
        # The caller may hold any lock, so it waits for none: who is missed here looks again.
        if wait.condition.acquire(blocking=False):
            wait.condition.notify_all()
            wait.condition.release()


class ScaledHorizon(Horizon):
    """A horizon of a `TimeScale`; it is none before it is moved for the first time.

    Whoever keeps up moves it again and again, also to where it is.
    """

    def __init__(self, time_scale: TimeScale) -> None:
        self._time_scale = time_scale

    @override
    def move_to(self, until_s: float) -> None:
        self._time_scale.move_horizon(self, until_s)

    @override
    def close(self) -> None:
        self._time_scale.move_horizon(self, None)


class ScaledWorker(Worker):
    """A worker that a `TimeScale` waits for.

    Parameters
    ----------
    leads : bool
        It is why the time is bound to the wall; see `TimeScale`.
    """

    def __init__(self, time_scale: TimeScale, *, leads: bool) -> None:
        self._time_scale = time_scale
        self._leads = leads
        self._lock = threading.Lock()
        self._busy = self._closed = False
        time_scale.change(leading=leads)

    @override
    def busy(self) -> None:
        self._become(busy=True)

    @override
    def idle(self) -> None:
        self._become(busy=False)

    @override
    def close(self) -> None:
        with self._lock:
            if not self._closed:
                self._time_scale.change(busy=-self._busy, leading=-self._leads)
            self._closed, self._busy = True, False

    def _become(self, *, busy: bool) -> None:
        with self._lock:
            if not self._closed and busy is not self._busy:
                self._busy = busy
                self._time_scale.change(busy=1 if busy else -1)


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
        self._lock = threading.Lock()
        self._times_s: list[float] = []

    def add(self, time_s: float) -> None:
        """Want what there is at `time_s`."""
        if not math.isfinite(time_s):
            return
        with self._lock:
            insort(self._times_s, time_s)
            del self._times_s[MOST_EXPECTED:]
        self.added.emit(time_s)

    def next_s(self, after_s: float) -> float:
        """Return the nearest one after `after_s`, inf for none; forgets those before."""
        if not self._times_s:
            return math.inf
        with self._lock:
            del self._times_s[: bisect_right(self._times_s, after_s)]
            return self._times_s[0] if self._times_s else math.inf
