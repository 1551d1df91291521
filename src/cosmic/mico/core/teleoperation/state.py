"""What there is to be seen of teleoperation."""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from cosmic.frame.clock import WALL
from cosmic.mico.hw.input_device import InputInfo, InputState


class TeleoperationPhase(StrEnum):
    """What teleoperation is at."""

    OFF = "off"
    """Nothing was started."""
    CENTRE = "let go of the sticks"
    """Nothing moves before everything that moves something was at rest."""
    ARMED = "armed"
    """Ready to move."""
    STEERING = "steering"
    """Something moves."""
    PAUSED = "paused"
    """Nothing moves while the window is out of focus."""
    STOPPED = "stopped"
    """It ended by itself, and must be started again."""


@dataclass(frozen=True, slots=True)
class TeleoperationState:
    """Teleoperation as it is now.

    Attributes
    ----------
    reason : str
        Why it is paused or was stopped.
    inputs : InputState or None
        What the device said last.
    velocities : mapping of float
        What is asked of each positioner, in its unit per second, or Hz.
    force : float
        What the hand feels, -1 to 1 of what the device can.
    slowed : float
        Part of the speed that the force leaves, 0 to 1.
    refused : mapping of str
        Why a positioner does not move although it should; until its input was at rest.
    poll_hz, command_hz, feedback_hz : float
        How often the device was read, speeds were sent, and the force was set, each second.
    """

    phase: TeleoperationPhase
    reason: str = ""
    device: InputInfo | None = None
    profile: str = ""
    fine: bool = False
    inputs: InputState | None = None
    velocities: Mapping[str, float] = field(default_factory=dict)
    force: float = 0.0
    slowed: float = 1.0
    refused: Mapping[str, str] = field(default_factory=dict)
    poll_hz: float = 0.0
    command_hz: float = 0.0
    feedback_hz: float = 0.0

    @property
    def words(self) -> str:
        """The phase with its reason, such as "stopped: unplugged"."""
        return f"{self.phase}: {self.reason}" if self.reason else str(self.phase)


class RateMeter:
    """Counts events over the last second; one thread counts, any reads."""

    def __init__(self, most: int = 2000) -> None:
        self._times_s: deque[float] = deque(maxlen=most)

    def count(self) -> None:
        """Count one event."""
        self._times_s.append(WALL.now_s())

    @property
    def rate_hz(self) -> float:
        """Events in the last second."""
        since_s = WALL.now_s() - 1.0
        times_s = self._times_s.copy()
        recent = [each for each in times_s if each > since_s]
        if len(recent) < 2:
            return float(len(recent))
        return (len(recent) - 1) / max(1e-6, recent[-1] - recent[0])
