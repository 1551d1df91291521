"""Offers a declared application at a station: its commands, its state and its streams."""

import secrets
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import partial
from threading import Event, Lock
from typing import Any, Final

from typing_extensions import override

from cosmic.frame.clock import WALL
from cosmic.frame.declaration import (
    CommandDeclaration,
    Declaration,
    Declared,
    declaration_of,
)
from cosmic.frame.errors import CosmicError, MoveCancelled
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.caller import Call, carrying_out, current_call
from cosmic.frame.network.errors import CallRefused, RemoteDefect
from cosmic.frame.network.ongoing import Answered, Ended, StateMessage
from cosmic.frame.network.remote import Offered, RemoteMark
from cosmic.frame.network.station import Station
from cosmic.frame.network.transport import Presence
from cosmic.frame.network.travelling_errors import to_plain
from cosmic.frame.operation import Operation, Progress, Task
from cosmic.frame.threads import WorkerThread

PUBLISH_EVERY_S: Final = 0.25
"""How often state is published, whether it changed or not."""
SHORTEST_S: Final = 0.03
"""How long a change waits at most for others to be published with it."""
KEYS: Final = "@"
"""Argument that says which of the parts with keys are meant, from the application down."""
NUMBER: Final = "#"
"""Argument that counts what a client commands: what it halted later is not begun any more."""
STATE: Final = "state"
COMMANDS: Final = "commands"
"""Topic with what clients command."""
NOW: Final = "now_s"


def command_name(parts: tuple[str, ...], command: str) -> str:
    """Return how a command of a part is called on a line; `parts` from the application down."""
    return ".".join((*parts, command))


def topic_of(application: str, at: tuple[str, ...], topic: str) -> str:
    """Return what a stream of a part is called on a line."""
    return "/".join((application, *at, topic))


class Overtaken:
    """What each client has halted, and by which of its commands; any thread.

    A halt may arrive before a command that was given before it: that one is void.
    """

    _MOST: Final = 512

    def __init__(self) -> None:
        self._lock = Lock()
        self._halted: OrderedDict[tuple[str, tuple[str, ...]], int] = OrderedDict()

    def note(self, token: str, at: tuple[str, ...], number: int) -> None:
        """Take note of a halt of the object at an address, and of all its parts."""
        with self._lock:
            self._halted[token, at] = max(number, self._halted.get((token, at), 0))
            self._halted.move_to_end((token, at))
            while len(self._halted) > self._MOST:
                self._halted.popitem(last=False)

    def holds(self, token: str, number: int, at: tuple[str, ...]) -> bool:
        """Return whether a command of that number came too late for what is at `at`."""
        if not self._halted or not number:
            return False
        with self._lock:
            return any(
                number <= self._halted.get((token, at[:count]), 0) for count in range(len(at) + 1)
            )


class _Ending:
    """An operation that another station follows; it ends with what it has changed. Any thread."""

    def __init__(self, operation: Operation[Any], state: Callable[[], StateMessage]) -> None:
        self._operation = operation
        self._state = state

    @property
    def title(self) -> str:
        """What it is."""
        return self._operation.title

    @property
    def done(self) -> bool:
        """True when it has ended."""
        return self._operation.done

    def cancel(self) -> None:
        """Ask it to end."""
        self._operation.cancel()

    def add_callback(self, callback: Callable[[object], object]) -> None:
        """Call `callback(self)` at the end."""
        self._operation.add_callback(lambda _operation: callback(self))

    def wait(self, timeout_s: float | None = None) -> Ended:
        """Return how it ended; raises `DeviceTimeout`, and nothing that it failed with."""
        error = self._operation.exception(timeout_s)
        if error is None:
            return Ended(self._operation.sent_result(), None, self._state())
        if not isinstance(error, CosmicError):
            error = RemoteDefect(f"{type(error).__name__}: {error}")
        return Ended(None, to_plain(error), self._state())


class _TaskEnding(_Ending):
    """One that tells its progress as well."""

    def subscribe(self, subscriber: Callable[[Progress], object]) -> Callable[[], None]:
        """Call `subscriber(progress)` at each step."""
        return self._operation.subscribe(subscriber)


@dataclass(frozen=True, slots=True)
class _Found:
    """An object that can be reached now, and where."""

    at: tuple[str, ...]
    served: Declared


