"""What MiCo needs from any motion controller: one Protocol for SCU, MCS and MCS2.

Positions are float micrometres or degrees, amplitudes volts, frequencies hertz, times seconds;
whatever a vendor library counts in is converted below this line. Commands return at once; what
comes of them arrives as events from `Controller.receive`.
"""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING, Protocol

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import DeviceError, DeviceFault
from cosmic.frame.plugins import Backend
from cosmic.frame.units import AxisUnit

if TYPE_CHECKING:
    from cosmic.twin.scene import Scene


class PositionerKind(StrEnum):
    """What a positioner is, as far as commanding it goes."""

    LINEAR = "linear"
    ROTARY = "rotary"
    OPEN_LOOP = "open-loop"


class ReferenceKind(StrEnum):
    """How a positioner finds out where it is."""

    NONE = "none"
    END_STOP = "end stop"
    MARK = "mark"


class Direction(StrEnum):
    """A direction along an axis."""

    BACKWARD = "backward"
    FORWARD = "forward"


class Activity(StrEnum):
    """What a channel is doing."""

    STOPPED = "stopped"
    SETTING_AMPLITUDE = "setting amplitude"
    STEPPING = "stepping"
    TARGETING = "targeting"
    HOLDING = "holding"
    CALIBRATING = "calibrating"
    REFERENCING = "referencing"

    @property
    def at_rest(self) -> bool:
        """True when the channel does not move and is not about to."""
        return self in (Activity.STOPPED, Activity.HOLDING)


@dataclass(frozen=True, slots=True, order=True)
class Channel:
    """Address of one positioner; both numbers count from zero."""

    device: int
    channel: int


@dataclass(frozen=True, slots=True)
class PositionerType:
    """What the controller says is connected to a channel.

    Attributes
    ----------
    code : int
        The vendor's number for it.
    name : str
        The vendor's name for it.
    kind : PositionerKind or None
        None when CoSMic does not know this type, or cannot foresee where it goes.
    reference : ReferenceKind
        How it can be referenced.
    driver : str
        The positioner type that the configuration names for it, of the group
        ``cosmic.positioners``; empty: what the vendor's number or the kind says.
    """

    code: int
    name: str
    kind: PositionerKind | None
    reference: ReferenceKind
    driver: str = ""

    def counted_backwards(self) -> "PositionerType":
        """Return what it is while its scale is inverted in the controller: nothing to be moved.

        Positions run the other way then, and steps and searches for an end do not: where they
        lead could not be foreseen.
        """
        name = f"{self.name}, its scale inverted in the controller (undo that with its own tool)"
        return replace(self, name=name, kind=None)


Serial = int | str
"""What is printed on a controller unit: a number of an SCU, such as "MCS2-00000412" of an MCS2."""


@dataclass(frozen=True, slots=True)
class DeviceIdentity:
    """One controller unit: its place in the list, its serial number and its firmware."""

    index: int
    serial: Serial
    firmware: str


@dataclass(frozen=True, slots=True)
class Capabilities:
    """What a controller can do beyond the common ground.

    Attributes
    ----------
    group_start : bool
        Several channels can be started by one command.
    velocity : bool
        A speed can be set in um/s; otherwise only the closed-loop frequency limit.
    position_known : bool
        The controller can tell whether a position is referenced.
    channels : int
        How many channels a device has at most; each is asked whether it is there.
    most_steps : int
        The most steps of one command that come to an end by themselves.
    frequency_hz : tuple of int
        The fewest and the most steps a second, in open and in closed loop.
    amplitude_v : tuple of float
        The lowest and the highest amplitude of a step.
    keeps_interpreter : bool
        Its calls are Python that never waits, as a simulated library's are, so that a stop of all
        channels goes through in one piece if the interpreter is not taken away meanwhile.
    """

    group_start: bool
    velocity: bool
    position_known: bool
    channels: int = 3
    most_steps: int = 29_999
    frequency_hz: tuple[int, int] = (1, 18_500)
    amplitude_v: tuple[float, float] = (15.0, 100.0)
    keeps_interpreter: bool = False


@dataclass(frozen=True, slots=True)
class Completed:
    """A movement came to an end; it may be told twice or never, so it is never counted."""

    channel: Channel


@dataclass(frozen=True, slots=True)
class Failed:
    """A command failed at the hardware; `channel` is None when a whole device did."""

    channel: Channel | None
    error: DeviceError


