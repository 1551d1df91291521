"""Arguments of what scripts call, checked where they come in: a wrong one is named at once.

A number is any real number, numpy's as well, but no truth value, text or bytes. What a number may
be is for whoever takes it to say: here only its kind is looked at.
"""

import inspect
import os
import types
import typing
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import is_dataclass
from enum import Enum
from functools import wraps
from numbers import Integral, Real
from pathlib import Path
from threading import TIMEOUT_MAX
from types import SimpleNamespace
from typing import Any, Final, ParamSpec, TypeVar, cast

from cosmic.frame.errors import ArgumentError

P = ParamSpec("P")
R = TypeVar("R")
C = TypeVar("C", bound=type)

Check = Callable[[object], object]
"""Returns the value as it is handed on; raises `_WrongKindError`."""

_PLAIN: Final = (type(None), bool, int, float, complex, str, bytes, list, tuple, dict, set)
_MOST_LOOKED_AT: Final = 1000
_LARGEST: Final = 1e300
_TIMES: Final = ("timeout_s", "budget_s", "since_s", "start_s", "end_s", "interval_s")
"""What is waited for, or looked up: the system takes no others."""
_CHECKED_FURTHER_IN: Final = ("position", "distance", "value")
"""Targets: the gate refuses what is none, with its reason."""
_NEVER_REFUSED: Final = ("stop", "abort", "cancel", "halt", "stop_outputs")
"""What ends a movement does so whatever reason it is given; see `reason_of`."""
_LONGEST_REASON: Final = 500


class _WrongKindError(Exception):
    """What is wanted, in words."""

    of_value = False


class _WrongValueError(_WrongKindError):
    of_value = True


def checked(function: Callable[P, R]) -> Callable[P, R]:
    """Have the arguments of a function checked by its annotations; for what scripts call.

    The function raises `TypeError` with the name of the argument, before anything was done.
    """
    signature = inspect.signature(function)
    parameters = signature.parameters.values()
    names = [
        each.name
        for each in parameters
        if each.kind in (each.POSITIONAL_ONLY, each.POSITIONAL_OR_KEYWORD)
    ]
    several = next((each.name for each in parameters if each.kind is each.VAR_POSITIONAL), None)
    checks: dict[str, Check] | None = None

    @wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        nonlocal checks
        if checks is None:  # not before: what annotations name may be loaded later
            checks = _checks_of(function, signature)
        given: list[object] = list(args)
        for index, value in enumerate(args):
            name = names[index] if index < len(names) else several
            if name in checks and name is not None:
                given[index] = _taken(checks[name], name, value, function)
        named: dict[str, object] = {
            name: _taken(checks[name], name, value, function) if name in checks else value
            for name, value in kwargs.items()
        }
        return cast("Callable[..., R]", function)(*given, **named)

    return call


def checked_class(kind: C) -> C:
    """Have the arguments of all public methods that a class defines checked, as `checked` does."""
    for name, member in list(vars(kind).items()):
        made = name == "__getitem__" or (name == "__init__" and is_dataclass(kind))
        if name in _NEVER_REFUSED or (name.startswith("_") and not made):
            continue
        if isinstance(member, staticmethod | classmethod):
            setattr(kind, name, type(member)(checked(member.__func__)))
        elif inspect.isfunction(member):
            setattr(kind, name, checked(member))
        elif isinstance(member, property) and member.fset is not None:
            setattr(kind, name, member.setter(checked(member.fset)))
    return kind


def reason_of(given: object) -> str:
    """Return what a stop was given as its reason as a short text; empty for nothing.

    Whatever it is, it keeps no stop from being carried out, here or at a station.
    """
    try:
        text = "" if given is None else str(given)
    except Exception:  # noqa: BLE001 - foreign code
        text = type(given).__name__
    return "".join(each if each.isprintable() else " " for each in text[:_LONGEST_REASON])


def check_fault(name: str, known: Collection[str]) -> None:
    """Raise `ArgumentError` where a simulator knows no fault of this name."""
    if name not in known:
        raise ArgumentError(f"there is no fault {name!r}; known: {', '.join(known)}")


def check_path(name: str, path: str | Path) -> None:
    """Refuse what no file can be called: too long, or with a zero in it.

    Raises
    ------
    ArgumentError
        It can be no file; the text has the name of the argument.
    """
    try:
        Path(path).stat()
    except (FileNotFoundError, NotADirectoryError, PermissionError):
        pass  # told when it is opened
    except (OSError, ValueError) as exc:
        why = getattr(exc, "strerror", None) or exc
        raise ArgumentError(f"{name}: {str(path)[:80]!r} can be no file ({why})") from exc


