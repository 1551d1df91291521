"""Calls to DAQCo at another station, from threads that may wait and from those that may not."""

from collections.abc import Callable, Mapping
from typing import Final, Protocol, TypeVar

from cosmic.daqco.api.errands import Errands, Told, do_and_tell
from cosmic.frame.errors import WrongThreadError
from cosmic.frame.network.transport import CALL_TIMEOUT_S, Transport
from cosmic.frame.threads import forbid_waiting_here

T = TypeVar("T")
SLOW_CALL_S: Final = 20.0
"""Opening boards and closing files may take that long."""
_READS: Final = ("report", "now_s", "folder", "name_recording", "recordings", "mark")


class Asks(Protocol):
    """Has something done at the station."""

    def __call__(self, function: str, arguments: Mapping[str, object] | None = None, /) -> object:
        """Call `function` there, take the report if it returns one, and return what it returns."""


def may_wait() -> bool:
    """Return whether the calling thread may wait for a line."""
    try:
        forbid_waiting_here("waiting for a station")
    except WrongThreadError:
        return False
    return True


class DaqcoLine:
    """One application at one station, as calls; any thread that may wait."""

    def __init__(self, transport: Transport, name: str, errands: Errands) -> None:
        self._transport = transport
        self._name = name
        self._errands = errands

    def call(self, function: str, arguments: Mapping[str, object] | None = None, /) -> object:
        """Call a function there and return its result; raises as `Transport.call`."""
        timeout_s = CALL_TIMEOUT_S if function in _READS else SLOW_CALL_S
        return self._transport.call(self._name, function, arguments, timeout_s=timeout_s)

    def carry_out(self, action: Callable[[], T], told: Told[T]) -> None:
        """Do `action` here, or aside where this thread must not wait, and tell how it ended."""
        if may_wait():
            do_and_tell(action, told)
        else:
            self._errands.do(action, told)
