"""Several axes that move together."""

from collections.abc import Mapping
from typing import Protocol, TypeVar

from cosmic.frame.clock import WALL
from cosmic.frame.errors import CosmicError, MoveCancelled
from cosmic.frame.task import Task
from cosmic.mico.core.device_manager import DeviceManager
from cosmic.mico.core.movement import Movement
from cosmic.mico.core.orders import Motion

T = TypeVar("T", covariant=True)


class GroupMovement:
    """A future for a synchronous movement: the failure of one axis stops the others.

    Any thread. `movements` has the movement of each axis by name.
    """

    def __init__(self, movements: Mapping[str, Movement]) -> None:
        self.movements = dict(movements)
        for movement in self.movements.values():
            movement.add_callback(self._on_end)

    def _on_end(self, ended: Movement) -> None:
        if not ended.success:
            self.cancel()

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
        failures: list[CosmicError] = []
        deadline_s = None if timeout_s is None else WALL.now_s() + timeout_s
        for movement in self.movements.values():
            left_s = None if deadline_s is None else max(0.0, deadline_s - WALL.now_s())
            error = movement.exception(left_s)
            if isinstance(error, CosmicError):
                failures.append(error)
        if failures:
            raise min(failures, key=_importance)
        return {name: movement.wait() for name, movement in self.movements.items()}


def move_together(
    manager: DeviceManager,
    motions: Mapping[str, Motion],
    task: Task,
    *,
    source: str,
    consent: bool = False,
) -> None:
    """Start `motions` at once and wait for all; whoever cancels `task` stops them.

    Raises
    ------
    CosmicError
        What ended one of them early, or the refusal: then nothing has moved.
    """
    orders = manager.order_together(motions, source=source, consent=consent)
    together = GroupMovement({name: order.movement for name, order in orders.items()})
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
