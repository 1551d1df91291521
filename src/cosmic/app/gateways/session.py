"""`GatewaySession`: one program that uses a station through a gateway of this process."""

import logging
import secrets
from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import count
from threading import Lock
from typing import Any, Final

from cosmic.app.gateways.plain import from_json
from cosmic.frame.network.caller import MOVE_LIMIT_S, Access, Caller
from cosmic.frame.network.errors import CallRefused
from cosmic.frame.network.host import KEYS, NUMBER
from cosmic.frame.network.lease import LeaseState
from cosmic.frame.network.ongoing import Answered, Ended, Ticket, Tickets
from cosmic.frame.network.remote import Offered
from cosmic.frame.network.station import Station
from cosmic.frame.network.travelling_errors import from_plain
from cosmic.frame.operation import Operation, Progress

logger = logging.getLogger(__name__)

_MOST_KEPT: Final = 256


@dataclass(frozen=True, slots=True)
class Order:
    """A command as it came, checked and numbered, not yet carried out."""

    application: str
    found: Offered
    arguments: Mapping[str, object]
    caller: Caller

    @property
    def title(self) -> str:
        """What it is, for messages."""
        return f"{self.application}.{self.found.name}"


Approve = Callable[[str, Order, Callable[[], object]], object]
"""`approve(who, order, carry_out)` returns what to answer with: often an operation that waits."""


