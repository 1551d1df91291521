"""Several axes that move together."""

from collections.abc import Callable, Mapping
from threading import Lock
from typing import Protocol, Self, TypeVar

from cosmic.frame.arguments import checked_class
from cosmic.frame.clock import WALL
from cosmic.frame.errors import CosmicError, MoveCancelled
from cosmic.frame.listeners import tell
from cosmic.frame.task import Task
from cosmic.mico.core.group_start import GroupStart
from cosmic.mico.core.movement import Movement
from cosmic.mico.core.orders import Motion, Order
from cosmic.mico.core.ports import ManagerPort

T = TypeVar("T", covariant=True)


@checked_class
class GroupMovement:
    """A future for a synchronous movement: the failure of one axis stops the others.

    Any thread. `movements` has the movement of each axis by name.
    """

    def __init__(self, movements: Mapping[str, Movement], start: GroupStart | None = None) -> None:
        self.movements = dict(movements)
        self._start = start
        self._lock = Lock()
        self._left = len(self.movements)
        self._callbacks: list[Callable[[GroupMovement], None]] = []
        for movement in self.movements.values():
            movement.add_callback(self._on_end)

    @classmethod
    def of(cls, orders: Mapping[str, Order]) -> Self:
        """Return the future of what `DeviceManager.order_together` ordered."""
        start = next((order.start for order in orders.values()), None)
        return cls({name: order.movement for name, order in orders.items()}, start)

    @property
    def start_skew_ms(self) -> float | None:
        """From the start of the first axis to that of the last, in milliseconds of wall time.

        Measured at the calls of the library; None before they were made, 0 where one goes alone.
        """
        if self._start is None:
            return 0.0
        return self._start.skew_ms

    def _on_end(self, ended: Movement) -> None:
        if not ended.success:
            self.cancel()
        with self._lock:
            self._left -= 1
            over = self._left == 0
            callbacks = self._callbacks if over else []
            if over:
                self._callbacks = []
        tell(callbacks, self)

    def add_callback(self, callback: "Callable[[GroupMovement], None]") -> None:
        """Call `callback(movement)` when all have ended, in the thread that ends the last, or now.

        It must return at once.
        """
        with self._lock:
            if self._left > 0:
                self._callbacks.append(callback)
                return
        tell([callback], self)

    @property
    def done(self) -> bool:
        """True when every axis has ended."""
        return all(movement.done for movement in self.movements.values())

    @property
    def success(self) -> bool:
        """True when every axis has reached its target."""
        return all(movement.success for movement in self.movements.values())

    def cancel(self) -> None:
        """Stop every axis that still moves."""
        for movement in self.movements.values():
            if not movement.done:
                movement.cancel()

    def wait(self, timeout_s: float | None = None) -> dict[str, float | None]:
        """Wait at most `timeout_s` of wall time for all and return the positions reached.

        Raises
        ------
        CosmicError
            What ended one of them early; as `Movement.wait`.
        """
        error = self.exception(timeout_s)
        if error is not None:
            raise error
        return {name: movement.wait() for name, movement in self.movements.items()}

    def exception(self, timeout: float | None = 0.0) -> CosmicError | None:
        """Return what ended one of them early, first of all what went wrong; None for success.

        Waits up to `timeout` seconds of wall time (None: for ever); bluesky names it so.

        Raises
        ------
        DeviceTimeout
            They had not all ended by then.
        """
        failures: list[CosmicError] = []
        deadline_s = None if timeout is None else WALL.now_s() + timeout
        for movement in self.movements.values():
            left_s = None if deadline_s is None else max(0.0, deadline_s - WALL.now_s())
            error = movement.exception(left_s)
            if isinstance(error, CosmicError):
                failures.append(error)
        return min(failures, key=_importance) if failures else None


def move_together(
    manager: ManagerPort,
    motions: Mapping[str, Motion],
    task: Task,
    *,
    source: str,
    consent: bool = False,
    linked: bool = True,
) -> None:
    """Start `motions` at once and wait for all; whoever cancels `task` stops them.

    Axes that are linked to them move as well, unless not `linked`.

    Raises
    ------
    CosmicError
        What ended one of them early, or the refusal: then nothing has moved.
    """
    orders = manager.order_together(motions, source=source, consent=consent, linked=linked)
    together = GroupMovement.of(orders)
    task.on_cancel(together.cancel)
    together.wait()


class _Waitable(Protocol[T]):
    def wait(self, timeout_s: float | None = None) -> T: ...

    def cancel(self) -> None: ...


def waited_for(movement: _Waitable[T]) -> T:
    """Wait for `movement`; whoever is interrupted while waiting leaves nothing moving."""
    try:
        return movement.wait()
    except KeyboardInterrupt:
        movement.cancel()
        raise


def _importance(error: CosmicError) -> int:
    """Sort what went wrong before what was only cancelled because of it."""
    return 1 if isinstance(error, MoveCancelled) else 0
