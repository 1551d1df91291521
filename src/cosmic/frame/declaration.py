"""What an application offers, declared once: where it is written.

A class in an `api` package derives from `Declared` and marks what others may use: `command` on
methods, `state` on properties, `stream` on methods that take a receiver, `part` on properties that
return other declared objects. In the same process it is used as it is. From another one it is used
through `cosmic.frame.network.proxy`, which makes an object of the same class out of these marks
alone. What is not marked is put together from what is, and so works at both places.
"""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from threading import Lock
from typing import Any, Final, TypeVar, get_args, get_origin, get_type_hints, overload

from cosmic.frame.arguments import checked_class
from cosmic.frame.background import OnResult, do_and_report
from cosmic.frame.clock import WALL, Clock
from cosmic.frame.events import Event, Unsubscribe
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.caller import MOVE_LIMIT_S
from cosmic.frame.network.conform import can_check
from cosmic.frame.network.lease import StationLease
from cosmic.frame.network.transfer import let_travel
from cosmic.frame.network.transport import CALL_TIMEOUT_S, Rule
from cosmic.frame.operation import Operation
from cosmic.frame.renamed import Renamed

F = TypeVar("F", bound=Callable[..., Any])
T = TypeVar("T")

UNKNOWN: Final = object()
"""Stands for a value that is not known."""
_MARK: Final = "__cosmic_declared__"
_OWN: Final = "self"
_ONE_RECEIVER: Final = "it takes one receiver, annotated as Callable[[WHAT], object]"
WANTED: Final = "wanted"
"""Parameter of a stream that looks whether anybody receives it."""
_lock: Final = Lock()


@dataclass(frozen=True, slots=True)
class Need:
    """What a command needs, and what it may cost.

    Attributes
    ----------
    moves : bool
        It moves something: only the holder of the lease may give it.
    reads : bool
        It changes nothing and returns at once: anybody may give it, and it is not in the log.
    at_once : bool
        It overtakes every other command, as `stop` does; it must return at once.
    limit_s : float
        How long who gave it may be silent before what it set in motion stops.
    timeout_s : float
        How long its answer may take.
    remembered_s : float
        How long its answer is good for. A thread that must not wait for a line gets the last
        answer, and has it asked for anew.
    meanwhile : object
        What such a thread gets before the first answer; `NotAvailable` is raised without it.
    aside : bool
        Such a thread has it done aside, and `Declared.refused` says why it was not done. Only for
        a command that returns nothing.
    renews : bool
        It keeps alive what was begun before, and overtakes everything. From elsewhere it is sent
        without waiting, only the newest word counts, and no state comes back.
    """

    moves: bool = False
    reads: bool = False
    at_once: bool = False
    limit_s: float = MOVE_LIMIT_S
    timeout_s: float = CALL_TIMEOUT_S
    remembered_s: float = 0.0
    meanwhile: object = UNKNOWN
    aside: bool = False
    renews: bool = False

    @property
    def overtakes(self) -> bool:
        """It waits for no other command."""
        return self.at_once or self.renews


@dataclass(frozen=True, slots=True)
class _StateMark:
    unknown: object
    quiet: bool
    fixed: bool


@dataclass(frozen=True, slots=True)
class _StreamMark:
    rule: Rule
    topic: str
    missing: Callable[[Any, Any], int] | None


@dataclass(frozen=True, slots=True)
class _NewestMark:
    of: str


@dataclass(frozen=True, slots=True)
class _PartMark:
    pass


def _marked(function: F, mark: object) -> F:
    setattr(function, _MARK, mark)
    return function


@overload
def command(function: F) -> F: ...
@overload
def command(
    *,
    moves: bool = False,
    reads: bool = False,
    at_once: bool = False,
    limit_s: float = ...,
    timeout_s: float = ...,
    remembered_s: float = ...,
    meanwhile: object = ...,
    aside: bool = ...,
    renews: bool = ...,
) -> Callable[[F], F]: ...
def command(function: F | None = None, **need: Any) -> F | Callable[[F], F]:
    """Declare a command; the arguments are those of `Need`.

    Every parameter needs an annotation: what is sent is checked against it.
    """
    if function is not None:
        return _marked(function, Need())
    return lambda marked: _marked(marked, Need(**need))


@overload
def state(function: F) -> F: ...
@overload
def state(*, unknown: object = ..., quiet: bool = ..., fixed: bool = ...) -> Callable[[F], F]: ...
def state(
    function: F | None = None,
    *,
    unknown: object = UNKNOWN,
    quiet: bool = False,
    fixed: bool = False,
) -> F | Callable[[F], F]:
    """Declare what a property returns as state: published on change, and read without waiting.

    It stands below `@property`.

    Parameters
    ----------
    unknown : object
        What it is elsewhere while the station was never reached; by default nothing, 0 or empty,
        by its annotation.
    quiet : bool
        It changes all the time, and nobody is told of it.
    fixed : bool
        It is the same for as long as the application runs, and may be large: it is told once.
    """
    mark = _StateMark(unknown, quiet, fixed)
    if function is not None:
        return _marked(function, mark)
    return lambda marked: _marked(marked, mark)


