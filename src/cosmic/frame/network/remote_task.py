"""What goes on at another station, followed from here."""

import logging
from collections.abc import Callable
from threading import Lock
from typing import Any, Final

from cosmic.frame.errors import CosmicError, ProtocolError
from cosmic.frame.network.errors import StationAway
from cosmic.frame.network.ongoing import Ticket
from cosmic.frame.network.travelling_errors import from_plain
from cosmic.frame.operation import Operation, Progress

logger = logging.getLogger(__name__)

_EARLY_LIMIT: Final = 256


class RemoteTask(Operation[object]):
    """A task or a movement at another station; any thread.

    When the connection is lost it ends with `StationAway`.
    """

    def __init__(self, ticket: Ticket, cancel: Callable[[str], None]) -> None:
        super().__init__(ticket.title)
        self.on_cancel(lambda: cancel(ticket.number))

    def end(self, result: object, error: CosmicError | None) -> None:
        """Note that it has ended; for whoever hears of it."""
        if error is not None:
            self.fail(error)
        else:
            self.finish(result)


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
            # Here: without the extra net, where nothing is remote, there is no codec.
            from cosmic.frame.network.codec import decode

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
            task.report(progress.fraction, progress.text)
        if done:
            with self._lock:
                self._running.pop(number, None)
            task.end(result, None if error is None else from_plain(error))
