"""What can be asked of an axis, as frozen data."""

from dataclasses import dataclass
from itertools import count
from typing import Final, NamedTuple, Self

from cosmic.frame.units import AxisUnit
from cosmic.mico.core.motion.group_start import GroupStart
from cosmic.mico.core.motion.lease import Guard
from cosmic.mico.core.motion.movement import Movement
from cosmic.mico.hw.interface import Capabilities, Direction

_numbers: Final = count(1)

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


class _OrderFields(NamedTuple):
    channel: int
    motion: Motion
    token: str
    source: str
    consent: bool
    movement: Movement
    reservation: Reservation | None
    follows: Movement | None
    epoch: int | None
    start: GroupStart | None
    frequency_hz: int | None
    guard: Guard | None
    number: int


class Order(_OrderFields):
    """One command on its way to a `Device`.

    Attributes
    ----------
    channel : int
        Channel of the device it is sent to.
    motion : Motion
        What to do.
    token : str
        Who sends it (see `Lease`).
    source : str
        Where it came from, for the log: "window", "key", "script" ...
    consent : bool
        The operator agreed to move an axis whose position is unknown.
    movement : Movement
        Completed when the movement ends.
    reservation : Reservation or None
        Set where the gate has already decided, together with others.
    epoch : int or None
        Number of stops so far when it was submitted; a stop since then makes it void.
    follows : Movement or None
        The order is void unless this was the newest on its channel, and nothing was halted since.
    start : GroupStart or None
        Others that it starts together with.
    frequency_hz : int or None
        Limit of the closed-loop speed for this movement only.
    guard : Guard or None
        Ends the movement when it expires; None for what this process commands.
    """

    __slots__ = ()  # a tuple, for it is made between a command and the call of the library

    def __new__(
        cls,
        channel: int,
        motion: Motion,
        token: str,
        source: str = "script",
        consent: bool = False,
        *,
        movement: Movement | None = None,
        reservation: Reservation | None = None,
        follows: Movement | None = None,
        epoch: int | None = None,
        start: GroupStart | None = None,
        frequency_hz: int | None = None,
        guard: Guard | None = None,
    ) -> Self:
        """Return an order with a number, and with a movement, of its own."""
        return tuple.__new__(
            cls,
            (
                channel,
                motion,
                token,
                source,
                consent,
                Movement() if movement is None else movement,
                reservation,
                follows,
                epoch,
                start,
                frequency_hz,
                guard,
                next(_numbers),
            ),
        )
