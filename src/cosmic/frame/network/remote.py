"""Which functions of an application may be called from another station, and with what."""

import inspect
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final, Protocol, TypeVar, get_type_hints, overload, runtime_checkable

from cosmic.frame.arguments import reason_of
from cosmic.frame.network.caller import MOVE_LIMIT_S
from cosmic.frame.network.conform import Mismatch, can_check, conform
from cosmic.frame.network.errors import CallRefused

F = TypeVar("F", bound=Callable[..., Any])
_MARK: Final = "__cosmic_remote__"


@dataclass(frozen=True, slots=True)
class RemoteMark:
    """What `remote` said of a function; `renews`: it only keeps alive what was begun before."""

    moves: bool
    reads: bool
    at_once: bool
    limit_s: float
    renews: bool = False


@overload
def remote(function: F) -> F: ...
@overload
def remote(
    *, moves: bool = False, reads: bool = False, at_once: bool = False, limit_s: float = ...
) -> Callable[[F], F]: ...
def remote(
    function: F | None = None,
    *,
    moves: bool = False,
    reads: bool = False,
    at_once: bool = False,
    limit_s: float = MOVE_LIMIT_S,
) -> F | Callable[[F], F]:
    """Let a function of an application be called from another station; a decorator.

    Every parameter needs an annotation; what is sent is checked against it. On a property it
    stands below `@property`, and the property is read by calling its name.

    Parameters
    ----------
    moves : bool
        It moves something: only the holder of the lease may call it.
    reads : bool
        It changes nothing and returns at once: anybody may call it, and it is not in the log.
    at_once : bool
        It overtakes every other call, as `stop` does; it must return at once.
    limit_s : float
        How long the caller may be silent before what the call set in motion stops.
    """

    def mark(marked: F) -> F:
        setattr(marked, _MARK, RemoteMark(moves, reads, at_once, limit_s))
        return marked

    return mark if function is None else mark(function)


@dataclass(frozen=True, slots=True)
class Offered:
    """A function that may be called.

    Attributes
    ----------
    mark : RemoteMark
        What kind of function it is.
    run : callable
        Carries it out with arguments by name.
    parameters : mapping of str to annotation
        What it takes.
    required : frozenset of str
        What has to be given.
    """

    name: str
    mark: RemoteMark
    run: Callable[..., object]
    parameters: Mapping[str, Any]
    required: frozenset[str]

    @property
    def ends(self) -> bool:
        """It ends something, as a stop does: whatever reason it is given, it is carried out."""
        return self.mark.at_once and not self.mark.renews

    def checked(self, arguments: Mapping[str, object]) -> dict[str, object]:
        """Return the arguments as the function takes them.

        What `ends` something loses those that it does not take.

        Raises
        ------
        CallRefused
            One is unknown, missing, or not of its type.
        """
        if self.ends:
            arguments = self._taken(arguments)
        surplus = [str(name)[:60] for name in arguments if name not in self.parameters]
        missing = self.required.difference(arguments)
        if surplus or missing:
            said = [name for name in self.parameters if name.isidentifier()]  # the rest is ours
            raise CallRefused(
                f"{self.name} takes {', '.join(said) or 'nothing'}; "
                f"unknown: {', '.join(surplus) or 'none'}, "
                f"missing: {', '.join(sorted(missing)) or 'none'}"
            )
        checked = {}
        for name, value in arguments.items():
            try:
                checked[name] = conform(value, self.parameters[name])
            except Mismatch as exc:
                raise CallRefused(
                    f"{self.name} was called with a wrong argument {name}: {exc}"
                ) from exc
        return checked

    def _taken(self, arguments: Mapping[str, object]) -> dict[str, object]:
        taken: dict[str, object] = {}
        for name, value in arguments.items():
            kind = self.parameters.get(name)
            with suppress(Mismatch):
                if kind is not None:
                    taken[name] = reason_of(value) if kind is str else conform(value, kind)
        return taken


@runtime_checkable
class Offers(Protocol):
    """Says itself what may be called."""

    @property
    def offered(self) -> dict[str, Offered]:
        """What may be called, by name."""


def offered_by(application: object) -> dict[str, Offered]:
    """Return what `application` offers: the functions and properties of its class so marked.

    One that `Offers` says itself what it offers.

    Raises
    ------
    TypeError
        A marked function cannot be checked: an annotation is missing or of a kind unknown here.
    """
    if isinstance(application, Offers):
        return application.offered
    found: dict[str, Offered] = {}
    for name, member in inspect.getmembers_static(type(application)):
        if isinstance(member, property) and member.fget is not None:
            mark = getattr(member.fget, _MARK, None)
            if mark is not None:
                found[name] = Offered(name, mark, _reader(application, name), {}, frozenset())
        elif mark := getattr(member, _MARK, None):
            found[name] = _offered(name, mark, getattr(application, name))
    return found


def _reader(application: object, name: str) -> Callable[[], object]:
    return lambda: getattr(application, name)


def _offered(name: str, mark: RemoteMark, function: Callable[..., object]) -> Offered:
    hints = get_type_hints(function)
    parameters: dict[str, Any] = {}
    required = set()
    for each in inspect.signature(function).parameters.values():
        by_name = each.kind in (each.POSITIONAL_OR_KEYWORD, each.KEYWORD_ONLY)
        if not by_name or each.name not in hints or not can_check(hints[each.name]):
            raise TypeError(f"{name} cannot be remote: its parameter {each} cannot be checked")
        parameters[each.name] = hints[each.name]
        if each.default is each.empty:
            required.add(each.name)
    return Offered(name, mark, function, parameters, frozenset(required))
