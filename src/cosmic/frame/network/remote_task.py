"""What goes on at another station, followed from here."""

import logging
from collections.abc import Callable
from threading import Condition, Lock
from typing import Any, Final

from cosmic.frame.errors import CosmicError, DeviceTimeout, ProtocolError
from cosmic.frame.listeners import tell
from cosmic.frame.network.codec import decode
from cosmic.frame.network.errors import StationAway
from cosmic.frame.network.ongoing import Ticket
from cosmic.frame.network.travelling_errors import from_plain
from cosmic.frame.task import Progress
from cosmic.frame.threads import forbid_waiting_here

logger = logging.getLogger(__name__)

_EARLY_LIMIT: Final = 256


class RemoteTask:
    """A task or a movement at another station; any thread.

    It has what both have: `done`, `success`, `exception`, `wait`, `cancel`, `add_callback`,
    `progress` and `subscribe`. When the connection is lost it ends with `StationAway`.
    """

    def __init__(self, ticket: Ticket, cancel: Callable[[str], None]) -> None:
        self._ticket = ticket
        self._cancel = cancel
        self._changed = Condition()
        self._done = False
        self._result: object = None
        self._error: CosmicError | None = None
        self._progress: Progress | None = None
        self._callbacks: list[Callable[[RemoteTask], None]] = []
        self._listeners: list[Callable[[Progress], None]] = []

    @property
    def title(self) -> str:
        """What is being done."""
        return self._ticket.title

    @property
    def done(self) -> bool:
        """True when it has ended, well or not."""
        return self._done

    @property
    def success(self) -> bool:
        """True when it has ended well."""
        return self._done and self._error is None

    @property
    def progress(self) -> Progress | None:
        """How far it is, where it tells."""
        return self._progress

    def exception(self, timeout: float | None = 0.0) -> CosmicError | None:
        """Return why it failed, or None; waits up to `timeout` s for its end."""
        self._wait(timeout)
        return self._error

    def wait(self, timeout_s: float | None = None) -> object:
        """Wait for the end and return its result; raises what it failed with.

        Raises
        ------
        DeviceTimeout
            It had not ended after `timeout_s` of wall time; it goes on.
        StationAway
            The connection was lost.
        WrongThreadError
            Called in the GUI thread.
        """
        self._wait(timeout_s)
        if self._error is not None:
            raise self._error
        return self._result

    def cancel(self) -> None:
        """End it early; what it has set in motion is stopped."""
        if not self._done:
            self._cancel(self._ticket.number)

    def add_callback(self, callback: "Callable[[RemoteTask], None]") -> None:
        """Call `callback(self)` at its end, or now if it has ended."""
        with self._changed:
            if not self._done:
                self._callbacks.append(callback)
                return
        tell([callback], self)

    def subscribe(self, listener: Callable[[Progress], None]) -> None:
        """Call `listener(progress)` at each step that is told."""
        with self._changed:
            self._listeners.append(listener)
            progress = self._progress
        if progress is not None:
            tell([listener], progress)

    def _wait(self, timeout_s: float | None) -> None:
        if not self._done:
            forbid_waiting_here(f"waiting for {self.title!r}")
        with self._changed:
            if not self._changed.wait_for(lambda: self._done, timeout_s):
                raise DeviceTimeout(f"{self.title} had not ended after {timeout_s:g} s")

    # For whoever hears of it

    def note_progress(self, progress: Progress) -> None:
        """Note how far it is."""
        self._progress = progress
        tell(tuple(self._listeners), progress)

    def end(self, result: object, error: CosmicError | None) -> None:
        """Note that it has ended."""
        with self._changed:
            if self._done:
                return
            self._done, self._result, self._error = True, result, error
            callbacks, self._callbacks = self._callbacks, []
            self._changed.notify_all()
        tell(callbacks, self)


class RemoteTasks:
    """The tasks of one connection; any thread."""

    def __init__(self, cancel: Callable[[str], None]) -> None:
        self._cancel = cancel
        self._lock = Lock()
        self._running: dict[str, RemoteTask] = {}
        # An end may overtake the answer that names its ticket.
        self._early: dict[str, list[list[Any]]] = {}

    def made(self, ticket: Ticket) -> RemoteTask:
        """Return the task for a ticket that a call returned."""
        task = RemoteTask(ticket, self._cancel)
        with self._lock:
            self._running[ticket.number] = task
            early = self._early.pop(ticket.number, [])
        for event in early:
            self._apply(task, event)
        return task

    def on_message(self, message: bytes) -> None:
        """Take what the station tells of a task."""
        try:
            event = decode(message)
            if not (isinstance(event, list) and len(event) == 5 and isinstance(event[0], str)):
                raise ProtocolError("a broken event came")
            with self._lock:
                task = self._running.get(event[0])
                if task is None:
                    self._early.setdefault(event[0], []).append(event)
                    while len(self._early) > _EARLY_LIMIT:
                        del self._early[next(iter(self._early))]
            if task is not None:
                self._apply(task, event)
        except ProtocolError as exc:
            logger.warning("ignored: %s", exc)

    def give_up(self, why: str) -> None:
        """End all of them: nobody will tell how they go on."""
        with self._lock:
            tasks, self._running = list(self._running.values()), {}
            self._early.clear()
        for task in tasks:
            task.end(None, StationAway(why))

    def _apply(self, task: RemoteTask, event: list[Any]) -> None:
        number, progress, done, result, error = event
        if isinstance(progress, Progress):
            task.note_progress(progress)
        if done:
            with self._lock:
                self._running.pop(number, None)
            task.end(result, None if error is None else from_plain(error))
