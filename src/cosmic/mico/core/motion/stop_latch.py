"""The stop that stays: set by anybody, reset only on purpose."""

from collections.abc import Callable
from dataclasses import dataclass
from threading import Lock

from cosmic.frame.events import Event, Unsubscribe


@dataclass(frozen=True, slots=True)
class StopState:
    """Whether motion is stopped, and why.

    Attributes
    ----------
    reason : str or None
        Why, or None while motion is allowed.
    epoch : int
        Number of stops so far. A reservation is void after the next stop, also once that is reset.
    """

    reason: str | None
    epoch: int

    @property
    def latched(self) -> bool:
        """True while nothing may move."""
        return self.reason is not None


class StopLatch:
    """Thread-safe latch that every loop polls; reading it takes no lock, and no call.

    Attributes
    ----------
    state : StopState
        The state now; only the latch itself changes it.
    """

    def __init__(self) -> None:
        self._lock = Lock()
        self.state = StopState(reason=None, epoch=0)
        self._announced: Event[StopState] = Event()

    def set(self, reason: str) -> None:
        """Latch; the first reason stays until the reset."""
        with self._lock:
            before = self.state
            said = before.reason or str(reason or "stopped")  # no reason at all stops as well
            self.state = StopState(reason=said, epoch=before.epoch + 1)

    def void_grants(self) -> None:
        """Let nothing that was reserved or queued so far start any more, without latching."""
        with self._lock:
            self.state = StopState(reason=self.state.reason, epoch=self.state.epoch + 1)

    def reset(self) -> None:
        """Allow motion again; what was stopped does not go on by itself."""
        with self._lock:
            self.state = StopState(reason=None, epoch=self.state.epoch)
        self.announce()

    def subscribe(self, listener: Callable[[StopState], object]) -> Unsubscribe:
        """Call `listener` after each change, in the thread that made it."""
        return self._announced.subscribe(listener)

    def announce(self) -> None:
        """Notify the listeners; apart from `set`, so that stopping comes first."""
        self._announced.emit(self.state)
