"""How commands are given to an application at a station: at once, aside, or past all others."""

import logging
from abc import abstractmethod
from collections.abc import Callable, Mapping
from itertools import count
from threading import Lock
from typing import Any, Final, Protocol, get_origin

from cosmic.frame.arguments import reason_of
from cosmic.frame.background import BackgroundJobs
from cosmic.frame.clock import WALL
from cosmic.frame.declaration import UNKNOWN, CommandDeclaration, result_of
from cosmic.frame.errors import CosmicError, MoveCancelled, NotAvailable, ProtocolError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.conform import Mismatch, conform
from cosmic.frame.network.host import KEYS, NUMBER, command_name
from cosmic.frame.network.known_state import Address
from cosmic.frame.network.ongoing import Answered, Ended, Ongoing
from cosmic.frame.network.remote_task import RemoteTask
from cosmic.frame.network.transport import Transport
from cosmic.frame.network.travelling_errors import from_plain
from cosmic.frame.operation import Operation, Progress
from cosmic.frame.threads import may_wait_here

logger = logging.getLogger(__name__)

STOP_LIMIT_S: Final = 1.0
"""How long the answer to what overtakes everything may take."""
RENEW_LIMIT_S: Final = 0.2
"""What keeps something alive is worth nothing later than this."""
_REMEMBERED: Final = 64


class KnownSide(Protocol):
    """What is known of the application; `ApplicationLink`."""

    @property
    @abstractmethod
    def station(self) -> str:
        """Name of the station; empty before it was heard of."""

    @abstractmethod
    def take(self, payload: object) -> bool:
        """Take state that came with an answer; False where the rest has to be asked for first."""

    @abstractmethod
    def fetch(self) -> None:
        """Ask the station how things stand."""

    @abstractmethod
    def note_command(self, name: str, arguments: Mapping[str, object]) -> None:
        """Take note that a command was carried out."""

    @abstractmethod
    def publish(self, changed: list[tuple[str, ...]]) -> None:
        """Have the proxies at those addresses say that something changed."""


