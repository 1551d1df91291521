"""What can be asked of an axis, as frozen data."""

from dataclasses import dataclass
from typing import Final

from cosmic.frame.units import AxisUnit
from cosmic.mico.hw.interface import Capabilities, Direction

COMMON: Final = Capabilities(group_start=False, velocity=False, position_known=True)
"""What is taken of a controller that has not been asked yet."""
LARGEST_STEPS: Final = COMMON.most_steps
FREQUENCY_HZ: Final = COMMON.frequency_hz
AMPLITUDE_V: Final = COMMON.amplitude_v


@dataclass(frozen=True, slots=True)
class MoveTo:
    """Go to a position in gate coordinates."""

    target: float
    unit: AxisUnit


@dataclass(frozen=True, slots=True)
class MoveBy:
    """Go a distance from where the axis stands, or from where it is going."""

    distance: float
    unit: AxisUnit


@dataclass(frozen=True, slots=True)
class Step:
    """Make steps without looking at a sensor; the sign is the direction."""

    steps: int
    amplitude_v: float
    frequency_hz: int


@dataclass(frozen=True, slots=True)
class Jog:
    """Keep moving while somebody renews it; `speed` in um/s, deg/s, or Hz for open loop."""

    direction: int
    speed: float


@dataclass(frozen=True, slots=True)
class Steer(Jog):
    """A jog whose speed and direction follow somebody's hand; ends `dead_man_s` after it is lost.

    The dead-man time counts on the wall clock.
    """

    dead_man_s: float

    @classmethod
    def at(cls, velocity: float, dead_man_s: float) -> "Steer":
        """Return what goes at a signed speed."""
        return cls(1 if velocity > 0.0 else -1, abs(velocity), dead_man_s)


@dataclass(frozen=True, slots=True)
class Calibrate:
    """Calibrate the sensor; sweeps several millimetres both ways."""


@dataclass(frozen=True, slots=True)
class Reference:
    """Find the reference; may sweep the whole travel."""


@dataclass(frozen=True, slots=True)
class ToEndStop:
    """Drive until the travel ends."""

    direction: Direction


MOTION_WORDS: Final[dict[type, str]] = {
    MoveTo: "a position to go to",
    MoveBy: "a distance to go",
    Step: "making steps",
    Jog: "jogging",
    Steer: "steering",
    Calibrate: "calibrating a sensor",
    Reference: "finding a reference",
    ToEndStop: "driving to an end stop",
}
"""What each motion is called before the operator."""

Motion = MoveTo | MoveBy | Step | Jog | Calibrate | Reference | ToEndStop


def motion_text(
    motion: Motion, *, directions: tuple[str, str] = ("up", "down"), speed_unit: str = ""
) -> str:
    """Return what an axis does, as the log says it: "moves to 120.0 um".

    Parameters
    ----------
    directions : (str, str)
        What going forward and backward is called for this axis, such as "right" and "left".
    speed_unit : str
        Of how fast it jogs: "um/s", "deg/s" or "Hz".
    """
    match motion:
        case MoveTo():
            return f"moves to {motion.target:.1f} {motion.unit}"
        case MoveBy():
            return f"moves by {motion.distance:+.1f} {motion.unit}"
        case Step():
            return f"makes {motion.steps:+d} steps of {motion.amplitude_v:g} V"
        case Jog():
            kind = "is steered" if isinstance(motion, Steer) else "jogs"
            towards = directions[0] if motion.direction > 0 else directions[1]
            return f"{kind} {towards} at {motion.speed:g} {speed_unit}"
        case Calibrate():
            return "calibrates its sensor"
        case Reference():
            return "looks for its reference"
        case ToEndStop():
            return "drives to its end stop"


@dataclass(frozen=True, slots=True)
class Interval:
    """All places of one axis that a movement can take it to, in the axis' unit."""

    low: float
    high: float

    def union(self, other: "Interval") -> "Interval":
        """Return the smallest interval that holds both."""
        return Interval(min(self.low, other.low), max(self.high, other.high))


@dataclass(frozen=True, slots=True)
class Reservation:
    """The gate's leave to make one movement once, void after the next stop.

    It holds the interval that the movement may sweep until it is released (`Gate.release`).
    Only the object that the gate gave is worth anything; it is used up with `Gate.claim`. One that
    is `straight` is for a start with others that keeps to a line, and for nothing else.
    """

    axis: str
    number: int
    epoch: int
    target: float | None
    straight: bool = False
