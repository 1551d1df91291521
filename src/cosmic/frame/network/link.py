"""One application at one station, as it is known and used here: the far side of a proxy."""

import logging
import threading
from collections.abc import Callable
from itertools import count
from threading import Lock
from typing import Any, Final, get_origin

from typing_extensions import override

from cosmic.frame.background import BackgroundJobs
from cosmic.frame.clock import WALL
from cosmic.frame.declaration import (
    UNKNOWN,
    CommandDeclaration,
    Companion,
    Declared,
    declaration_of,
    result_of,
)
from cosmic.frame.errors import CosmicError, MoveCancelled, NotAvailable, ProtocolError
from cosmic.frame.events import Event
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.conform import Mismatch, conform
from cosmic.frame.network.host import KEYS, NOW, NUMBER, STATE, command_name, topic_of
from cosmic.frame.network.known_state import Address, KnownState
from cosmic.frame.network.ongoing import Answered, Ended, Ongoing, StateMessage
from cosmic.frame.network.remote_stream import RemoteStream
from cosmic.frame.network.remote_task import RemoteTask
from cosmic.frame.network.station_clock import Reading, StationClock
from cosmic.frame.network.transport import Presence, Rule, Subscription, Transport
from cosmic.frame.network.travelling_errors import from_plain
from cosmic.frame.operation import Operation, Progress
from cosmic.frame.threads import WorkerThread, may_wait_here

logger = logging.getLogger(__name__)

RETRY_S: Final = 0.5
STOP_LIMIT_S: Final = 1.0
"""How long the answer to what overtakes everything may take."""
RENEW_LIMIT_S: Final = 0.2
"""What keeps something alive is worth nothing later than this."""
_DRIFT: Final = 2e-4
_LOOK_S: Final = 0.05
_CLOCK_S: Final = 20.0
_READINGS: Final = 5
_REMEMBERED: Final = 64


class _Keeper(WorkerThread):
    """Calls `look` again and again."""

    def __init__(self, name: str, look: Callable[[], None], policy: FailurePolicy) -> None:
        super().__init__(name, policy)
        self._look = look

    @override
    def run_body(self) -> None:
        while not self._end_requested.wait(_LOOK_S):
            self._look()


