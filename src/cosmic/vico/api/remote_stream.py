"""What is received of a topic only while somebody looks at it."""

from collections.abc import Callable
from threading import Lock
from typing import Final, Generic, TypeVar

from cosmic.frame.clock import WALL
from cosmic.frame.network.transport import Rule, Subscription, Transport

T = TypeVar("T")

IDLE_S: Final = 3.0
"""Wall time after the last look when the station is told to send no more."""


class Stream(Generic[T]):
    """The newest of a topic; any thread.

    Parameters
    ----------
    read : callable
        From what came to what it stands for; None for what is to be passed over.
    open_soon : callable
        Has `open` called in a thread that may wait.
    """

    def __init__(
        self,
        transport: Transport,
        topic: str,
        read: Callable[[object], T | None],
        open_soon: "Callable[[Stream[T]], object]",
    ) -> None:
        self._transport, self._topic, self._read = transport, topic, read
        self._open_soon = open_soon
        self._lock = Lock()
        self._subscription: Subscription | None = None
        self._wanted = False
        self._looked_s = 0.0
        self._newest: T | None = None
        self._live = False
        self._came_s = 0.0

    @property
    def wanted(self) -> bool:
        """Somebody has looked lately."""
        return self._wanted

    @property
    def silent_s(self) -> float:
        """Wall time since something came."""
        return WALL.now_s() - self._came_s

    @property
    def live(self) -> bool:
        """It is being received, and something has come."""
        return self._live

    @property
    def last(self) -> T | None:
        """What came last; nobody looks again because of that."""
        return self._newest

    def newest(self) -> T | None:
        """Return what came last, and have more sent for a while."""
        self._looked_s = WALL.now_s()
        if not self._wanted:
            self._wanted = True
            self._open_soon(self)
        return self._newest

    def open(self) -> None:
        """Begin to receive."""
        with self._lock:
            if self._subscription is None:
                self._subscription = self._transport.subscribe(self._topic, Rule.LATEST, self.take)

    def close_if_idle(self) -> None:
        """End receiving where nobody has looked for a while."""
        received = self._wanted or self._subscription is not None
        if received and WALL.now_s() - self._looked_s > IDLE_S:
            self.close()

    def close(self) -> None:
        """End receiving; the next look begins anew."""
        with self._lock:
            subscription, self._subscription = self._subscription, None
            self._wanted = self._live = False
        if subscription is not None:
            subscription.close()

    def take(self, payload: object) -> None:
        """Take what came, by its topic or because somebody asked."""
        found = self._read(payload)
        if found is not None:
            self._newest, self._live, self._came_s = found, True, WALL.now_s()
