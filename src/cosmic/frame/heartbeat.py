"""`HeartbeatWatch`: notices threads that hang in a driver, which nobody else would tell of."""

from collections.abc import Callable, Sequence
from typing import Final

from typing_extensions import override

from cosmic.frame.failure import FailurePolicy
from cosmic.frame.threads import WorkerThread

STALL_S: Final = 5.0
"""So long a call of a driver may take before it is told."""
OPEN_S: Final = 20.0
"""The same while a device is opened, which may look for it in several places."""
_LOOK_S: Final = 0.125  # looks add up to whole seconds


class Heartbeat:
    """Says that a thread goes round.

    Parameters
    ----------
    on_stall : callable
        Takes for how many seconds the thread has hung, and 0.0 when it goes on again; called in
        the thread of the watch.
    """

    def __init__(self, on_stall: Callable[[float], None]) -> None:
        self._on_stall = on_stall
        self._beats = self._seen = 0
        self._allowed_s = STALL_S
        self._missed_s = 0.0
        self._stalled = False

    def beat(self, allowed_s: float = STALL_S) -> None:
        """Say that the thread goes on; the next beat is due within `allowed_s` of wall time."""
        self._allowed_s = allowed_s
        self._beats += 1

    def end(self) -> None:
        """Say that the thread ends, and is not to be watched any more."""
        self._beats = 0

    def overdue(self, by_s: float) -> bool:
        """Tell whether a call, waits that were announced aside, takes longer than `by_s`."""
        beats = self._beats
        announced_s = max(0.0, self._allowed_s - STALL_S)
        return 0 < beats == self._seen and self._missed_s >= announced_s + by_s

    def look(self, passed_s: float) -> None:
        """Tell whether there was no beat for too long, or there is one again; thread of the watch.

        A computer that stood still as a whole is no reason: looks are counted, not seconds.
        """
        beats = self._beats
        if beats != self._seen or beats == 0:
            self._seen, self._missed_s = beats, 0.0
            if self._stalled:
                self._stalled = False
                self._on_stall(0.0)
            return
        self._missed_s += passed_s
        if self._missed_s >= self._allowed_s and not self._stalled:
            self._stalled = True
            self._on_stall(self._missed_s)


class HeartbeatWatch(WorkerThread):
    """Looks at heartbeats eight times a second."""

    def __init__(self, name: str, beats: Sequence[Heartbeat], policy: FailurePolicy) -> None:
        super().__init__(name, policy)
        self._heartbeats = tuple(beats)

    def add(self, beats: Sequence[Heartbeat]) -> None:
        """Look at more of them from now on; by the thread that started the watch."""
        self._heartbeats = (*self._heartbeats, *beats)

    @override
    def run_body(self) -> None:
        while not self._end_requested.wait(_LOOK_S):
            for each in self._heartbeats:
                each.look(_LOOK_S)
