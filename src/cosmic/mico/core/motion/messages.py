"""What goes into a `Device`'s queue, and what comes out of its signals."""

from collections.abc import Callable
from dataclasses import dataclass

from cosmic.frame.errors import CosmicError, DeviceError
from cosmic.frame.units import AxisUnit
from cosmic.frame.verdict import ALLOWED, MoveVerdict
from cosmic.mico.core.motion.jog import JogRun
from cosmic.mico.core.motion.movement import Movement
from cosmic.mico.core.motion.orders import Motion, Order, Reservation
from cosmic.mico.hw.interface import Event


@dataclass(frozen=True, slots=True)
class PositionChanged:
    """A position that was read and differs from the one before.

    Attributes
    ----------
    position : float
        In gate coordinates and `unit`.
    """

    name: str
    position: float
    unit: str


@dataclass(frozen=True, slots=True)
class MovementBegun:
    """A movement that the gate allowed was sent to the controller.

    Attributes
    ----------
    from_position : float or None
        Where the axis stood, or was, as it was last read; in gate coordinates and `unit`.
    target : float or None
        Where a movement to a position goes.
    time_s : float
        Platform time.
    source : str
        Where it came from: "window", "key", "script" ...
    """

    name: str
    motion: Motion
    from_position: float | None
    target: float | None
    unit: AxisUnit
    time_s: float
    source: str


@dataclass(frozen=True, slots=True)
class MovementEnded:
    """How a movement of an axis ended; `error` is None when it reached its target."""

    name: str
    position: float | None
    error: CosmicError | None


@dataclass(frozen=True, slots=True)
class DeviceLost:
    """A device cannot be reached; `in_motion` when one of its axes was moving."""

    index: int
    reason: str
    in_motion: bool


@dataclass(frozen=True, slots=True)
class CheckedMove:
    """What the gate says to an order, or to the next packet of a jog.

    Attributes
    ----------
    motion : Motion or None
        What may be sent; None where a jog has come to its end.
    slowed : bool
        The jog goes at another speed from now on.
    """

    order: Order
    motion: Motion | None
    verdict: MoveVerdict = ALLOWED
    reservation: Reservation | None = None
    jog: JogRun | None = None
    slowed: bool = False


OnChecked = Callable[[CheckedMove], None]


@dataclass(frozen=True, slots=True)
class GateAnswer:
    """The gate has checked an order, or the next packet of a jog, in another thread."""

    checked: CheckedMove
    on_checked: OnChecked


@dataclass(frozen=True, slots=True)
class Halt:
    """Stop one channel again and fail its movement; with `only`, if it is that one."""

    channel: int
    error: CosmicError
    only: Movement | None = None


@dataclass(frozen=True, slots=True)
class StopAll:
    """Stop every channel again and fail every movement."""

    error: CosmicError


@dataclass(frozen=True, slots=True)
class Lost:
    """The listener cannot reach the device."""

    error: DeviceError


@dataclass(frozen=True, slots=True)
class SetFrequency:
    """Limit the closed-loop speed of one channel."""

    channel: int
    frequency_hz: int


@dataclass(frozen=True, slots=True)
class Wake:
    """Nothing but a reason to look whether the thread shall end."""


@dataclass(frozen=True, slots=True)
class PublishState:
    """Publish the state of one channel, which somebody else changed."""

    channel: int


@dataclass(frozen=True, slots=True)
class GroupMoveSent:
    """An order that waited for others was sent with them, or could not be."""

    order: Order
    error: CosmicError | None


Message = (
    GateAnswer
    | GroupMoveSent
    | Order
    | Event
    | Halt
    | StopAll
    | Lost
    | SetFrequency
    | PublishState
    | Wake
)
"""What a `Device` takes from its queue."""