def check_named(name: str, path: str | Path) -> None:
    """Refuse what no file can be called, and no name at all: that is the working directory.

    Raises
    ------
    ArgumentError
        It is empty, or can be no file; the text has the name of the argument.
    """
    check_path(name, path)
    if not str(path).strip():
        raise ArgumentError(f"{name} is empty; give one by name, such as 'out'")


def _taken(check: Check, name: str, value: object, function: Callable[..., object]) -> object:
    try:
        return check(value)
    except _WrongKindError as exc:
        where = getattr(function, "__name__", "")
        kind = ArgumentError if exc.of_value else TypeError
        raise kind(f"{where}: {name} must be {exc}, not {_shown(value)}") from None


def _shown(value: object) -> str:
    try:
        text = repr(value)
    except Exception:  # noqa: BLE001 - whatever a stranger's object does
        text = "?"
    return f"{text[:60]}{'…' if len(text) > 60 else ''} ({type(value).__name__})"


def _checks_of(function: Callable[..., object], signature: inspect.Signature) -> dict[str, Check]:
    found: dict[str, Check] = {}
    known = getattr(inspect.unwrap(function), "__globals__", {})
    for name, parameter in signature.parameters.items():
        hint = _resolved(parameter.annotation, known)
        check = None if isinstance(hint, str) else _check_for(hint)
        if name in _CHECKED_FURTHER_IN:
            check = _no_bytes
        if name in _TIMES and check is not None:
            check = _time(check)
        if check is not None:
            found[name] = check
    return found


def _resolved(hint: object, known: dict[str, object]) -> object:
    """Return what an annotation in quotes means; itself where that is for mypy only."""
    if not isinstance(hint, str):
        return hint
    try:
        return typing.get_type_hints(SimpleNamespace(__annotations__={"it": hint}), known)["it"]
    except (NameError, TypeError, AttributeError):
        return hint


def _check_for(hint: Any) -> Check | None:
    """Return what checks a value against an annotation; None: anything goes."""
    if hint in _SIMPLE:
        return _SIMPLE[hint]
    origin = typing.get_origin(hint)
    if origin in (typing.Union, types.UnionType):
        return _any_of(hint)
    if origin is typing.Literal:
        return _words(typing.get_args(hint))
    if origin is None:
        return _plain_class(hint) if isinstance(hint, type) else None
    if origin is os.PathLike:
        return _path
    if not isinstance(origin, type):
        return None
    if issubclass(origin, Mapping):
        return _mapping
    if origin is tuple:
        return _fixed(typing.get_args(hint))
    if origin in (list, set, frozenset, Iterable, Collection) or issubclass(origin, Sequence):
        return _many(typing.get_args(hint))
    return _plain_class(origin)


def _number(value: object) -> object:
    if isinstance(value, bool) or not isinstance(value, Real):
        raise _WrongKindError("a number")
    if isinstance(value, Integral) and not -_LARGEST < int(value) < _LARGEST:
        raise _WrongValueError("a number of a size that a computer has")
    return value if isinstance(value, float | int) else float(value)


def _whole(value: object) -> object:
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise _WrongKindError("a whole number")
    return int(value)


def _truth(value: object) -> object:
    if isinstance(value, bool):
        return value
    if type(value).__name__ in ("bool", "bool_") and type(value).__module__ == "numpy":
        return bool(value)
    raise _WrongKindError("True or False")


def _text(value: object) -> object:
    if not isinstance(value, str):
        raise _WrongKindError("a text")
    return value


def _path(value: object) -> object:
    if not isinstance(value, str | os.PathLike) or isinstance(os.fspath(value), bytes):
        raise _WrongKindError("a path")
    return Path(value)


def _named(value: object) -> object:
    """Return a path; an empty text as it is, for a path of it is the working directory."""
    return value if isinstance(value, str) and not value else _path(value)


def _time(check: Check) -> Check:
    """Return a check for seconds: finite, and no more than can be waited for."""

    def checked_time(value: object) -> object:
        found = check(value)
        if isinstance(found, float | int) and not -TIMEOUT_MAX < found < TIMEOUT_MAX:
            raise _WrongValueError(f"a time, a finite number of less than {TIMEOUT_MAX:.0f} s")
        return found

    return checked_time


