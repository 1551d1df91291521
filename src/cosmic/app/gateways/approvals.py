"""`Approvals`: what a program wants to move waits here until a person says yes or no."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import count
from threading import Lock
from typing import Any, Final

from cosmic.app.gateways.session import Order
from cosmic.frame.clock import WALL
from cosmic.frame.declaration import Declared, command, state
from cosmic.frame.errors import CosmicError, NotAvailable, OperationCancelled
from cosmic.frame.events import Event
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.job_queue import JobQueue
from cosmic.frame.network.caller import Access, current_call
from cosmic.frame.network.errors import CallRefused
from cosmic.frame.network.host import KEYS
from cosmic.frame.operation import Operation

MOST: Final = 32
LONGEST_S: Final = 300.0
"""What waits longer is refused."""
OWN_DOOR: Final = "station"
"""Clients that come by another door cannot approve, least of all themselves."""


@dataclass(frozen=True, slots=True)
class Asked:
    """A command that waits.

    Attributes
    ----------
    number : int
        By which it is approved.
    who : str
        The program that wants it.
    what : str
        The command, such as "mico.axes.begin".
    details : str
        Its arguments, for a person to read.
    since_s : float
        Wall time of this station.
    """

    number: int
    who: str
    what: str
    details: str
    since_s: float


@dataclass(slots=True)
class _Waiting:
    asked: Asked
    carry_out: Callable[[], object]
    operation: Operation[Any]


class Approvals(Declared):
    """The queue of commands that wait for a person; any thread. At last `close`.

    Attributes
    ----------
    decided : Event
        `decided(asked, approved)` is emitted when a person at this station has decided.
    """

    def __init__(self, policy: FailurePolicy) -> None:
        self.decided: Event[[Asked, bool]] = Event()
        self._lock = Lock()
        self._numbers = count(1)
        self._waiting: dict[int, _Waiting] = {}
        self._queue = JobQueue("approved commands", policy)

    @property
    @state
    def waiting(self) -> tuple[Asked, ...]:
        """What waits, oldest first."""
        self._drop_old()
        with self._lock:
            return tuple(each.asked for each in self._waiting.values())

    @command
    def approve(self, number: int) -> None:
        """Have a command carried out; lease and gate look at it then.

        Raises
        ------
        NotAvailable
            It does not wait any more.
        CallRefused
            Whoever approves came through a gateway, or may not move anything.
        """
        _check_person()
        found = self._taken(number)
        self._publish(found.asked, approved=True)
        self._queue.submit(lambda: self._carry_out(found), found.asked.what)

    @command
    def refuse(self, number: int, why: str = "") -> None:
        """Refuse a command; raises as `approve`."""
        _check_person()
        found = self._taken(number)
        self._publish(found.asked, approved=False)
        found.operation.fail(OperationCancelled(f"the operator refused it. {why}".strip()))

    def ask(self, who: str, order: Order, carry_out: Callable[[], object]) -> Operation[Any]:
        """Have a command wait; the operation ends as the command does.

        Raises
        ------
        CallRefused
            Too many wait.
        """
        with self._lock:
            if len(self._waiting) >= MOST:
                raise CallRefused(f"{MOST} commands wait for approval already")
            number = next(self._numbers)
            asked = Asked(number, who, order.title, _said(order), WALL.now_s())
            made: Operation[Any] = Operation(f"{order.title} waits for approval")
            self._waiting[number] = _Waiting(asked, carry_out, made)
        made.on_cancel(lambda: self._cancel(number))
        made.report(0.0, "waits for approval")
        self.note_change()
        return made

    def close(self) -> None:
        """Refuse what waits; any state."""
        with self._lock:
            left, self._waiting = list(self._waiting.values()), {}
        for each in left:
            each.operation.fail(NotAvailable("the station closes"))
        self._queue.request_end()
        self._queue.join()

    def _publish(self, asked: Asked, *, approved: bool) -> None:
        if current_call() is None:
            self.decided.emit(asked, approved)

    def _taken(self, number: int) -> _Waiting:
        self._drop_old()
        with self._lock:
            found = self._waiting.pop(number, None)
        if found is None:
            raise NotAvailable(f"command {number} does not wait any more")
        self.note_change()
        return found

    def _cancel(self, number: int) -> None:
        with self._lock:
            found = self._waiting.pop(number, None)
        if found is not None:
            found.operation.fail(OperationCancelled("taken back before it was approved"))
            self.note_change()

    def _drop_old(self) -> None:
        before_s = WALL.now_s() - LONGEST_S
        with self._lock:
            old = [each for each in self._waiting.values() if each.asked.since_s < before_s]
            for each in old:
                del self._waiting[each.asked.number]
        for each in old:
            each.operation.fail(NotAvailable(f"nobody approved it within {LONGEST_S:g} s"))

    @staticmethod
    def _carry_out(found: _Waiting) -> None:
        operation = found.operation
        if operation.cancel_requested:  # while it waited for others that were approved
            operation.fail(OperationCancelled("taken back before it was begun"))
            return
        try:
            result = found.carry_out()
        except CosmicError as exc:
            operation.fail(exc)
            return
        if not isinstance(result, Operation):
            operation.finish(result)
            return
        inner: Operation[Any] = result
        operation.on_cancel(inner.cancel)

        def end(ended: Operation[Any]) -> None:
            if ended.failure is not None:
                operation.fail(ended.failure)
            else:
                operation.finish(ended.result)

        inner.add_callback(end)


def _check_person() -> None:
    call = current_call()
    if call is None:
        return
    if call.caller.door != OWN_DOOR or call.caller.access < Access.MOVE:
        raise CallRefused(f"{call.caller.name} cannot approve: a person at a window does")


def _said(order: Order) -> str:
    given = order.arguments
    of = given.get(KEYS)
    parts = [" ".join(map(str, of))] if isinstance(of, tuple) and of else []
    parts += [f"{name}={value!r}"[:200] for name, value in given.items() if name[0] not in "@#"]
    return ", ".join(parts)[:500]
