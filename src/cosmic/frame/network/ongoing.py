"""What goes on after a call has returned (a task, a movement), followed from elsewhere."""

import logging
import secrets
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from threading import Lock
from typing import Final, Protocol, runtime_checkable

import numpy as np

from cosmic.frame.errors import CosmicError
from cosmic.frame.events import notify
from cosmic.frame.network.errors import CallRefused, RemoteDefect
from cosmic.frame.network.transfer import transferable
from cosmic.frame.network.travelling_errors import to_plain
from cosmic.frame.operation import Progress

logger = logging.getLogger(__name__)

transferable(Progress)

_MOST_TICKETS: Final = 256
_PLAIN: Final = (float, int, str, bytes, list, tuple, dict, np.ndarray, type(None))


@runtime_checkable
class Ongoing(Protocol):
    """The shape of a `Task` and a `Movement`."""

    @property
    @abstractmethod
    def done(self) -> bool:
        """True when it has ended."""

    @abstractmethod
    def cancel(self) -> None:
        """End it early."""

    @abstractmethod
    def wait(self, timeout_s: float | None = None) -> object:
        """Wait for the end; raises what it failed with."""


@transferable
@dataclass(frozen=True, slots=True)
class Ticket:
    """Stands for something that goes on at the station."""

    number: str
    title: str


@transferable
@dataclass(frozen=True, slots=True)
class StateMessage:
    """State of a declared object, and of its parts.

    Attributes
    ----------
    start : str
        Another one at each start of the station.
    number : int
        Counts the messages of that start; the newest replaces all before it.
    at : tuple of str
        Which object: names of parts and their keys, from the application down.
    values : dict
        By the name of a property or a part.
    clock_rate : float
        How many seconds of the platform go by in one of the wall.
    wall_s : float
        What the wall clock of the station says.
    whole : bool
        What never changes is in it as well.
    """

    start: str
    number: int
    at: tuple[str, ...]
    values: dict[str, object]
    clock_rate: float
    wall_s: float = 0.0
    whole: bool = True


@transferable
@dataclass(frozen=True, slots=True)
class Ended:
    """How an operation ended, and the state of the application after it.

    Attributes
    ----------
    error : list or None
        The exception as plain values.
    """

    result: object
    error: list[object] | None
    state: StateMessage


@transferable
@dataclass(frozen=True, slots=True)
class Answered:
    """What a command returned, and the state of its object after it."""

    result: object
    state: StateMessage


Send = Callable[[list[object]], None]


class Tickets:
    """What goes on at a station for one session; any thread.

    Parameters
    ----------
    send : callable
        Sends ``[ticket, progress or None, done, result, exception or None]`` to the session;
        returns at once.
    """

    def __init__(self, send: Send) -> None:
        self._send = send
        self._lock = Lock()
        self._running: dict[str, tuple[Ongoing, bool]] = {}

    def wrap(self, result: object, *, moves: bool) -> object:
        """Return a `Ticket` in place of something that goes on, anything else as it is.

        Raises
        ------
        CallRefused
            Too much goes on for this session; what came last was cancelled.
        """
        if isinstance(result, Answered):
            return Answered(self.wrap(result.result, moves=moves), result.state)
        if isinstance(result, _PLAIN) or not isinstance(result, Ongoing):
            return result
        number = secrets.token_hex(8)
        with self._lock:
            full = len(self._running) >= _MOST_TICKETS
            if not full:
                self._running[number] = (result, moves)
        if full:
            result.cancel()
            raise CallRefused(f"{_MOST_TICKETS} things go on for this client already")
        self._follow(number, result)
        return Ticket(number, str(getattr(result, "title", "")))

    def cancel(self, number: object) -> None:
        """End one early.

        Raises
        ------
        CallRefused
            There is none of that number, or it has ended.
        """
        with self._lock:
            found = self._running.get(number) if isinstance(number, str) else None
        if found is not None:
            found[0].cancel()

    def cancel_motion(self) -> None:
        """End early everything that moves, because nobody watches it any more."""
        with self._lock:
            moving = [ongoing for ongoing, moves in self._running.values() if moves]
        for each in moving:
            if not each.done:
                notify(each.cancel)  # one that fails leaves nothing else moving

    def _follow(self, number: str, ongoing: Ongoing) -> None:
        subscribe = getattr(ongoing, "subscribe", None)
        add_callback = getattr(ongoing, "add_callback", None)

        def on_progress(progress: Progress) -> None:
            if progress.done:
                self._finish(number, ongoing)
            else:
                self._send([number, progress, False, None, None])

        if subscribe is not None:
            subscribe(on_progress)
        elif add_callback is not None:
            add_callback(lambda *_: self._finish(number, ongoing))
        else:
            logger.warning("the end of %r cannot be told: it has no add_callback", ongoing)

    def _finish(self, number: str, ongoing: Ongoing) -> None:
        with self._lock:
            if self._running.pop(number, None) is None:
                return
        try:
            result = ongoing.wait(0.0)
        except CosmicError as exc:
            self._send([number, None, True, None, to_plain(exc)])
        except Exception as exc:  # noqa: BLE001 - whoever carried it out has reported it
            self._send([number, None, True, None, to_plain(RemoteDefect(repr(exc)))])
        else:
            self._send([number, None, True, result, None])
