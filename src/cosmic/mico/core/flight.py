"""What a `Device` remembers of one channel: the order under way and what it has asked."""

from collections import deque
from dataclasses import dataclass, field

from cosmic.mico.core.orders import Order


@dataclass(slots=True)
class Flight:
    """One order that the controller has taken.

    Attributes
    ----------
    at_rest : bool
        The controller says, asked after the start, that the channel stands.
    error : Exception or None
        Why the movement will fail once it stands.
    progress_s : float
        Platform time of the last sign of life: a new position or activity.
    """

    order: Order
    started_s: float
    progress_s: float
    at_rest: bool = False
    error: Exception | None = None


@dataclass(slots=True)
class ChannelDesk:
    """What is under way on one channel; device thread only.

    An answer says what was true when it was given, not now: one that was asked for before a
    movement started says nothing about it. The controller answers each channel in order, so the
    numbers of the orders that were current when each question was asked tell old from new. A lost
    answer makes later ones look older than they are, which is safe: the next poll repeats them.
    """

    flight: Flight | None = None
    activity_asked: deque[int] = field(default_factory=lambda: deque(maxlen=64))
    position_asked: deque[int] = field(default_factory=lambda: deque(maxlen=64))
    next_poll_s: float = 0.0
    silent_polls: int = 0

    @property
    def order_number(self) -> int:
        """Number of the order under way, 0 without one."""
        return self.flight.order.number if self.flight else 0

    def answers_current(self, asked: deque[int]) -> bool:
        """Take the oldest open question and say whether it was asked in this flight."""
        number = asked.popleft() if asked else 0
        return self.flight is not None and number == self.flight.order.number
