"""What goes into a `Device`'s queue, and what comes out of its signals."""

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from itertools import count
from typing import Final, NamedTuple, Protocol, Self

from PySide6.QtCore import SignalInstance

from cosmic.frame.errors import CosmicError, DeviceError
from cosmic.frame.operation import Task
from cosmic.frame.units import AxisUnit
from cosmic.frame.verdict import ALLOWED, MoveVerdict
from cosmic.mico.core.motion.group_start import GroupStart
from cosmic.mico.core.motion.jog import JogRun
from cosmic.mico.core.motion.lease import Guard
from cosmic.mico.core.motion.movement import Movement
from cosmic.mico.core.motion.orders import Motion, Reservation
from cosmic.mico.hw.interface import Direction, Event

_numbers: Final = count(1)


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
        Number of stops so far when it was made, or submitted; a stop since then makes it void.
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
class SetUp:
    """Store in the controller what is connected to a channel; the task ends when that is done.

    Attributes
    ----------
    change : int or Direction
        The vendor's number of the positioner type, or where a search for the reference begins.
    """

    channel: int
    change: int | Direction
    done: Task


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
    | SetUp
    | PublishState
    | Wake
)
"""What a `Device` takes from its queue."""


class DeviceSignals(Protocol):
    """The signals of a `Device`."""

    @property
    @abstractmethod
    def position_changed(self) -> SignalInstance:
        """A position was read that differs from the one before."""

    @property
    @abstractmethod
    def state_changed(self) -> SignalInstance:
        """The state of a positioner changed."""

    @property
    @abstractmethod
    def movement_begun(self) -> SignalInstance:
        """A movement was sent to the controller."""

    @property
    @abstractmethod
    def movement_ended(self) -> SignalInstance:
        """A movement ended."""

    @property
    @abstractmethod
    def movement_refused(self) -> SignalInstance:
        """The gate refused a movement."""