class StationCommands:
    """Gives the commands of one application at one station; any thread.

    A thread that may wait gets the answer. In one that must not, such as a window's, what takes a
    while is begun aside, what overtakes everything is sent past all else, and of what keeps
    something alive only the newest word counts.

    Parameters
    ----------
    name : str
        Under which the station hosts the application.
    """

    def __init__(
        self, transport: Transport, name: str, policy: FailurePolicy, known: KnownSide
    ) -> None:
        self._transport = transport
        self._name = name
        self._policy = policy
        self._known = known
        self._background = BackgroundJobs(f"{name} background", policy)
        self._ends = BackgroundJobs(f"{name} ends", policy)
        self._commands = BackgroundJobs(f"{name} commands", policy)
        self._stops = BackgroundJobs(f"{name} stops", policy)
        self._renewals = BackgroundJobs(f"{name} keeps alive", policy)
        self._newest: dict[tuple[str, ...], Callable[[], object]] = {}
        self._numbers = count(1)
        self._moving: set[Operation[Any]] = set()
        self._lock = Lock()
        self._answers: dict[object, tuple[float, object]] = {}
        self._asked: set[object] = set()
        self._refused: dict[tuple[str, ...], str] = {}

    @property
    def moves(self) -> bool:
        """Something that was begun from here still moves."""
        with self._lock:
            return bool(self._moving)

    def end_motion(self) -> None:
        """Have everything stop that was begun here, before this end closes."""
        with self._lock:
            moving = list(self._moving)
        for each in moving:
            try:
                each.cancel()
            except CosmicError as exc:
                logger.warning("what was begun here stops by the lease only: %s", exc)

    def close(self) -> None:
        """End the threads; a stop that was asked for is sent before."""
        until_s = WALL.now_s() + STOP_LIMIT_S
        while self._stops.waiting and WALL.now_s() < until_s:
            WALL.sleep(0.005)
        threads = (self._background, self._commands, self._ends, self._stops, self._renewals)
        for thread in threads:
            thread.request_end()
        for thread in threads:
            if not thread.join():
                logger.error("%s does not end", thread.name)

    def call(
        self, address: Address, command: CommandDeclaration, arguments: dict[str, object]
    ) -> object:
        """Give a command and return its result; the state that comes with it is known then.

        Raises
        ------
        StationAway, StationTimeout
            The station cannot be reached, or did not answer in time.
        NotAvailable
            This thread must not wait, and the answer is not known yet.
        CosmicError
            What the command raised there.
        """
        need = command.need
        if not need.reads and not need.renews:
            self._note_refusal(address, "")
        if need.at_once:  # it is carried out whatever reason it is given
            arguments = {
                name: reason_of(value) if command.parameters.get(name) is str else value
                for name, value in arguments.items()
            }
        if need.moves or need.at_once:
            arguments = {**arguments, NUMBER: next(self._numbers)}
        return self._manner(command)(address, command, arguments)

    def _manner(
        self, command: CommandDeclaration
    ) -> Callable[[Address, CommandDeclaration, dict[str, object]], object]:
        """Return how a command is given in this thread."""
        need = command.need
        if need.renews:
            return self._renew
        if need.remembered_s:
            return self._remembered
        if may_wait_here():
            return self._asked_now
        if need.at_once and command.result in (None, type(None)):
            return self._overtake
        if operation_kind(command.result) is not None:
            return self._begun_aside
        return self._done_aside if need.aside else self._asked_now

    def _remembered(
        self, address: Address, command: CommandDeclaration, arguments: dict[str, object]
    ) -> object:
        """Return the last answer while it is good; a thread that must not wait gets no newer."""
        key = (address.at, command.name, repr(sorted(arguments.items())))
        at_s, found = self._answers.get(key, (-float("inf"), UNKNOWN))
        if WALL.now_s() - at_s >= command.need.remembered_s:
            if may_wait_here():
                found = self._ask(key, address, command, arguments)
            else:
                self._ask_aside(key, address, command, arguments)
        if isinstance(found, CosmicError):
            raise found.with_traceback(None)
        if found is UNKNOWN:
            found = command.need.meanwhile
        if found is UNKNOWN:
            raise NotAvailable(f"{self._known.station or 'the station'} is being asked")
        return found

    def refused(self, address: Address) -> str:
        """Return why the last wish of a window about an object was not granted; or empty."""
        return self._refused.get(address.at, "")

    def _note_refusal(self, address: Address, text: str) -> None:
        before = self._refused.get(address.at, "")
        self._refused[address.at] = text
        if text:
            logger.warning("%s %s: %s", self._name, " ".join(address.at), text)
        if before != text:
            self._known.publish([address.at])

    def _done_aside(
        self, address: Address, command: CommandDeclaration, arguments: dict[str, object]
    ) -> None:
        """Do something aside, for a thread that must not wait."""

        def on_result(_result: object, error: CosmicError | None) -> None:
            if error is not None:
                self._note_refusal(address, str(error))

        self._commands.do(lambda: self._asked_now(address, command, arguments), on_result)

    def _renew(
        self, address: Address, command: CommandDeclaration, arguments: dict[str, object]
    ) -> None:
        """Keep something alive without waiting: only the newest word counts."""
        function, sent = self._sent(address, command, arguments)
        key = (*address.at, command.name)

        def send() -> object:
            return self._transport.call(self._name, function, sent, timeout_s=RENEW_LIMIT_S)

        def send_newest() -> object:
            with self._lock:
                newest = self._newest.pop(key)
            return newest()

        def on_result(_result: object, error: CosmicError | None) -> None:
            if error is not None:
                logger.warning("%s: %s", function, error)

        with self._lock:
            waits = key in self._newest
            self._newest[key] = send
        if not waits:
            self._renewals.do(send_newest, on_result)

    def _overtake(
        self, address: Address, command: CommandDeclaration, arguments: dict[str, object]
    ) -> None:
        """Have done past everything what a thread that must not wait wants; loud where it fails."""

        def on_result(_result: object, error: CosmicError | None) -> None:
            if error is not None:
                where = " ".join((command.name, *address.keys))
                self._policy.report(error, f"{where} was NOT carried out at the station")

        self._stops.do(lambda: self._asked_now(address, command, arguments), on_result)

    def _begun_aside(
        self, address: Address, command: CommandDeclaration, arguments: dict[str, object]
    ) -> Operation[Any]:
        """Begin something for a thread that must not wait; what forbids it ends the operation."""
        kind = operation_kind(command.result) or Operation
        known = kind.followed(command.name.replace("_", " ").strip().capitalize())

        def begin() -> object:
            if known.cancel_requested:
                raise MoveCancelled(f"{command.name}: cancelled before it was begun")
            return self._asked_now(address, command, arguments)

        def on_result(begun: object, error: CosmicError | None) -> None:
            if isinstance(begun, Operation):
                begun.add_callback(lambda ended: _end_as(ended, known))
                _go_on_as(begun, known)
            else:
                self._note_refusal(address, str(error or ""))
                known.fail(error or ProtocolError(f"{command.name} began nothing"))

        self._commands.do(begin, on_result)
        return known

    def _followed(self, begun: RemoteTask, command: CommandDeclaration) -> Operation[Any]:
        """Return what ends as `begun` does, once it is known here what that has changed."""
        kind = operation_kind(command.result) or Operation
        known: Operation[Any] = kind.followed(begun.title)
        if command.need.moves:
            with self._lock:
                self._moving.add(known)

        def on_end(ended: RemoteTask) -> None:
            with self._lock:
                self._moving.discard(known)
            how = ended.result if ended.failure is None else None
            if isinstance(how, Ended) and self._known.take(how.state):
                self._end(known, command, how)
            elif isinstance(how, Ended):
                self._ends.do(self._known.fetch, lambda *_: self._end(known, command, how))
            elif ended.failure is not None:
                known.fail(ended.failure)
            else:  # of a command that changes nothing
                known.finish(ended.result)

        _go_on_as(begun, known)
        begun.add_callback(on_end)
        return known

    def _end(self, known: Operation[Any], command: CommandDeclaration, how: Ended) -> None:
        try:
            if how.error is not None:
                known.fail(from_plain(how.error))
            else:
                kind = result_of(command.result)
                known.finish_as_sent(how.result if kind is None else conform(how.result, kind))
        except (Mismatch, ProtocolError) as exc:
            known.fail(ProtocolError(f"{command.name} ended with something else: {exc}"))

    def aside(self, action: Callable[[], Any], on_result: Callable[[Any, Any], object]) -> None:
        """Do something in a thread that may wait for the line, and tell how it ended."""
        self._background.do(action, on_result)

    def _asked_now(
        self, address: Address, command: CommandDeclaration, arguments: dict[str, object]
    ) -> object:
        function, sent = self._sent(address, command, arguments)
        timeout_s = STOP_LIMIT_S if command.need.at_once else command.need.timeout_s
        result = self._transport.call(self._name, function, sent, timeout_s=timeout_s)
        if isinstance(result, Answered):
            self._known.take(result.state)
            result = result.result
            self._known.note_command(command.name, arguments)
        if isinstance(result, RemoteTask):
            return self._followed(result, command)
        if command.result in (None, Any) or isinstance(result, Ongoing):
            return result
        try:
            return conform(result, command.result)
        except Mismatch as exc:
            raise ProtocolError(f"{self._name}.{function} returned something else: {exc}") from exc

    def _sent(
        self, address: Address, command: CommandDeclaration, arguments: dict[str, object]
    ) -> tuple[str, dict[str, object]]:
        sent = {**arguments, KEYS: address.keys} if address.keys else arguments
        return command_name(address.parts, command.name), sent

    def _ask(
        self,
        key: object,
        address: Address,
        command: CommandDeclaration,
        arguments: dict[str, object],
    ) -> object:
        try:
            found = self._asked_now(address, command, arguments)
        except CosmicError as exc:
            found = exc
        with self._lock:
            self._answers[key] = (WALL.now_s(), found)
            while len(self._answers) > _REMEMBERED:
                del self._answers[next(iter(self._answers))]
        return found

    def _ask_aside(
        self,
        key: object,
        address: Address,
        command: CommandDeclaration,
        arguments: dict[str, object],
    ) -> None:
        with self._lock:
            waits = key in self._asked
            self._asked.add(key)
        if waits:
            return

        def on_result(_found: object, _error: CosmicError | None) -> None:
            with self._lock:
                self._asked.discard(key)

        self._background.do(lambda: self._ask(key, address, command, arguments), on_result)


def _go_on_as(begun: Operation[Any], known: Operation[Any]) -> None:
    """Have `known` tell the progress of `begun`, and cancel it."""

    def on_progress(progress: Progress) -> None:
        if not progress.done:
            known.report(progress.fraction, progress.text)

    begun.subscribe(on_progress)
    known.on_cancel(begun.cancel)


def _end_as(ended: Operation[Any], known: Operation[Any]) -> None:
    """End `known` as `ended` did."""
    error = ended.failure
    if error is not None:
        known.fail(error)
    else:
        known.finish_as_sent(ended.sent_result())


def operation_kind(result: Any) -> type[Operation[Any]] | None:
    """Return the kind of operation that a command returns; None where it returns none."""
    kind = get_origin(result) or result
    return kind if isinstance(kind, type) and issubclass(kind, Operation) else None
