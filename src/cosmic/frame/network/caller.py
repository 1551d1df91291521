"""Who calls, as the code that is called may ask."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from enum import IntEnum
from typing import Final

from cosmic.frame.network.dead_man import DeadMan

JOG_LIMIT_S: Final = 0.3
"""Silence after which motion without an end of its own stops."""
MOVE_LIMIT_S: Final = 1.0
"""Silence after which any other motion stops, and the lease lapses."""


class Access(IntEnum):
    """What a client may do; each includes those before it."""

    VIEW = 1
    """Subscribe, and call what only reads."""
    CALL = 2
    """Call everything that moves nothing."""
    MOVE = 3
    """Take the lease and move."""


@dataclass(frozen=True, slots=True)
class Caller:
    """Who called.

    Attributes
    ----------
    name : str
        What log and windows show.
    token : str
        Proof of its session; never shown.
    access : Access
        What it may do.
    local : bool
        It runs in this process.
    door : str
        How it comes: "station", "http", "mcp", "epics".
    """

    name: str
    token: str
    access: Access = Access.MOVE
    local: bool = False
    door: str = "station"


def _never(_at: tuple[str, ...]) -> bool:
    return False


@dataclass(frozen=True, slots=True)
class Call:
    """A call being carried out.

    Attributes
    ----------
    caller : Caller
        Who called.
    dead_man : DeadMan or None
        To be polled by the thread that moves: it expires when the caller dies, freezes, is cut
        off or loses the lease. None when the function moves nothing.
    overtaken : callable
        Returns whether the caller has halted the part at that address since it gave this command.
    """

    caller: Caller
    dead_man: DeadMan | None = None
    overtaken: Callable[[tuple[str, ...]], bool] = _never


_LONGEST: Final = 120
_current: Final[ContextVar[Call | None]] = ContextVar("cosmic_call", default=None)


def current_call() -> Call | None:
    """Return the call that this thread carries out; None when no station carries it out."""
    return _current.get()


def one_line(text: str) -> str:
    """Return `text` as it may stand in a log: short, and in one line."""
    return "".join(each if each.isprintable() else " " for each in text[:_LONGEST])


def source_of(source: str) -> str:
    """Return who commands, for the log: `source` here, the name of a client before it."""
    call = current_call()
    return source if call is None else f"{call.caller.name} {one_line(source)}".strip()


def caller_token() -> str:
    """Return the token of the client whose call this thread carries out; empty for none."""
    call = current_call()
    return "" if call is None else call.caller.token


def caller_dead_man() -> DeadMan | None:
    """Return the dead man of the call that this thread carries out; None where it has none."""
    call = current_call()
    return None if call is None else call.dead_man


def called_remotely() -> bool:
    """Return whether this thread does what another process asked for."""
    call = _current.get()
    return call is not None and not call.caller.local


@contextmanager
def carrying_out(call: Call) -> Iterator[None]:
    """Say what this thread carries out, while it does."""
    token = _current.set(call)
    try:
        yield
    finally:
        _current.reset(token)
