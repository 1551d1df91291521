"""`Interrupted`: a signal that ends the program ends a command in order, and is no traceback.

Free of Qt: the command line, which uses it, loads no more than it needs. What runs on by itself,
a station, a campaign or a window, asks `cosmic.frame.platform_services.ending_signals` instead.
"""

import signal
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import Final

from cosmic.frame.errors import CosmicError
from cosmic.frame.platform_services import ending_signals

_SIGNALLED: Final = 128
"""What a shell adds to the number of the signal that ended a program."""


class Interrupted(KeyboardInterrupt):
    """Terminal or system ask the program to end; raised in the main thread, where it just is.

    No `Exception`, so that nothing takes it for a failure of its own and goes on.

    Parameters
    ----------
    name : str
        Of the signal, such as "SIGTERM".
    """

    def __init__(self, name: str) -> None:
        super().__init__(f"interrupted by {name}")
        self.name = name

    @property
    def exit_code(self) -> int:
        """What the program returns: 130 after SIGINT, 143 after SIGTERM."""
        return _SIGNALLED + signal.Signals[self.name].value


@contextmanager
def interruptible() -> Generator[None]:
    """Raise `Interrupted` here at a signal that ends the program; outside the main thread nothing.

    Raises
    ------
    Interrupted
        There was one.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    with ending_signals(_interrupt):
        yield


def _interrupt(name: str) -> None:
    raise Interrupted(name)


@contextmanager
def held_back(at_once: Callable[[str], object] | None = None) -> Generator[None]:
    """Raise `Interrupted` only behind what is within, so that it is done whole. Main thread.

    Where what is within fails after a signal, that is how it ended, and is not raised.

    Parameters
    ----------
    at_once : callable, optional
        Called at each signal with its name, such as to have what is within end earlier.

    Raises
    ------
    Interrupted
        There was a signal.
    """
    heard: list[str] = []

    def hear(name: str) -> None:
        heard.append(name)
        if at_once is not None:
            at_once(name)

    with ending_signals(hear):
        try:
            yield
        except CosmicError:
            if not heard:
                raise
    if heard:
        raise Interrupted(heard[0])
