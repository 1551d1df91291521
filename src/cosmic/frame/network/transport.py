"""What code that uses a station sees: four functions, wherever the station is."""

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Final, Protocol

CALL_TIMEOUT_S: Final = 2.0
SHARED_PREFIX: Final = "shared/"
"""Topics that begin so may be published to by clients; all others belong to the station."""


class Rule(StrEnum):
    """What a subscriber wants of a topic."""

    LATEST = "latest"
    """Only the newest: what came meanwhile is passed over."""
    ALL = "all"
    """Each one, in order; what is lost all the same is counted."""


@dataclass(frozen=True, slots=True)
class Presence:
    """Whether a station or one of its clients is there.

    Attributes
    ----------
    name : str
        Its name.
    here : bool
        It can be reached now.
    why : str
        Why not; empty while it is there.
    """

    name: str
    here: bool
    why: str = ""


Receiver = Callable[[object], None]
PresenceListener = Callable[[Presence], None]


class Subscription(Protocol):
    """A topic being received; the receiver is called in a thread of its own."""

    @property
    @abstractmethod
    def lost(self) -> int:
        """How many were lost that the rule `ALL` promised."""

    @abstractmethod
    def close(self) -> None:
        """End it; the receiver is not called any more. Not from within the receiver."""


class Transport(Protocol):
    """One station, as its user sees it; any thread."""

    @abstractmethod
    def call(
        self,
        application: str,
        function: str,
        arguments: Mapping[str, object] | None = None,
        *,
        timeout_s: float = CALL_TIMEOUT_S,
    ) -> object:
        """Call a function of an application there and return its result.

        A call that was not begun after `timeout_s` is not begun any more; one that moves, after
        1 s. What takes long returns something with `done`, `cancel` and `wait`.

        Raises
        ------
        StationAway
            The station cannot be reached; nothing was sent.
        StationTimeout
            No answer came in time.
        CommandExpired
            The call arrived too late and was not carried out.
        CallRefused
            Such a call is not offered or not permitted, or an argument is not of its type.
        MoveRefused
            The gate refused the movement, or the lease is not held (`NO_LEASE`).
        WrongThreadError
            The station is elsewhere, and this is the GUI thread; only what overtakes everything
            (a stop) may be called there.
        CosmicError
            Whatever the function raised.
        """

    @abstractmethod
    def publish(self, topic: str, payload: object) -> None:
        """Publish to a topic that begins with ``shared/``; returns at once.

        Raises
        ------
        CallRefused
            The topic belongs to the station.
        StationAway
            The station cannot be reached.
        """

    @abstractmethod
    def subscribe(self, topic: str, rule: Rule, receiver: Receiver) -> Subscription:
        """Have `receiver(payload)` called with what is published to `topic`, from now on."""

    @abstractmethod
    def presence(self, listener: PresenceListener) -> Callable[[], None]:
        """Call `listener` now and at each change; returns the function that ends it."""

    @abstractmethod
    def take_lease(self) -> None:
        """Take the right to move, or keep it.

        Raises
        ------
        MoveRefused
            Another holds it (`NO_LEASE`).
        """

    @abstractmethod
    def release_lease(self) -> None:
        """Give the right to move back; what moves by it stops."""

    @abstractmethod
    def close(self) -> None:
        """End every subscription, give the lease back and release what was opened; any state."""
