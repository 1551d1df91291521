"""Calls to DAQCo at another station, from threads that may wait and from those that may not."""

from collections.abc import Callable, Mapping
from queue import SimpleQueue
from threading import Lock
from typing import Final, Protocol, TypeVar

from typing_extensions import override

from cosmic.frame.errors import CosmicError, NotAvailable, WrongThreadError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.transport import CALL_TIMEOUT_S, Transport
from cosmic.frame.threads import WorkerThread, forbid_waiting_here

T = TypeVar("T")
SLOW_CALL_S: Final = 20.0
"""Opening boards and closing files may take that long."""
_READS: Final = ("report", "now_s", "folder", "name_recording", "mark")


class Asks(Protocol):
    """Has something done at the station."""

    def __call__(self, function: str, arguments: Mapping[str, object] | None = None, /) -> object:
        """Call `function` there, take the report if it returns one, and return what it returns."""


def may_wait() -> bool:
    """Return whether the calling thread may wait for a line."""
    try:
        forbid_waiting_here("waiting for a station")
    except WrongThreadError:
        return False
    return True


class Errands(WorkerThread):
    """Does one after the other what a window must not wait for."""

    def __init__(self, policy: FailurePolicy) -> None:
        super().__init__("DAQCo errands", policy)
        self._jobs: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._giving = Lock()
        self._over = False

    def give(self, job: Callable[[], None]) -> None:
        """Have `job` done; returns at once.

        Raises
        ------
        NotAvailable
            The application is closed.
        """
        with self._giving:
            if self._over:
                raise NotAvailable("DAQCo is closed")
            self._jobs.put(job)

    @override
    def run_body(self) -> None:
        while (job := self._jobs.get()) is not None:
            try:
                job()
            except Exception as exc:  # noqa: BLE001 - the next errand must not wait for ever
                self._policy.report(exc, "an errand for DAQCo at another station")

    @override
    def request_end(self) -> None:
        super().request_end()
        with self._giving:
            if not self._over:
                self._over = True
                self._jobs.put(None)


class DaqcoLine:
    """One application at one station, as calls; any thread that may wait."""

    def __init__(self, transport: Transport, name: str, errands: Errands) -> None:
        self._transport = transport
        self._name = name
        self._errands = errands

    def call(self, function: str, arguments: Mapping[str, object] | None = None, /) -> object:
        """Call a function there and return its result; raises as `Transport.call`."""
        timeout_s = CALL_TIMEOUT_S if function in _READS else SLOW_CALL_S
        return self._transport.call(self._name, function, arguments, timeout_s=timeout_s)

    def aside(self, job: Callable[[], None]) -> None:
        """Carry out `job` in a thread that may wait; returns at once."""
        self._errands.give(job)

    def carry_out(
        self, action: Callable[[], T], told: Callable[[T | None, CosmicError | None], object]
    ) -> None:
        """Do `action` here, or aside where this thread must not wait, and tell how it ended."""

        def job() -> None:
            try:
                result = action()
            except CosmicError as exc:
                told(None, exc)
            else:
                told(result, None)

        if may_wait():
            job()
            return
        try:
            self.aside(job)
        except NotAvailable as exc:
            told(None, exc)