def stream(
    rule: Rule, *, topic: str = "", missing: Callable[[Any, Any], int] | None = None
) -> Callable[[F], F]:
    """Declare a method as a stream: it takes a receiver and returns the function that ends it.

    A method with a second parameter `wanted` is handed a function that says whether anybody
    receives it now, so that nothing is made that nobody wants.

    Parameters
    ----------
    rule : Rule
        Whether each one counts (`ALL`), or the newest (`LATEST`).
    topic : str
        How it is called on a line; the name of the method by default.
    missing : callable or None
        `missing(before, after)` says how much was lost between two that came one after the other;
        by default each one lost counts.
    """
    return lambda marked: _marked(marked, _StreamMark(rule, topic, missing))


def newest(of: str) -> Callable[[F], F]:
    """Declare that a property returns the newest of a stream, None where there is none.

    It stands below `@property`; elsewhere the stream is received for it all the time.
    """
    return lambda marked: _marked(marked, _NewestMark(of))


def part(function: F) -> F:
    """Declare that a property returns another declared object, or a mapping of names to such.

    It stands below `@property`. One that may be missing returns None then.
    """
    return _marked(function, _PartMark())


class Companion:
    """What keeps an eye on an application at another station, on this side of the line."""

    def close(self) -> None:
        """End what was begun here; any state."""

    def on_opened(self) -> None:
        """Begin: streams may be subscribed to from now on."""

    def on_state(self, *, first: bool) -> None:
        """Take note of a new state; `first` of this start of the station."""

    def on_commanded(self, command: str, arguments: Mapping[str, object]) -> None:
        """Take note that a command from here was carried out."""

    def look(self, silent_s: float) -> None:
        """Take note of for how long nothing has come; called again and again."""

    @property
    def ready(self) -> bool:
        """What is known suffices to begin."""
        return True


@checked_class
class Declared:
    """Base of a class that declares what an application offers; any thread.

    Here it is used directly. The attributes below are the same wherever it is.
    """

    elsewhere = Renamed("remote")
    moves_elsewhere = Renamed("moves_remotely")
    _change_event: "Event[[]] | None" = None

    @property
    def clock(self) -> Clock:
        """The clock by which the application goes."""
        return WALL

    @property
    def away(self) -> str:
        """Why the station cannot be reached; empty while it can, and here."""
        return ""

    @property
    def remote(self) -> str:
        """Where it runs, for the operator, such as "at the station fibres"; empty here."""
        return ""

    @property
    def refused(self) -> str:
        """Why the last wish of a window was not granted, where that was heard later; or empty."""
        return ""

    @property
    def missed(self) -> int:
        """How much of the streams did not reach this process."""
        return 0

    @property
    def moves_remotely(self) -> bool:
        """Something that was begun through this object still moves at another station."""
        return False

    def wall_s_here(self, wall_s: float) -> float:
        """Return what the wall clock of this process said when that of the application did."""
        return wall_s

    def on_change(self, listener: Callable[[], object]) -> Unsubscribe:
        """Call `listener()`, in any thread, when anything but streams changed."""
        with _lock:
            if self._change_event is None:
                self._change_event = Event()
            event = self._change_event
        return event.subscribe(listener)

    def note_change(self) -> None:
        """Tell everybody that something changed; for whoever changes it."""
        if self._change_event is not None:
            self._change_event.emit()

    def carry_out(
        self, action: Callable[[], T], on_result: OnResult[T], *, slow: bool = False
    ) -> None:
        """Do what may have to wait for a line, without waiting in a window's thread.

        `on_result` takes the result, or the `CosmicError` that was raised; here it is called at
        once, unless it is `slow` and there is a thread for that.
        """
        del slow
        do_and_report(action, on_result)

    def set_up_proxy(self, key: str, policy: FailurePolicy) -> None:
        """Prepare what a proxy of this class keeps on this side; `key` is that of the part."""

    def take_lease_of(self, lease: StationLease) -> None:
        """Let the lease of the station that hosts it decide who may move."""

    def made_companion(self) -> Companion | None:
        """Return what keeps an eye on the station where this is a proxy; None for nothing."""
        return None


@dataclass(frozen=True, slots=True)
class CommandDeclaration:
    """A command: what it needs, takes and returns."""

    name: str
    need: Need
    parameters: Mapping[str, Any]
    required: frozenset[str]
    result: Any


@dataclass(frozen=True, slots=True)
class StateDeclaration:
    """A property that is state."""

    name: str
    kind: Any
    unknown: object
    quiet: bool
    fixed: bool = False


@dataclass(frozen=True, slots=True)
class StreamDeclaration:
    """A stream of payloads of one kind."""

    name: str
    rule: Rule
    topic: str
    kind: Any
    missing: Callable[[Any, Any], int] | None
    asks: bool


@dataclass(frozen=True, slots=True)
class PartDeclaration:
    """Another declared object that may be missing, or several by name."""

    name: str
    kind: type[Declared]
    keyed: bool
    optional: bool = False