def _no_bytes(value: object) -> object:
    if isinstance(value, bytes | bytearray):  # float() would read them
        raise _WrongKindError("a number or a text")
    return value


def _none(value: object) -> object:
    if value is not None:
        raise _WrongKindError("None")
    return value


_SIMPLE: Final[dict[object, Check]] = {
    float: _number,
    int: _whole,
    bool: _truth,
    str: _text,
    Path: _path,
    type(None): _none,
    None: _none,
}


def _any_of(hint: Any) -> Check | None:
    kinds = typing.get_args(hint)
    paths = any(each is Path or typing.get_origin(each) is os.PathLike for each in kinds)
    # A text beside a path is one.
    named = (str, Path) if paths and str in kinds else ()
    checks = [_named if each in named else _check_for(each) for each in kinds]
    if any(each is None for each in checks):
        return None

    def check(value: object) -> object:
        wanted = []
        for each in checks:
            try:
                return each(value) if each is not None else value
            except _WrongValueError:
                raise
            except _WrongKindError as exc:
                wanted.append(str(exc))
        raise _WrongKindError(" or ".join(dict.fromkeys(wanted)))

    return check


def _words(words: tuple[object, ...]) -> Check:
    def check(value: object) -> object:
        if not any(type(value) is type(each) for each in words) and not isinstance(value, str):
            raise _WrongKindError(f"one of {', '.join(map(repr, words))}")
        return value

    return check


def _mapping(value: object) -> object:
    # What is in it is judged further in: the gate refuses a target with its reason.
    if not isinstance(value, Mapping):
        raise _WrongKindError("a mapping, such as a dict")
    for each in value.values():
        _no_bytes(each)
    return value


def _many(kinds: tuple[Any, ...]) -> Check:
    one = _check_for(kinds[0]) if kinds else None

    def check(value: object) -> object:
        single = isinstance(value, str | Mapping) and one is not _text
        if single or isinstance(value, bytes) or not isinstance(value, Iterable):
            raise _WrongKindError("a list or another sequence")
        listed = isinstance(value, list | tuple) or type(value).__module__ == "numpy"
        for each in list(value)[:_MOST_LOOKED_AT] if listed else ():
            try:
                _ = one(each) if one is not None else None
            except _WrongKindError as exc:
                raise _WrongKindError(f"a sequence of which each is {exc}") from None
        return value

    return check


def _fixed(kinds: tuple[Any, ...]) -> Check:
    """Return what checks a tuple, which may come as a list or an array as well."""
    if len(kinds) != 2 or kinds[1] is not Ellipsis:
        checks = [_check_for(each) for each in kinds]

        def check(value: object) -> object:
            found = _many(())(value)
            items = list(cast("Iterable[object]", found))
            if isinstance(value, str | Mapping) or len(items) != len(checks):
                raise _WrongKindError(f"{len(checks)} values")
            return tuple(
                item if one is None else one(item) for one, item in zip(checks, items, strict=True)
            )

        return check
    many = _many(kinds[:1])
    return lambda value: tuple(cast("Iterable[object]", many(value)))


def _plain_class(kind: type) -> Check | None:
    """Refuse what is of a plain kind where something of the program's is wanted."""
    if cast("object", kind) is Callable:
        return _callable
    if issubclass(kind, Enum):
        return _member(kind)
    return _not_plain(kind, f"a {kind.__name__}") if kind.__module__.startswith("cosmic.") else None


def _not_plain(kind: type, wanted: str) -> Check:
    # Data is read by its names; what does something may have a double.
    strict = is_dataclass(kind) or hasattr(kind, "model_fields")

    def check(value: object) -> object:
        plain = isinstance(value, _PLAIN) or type(value) is object
        plain = plain or type(value).__module__ == "numpy"
        if (strict or plain) and not _is_one(value, kind):
            raise _WrongKindError(wanted)
        return value

    return check


def _is_one(value: object, kind: type) -> bool:
    try:
        return isinstance(value, kind)
    except TypeError:  # a protocol that cannot be asked
        return False


def _member(kind: type[Enum]) -> Check:
    words = ", ".join(str(each.value) for each in kind)

    def check(value: object) -> object:
        if isinstance(value, kind) or (issubclass(kind, str) and isinstance(value, str)):
            return value
        raise _WrongKindError(f"a {kind.__name__}: {words}")

    return check


def _callable(value: object) -> object:
    if not callable(value):
        raise _WrongKindError("something that can be called")
    return value
