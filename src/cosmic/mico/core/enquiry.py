"""`Enquiry`: asks what a channel is doing and where it is, and knows what was asked when."""

from collections import deque
from collections.abc import Callable
from typing import Final

from cosmic.frame.clock import WALL
from cosmic.frame.errors import DeviceError, DeviceFault
from cosmic.mico.core.flight import Flight, PilotContext
from cosmic.mico.core.positioner import PositionerBase
from cosmic.mico.core.quietly import quietly

MOST_OPEN: Final = 8
GIVEN_UP_S: Final = 2.0
"""Wall time after which an answer is taken for lost."""


class Questions:
    """Order numbers that were current when each open question was asked.

    An answer says what was true when it was given: one asked for before a movement started says
    nothing about it. Each channel answers in order, so the oldest number belongs to the next
    answer. Lost answers make later ones look older than they are, which is safe, and are forgotten
    when nothing has come for long.
    """

    def __init__(self) -> None:
        self._open: deque[tuple[int, float]] = deque()

    def may_ask(self) -> bool:
        """Return False while enough questions wait for their answers."""
        if len(self._open) < MOST_OPEN:
            return True
        if WALL.now_s() - self._open[0][1] < GIVEN_UP_S:
            return False
        self._open.clear()
        return True

    def asked(self, number: int) -> None:
        """Note a question."""
        self._open.append((number, WALL.now_s()))

    def withdrawn(self) -> None:
        """Forget the newest question, which could not be asked."""
        if self._open:
            self._open.pop()

    def answered(self) -> int:
        """Return the number under which the oldest open question was asked, 0 without one."""
        return self._open.popleft()[0] if self._open else 0


class Enquiry:
    """Puts the questions about one channel to the controller; device thread only."""

    def __init__(self, positioner: PositionerBase, context: PilotContext) -> None:
        self._positioner = positioner
        self._controller = context.controller
        self._address = positioner.state.address
        self._activity = Questions()
        self._position = Questions()

    def ask_activity(self, flight: Flight | None) -> None:
        """Ask what the channel is doing, during `flight`."""
        self._ask(
            self._activity,
            _number(flight),
            lambda: self._controller.ask_activity(self._address),
        )

    def activity_answered(self) -> int:
        """Return the number of the order under way when the oldest question was asked."""
        return self._activity.answered()

    def ask_position(self, flight: Flight | None) -> None:
        """Ask for the position, where there is a sensor."""
        if not self._positioner.has_sensor:
            return
        final = flight is not None and flight.rests_seen > 0
        unit = self._positioner.state.unit
        self._ask(
            self._position,
            -_number(flight) if final else _number(flight),
            lambda: self._controller.ask_position(self._address, unit),
        )

    def position_answered(self) -> int:
        """Return the number as `activity_answered`; below 0 when the channel stood already."""
        return self._position.answered()

    def ask_position_known(self) -> bool:
        """Ask whether the position is referenced; False where the library cannot say."""
        try:
            self._controller.ask_position_known(self._address)
        except DeviceError as exc:
            if exc.fault is not DeviceFault.UNSUPPORTED:
                raise
            return False
        return True

    def _ask(self, questions: Questions, number: int, call: Callable[[], None]) -> None:
        if not questions.may_ask():
            return
        questions.asked(number)
        if not quietly(self._positioner.state.name, call):
            questions.withdrawn()


def _number(flight: Flight | None) -> int:
    """Return under which number to ask: 0 without an order under way, or before it is sent."""
    return 0 if flight is None or flight.awaiting else flight.order.number
