"""One application at one station, as it is known and used here: the far side of a proxy."""

import logging
import threading
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from threading import Lock
from typing import Any, Final

from typing_extensions import override

from cosmic.frame.background import BackgroundJobs
from cosmic.frame.clock import WALL
from cosmic.frame.declaration import (
    UNKNOWN,
    CommandDeclaration,
    Companion,
    Declared,
    StreamDeclaration,
    declaration_of,
)
from cosmic.frame.errors import CosmicError, NotAvailable, ProtocolError
from cosmic.frame.events import Event, Unsubscribe, notify
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.conform import Mismatch, conform
from cosmic.frame.network.errors import StationAway
from cosmic.frame.network.host import KEYS, NOW, STATE, command_name, topic_of
from cosmic.frame.network.ongoing import Answered, Ongoing, StateMessage
from cosmic.frame.network.remote_task import RemoteTask
from cosmic.frame.network.station_clock import Reading, StationClock
from cosmic.frame.network.transport import Presence, Rule, Subscription, Transport
from cosmic.frame.operation import Operation, Progress, Task
from cosmic.frame.threads import WorkerThread, may_wait_here

logger = logging.getLogger(__name__)

RETRY_S: Final = 0.5
LINGER_S: Final = 2.0
"""How long a stream still comes after nobody wants it any more."""
_LOOK_S: Final = 0.05
_CLOCK_S: Final = 20.0
_READINGS: Final = 5
_REMEMBERED: Final = 64

Receiver = Callable[[Any], object]


@dataclass(frozen=True, slots=True)
class Address:
    """Which object of an application.

    Attributes
    ----------
    kind : type
        What it declares.
    parts : tuple of str
        Names of the parts that lead to it.
    keys : tuple of str
        For those of them that have keys.
    at : tuple of str
        Both, in order.
    """

    kind: type[Declared]
    parts: tuple[str, ...] = ()
    keys: tuple[str, ...] = ()
    at: tuple[str, ...] = ()

    def part(self, name: str, key: str | None = None) -> "Address":
        """Return the address of a part."""
        kind = declaration_of(self.kind).parts[name].kind
        if key is None:
            return Address(kind, (*self.parts, name), self.keys, (*self.at, name))
        return Address(kind, (*self.parts, name), (*self.keys, key), (*self.at, name, key))


@dataclass(frozen=True, slots=True)
class _Known:
    """State of one object, and the number of the message that told it."""

    number: int
    values: dict[str, object]


