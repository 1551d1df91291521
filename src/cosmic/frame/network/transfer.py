"""Which enumerations and dataclasses may travel between stations, by name."""

from dataclasses import is_dataclass
from enum import Enum
from threading import Lock
from typing import Final, TypeVar

from cosmic.frame.verdict import MoveVerdict, Reason

C = TypeVar("C", bound=type)

_known: Final[dict[str, type]] = {}
_lock: Final = Lock()


def transferable(cls: C) -> C:
    """Let an enumeration or a dataclass travel; a decorator, or called with a class.

    Both stations have to know it. Its fields are checked against their annotations on arrival.

    Raises
    ------
    TypeError
        It is neither, or another class of that name is known already.
    """
    if not (is_dataclass(cls) or issubclass(cls, Enum)):
        raise TypeError(f"only enumerations and dataclasses travel, not {cls!r}")
    with _lock:
        if _known.setdefault(cls.__name__, cls) is not cls:
            raise TypeError(
                f"another class {cls.__name__} travels already: {_known[cls.__name__]!r}"
            )
    return cls


def known_class(name: object) -> type | None:
    """Return the class that travels under `name`, or None."""
    return _known.get(name) if isinstance(name, str) else None


def may_travel(cls: type) -> bool:
    """Return whether `cls` was registered."""
    return _known.get(cls.__name__) is cls


transferable(MoveVerdict)
transferable(Reason)
