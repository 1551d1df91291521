"""`AxisDriver`: has one axis move as fast as an input says; input thread."""

import logging
from abc import abstractmethod
from collections.abc import Callable
from typing import Final, Protocol

from cosmic.frame.clock import WALL
from cosmic.frame.errors import CosmicError, MoveCancelled
from cosmic.mico.core.motion.jog import HandLostError
from cosmic.mico.core.motion.movement import Movement
from cosmic.mico.core.motion.positioner import PositionerState, class_for
from cosmic.mico.core.teleoperation.settings import TeleoperationSettings
from cosmic.mico.core.teleoperation.state import RateMeter

logger = logging.getLogger(__name__)

OPEN_LOOP_PERIOD_S: Final = 0.05
_CHANGE: Final = 0.2
KEEP_ALIVE: Final = 0.25
"""Part of the dead-man time after which a speed that has not changed is sent again."""


class Steered(Protocol):
    """A continuous movement that goes on while it is renewed; `Jogging` of the scripted API."""

    @property
    @abstractmethod
    def movement(self) -> Movement:
        """The movement; done when the axis is stationary."""

    @abstractmethod
    def renew(self, velocity: float | None = None) -> None:
        """Keep it alive, at a signed speed; at the one it has where none is given."""

    @abstractmethod
    def end(self, why: str = "jog ended") -> None:
        """Stop it past every queue."""


class SteeredAxis(Protocol):
    """What is steered; `Axis` of the scripted API, here or at a station.

    Nothing here waits, whatever thread calls it.
    """

    @property
    @abstractmethod
    def key(self) -> str:
        """Name of the axis, such as "left.x"."""

    @property
    @abstractmethod
    def details(self) -> PositionerState:
        """Everything known of it."""

    @abstractmethod
    def steer(self, velocity: float, *, dead_man_s: float, source: str = "") -> Steered:
        """Begin to move at a signed speed; it ends when nobody renews it for `dead_man_s`."""


class AxisDriver:
    """Begins, changes and ends the movement of one axis.

    A refusal, a limit or a command from elsewhere ends the movement; it begins again once the
    input was at rest or went the other way.
    """

    def __init__(
        self,
        axis: SteeredAxis,
        settings: TeleoperationSettings,
        *,
        source: str,
        commands: RateMeter,
        busy: Callable[[], str] = str,
    ) -> None:
        state = axis.details
        self.name = axis.key
        self._axis = axis
        self._settings = settings
        self._source = source
        self._sensor = class_for(state.kind, state.positioner).has_sensor
        self._commands = commands
        self._busy = busy
        self._steered: Steered | None = None
        self._sent = 0.0
        self._sent_wall_s = self._began_wall_s = 0.0
        self._blocked = 0
        self.refused = ""

    @property
    def moving(self) -> bool:
        """True while a movement is under way that began here."""
        return self._steered is not None

    def steer(self, velocity: float) -> None:
        """Go at `velocity`; 0 stops at once."""
        direction = (velocity > 0.0) - (velocity < 0.0)
        if direction == 0:
            self.release("let go")
            self._blocked, self.refused = 0, ""
            return
        if self._steered is not None and self._steered.movement.done:
            self._look_why(self._steered.movement)
        if direction == self._blocked:
            return
        if why := self._busy():
            self.release(why)
            self._block(velocity, why)
            return
        if self._blocked:
            self._blocked, self.refused = 0, ""
        if self._steered is None:
            self._begin(velocity)
        elif self._sensor:
            self._go_on(self._steered, velocity)
        else:
            self._go_on_by_steps(self._steered, velocity)

    def release(self, why: str) -> None:
        """Stop what was begun here, past every queue."""
        steered, self._steered = self._steered, None
        if steered is not None and not steered.movement.done:
            steered.end(why)

    def _begin(self, velocity: float) -> None:
        try:
            self._steered = self._axis.steer(
                velocity, dead_man_s=self._settings.dead_man_s, source=self._source
            )
        except CosmicError as exc:
            self._block(velocity, str(exc))
            return
        self._note(velocity)
        self._began_wall_s = self._sent_wall_s

    def _go_on(self, steered: Steered, velocity: float) -> None:
        passed_s = WALL.now_s() - self._sent_wall_s
        turned = velocity * self._sent < 0.0
        if turned or passed_s >= 1.0 / self._settings.command_hz:
            steered.renew(velocity)
            self._note(velocity)

    def _go_on_by_steps(self, steered: Steered, velocity: float) -> None:
        """Keep bursts of steps going; their speed is changed by another order, seldom."""
        now_s = WALL.now_s()
        turned = velocity * self._sent < 0.0
        changed = abs(velocity - self._sent) > _CHANGE * abs(self._sent)
        if turned or (changed and now_s - self._began_wall_s >= OPEN_LOOP_PERIOD_S):
            self._begin(velocity)
        elif now_s - self._sent_wall_s >= KEEP_ALIVE * self._settings.dead_man_s:
            steered.renew()
            self._sent_wall_s = now_s

    def _note(self, velocity: float) -> None:
        self._sent, self._sent_wall_s = velocity, WALL.now_s()
        self._commands.count()

    def _look_why(self, movement: Movement) -> None:
        """Take note of why a movement ended that should have gone on."""
        error = movement.exception()
        self._steered = None
        if isinstance(error, HandLostError):
            return  # this thread was late, and is here again: the input is what it says now
        if error is None:
            self._block(self._sent, "at its limit")
        elif isinstance(error, MoveCancelled):
            self._block(self._sent, "somebody else moved or halted it")
        else:
            self._block(self._sent, str(error))

    def _block(self, velocity: float, why: str) -> None:
        self._steered = None
        self._blocked = 1 if velocity > 0.0 else -1
        if why != self.refused:
            logger.warning("teleoperation of %s: %s", self.name, why)
        self.refused = why