class RemoteStream:
    """One stream from another station; any thread.

    It comes while somebody wants it, in a thread of its own, and a little longer.

    Parameters
    ----------
    on_loss : callable
        Called when something was lost on the way.
    """

    def __init__(
        self,
        declared: StreamDeclaration,
        topic: str,
        transport: Transport,
        on_loss: Callable[[], object],
    ) -> None:
        self._declared = declared
        self._topic = topic
        self._transport = transport
        self._on_loss = on_loss
        self._lock = Lock()
        self._came: Event[Any] = Event()
        self._subscription: Subscription | None = None
        self._kept = False
        self._before: object = UNKNOWN
        self._gaps = 0
        self._missed = 0
        self._newest: object = None
        self._unwanted_wall_s = 0.0
        self.heard_wall_s = -float("inf")

    @property
    def newest(self) -> object:
        """The newest that came; None before the first."""
        return self._newest

    @property
    def missed(self) -> int:
        """How much was wanted and did not reach this process."""
        return self._missed

    def subscribe(self, receiver: Receiver) -> Unsubscribe:
        """Call `receiver` with what comes from now on; raises `StationAway` once it is closed."""
        self._open()
        end = self._came.subscribe(receiver)

        def unsubscribe() -> None:
            end()
            self._unwanted_wall_s = WALL.now_s()

        return unsubscribe

    def keep(self) -> None:
        """Have it come all the time, whether anybody wants it or not."""
        self._kept = True
        self._open()

    def _open(self) -> None:
        with self._lock:
            if self._subscription is None:
                self._before, self._gaps = UNKNOWN, 0
                self._subscription = self._transport.subscribe(
                    self._topic, self._declared.rule, self._take
                )

    def clear(self) -> None:
        """Forget the newest: it is no longer what there is now."""
        self._newest = None

    def tidy(self) -> None:
        """End it where nobody wants it any more; not in a thread that receives."""
        with self._lock:
            idle_s = WALL.now_s() - self._unwanted_wall_s
            if len(self._came) or self._kept or idle_s < LINGER_S:
                return
            unwanted, self._subscription = self._subscription, None
        if unwanted is not None:
            unwanted.close()

    def close(self) -> None:
        """Receive no more; any state."""
        with self._lock:
            subscription, self._subscription = self._subscription, None
            self._came = Event()
        if subscription is not None:
            subscription.close()

    # In the thread that receives

    def _take(self, payload: object) -> None:
        if payload is None and self._declared.asks:
            return  # from now on the station knows that this is wanted
        try:
            payload = conform(payload, self._declared.kind)
        except Mismatch as exc:
            raise ProtocolError(f"{self._topic}: {exc}") from exc
        self.heard_wall_s = WALL.now_s()
        self._count(payload)
        self._newest = payload
        self._came.emit(payload)

    def _count(self, payload: object) -> None:
        before, self._before = self._before, payload
        if self._declared.rule is not Rule.ALL:
            return
        if self._declared.missing is not None:
            lost = 0 if before is UNKNOWN else self._declared.missing(before, payload)
        else:
            gaps = self._subscription.lost if self._subscription is not None else self._gaps
            lost, self._gaps = gaps - self._gaps, gaps
        if lost > 0:
            self._missed += lost
            logger.error("%s: %d were lost on the way from the station", self._topic, lost)
            self._on_loss()


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
    """

    def __init__(
        self, kind: type[Declared], transport: Transport, name: str, policy: FailurePolicy
    ) -> None:
        self.root = Address(kind)
        self.clock = StationClock()
        self.companion: Companion = Companion()
        self.on_change: Callable[[tuple[str, ...]], object] = lambda _at: None
        self.policy = policy
        self._transport = transport
        self._name = name
        self._background = BackgroundJobs(f"{name} background", policy)
        self._ends = BackgroundJobs(f"{name} ends", policy)
        self._keeper = _Keeper(f"{name} elsewhere", self._look, policy)
        self._lock = Lock()
        self._start = ""
        self._known: dict[tuple[str, ...], _Known] = {}
        self._streams: dict[tuple[str, ...], RemoteStream] = {}
        self._answers: dict[object, tuple[float, object]] = {}
        self._asked: set[object] = set()
        self._refused: dict[tuple[str, ...], str] = {}
        self._station = ""
        self._away, self._here = "not connected yet", False
        self._heard_wall_s = self._retry_wall_s = self._clock_wall_s = -float("inf")
        self._ready = threading.Event()
        self._subscription: Subscription | None = None
        self._end_presence: Callable[[], None] = lambda: None

    # What is known

    @property
    def transport(self) -> Transport:
        """The way to the station."""
        return self._transport

    @property
    def away(self) -> str:
        """Why the station cannot be reached; empty while it can."""
        return self._away

    @property
    def elsewhere(self) -> str:
        """Where it runs, as the operator is told."""
        return f"at the station {self._station}" if self._station else "at another station"

    @property
    def missed(self) -> int:
        """How much of all streams did not reach this process."""
        return sum(each.missed for each in list(self._streams.values()))

    def value(self, address: Address, name: str) -> object:
        """Return a value of the state of an object.

        Raises
        ------
        StationAway
            It was never told, and has no value that stands for that.
        """
        known = self._known.get(address.at)
        if known is not None and name in known.values:
            return known.values[name]
        unknown = declaration_of(address.kind).state[name].unknown
        if unknown is UNKNOWN:
            raise StationAway(f"{name} is not known: {self._away or 'it was not told yet'}")
        return unknown

    def keys(self, address: Address, name: str) -> tuple[str, ...]:
        """Return the keys of the parts of that name that there are."""
        known = self._known.get(address.at)
        found = known.values.get(name, ()) if known is not None else ()
        return found if isinstance(found, tuple) else ()

    def there(self, address: Address, name: str) -> bool:
        """Return whether there is the part of that name, which may be missing."""
        known = self._known.get(address.at)
        return known is not None and known.values.get(name) is True

    def stream(self, address: Address, name: str) -> RemoteStream:
        """Return a stream of an object."""
        with self._lock:
            at = (*address.at, name)
            if at not in self._streams:
                declared = declaration_of(address.kind).streams[name]
                topic = topic_of(self._name, address.at, declared.topic)
                self._streams[at] = RemoteStream(
                    declared, topic, self._transport, lambda: self._tell([address.at])
                )
            return self._streams[at]

    # Beginning and ending

    def open(self) -> None:
        """Begin to use the station; it need not be there yet."""
        topic = topic_of(self._name, (), STATE)
        self.companion.on_opened()
        for name in declaration_of(self.root.kind).newest.values():
            self.stream(self.root, name).keep()
        self._subscription = self._transport.subscribe(topic, Rule.LATEST, self._take)
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
        threads = (self._keeper, self._background, self._ends)
        for thread in threads:
            thread.request_end()
        for thread in threads:
            if not thread.join():
                logger.error("%s does not end", thread.name)
        self.companion.close()
        subscription, self._subscription = self._subscription, None
        if subscription is not None:
            subscription.close()
        for each in list(self._streams.values()):
            each.close()

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
        if not command.need.reads:
            self._note_refusal(address, "")
        if not may_wait_here() and command.result is Task and not command.need.at_once:
            return self._begun_aside(address, command, arguments)
        if command.need.aside:
            self._done_aside(address, command, arguments)
            return None
        if not command.need.remembered_s:
            return self._asked_now(address, command, arguments)
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
            self._tell([address.at])

    def _done_aside(
        self, address: Address, command: CommandDeclaration, arguments: dict[str, object]
    ) -> None:
        """Do something aside where this thread must not wait, else now."""
        if may_wait_here():
            self._asked_now(address, command, arguments)
            return

        def told(_result: object, error: CosmicError | None) -> None:
            if error is not None:
                self._note_refusal(address, str(error))

        self._background.do(lambda: self._asked_now(address, command, arguments), told)

    def _begun_aside(
        self, address: Address, command: CommandDeclaration, arguments: dict[str, object]
    ) -> Task:
        """Begin something for a thread that must not wait; what forbids it ends the task."""
        task = Task(command.name.replace("_", " ").capitalize())

        def told(begun: object, error: CosmicError | None) -> None:
            if isinstance(begun, Operation):
                begun.add_callback(lambda ended: _end_as(ended, task, lambda _: task.finish()))
                _go_on_as(begun, task)
            else:
                self._note_refusal(address, str(error or ""))
                task.fail(error or ProtocolError(f"{command.name} began nothing"))

        self._background.do(lambda: self._asked_now(address, command, arguments), told)
        return task

    def _followed(self, begun: RemoteTask) -> Operation[object]:
        """Return what ends as `begun` does, once it is known here what that has changed."""
        known: Operation[object] = Operation(begun.title)

        def on_end(ended: RemoteTask) -> None:
            self._ends.do(self._fetch, lambda *_: _end_as(ended, known, known.finish))

        begun.add_callback(on_end)
        _go_on_as(begun, known)
        return known

    def aside(self, action: Callable[[], Any], told: Callable[[Any, Any], object]) -> None:
        """Do something in a thread that may wait for the line, and tell how it ended."""
        self._background.do(action, told)

    def _asked_now(
        self, address: Address, command: CommandDeclaration, arguments: dict[str, object]
    ) -> object:
        function = command_name(address.parts, command.name)
        sent = {**arguments, KEYS: address.keys} if address.keys else arguments
        timeout_s = command.need.timeout_s
        result = self._transport.call(self._name, function, sent, timeout_s=timeout_s)
        if isinstance(result, Answered):
            self._take(result.state)
            result = result.result
            self.companion.on_commanded(command.name, arguments)
        if isinstance(result, RemoteTask):
            return self._followed(result)
        if command.result in (None, Any) or isinstance(result, Ongoing):
            return result
        try:
            return conform(result, command.result)
        except Mismatch as exc:
            raise ProtocolError(f"{self._name}.{function} returned something else: {exc}") from exc

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

        def told(_found: object, _error: CosmicError | None) -> None:
            with self._lock:
                self._asked.discard(key)

        self._background.do(lambda: self._ask(key, address, command, arguments), told)

    # What the station tells

    def _take(self, payload: object) -> None:
        """Take state unless a newer one is known; any thread."""
        if not isinstance(payload, StateMessage):
            raise ProtocolError(f"a {type(payload).__name__} came instead of state")
        told = dict(_flat(self._address(payload.at), payload.values))
        with self._lock:
            first = payload.start != self._start
            if first and payload.at:
                return  # of an application that was started anew; what it is follows
            if first:
                self._known.clear()
                self._start = payload.start
            newer = [at for at in told if self._number(at) < payload.number]
            changed = [at for at in newer if self._differs(at, told[at])]
            for at in newer:
                self._known[at] = _Known(payload.number, told[at][1])
            was_away, self._away = self._away, "" if self._here else self._away
            self._heard_wall_s = WALL.now_s()
        if first:
            self.clock.forget(payload.clock_rate)
            self._clock_wall_s = -float("inf")
        if newer:
            self.companion.on_state(first=first)
        if was_away != self._away:
            changed.append(())
        self._tell(changed)

    def _address(self, at: tuple[str, ...]) -> Address:
        address, names = self.root, iter(at)
        for name in names:
            part = declaration_of(address.kind).parts.get(name)
            if part is None:
                raise ProtocolError(f"the state of the unknown part {name[:60]!r} came")
            address = address.part(name, next(names, "") if part.keyed else None)
        return address

    def _number(self, at: tuple[str, ...]) -> int:
        known = self._known.get(at)
        return known.number if known is not None else 0

    def _differs(self, at: tuple[str, ...], told: tuple[Address, dict[str, object]]) -> bool:
        known, (address, values) = self._known.get(at), told
        states = declaration_of(address.kind).state
        loud = [name for name in values if name not in states or not states[name].quiet]
        return known is None or any(known.values.get(each) != values[each] for each in loud)

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
            self._tell([()])

    def _tell(self, changed: list[tuple[str, ...]]) -> None:
        for at in {*changed, *([()] if changed else [])}:
            notify(self.on_change, at)

    # The keeper's thread

    def _look(self) -> None:
        now_s = WALL.now_s()
        streams = list(self._streams.values())
        heard_s = max(self._heard_wall_s, *(each.heard_wall_s for each in streams), -float("inf"))
        self.companion.look(now_s - heard_s)
        for each in streams:
            each.tidy()
        if not self._here:
            return
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


def _end_as(ended: Operation[Any], known: Operation[Any], finish: Callable[[Any], object]) -> None:
    """End `known` as `ended` did."""
    error = ended.failure
    if error is not None:
        known.fail(error)
    else:
        finish(ended.result)


def _flat(
    address: Address, values: Mapping[str, object]
) -> Iterator[tuple[tuple[str, ...], tuple[Address, dict[str, object]]]]:
    """Yield the state of an object and each of its parts, checked; of parts with keys the keys."""
    declaration = declaration_of(address.kind)
    own: dict[str, object] = {}
    for name, part in declaration.parts.items():
        inner = values.get(name)
        if part.optional:
            own[name] = inner is not None
            if inner is None:
                continue
        if not isinstance(inner, dict):
            raise ProtocolError(f"state without its part {name} came")
        if not part.keyed:
            yield from _flat(address.part(name), inner)
            continue
        for key, each in inner.items():
            if not (isinstance(key, str) and isinstance(each, dict)):
                raise ProtocolError(f"a broken part {name} came")
            yield from _flat(address.part(name, key), each)
        own[name] = tuple(inner)
    try:
        for name, state in declaration.state.items():
            own[name] = conform(values[name], state.kind)
    except (KeyError, Mismatch) as exc:
        raise ProtocolError(f"state of another version came: {name}: {exc}") from exc
    yield address.at, (address, own)
