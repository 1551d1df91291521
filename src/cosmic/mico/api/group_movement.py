"""`GroupMovement`: several axes that move together, and how they are begun."""

from collections.abc import Mapping
from dataclasses import dataclass
from threading import Lock
from typing import Any, ClassVar, Self

from typing_extensions import override

from cosmic.frame.arguments import checked_class
from cosmic.frame.errors import MoveCancelled
from cosmic.frame.operation import Operation, Task
from cosmic.mico.core.motion.group_start import GroupStart
from cosmic.mico.core.motion.manager import DeviceManager
from cosmic.mico.core.motion.messages import Order
from cosmic.mico.core.motion.movement import Movement
from cosmic.mico.core.motion.orders import Motion


@dataclass(frozen=True, slots=True)
class GroupEnd:
    """How several axes that moved together have ended well, as it is told to another process."""

    positions: dict[str, float | None]
    start_skew_ms: float | None


@checked_class
class GroupMovement(Operation[dict[str, float | None]]):
    """A synchronous movement: the failure of one axis stops the others. Any thread.

    Its result are the positions reached, by name. It fails with what ended one of them early, first
    of all with what went wrong and not with what was only cancelled because of it.

    Attributes
    ----------
    movements : dict of str to Movement
        The movement of each axis; empty of a group that moves at another station.
    """

    sent_kind: ClassVar[Any] = GroupEnd

    def __init__(
        self, movements: Mapping[str, Movement], start: GroupStart | None = None, *, title: str = ""
    ) -> None:
        super().__init__(title or f"the movement of {', '.join(movements) or 'nothing'}")
        self.movements = dict(movements)
        self._start = start
        self._skew_ms: float | None = None if title else 0.0
        self._counting = Lock()
        self._left = len(self.movements)
        self.on_cancel(self._stop_all)
        if not (self.movements or title):
            self.finish({})
        for movement in self.movements.values():
            movement.add_callback(self._on_end)

    @classmethod
    def of(cls, orders: Mapping[str, Order]) -> Self:
        """Return the future of what `GroupOrders.order_together` ordered."""
        start = next((order.start for order in orders.values()), None)
        return cls({name: order.movement for name, order in orders.items()}, start)

    @classmethod
    @override
    def followed(cls, title: str) -> Self:
        return cls({}, title=title or "the movement of axes elsewhere")

    @override
    def sent_result(self) -> GroupEnd:
        return GroupEnd(self.result, self.start_skew_ms)

    @override
    def finish_as_sent(self, sent: GroupEnd) -> bool:
        self._skew_ms = sent.start_skew_ms
        return self.finish(sent.positions)

    @property
    def start_skew_ms(self) -> float | None:
        """From the start of the first axis to that of the last, in milliseconds of wall time.

        Measured at the calls of the library; None before they were made, 0 where one goes alone.
        """
        return self._skew_ms if self._start is None else self._start.skew_ms

    def _stop_all(self) -> None:
        for movement in self.movements.values():
            if not movement.done:
                movement.cancel()

    def _on_end(self, ended: Movement) -> None:
        if not ended.success:
            self._stop_all()
        with self._counting:
            self._left -= 1
            over = self._left == 0
        if not over:
            return
        failures = [each.failure for each in self.movements.values() if each.failure is not None]
        if failures:
            self.fail(min(failures, key=_importance))
        else:
            self.finish({name: each.result for name, each in self.movements.items()})


class LinkedMovement(Movement):
    """Ends when all axes have: well at the position of the one that was asked, or badly.

    `parts` has the movement of each axis by name; empty where all were refused.
    """

    def __init__(self, axis: str) -> None:
        super().__init__()
        self._axis = axis
        self._guarded = Lock()
        self.parts: Mapping[str, Movement] = {}

    def begin(self, group: GroupMovement) -> None:
        """Follow `group`; for whoever makes it."""
        self.parts = group.movements
        self.on_cancel(group.cancel)
        for part in self.parts.values():
            part.add_callback(self._on_part_ended)

    def _on_part_ended(self, _part: Movement) -> None:
        with self._guarded:
            if not all(part.done for part in self.parts.values()):
                return
        failures = [error for part in self.parts.values() if (error := part.exception())]
        if failures:
            causes = (each for each in failures if not isinstance(each, MoveCancelled))
            self.fail(next(causes, failures[0]))
        else:
            self.finish(self.parts[self._axis].wait())


def move_together(
    manager: DeviceManager,
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
    orders = manager.groups.order_together(motions, source=source, consent=consent, linked=linked)
    together = GroupMovement.of(orders)
    task.on_cancel(together.cancel)
    together.wait()


def _importance(error: Exception) -> int:
    """Sort what went wrong before what was only cancelled because of it."""
    return 1 if isinstance(error, MoveCancelled) else 0