class Host:
    """A declared application as others use it, once a `Station` hosts it; at last `close`.

    Parameters
    ----------
    name : str
        Under which the station hosts it.
    """

    def __init__(self, name: str, served: Declared) -> None:
        self._name = name
        self._served = served
        self._start = secrets.token_hex(8)
        self._number = 0
        self._lock = Lock()
        self._station: Station | None = None
        self._publisher: _Publisher | None = None
        self._asked: set[str] = set()
        self._forget: Callable[[], None] = lambda: None
        self._ends: dict[tuple[str, ...], tuple[Declared, list[Callable[[], None]]]] = {}
        self._overtaken = Overtaken()

    @property
    def served(self) -> Declared:
        """The application itself."""
        return self._served

    # What may be called

    @property
    def offered(self) -> dict[str, Offered]:
        """The commands of the application and its parts, and what is read of it."""
        found = dict(self._offered_by(declaration_of(type(self._served)), (), ()))
        reads = RemoteMark(moves=False, reads=True, at_once=False, limit_s=0.0)
        found[STATE] = Offered(STATE, reads, self.state, {}, frozenset())
        found[NOW] = Offered(NOW, reads, self.now_s, {}, frozenset())
        return found

    def _offered_by(
        self, declaration: Declaration, parts: tuple[str, ...], keyed: tuple[bool, ...]
    ) -> Iterator[tuple[str, Offered]]:
        for name, each in declaration.commands.items():
            yield command_name(parts, name), self._offered_command(each, parts, keyed)
        for name, part in declaration.parts.items():
            inner = declaration_of(part.kind)
            yield from self._offered_by(inner, (*parts, name), (*keyed, part.keyed))

    def _offered_command(
        self, command: CommandDeclaration, parts: tuple[str, ...], keyed: tuple[bool, ...]
    ) -> Offered:
        need = command.need
        mark = RemoteMark(need.moves, need.reads, need.overtakes, need.limit_s, need.renews)
        parameters, required = dict(command.parameters), command.required
        if any(keyed):
            parameters[KEYS] = tuple[str, ...]
            required = required | {KEYS}
        if need.moves or need.overtakes:
            parameters[NUMBER] = int

        def run(**arguments: Any) -> object:
            found = self._resolved(parts, keyed, arguments.pop(KEYS, ()))
            call = self._in_order(command, found.at, arguments.pop(NUMBER, 0))
            if not (need.reads or need.renews):
                self._publish_command(found.at, command.name, arguments)
            with carrying_out(call) if call is not None else nullcontext():
                result = getattr(found.served, command.name)(**arguments)
            if need.reads or need.renews:
                return result
            self._note_change()
            if isinstance(result, Operation):
                made = _TaskEnding if isinstance(result, Task) else _Ending
                result = made(result, lambda: self.state(whole=False))
            return Answered(result, self._message(found, whole=False))

        return Offered(command_name(parts, command.name), mark, run, parameters, required)

    def _publish_command(
        self, at: tuple[str, ...], command: str, arguments: Mapping[str, object]
    ) -> None:
        """Publish what a client commands, a line each."""
        call, station = current_call(), self._station
        if call is not None and station is not None:
            said = ", ".join(f"{name}={value!r:.100}" for name, value in arguments.items())
            line = f"{call.caller.name}: {' '.join((*at[-1:], command))}({said})"
            station.publish(topic_of(self._name, (), COMMANDS), line[:500])

    def _in_order(
        self, command: CommandDeclaration, at: tuple[str, ...], number: int
    ) -> Call | None:
        """Return the call as the command sees it; raises `MoveCancelled` where it is void."""
        call = current_call()
        if call is None:
            return None
        token = call.caller.token
        if command.need.at_once:
            self._overtaken.note(token, at, number)
        elif command.need.moves and self._overtaken.holds(token, number, at):
            raise MoveCancelled(f"{at[-1] if at else self._name}: halted before it started")
        return replace(call, overtaken=partial(self._overtaken.holds, token, number))

    def _resolved(
        self, parts: tuple[str, ...], keyed: tuple[bool, ...], keys: tuple[str, ...]
    ) -> _Found:
        served: Any = self._served
        at: list[str] = []
        left = list(keys)
        for name, with_key in zip(parts, keyed, strict=True):
            served = getattr(served, name)
            at.append(name)
            if with_key:
                key = left.pop(0) if left else ""
                if key not in served:
                    there = ", ".join(served) or "none"
                    raise CallRefused(f"there is no {key[:60]!r} in {name}; there are {there}")
                served = served[key]
                at.append(key)
            elif served is None:
                raise CallRefused(f"there is no {name} here")
        return _Found(tuple(at), served)

    # What is read

    def state(self, *, whole: bool = True) -> StateMessage:
        """Return the state of everything; with a `whole` one what never changes as well."""
        return self._message(_Found((), self._served), whole=whole)

    def now_s(self) -> float:
        """Return what the clock of the application says here."""
        return self._served.clock.now_s()

    def _message(self, found: _Found, *, whole: bool) -> StateMessage:
        with self._lock:  # so that a higher number never has older values
            self._number += 1
            values = _values(found.served, whole=whole)
            return StateMessage(
                self._start,
                self._number,
                found.at,
                values,
                self._served.clock.rate,
                WALL.now_s(),
                whole,
            )

    # Hosting

    def on_hosted(self, station: Station) -> None:
        """Publish on this station from now on; `close` ends it."""
        self._station = station
        self._served.take_lease_of(station.lease)
        self._publisher = _Publisher(f"{self._name} publishes", self._publish, station.policy)
        self._follow()
        self._publisher.start()
        self._forget = station.presence(self._on_client)

    def close(self) -> None:
        """Publish no more; any state."""
        self._forget()
        if self._publisher is not None:
            self._publisher.request_end()
            self._publisher.join()
        while self._ends:
            _, (_, ends) = self._ends.popitem()
            for end in ends:
                end()
        self._station = None

    def _note_change(self) -> None:
        if self._publisher is not None:
            self._publisher.note_change()

    def _publish(self) -> None:
        station = self._station
        if station is not None:
            self._follow()
            station.publish(topic_of(self._name, (), STATE), self.state(whole=False))

    def _follow(self) -> None:
        """Follow what there is now, and nothing that has gone."""
        there = {each.at: each.served for each in _reachable((), self._served)}
        for at in [at for at, (served, _) in self._ends.items() if there.get(at) is not served]:
            for end in self._ends.pop(at)[1]:
                end()
        for at, served in there.items():
            if at not in self._ends:
                self._ends[at] = (served, [served.on_change(self._note_change)])
                self._ends[at][1].extend(self._published(at, served))

    def _published(self, at: tuple[str, ...], served: Declared) -> Iterator[Callable[[], None]]:
        for name, each in declaration_of(type(served)).streams.items():
            topic = topic_of(self._name, at, each.topic)
            publish = self._publisher_to(topic)
            if not each.asks:
                yield getattr(served, name)(publish)
                continue
            self._asked.add(topic)
            publish(None)
            yield getattr(served, name)(publish, partial(self._wanted, topic))

    def _wanted(self, topic: str) -> bool:
        return self._station is not None and self._station.wanted(topic)

    def _on_client(self, client: Presence) -> None:
        """Publish nothing to what is made on demand: from then on it is known who receives."""
        if client.here:
            for topic in list(self._asked):
                self._publisher_to(topic)(None)

    def _publisher_to(self, topic: str) -> Callable[[object], None]:
        def publish(payload: object) -> None:
            if self._station is not None:
                self._station.publish(topic, payload)

        return publish