@dataclass(frozen=True, slots=True)
class Declaration:
    """All that a class declares, by name."""

    commands: dict[str, CommandDeclaration] = field(default_factory=dict)
    state: dict[str, StateDeclaration] = field(default_factory=dict)
    streams: dict[str, StreamDeclaration] = field(default_factory=dict)
    newest: dict[str, str] = field(default_factory=dict)
    parts: dict[str, PartDeclaration] = field(default_factory=dict)


_declarations: Final[dict[type[Declared], Declaration]] = {}


def declaration_of(kind: type[Declared]) -> Declaration:
    """Return what a class declares; what it names may travel from then on.

    Raises
    ------
    TypeError
        Something declared cannot be checked: an annotation is missing or of a kind unknown here.
    """
    known = _declarations.get(kind)
    if known is None:
        known = _declarations[kind] = _declared_by(kind)
    return known


def _declared_by(kind: type[Declared]) -> Declaration:
    found = Declaration()
    for name, member in inspect.getmembers_static(kind):
        function = member.fget if isinstance(member, property) else member
        mark = getattr(function, _MARK, None)
        if function is None or mark is None:
            continue
        where = f"{kind.__name__}.{name}"
        hints = get_type_hints(function)
        if isinstance(mark, Need):
            found.commands[name] = _command(where, function, mark, hints)
        elif isinstance(mark, _StateMark):
            _let_travel(where, hints.get("return"))
            unknown = mark.unknown if mark.unknown is not UNKNOWN else _empty(hints["return"])
            found.state[name] = StateDeclaration(
                name, hints["return"], unknown, mark.quiet, mark.fixed
            )
        elif isinstance(mark, _StreamMark):
            payload = _payload(where, hints)
            topic = mark.topic or name
            asks = WANTED in hints
            made = StreamDeclaration(name, mark.rule, topic, payload, mark.missing, asks)
            found.streams[name] = made
        elif isinstance(mark, _NewestMark):
            found.newest[name] = mark.of
        elif isinstance(mark, _PartMark):
            found.parts[name] = _part(where, name, hints)
            declaration_of(found.parts[name].kind)  # what it names may travel as well
    for name, of in found.newest.items():
        if of not in found.streams:
            raise TypeError(f"{kind.__name__}.{name} is the newest of {of}, which is not a stream")
    return found


def _command(
    where: str, function: Callable[..., object], need: Need, hints: dict[str, Any]
) -> CommandDeclaration:
    parameters: dict[str, Any] = {}
    required = set()
    for each in inspect.signature(function).parameters.values():
        if each.name == _OWN:
            continue
        if each.kind not in (each.POSITIONAL_OR_KEYWORD, each.KEYWORD_ONLY):
            raise TypeError(f"{where} cannot be declared: {each} has no name of its own")
        _let_travel(f"{where}, {each}", hints.get(each.name))
        parameters[each.name] = hints[each.name]
        if each.default is each.empty:
            required.add(each.name)
    result = hints.get("return")
    let_travel(result)
    let_travel(result_of(result))
    name = where.rpartition(".")[2]
    return CommandDeclaration(name, need, parameters, frozenset(required), result)


def result_of(kind: Any) -> Any:
    """Return what an operation of that kind ends with, as far as it travels; None: not known."""
    made = get_origin(kind) or kind
    if not (isinstance(made, type) and issubclass(made, Operation)):
        return None
    return made.sent_kind or next(iter(get_args(kind)), None)


def _payload(where: str, hints: dict[str, Any]) -> Any:
    receivers = [each for name, each in hints.items() if name not in ("return", WANTED)]
    if len(receivers) != 1 or get_origin(receivers[0]) is not Callable:
        raise TypeError(f"{where} cannot be a stream: {_ONE_RECEIVER}")
    taken = get_args(receivers[0])[0]
    if not isinstance(taken, list) or len(taken) != 1:
        raise TypeError(f"{where} cannot be a stream: {_ONE_RECEIVER}")
    _let_travel(where, taken[0])
    return taken[0]


def _part(where: str, name: str, hints: dict[str, Any]) -> PartDeclaration:
    kind = hints.get("return")
    optional = type(None) in get_args(kind)
    if optional:
        (kind,) = (each for each in get_args(kind) if each is not type(None))
    keyed = get_origin(kind) in (dict, Mapping)
    if keyed:
        kind = get_args(kind)[1]
    if not (isinstance(kind, type) and issubclass(kind, Declared)):
        raise TypeError(f"{where} cannot be a part: it does not return what is declared")
    return PartDeclaration(name, kind, keyed, optional)


def _annotation(annotation: Any) -> str:
    if annotation is None:
        return "its annotation is missing"
    return f"{annotation} cannot be checked when it travels"


def _let_travel(where: str, annotation: Any) -> None:
    if annotation is None or not can_check(annotation):
        raise TypeError(f"{where} cannot be declared: {_annotation(annotation)}")
    let_travel(annotation)


def _empty(annotation: Any) -> object:
    """Return the empty value of a kind, `UNKNOWN` where it has none."""
    origin = get_origin(annotation) or annotation
    if type(None) in get_args(annotation):
        return None
    if origin in (bool, int, float, str, bytes, tuple, list, dict):
        return origin()
    return {} if origin is Mapping else UNKNOWN
