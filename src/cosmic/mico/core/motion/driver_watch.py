"""`DriverCalls`: notices a library that does not return, and stops past it all the same."""

from collections.abc import Callable
from functools import partial
from typing import Final

from cosmic.frame.failure import FailurePolicy
from cosmic.frame.heartbeat import Heartbeat
from cosmic.frame.job_queue import JobQueue
from cosmic.frame.threads import JOIN_TIMEOUT_S, WorkerThread

_KNOWN_TO_HANG_S: Final = 0.5
SUSPECT_S: Final = 1.0
"""After so long in a call a device may hang: others stop it in a thread of its own."""


class DriverCalls:
    """Whether the two threads of a device come back from the library; any thread.

    Attributes
    ----------
    device, listener : Heartbeat
        Of the thread that commands and of the one that receives.

    Parameters
    ----------
    on_stall : callable
        Takes for how many seconds a call has not returned, and 0.0 once all have; called in
        the thread of the watch.
    """

    def __init__(self, name: str, policy: FailurePolicy, on_stall: Callable[[float], None]) -> None:
        self.device = Heartbeat(partial(self._on_stall, 0))
        self.listener = Heartbeat(partial(self._on_stall, 1))
        self._stalled: set[int] = set()
        self._report = on_stall
        self._stops = JobQueue(f"stop of {name}", policy)
        self._stopped_past = False

    @property
    def suspect(self) -> bool:
        """Whether a call of the library may hang."""
        return self.device.overdue(SUSPECT_S) or self.listener.overdue(SUSPECT_S)

    def past(self, call: Callable[[], None]) -> None:
        """Make a call that stops in another thread, for it may hang in it; returns at once.

        That thread makes one after the other; the device thread repeats each when it comes back.
        """
        self._stopped_past = True
        self._stops.submit(call, "stop")

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
