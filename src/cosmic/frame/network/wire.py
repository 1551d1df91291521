"""What an engine between processes has to do: carry bytes under keys. It knows no application."""

from abc import abstractmethod
from typing import Protocol, runtime_checkable

from cosmic.frame.network.delivery import Inbox
from cosmic.frame.network.line_settings import Line
from cosmic.frame.network.transport import Rule


class Question(Protocol):
    """A message that waits for its answer."""

    @property
    @abstractmethod
    def key(self) -> str:
        """Where it was sent to."""

    @property
    @abstractmethod
    def message(self) -> bytes:
        """What was sent."""

    @abstractmethod
    def answer(self, message: bytes) -> None:
        """Answer it, once; any thread. Does nothing when the asker is gone."""


class Outlet(Protocol):
    """Where messages of one topic go out; one thread at a time, but `wanted` is for any."""

    @property
    @abstractmethod
    def wanted(self) -> bool:
        """Whether anybody receives them; False once it is closed."""

    @abstractmethod
    def put(self, message: bytes) -> None:
        """Send one; may wait while the line is full."""

    @abstractmethod
    def close(self) -> None:
        """Release it."""


class Liveliness(Protocol):
    """A token that others see as long as it stands and the line holds."""

    @abstractmethod
    def close(self) -> None:
        """Take it away."""


class Wire(Protocol):
    """One end of an engine; any thread. It reconnects by itself."""

    @abstractmethod
    def ask(self, key: str, message: bytes, *, timeout_s: float) -> bytes:
        """Send a message and return the answer to it.

        Raises
        ------
        StationAway
            Nobody is there to answer.
        StationTimeout
            No answer came in time.
        """

    @abstractmethod
    def questions(self, keys: str) -> Inbox[Question]:
        """Receive the questions to `keys`, which may end in ``/**``."""

    @abstractmethod
    def outlet(self, key: str, rule: Rule) -> Outlet:
        """Return where messages under `key` go out to those who want `rule`."""

    @abstractmethod
    def inlet(self, key: str, rule: Rule) -> Inbox[bytes]:
        """Receive the messages under `key`."""

    @abstractmethod
    def liveliness(self, key: str) -> Liveliness:
        """Set up a token that says that this end is alive."""

    @abstractmethod
    def watch_liveliness(self, keys: str) -> Inbox[tuple[str, bool]]:
        """Receive tokens as they come (True) and go (False), those there are first."""

    @abstractmethod
    def close(self) -> None:
        """Close it and release everything; every inbox then raises. Any state."""


@runtime_checkable
class WithLine(Protocol):
    """A wire beside which direct lines may be opened."""

    @property
    @abstractmethod
    def line(self) -> Line:
        """Where it goes, and what both sides prove themselves with."""