@dataclass(frozen=True, slots=True)
class PositionRead:
    """Answer to `ask_position`, finite, in `unit`."""

    channel: Channel
    value: float
    unit: AxisUnit


@dataclass(frozen=True, slots=True)
class ActivityRead:
    """Answer to `ask_activity`."""

    channel: Channel
    activity: Activity


@dataclass(frozen=True, slots=True)
class SensorPresentRead:
    """Answer to `ask_sensor_present`."""

    channel: Channel
    present: bool


@dataclass(frozen=True, slots=True)
class TypeRead:
    """Answer to `ask_type`."""

    channel: Channel
    positioner: PositionerType


@dataclass(frozen=True, slots=True)
class PositionKnownRead:
    """Answer to `ask_position_known`: whether the position is referenced."""

    channel: Channel
    known: bool


@dataclass(frozen=True, slots=True)
class SafeDirectionRead:
    """Answer to `ask_safe_direction`: where a search for the reference begins."""

    channel: Channel
    direction: Direction


@dataclass(frozen=True, slots=True)
class OtherAnswer:
    """An answer that MiCo did not ask for and does not need; kept for the log."""

    channel: Channel | None
    text: str


@dataclass(frozen=True, slots=True)
class MatchedMove:
    """One axis' part of a movement along a straight line.

    Attributes
    ----------
    target : float
        Where it goes, in `unit`.
    speed, acceleration : float
        Above 0, per second and per second squared; those of all parts are to each other as their
        distances, so that all axes are at the same share of their ways at any time.
    following_error : float
        How far the axis may lag behind before it counts as failed, in `unit`.
    """

    channel: Channel
    target: float
    unit: AxisUnit
    hold_s: float
    speed: float
    acceleration: float
    following_error: float


Event = (
    Completed
    | Failed
    | PositionRead
    | ActivityRead
    | SensorPresentRead
    | TypeRead
    | PositionKnownRead
    | SafeDirectionRead
    | OtherAnswer
)


def _unsupported(channel: Channel, what: str) -> DeviceError:
    text = f"device {channel.device}, channel {channel.channel}: the controller knows no {what}"
    fault = DeviceFault.UNSUPPORTED
    return DeviceError(text, fault=fault, device=channel.device, channel=channel.channel)


