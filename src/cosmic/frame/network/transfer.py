"""Which enumerations, dataclasses and settings may travel between stations, by name."""

from dataclasses import fields, is_dataclass
from enum import Enum
from threading import Lock
from typing import Any, Final, TypeVar, get_args, get_type_hints

from cosmic.frame.config import StrictModel
from cosmic.frame.verdict import MoveVerdict, Reason

C = TypeVar("C", bound=type)

_known: Final[dict[str, type]] = {}
_walked: Final[set[type]] = set()
_lock: Final = Lock()


def transferable(cls: C) -> C:
    """Let an enumeration, a dataclass or settings travel; a decorator, or called with a class.

    Both stations have to know it. Its fields are checked against their annotations on arrival.

    Raises
    ------
    TypeError
        It is neither, or another class of that name is known already.
    """
    if not (is_dataclass(cls) or issubclass(cls, (Enum, StrictModel))):
        raise TypeError(f"only enumerations, dataclasses and settings travel, not {cls!r}")
    with _lock:
        if _known.setdefault(cls.__name__, cls) is not cls:
            raise TypeError(
                f"another class {cls.__name__} travels already: {_known[cls.__name__]!r}"
            )
    return cls


def let_travel(annotation: Any) -> None:
    """Let every class that an annotation names travel, with those of its fields."""
    for each in get_args(annotation):
        let_travel(each)
    if not isinstance(annotation, type) or get_args(annotation):
        return
    data = is_dataclass(annotation)
    if not (data or issubclass(annotation, (Enum, StrictModel))) or annotation in _walked:
        return
    _walked.add(annotation)
    transferable(annotation)
    if data:
        hints = get_type_hints(annotation)
        for each in fields(annotation):
            let_travel(hints[each.name])


def known_class(name: object) -> type | None:
    """Return the class that travels under `name`, or None."""
    return _known.get(name) if isinstance(name, str) else None


def may_travel(cls: type) -> bool:
    """Return whether `cls` was registered."""
    return _known.get(cls.__name__) is cls


transferable(MoveVerdict)
transferable(Reason)
