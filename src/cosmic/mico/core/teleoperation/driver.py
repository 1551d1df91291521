"""`AxisDriver`: has one positioner move as fast as an input says; input thread."""

import logging
from typing import Final

from cosmic.frame.clock import WALL
from cosmic.frame.errors import CosmicError, MoveCancelled
from cosmic.mico.core.motion.device_commander import DeviceCommander
from cosmic.mico.core.motion.jog import HandLostError
from cosmic.mico.core.motion.messages import Order
from cosmic.mico.core.teleoperation.settings import TeleoperationSettings
from cosmic.mico.core.teleoperation.state import RateMeter

logger = logging.getLogger(__name__)

OPEN_LOOP_PERIOD_S: Final = 0.05
_CHANGE: Final = 0.2
KEEP_ALIVE: Final = 0.25
"""Part of the dead-man time after which a speed that has not changed is sent again."""


class AxisDriver:
    """Begins, changes and ends the movement of one positioner.

    A refusal, a limit or a command from elsewhere ends the movement; it begins again once the
    input was at rest or went the other way.
    """

    def __init__(
        self,
        name: str,
        channel: int,
        commander: DeviceCommander,
        settings: TeleoperationSettings,
        *,
        sensor: bool,
        commands: RateMeter,
    ) -> None:
        self.name = name
        self._channel = channel
        self._commander = commander
        self._settings = settings
        self._sensor = sensor
        self._commands = commands
        self._order: Order | None = None
        self._sent = 0.0
        self._sent_wall_s = self._began_wall_s = 0.0
        self._blocked = 0
        self.refused = ""

    @property
    def moving(self) -> bool:
        """True while a movement is under way that began here."""
        return self._order is not None

    def steer(self, velocity: float) -> None:
        """Go at `velocity`; 0 stops at once."""
        direction = (velocity > 0.0) - (velocity < 0.0)
        if direction == 0:
            self.release("let go")
            self._blocked, self.refused = 0, ""
            return
        if self._order is not None and self._order.movement.done:
            self._look_why(self._order)
        if direction == self._blocked:
            return
        if self._blocked:
            self._blocked, self.refused = 0, ""
        if self._order is None:
            self._begin(velocity)
        elif self._sensor:
            self._go_on(self._order, velocity)
        else:
            self._go_on_by_steps(self._order, velocity)

    def release(self, why: str) -> None:
        """Stop what was begun here, past every queue."""
        order, self._order = self._order, None
        if order is not None and not order.movement.done:
            self._commander.stop(self._channel, why)

    def _begin(self, velocity: float) -> None:
        try:
            self._order = self._commander.steer(
                self._channel, velocity, dead_man_s=self._settings.dead_man_s
            )
        except CosmicError as exc:
            self._block(velocity, str(exc))
            return
        self._note(velocity)
        self._began_wall_s = self._sent_wall_s

    def _go_on(self, order: Order, velocity: float) -> None:
        passed_s = WALL.now_s() - self._sent_wall_s
        turned = velocity * self._sent < 0.0
        if turned or passed_s >= 1.0 / self._settings.command_hz:
            self._commander.steer_on(order, velocity)
            self._note(velocity)

    def _go_on_by_steps(self, order: Order, velocity: float) -> None:
        """Keep bursts of steps going; their speed is changed by another order, seldom."""
        now_s = WALL.now_s()
        turned = velocity * self._sent < 0.0
        changed = abs(velocity - self._sent) > _CHANGE * abs(self._sent)
        if turned or (changed and now_s - self._began_wall_s >= OPEN_LOOP_PERIOD_S):
            self._begin(velocity)
        elif now_s - self._sent_wall_s >= KEEP_ALIVE * self._settings.dead_man_s:
            self._commander.renew_jog(order)
            self._sent_wall_s = now_s

    def _note(self, velocity: float) -> None:
        self._sent, self._sent_wall_s = velocity, WALL.now_s()
        self._commands.count()

    def _look_why(self, order: Order) -> None:
        """Take note of why a movement ended that should have gone on."""
        error = order.movement.exception()
        self._order = None
        if isinstance(error, HandLostError):
            return  # this thread was late, and is here again: the input is what it says now
        if error is None:
            self._block(self._sent, "at its limit")
        elif isinstance(error, MoveCancelled):
            self._block(self._sent, "somebody else moved or halted it")
        else:
            self._block(self._sent, str(error))

    def _block(self, velocity: float, why: str) -> None:
        self._order = None
        self._blocked = 1 if velocity > 0.0 else -1
        if why != self.refused:
            logger.warning("teleoperation of %s: %s", self.name, why)
        self.refused = why