class Controller(Protocol):
    """One vendor library and all devices it drives; thread-safe.

    Order of calls: `find_devices`, `open`, anything, `close`. `open` may follow `close`.
    Each command raises `DeviceError` when the library itself refuses it (no such channel, value
    out of range, device gone); trouble at the hardware comes later as a `Failed` event. The
    answers for one channel arrive in the order they were asked for; between channels there is
    no order. `stop` is the one call that may be made past a device's own thread.
    """

    @property
    @abstractmethod
    def name(self) -> str:
        """What the operator reads, such as "SCU3DControl 1.5.16 (simulated)"."""

    @property
    @abstractmethod
    def simulated(self) -> bool:
        """True when no hardware moves."""

    @property
    @abstractmethod
    def capabilities(self) -> Capabilities:
        """What this controller can do."""

    def device_capabilities(self, device: int) -> Capabilities:
        """Return what one device can do; after `open`."""
        del device  # most controllers are all alike
        return self.capabilities

    @abstractmethod
    def find_devices(self) -> tuple[Serial, ...]:
        """Return the serial numbers of the devices connected; before `open`."""

    @abstractmethod
    def open(self, serials: Sequence[Serial] = ()) -> tuple[DeviceIdentity, ...]:
        """Initialise the devices named, or all, for asynchronous work.

        Raises
        ------
        NotConnectedError
            No device, or one of `serials` is not there.
        DeviceError
            The library failed.
        """

    @abstractmethod
    def close(self) -> None:
        """Release all devices; harmless when nothing is open. End listeners first."""

    @abstractmethod
    def receive(self, device: int, timeout_s: float) -> Event | None:
        """Return the next event of one device, or None after `timeout_s`; one thread per device.

        Raises
        ------
        DeviceError
            The device cannot be reached.
        """

    @abstractmethod
    def report_completion(self, channel: Channel) -> None:
        """Have `Completed` sent after each movement of `channel`."""

    @abstractmethod
    def ask_sensor_present(self, channel: Channel) -> None:
        """Ask whether a sensor is connected; `DeviceFault.NO_CHANNEL` when there is no channel."""

    @abstractmethod
    def ask_type(self, channel: Channel) -> None:
        """Ask what is connected."""

    @abstractmethod
    def ask_position_known(self, channel: Channel) -> None:
        """Ask whether the position is referenced; `DeviceFault.UNSUPPORTED` on old libraries."""

    @abstractmethod
    def ask_safe_direction(self, channel: Channel) -> None:
        """Ask which way a search for the reference begins; `DeviceFault.UNSUPPORTED` if it can't.

        A positioner that is referenced at an end stop goes that way only.
        """

    @abstractmethod
    def ask_position(self, channel: Channel, unit: AxisUnit) -> None:
        """Ask for the position: "um" of a linear, "deg" of a rotary positioner."""

    @abstractmethod
    def ask_activity(self, channel: Channel) -> None:
        """Ask what the channel is doing."""

    @abstractmethod
    def set_closed_loop_frequency(self, channel: Channel, frequency_hz: int) -> None:
        """Limit the speed of closed-loop movements, 1 to 18500 Hz."""

    @abstractmethod
    def step(self, channel: Channel, steps: int, *, amplitude_v: float, frequency_hz: int) -> None:
        """Make up to 29999 steps either way, at 15 to 100 V and 1 to 18500 Hz, without sensor.

        A number that the library would take as endless is refused with `DeviceFault.PARAMETER`.
        """

    @abstractmethod
    def move_to(self, channel: Channel, target: float, unit: AxisUnit, *, hold_s: float) -> None:
        """Move to `target` in closed loop and hold there for `hold_s`; inf holds for ever."""

    @abstractmethod
    def move_by(self, channel: Channel, distance: float, unit: AxisUnit, *, hold_s: float) -> None:
        """Move by `distance` in closed loop and hold there for `hold_s`; inf holds for ever."""

    @abstractmethod
    def calibrate(self, channel: Channel) -> None:
        """Calibrate the sensor; moves several millimetres both ways."""

    @abstractmethod
    def reference(self, channel: Channel, *, hold_s: float) -> None:
        """Find the reference; may sweep the whole travel."""

    @abstractmethod
    def move_to_end_stop(self, channel: Channel, direction: Direction, *, hold_s: float) -> None:
        """Drive until the travel ends."""

    def set_speed(
        self, channel: Channel, speed: float, acceleration: float, unit: AxisUnit
    ) -> None:
        """Set speed and acceleration of the movements to come; needs `Capabilities.velocity`."""
        raise _unsupported(channel, f"a speed of {speed} {unit}/s, {acceleration} {unit}/s2")

    def set_sensor_type(self, channel: Channel, code: int) -> None:
        """Say which positioner is connected, by the vendor's number; it is uncalibrated then."""
        raise _unsupported(channel, f"setting of a sensor type {code}")

    def set_safe_direction(self, channel: Channel, direction: Direction) -> None:
        """Say where a search for the reference begins; a new one needs a new calibration."""
        raise _unsupported(channel, f"setting of a safe direction, {direction}")

    def move_together(self, moves: Sequence[MatchedMove]) -> None:
        """Start movements of one device by one command, all or none.

        Needs `Capabilities.group_start` and `Capabilities.velocity`.
        """
        raise _unsupported(moves[0].channel, "a start of several channels by one command")

    @abstractmethod
    def stop(self, channel: Channel) -> None:
        """Stop at once; never waits for anything but the library itself. Any thread."""


@dataclass(frozen=True, slots=True)
class ControllerContext:
    """What a platform gives to the driver of some of its controllers.

    Attributes
    ----------
    clock : Clock
        The platform's, which paces simulated controllers.
    library : str
        Path of the vendor's library; empty looks where the system does.
    serials : tuple of int or str
        The devices that are configured for it, in the order of their numbers; empty: all found.
    scene : Scene or None
        What simulated controllers move; None where there is no twin.
    seed : int
        Of what is random in simulated controllers.
    """

    clock: Clock = WALL
    library: str = ""
    serials: tuple[Serial, ...] = ()
    scene: "Scene | None" = None
    seed: int = 0


ControllerBackend = Backend[ControllerContext, Controller]
"""What an entry point of the group ``cosmic.controllers`` leads to."""