class GatewaySession:
    """What one program commands through a gateway, and what goes on for it; any thread.

    It commands as a client of the station does: through the lease, the gate and the checks of the
    invoker. `close` it in every case: what it moves stops then.

    Parameters
    ----------
    name : str
        What log and windows show.
    approve : callable or None
        Asked before a command that moves is carried out.
    door : str
        Which gateway: "http" or "epics".
    """

    def __init__(
        self,
        station: Station,
        name: str,
        access: Access,
        approve: Approve | None = None,
        *,
        door: str,
    ) -> None:
        self._station = station
        self._caller = Caller(name, secrets.token_hex(16), access, door=door)
        self._approve = approve
        self._keep_s = MOVE_LIMIT_S
        self._heard_s = station.clock.now_s()
        self._numbers = count(1)
        self._lock = Lock()
        self._operations: OrderedDict[str, Operation[Any]] = OrderedDict()
        self._asked: list[Operation[Any]] = []
        self._tickets = Tickets(self._on_event)
        self._forget = station.lease.subscribe(self._on_lease)

    @property
    def name(self) -> str:
        """What log and windows show."""
        return self._caller.name

    @property
    def in_control(self) -> bool:
        """It holds the right to move."""
        return self._station.lease.holds(self._caller.token)

    @property
    def may_be_silent(self) -> bool:
        """It asked to keep the right to move longer than heartbeats are apart."""
        return self._keep_s > MOVE_LIMIT_S

    def take_control(self, *, in_process: bool = False, keep_s: float = MOVE_LIMIT_S) -> None:
        """Take the right to move, or keep it.

        Parameters
        ----------
        in_process : bool
            Whoever calls sees to it by itself that the program is alive.
        keep_s : float
            How long the program may be silent and keep the right; what it moves ends before.

        Raises
        ------
        MoveRefused
            Another holds it (`NO_LEASE`).
        CallRefused
            This program may not move anything.
        """
        if self._caller.access < Access.MOVE:
            raise CallRefused(f"{self.name} may not move anything")
        token = self._caller.token
        self._station.lease.take(self.name, token, in_process=in_process, keep_s=keep_s)
        self._keep_s = MOVE_LIMIT_S if in_process else keep_s
        self.beat()

    def release_control(self) -> None:
        """Give the right to move back; what moves by it stops."""
        self._tickets.cancel_motion()
        self._station.lease.release(self._caller.token)

    def beat(self) -> None:
        """Note a heartbeat of the program."""
        self._heard_s = self._station.clock.now_s()
        self._station.lease.beat(self._caller.token, self._heard_s)

    def end_silent_motion(self) -> None:
        """End what it moves where it has been silent too long for that; it may keep the right."""
        if self._station.clock.now_s() - self._heard_s > MOVE_LIMIT_S:
            self._tickets.cancel_motion()

    def hang_up(self) -> None:
        """End what it moves, for its last line is gone, and the right unless it may be silent."""
        if self.may_be_silent:
            self._tickets.cancel_motion()
        else:
            self.lose_motion(f"{self.name} hung up")

    def lose_motion(self, why: str) -> None:
        """End what it moves and take the right to move from it."""
        self._station.lease.release(self._caller.token, why)
        self._tickets.cancel_motion()

    def close(self, why: str = "its gateway closes") -> None:
        """End the session; what it moves stops, what waits for approval is taken back.

        Harmless the second time.
        """
        self.lose_motion(why)
        with self._lock:
            asked, self._asked = self._asked, []
        for each in asked:
            each.cancel()
        self._forget()

    # Commands

    def order(
        self,
        application: str,
        function: str,
        arguments: Mapping[str, object],
        keys: tuple[str, ...] = (),
        *,
        door: str = "",
    ) -> Order:
        """Return a command, its arguments made of JSON; a later halt makes it void.

        Parameters
        ----------
        keys : tuple of str
            Of the parts with keys on the way to the command.
        door : str
            How it came, such as "mcp"; by default, the gateway's own.

        Raises
        ------
        CallRefused
            There is no such command, it may not be given, or an argument is not of its kind.
        """
        caller = replace(self._caller, door=door) if door else self._caller
        found = self._station.invoker(application).find(caller, function)
        known = {name: kind for name, kind in found.parameters.items() if name[0] not in "@#"}
        given: dict[str, object] = {}
        for name, value in arguments.items():
            if found.ends:
                given[name] = value
                continue
            if name not in known:
                raise CallRefused(
                    f"{function} takes {', '.join(known) or 'nothing'}, not {str(name)[:60]!r}"
                )
            try:
                given[name] = from_json(value, known[name])
            except CallRefused as exc:
                raise CallRefused(f"{function}: {name}: {exc}") from exc
        if KEYS in found.parameters:
            given[KEYS] = keys
        if NUMBER in found.parameters:
            given[NUMBER] = next(self._numbers)
        return Order(application, found, found.checked(given), caller)

    def carry_out(self, order: Order, still_wanted: Callable[[], None] | None = None) -> object:
        """Carry a command out and return its result; an `Operation` where it goes on.

        Parameters
        ----------
        still_wanted : callable or None
            Called when its turn has come; raises when nobody waits for it any more.

        Raises
        ------
        CosmicError
            What the command raised, or why it was refused.
        """
        mark = order.found.mark
        if self._approve is not None and mark.moves and not mark.at_once:
            asked = self._approve(self.name, order, lambda: self._invoke(order))
            if isinstance(asked, Operation):
                with self._lock:
                    self._asked = [*(each for each in self._asked if not each.done), asked]
            return asked
        return self._invoke(order, still_wanted)

    def _invoke(self, order: Order, still_wanted: Callable[[], None] | None = None) -> object:
        invoker = self._station.invoker(order.application)
        result = invoker.invoke(order.caller, order.found.name, order.arguments, still_wanted)
        wrapped = self._tickets.wrap(result, moves=order.found.mark.moves)
        answer = wrapped.result if isinstance(wrapped, Answered) else wrapped
        if isinstance(answer, Ticket):
            return self._followed(answer.number, answer.title)
        return answer

    def _followed(self, number: str, title: str = "") -> Operation[Any]:
        """Return what stands for something that goes on; the first to ask makes it."""
        with self._lock:
            found = self._operations.get(number)
            if found is None:
                found = self._operations[number] = Operation(title or "a command")
                found.on_cancel(lambda: self._tickets.cancel(number))
                for old in [each for each, one in self._operations.items() if one.done]:
                    if len(self._operations) > _MOST_KEPT:
                        del self._operations[old]
        return found

    def _on_event(self, event: list[object]) -> None:
        number, progress, done, result, error = event
        title = progress.title if isinstance(progress, Progress) else ""
        followed = self._followed(str(number), title)  # it may come before the answer does
        if not done:
            if isinstance(progress, Progress):
                followed.report(progress.fraction, progress.text)
        elif isinstance(result, Ended):
            self._end(followed, result.result, result.error)
        else:
            self._end(followed, result, error)

    @staticmethod
    def _end(followed: Operation[Any], result: object, error: object) -> None:
        if error is None:
            followed.finish(result)
        else:
            followed.fail(from_plain(error))

    def _on_lease(self, _state: LeaseState) -> None:
        if not self.in_control:
            self._tickets.cancel_motion()
