"""`DriverCalls`: notices a library that does not return, and stops past it all the same."""

import math
from collections.abc import Callable
from functools import partial
from typing import Final

from cosmic.frame.failure import FailurePolicy
from cosmic.frame.heartbeat import Heartbeat
from cosmic.frame.job_queue import JobQueue
from cosmic.frame.threads import JOIN_TIMEOUT_S, WorkerThread

_KNOWN_TO_HANG_S: Final = 0.5
SUSPECT_S: Final = 0.5
"""After so long in a call, and one look, a device may hang: others stop it in another thread."""
LATE_S: Final = 1.0
"""A stop from which the library has not returned by then is told not to be carried out."""


class DriverCalls:
    """Whether the two threads of a device come back from the library; any thread.

    Attributes
    ----------
    device, listener, stops : Heartbeat
        Of the thread that commands, of the one that receives, and of whoever stops.

    Parameters
    ----------
    on_stall, on_late_stop : callable
        Take for how many seconds a call, or one that stops, has not returned, and 0.0 once all
        have; called in the thread of the watch.
    """

    def __init__(
        self,
        name: str,
        policy: FailurePolicy,
        on_stall: Callable[[float], None],
        on_late_stop: Callable[[float], None],
    ) -> None:
        self.device = Heartbeat(partial(self._on_stall, 0))
        self.listener = Heartbeat(partial(self._on_stall, 1))
        self.stops = Heartbeat(on_late_stop)
        self._stopping: set[object] = set()
        self._watching = False
        self._stalled: set[int] = set()
        self._report = on_stall
        self._stops = JobQueue(f"stop of {name}", policy)
        self._stopped_past = False

    @property
    def suspect(self) -> bool:
        """Whether a call of the library may hang."""
        every = (self.device, self.listener, self.stops)
        return any(each.overdue(SUSPECT_S) for each in every)

    def stop(self, call: Callable[[], None]) -> None:
        """Make a call that stops; where it may hang in the library, in another thread.

        That thread makes one after the other; the device thread repeats each when it comes back.
        """
        if not self.suspect:
            self._watched(call)
            return
        self._stopped_past = True
        self._stops.submit(partial(self._watched, call), "stop")

    def _watched(self, call: Callable[[], None]) -> None:
        mine = object()
        self._stopping.add(mine)
        # A further stop does not begin the wait for one that hangs anew.
        if not self._watching:
            self._watch()
        try:
            call()
        finally:
            self._stopping.discard(mine)
            self._watch()

    def _watch(self) -> None:
        """Watch as long as somebody stops; without a lock, for no stop waits for another."""
        while True:
            self._watching = stopping = bool(self._stopping)
            self.stops.beat(LATE_S if stopping else math.inf)
            if bool(self._stopping) is stopping:
                return

    def _on_stall(self, which: int, stalled_s: float) -> None:
        before = bool(self._stalled)
        (self._stalled.add if stalled_s else self._stalled.discard)(which)
        if bool(self._stalled) != before:
            self._report(stalled_s)

    def end(self) -> list[WorkerThread]:
        """End the thread that stops, after the stops that it was given; return it if it hangs."""
        if not self._stopped_past:
            return []
        self._stops.submit(self._stops.request_end, "the end")
        return [] if self._stops.join(self.join_s) else [self._stops]

    @property
    def join_s(self) -> float:
        """How long the end of a thread that may hang in the library is waited for."""
        return _KNOWN_TO_HANG_S if self._stalled else JOIN_TIMEOUT_S