def _values(served: Declared, *, whole: bool) -> dict[str, object]:
    """Return the state of an object and its parts, by name."""
    declaration = declaration_of(type(served))
    values: dict[str, object] = {
        name: getattr(served, name)
        for name, each in declaration.state.items()
        if whole or not each.fixed
    }
    for name, part in declaration.parts.items():
        found = getattr(served, name)
        if part.keyed:
            values[name] = {key: _values(each, whole=whole) for key, each in found.items()}
        else:
            values[name] = _values(found, whole=whole) if found is not None else None
    return values


def _reachable(at: tuple[str, ...], served: Declared) -> Iterator[_Found]:
    yield _Found(at, served)
    for name, part in declaration_of(type(served)).parts.items():
        found = getattr(served, name)
        if part.keyed:
            for key, each in found.items():
                yield from _reachable((*at, name, key), each)
        elif found is not None:
            yield from _reachable((*at, name), found)


class _Publisher(WorkerThread):
    """Calls `publish` soon after each change, and regularly."""

    def __init__(self, name: str, publish: Callable[[], None], policy: FailurePolicy) -> None:
        super().__init__(name, policy)
        self._publish = publish
        self._changed = Event()

    def note_change(self) -> None:
        """Have it published soon; returns at once, any thread."""
        self._changed.set()

    @override
    def run_body(self) -> None:
        while not self._end_requested.wait(SHORTEST_S):
            self._changed.wait(PUBLISH_EVERY_S)
            self._changed.clear()
            if not self.end_requested:
                self._publish()

    @override
    def request_end(self) -> None:
        super().request_end()
        self._changed.set()