class ApplicationLink:
    """Gives commands to an application at another station and knows its state; any thread.

    Whatever is read is known already, as the station last told. While the station is away, `away`
    says why, commands raise `StationAway`, and everything goes on by itself when it is back.

    Parameters
    ----------
    kind : type
        What the application declares.
    transport : Transport
        To the station; whoever made it closes it, after `close`.
    name : str
        Under which the station hosts the application.

    Attributes
    ----------
    state : KnownState
        How things stand there, as it was published last.
    """

    def __init__(
        self, kind: type[Declared], transport: Transport, name: str, policy: FailurePolicy
    ) -> None:
        self.root = Address(kind)
        self.clock = StationClock()
        self._companions: tuple[Companion, ...] = ()
        self._changed: Event[tuple[str, ...]] = Event()
        self.policy = policy
        self._transport = transport
        self._name = name
        self._background = BackgroundJobs(f"{name} background", policy)
        self._ends = BackgroundJobs(f"{name} ends", policy)
        self._commands = BackgroundJobs(f"{name} commands", policy)
        self._stops = BackgroundJobs(f"{name} stops", policy)
        self._renewals = BackgroundJobs(f"{name} keeps alive", policy)
        self._newest: dict[tuple[str, ...], Callable[[], object]] = {}
        self._numbers = count(1)
        self._moving: set[Operation[Any]] = set()
        self._keeper = _Keeper(f"remote {name}", self._look, policy)
        self._lock = Lock()
        self.state = KnownState(self.root)
        self._streams: dict[tuple[str, ...], RemoteStream] = {}
        self._answers: dict[object, tuple[float, object]] = {}
        self._asked: set[object] = set()
        self._refused: dict[tuple[str, ...], str] = {}
        self._station = ""
        self._away, self._here = "not connected yet", False
        self._heard_wall_s = self._retry_wall_s = self._clock_wall_s = -float("inf")
        self._wall_s: tuple[float, float] | None = None
        self._incomplete = False
        self._ready = threading.Event()
        self._subscription: Subscription | None = None
        self._end_presence: Callable[[], None] = lambda: None

    def join(
        self, companion: Companion | None, on_change: Callable[[tuple[str, ...]], object]
    ) -> None:
        """Tell a proxy of changes, and have its companion keep an eye on the station."""
        self._changed.subscribe(on_change)
        if companion is not None:
            self._companions = (*self._companions, companion)
            if self._subscription is not None:
                companion.on_opened()

    # What is known

    @property
    def ready(self) -> bool:
        """What is known suffices to begin."""
        return all(each.ready for each in self._companions)

    @property
    def moves(self) -> bool:
        """Something that was begun from here still moves."""
        with self._lock:
            return bool(self._moving)

    def wall_s_here(self, wall_s: float) -> float:
        """Return what the wall clock here said when that of the station did."""
        known = self._wall_s
        return wall_s if known is None else wall_s + known[0]

    @property
    def transport(self) -> Transport:
        """The way to the station."""
        return self._transport

    @property
    def away(self) -> str:
        """Why the station cannot be reached; empty while it can."""
        return self._away

    @property
    def remote(self) -> str:
        """Where it runs, as the operator is told."""
        return f"at the station {self._station}" if self._station else "at another station"

    @property
    def missed(self) -> int:
        """How much of all streams did not reach this process."""
        return sum(each.missed for each in list(self._streams.values()))

    def stream(self, address: Address, name: str) -> RemoteStream:
        """Return a stream of an object."""
        with self._lock:
            at = (*address.at, name)
            if at not in self._streams:
                declared = declaration_of(address.kind).streams[name]
                topic = topic_of(self._name, address.at, declared.topic)
                self._streams[at] = RemoteStream(
                    declared, topic, self._transport, lambda: self._publish([address.at])
                )
            return self._streams[at]

    # Beginning and ending

    def open(self) -> None:
        """Begin to use the station; it need not be there yet."""
        topic = topic_of(self._name, (), STATE)
        for each in self._companions:
            each.on_opened()
        for name in declaration_of(self.root.kind).newest.values():
            self.stream(self.root, name).keep()
        self._subscription = self._transport.subscribe(topic, Rule.LATEST, self._on_state)
        self._end_presence = self._transport.presence(self._on_presence)
        self._keeper.start()

    def wait_until_known(self, timeout_s: float) -> bool:
        """Wait until it is known how things stand there; False where it is not in time."""
        return self._ready.wait(timeout_s)

    def let_go(self) -> None:
        """Let nobody wait any longer to know how things stand."""
        self._ready.set()

    def close(self) -> None:
        """Use the station no more; there everything goes on. Any state."""
        self.let_go()
        self._end_presence()
        self._end_motion()
        threads = (
            self._keeper,
            self._background,
            self._commands,
            self._ends,
            self._stops,
            self._renewals,
        )
        until_s = WALL.now_s() + STOP_LIMIT_S
        while self._stops.waiting and WALL.now_s() < until_s:  # a stop that was asked for is sent
            WALL.sleep(0.005)
        for thread in threads:
            thread.request_end()
        for thread in threads:
            if not thread.join():
                logger.error("%s does not end", thread.name)
        for companion in self._companions:
            companion.close()
        subscription, self._subscription = self._subscription, None
        if subscription is not None:
            subscription.close()
        for each in list(self._streams.values()):
            each.close()

    def _end_motion(self) -> None:
        """Have everything stop that was begun here, before this end closes."""
        with self._lock:
            moving = list(self._moving)
        for each in moving:
            try:
                each.cancel()
            except CosmicError as exc:
                logger.warning("what was begun here stops by the lease only: %s", exc)

    # Commands

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
            raise NotAvailable(f"{self._station or 'the station'} is being asked")
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
            self._publish([address.at])

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
                self.policy.report(error, f"{where} was NOT carried out at the station")

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
            if isinstance(how, Ended) and self._take(how.state):
                self._end(known, command, how)
            elif isinstance(how, Ended):
                self._ends.do(self._fetch, lambda *_: self._end(known, command, how))
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
            self._take(result.state)
            result = result.result
            for each in self._companions:
                each.on_commanded(command.name, arguments)
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

    # What the station tells

    def _on_state(self, payload: object) -> None:
        self._take(payload)

    def _take(self, payload: object) -> bool:
        """Take state unless a newer one is known; any thread.

        False where the rest of it has to be asked for first: of an application that was started
        anew, or of a part that is new.
        """
        if not isinstance(payload, StateMessage):
            raise ProtocolError(f"a {type(payload).__name__} came instead of state")
        published = self.state.checked(payload)
        with self._lock:
            taken = self.state.take(payload, published)
            if taken is None:
                self._incomplete = True
                return False
            if taken.first:
                self._wall_s = None
            self._note_wall(payload.wall_s)
            was_away, self._away = self._away, "" if self._here else self._away
            self._heard_wall_s = WALL.now_s()
        if taken.first:
            self.clock.forget(payload.clock_rate)
            self._clock_wall_s = -float("inf")
        changed = list(taken.changed)
        if taken.newer:
            for each in self._companions:
                each.on_state(first=taken.first)
        if was_away != self._away:
            changed.append(())
        self._publish(changed)
        return True

    def _note_wall(self, wall_s: float) -> None:
        """Reckon by how much the wall clocks differ: a message on its way only adds to it."""
        now_s = WALL.now_s()
        offset_s = now_s - wall_s
        if self._wall_s is not None:
            before_s, noted_s = self._wall_s
            offset_s = min(offset_s, before_s + _DRIFT * (now_s - noted_s))
        self._wall_s = offset_s, now_s

    def _on_presence(self, presence: Presence) -> None:
        self._station = presence.name
        self._here = presence.here
        if presence.here:
            self._retry_wall_s = -float("inf")
        else:
            said = f"{presence.name} is away: "
            self._set_away(said + presence.why.removeprefix(said))

    def _set_away(self, why: str) -> None:
        for each in list(self._streams.values()):
            each.clear()  # nobody shall take old values for those of now
        with self._lock:
            before, self._away = self._away, why
        if before != why:
            self._publish([()])

    def _publish(self, changed: list[tuple[str, ...]]) -> None:
        for at in {*changed, *([()] if changed else [])}:
            self._changed.emit(at)

    # The keeper's thread

    def _look(self) -> None:
        now_s = WALL.now_s()
        streams = list(self._streams.values())
        heard_s = max(self._heard_wall_s, *(each.heard_wall_s for each in streams), -float("inf"))
        for companion in self._companions:
            companion.look(now_s - heard_s)
        for each in streams:
            each.tidy()
        if not self._here:
            return
        if self._incomplete:
            self._incomplete = False
            self._fetch()
        unheard = self._away or now_s - self._heard_wall_s > RETRY_S
        if unheard and now_s - self._retry_wall_s > RETRY_S:
            self._retry_wall_s = now_s
            self._fetch()
        if not self._away and now_s - self._clock_wall_s > _CLOCK_S:
            self._read_clock()

    def _fetch(self) -> None:
        try:
            self._take(self._transport.call(self._name, STATE))
        except CosmicError as exc:
            self._set_away(str(exc))

    def _read_clock(self) -> None:
        self._clock_wall_s = WALL.now_s()
        readings = []
        try:
            for _ in range(_READINGS):
                asked_s = WALL.now_s()
                station_s = self._transport.call(self._name, NOW)
                if isinstance(station_s, float):
                    readings.append(Reading(station_s, asked_s, WALL.now_s()))
        except CosmicError as exc:
            logger.debug("the station's clock could not be read: %s", exc)
        self.clock.take(readings)
        if readings:
            self._ready.set()


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
