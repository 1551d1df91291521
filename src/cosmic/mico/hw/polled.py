"""A `Controller` for stages that only answer questions; a driver of another make writes a unit.

A `StageUnit` is one box with its axes; a `StageAxis` answers what it is asked and begins what it is
told, each within one exchange on the line. `PolledController` makes the events of them that MiCo
waits for: it asks an axis that moves, and says when it is stationary.
"""

import logging
import math
from abc import abstractmethod
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from threading import Condition, Lock
from typing import Final, Protocol

from typing_extensions import override

from cosmic.frame.clock import WALL
from cosmic.frame.errors import DeviceError, DeviceFault, NotConnectedError
from cosmic.frame.units import AxisUnit
from cosmic.mico.hw.interface import (
    Activity,
    ActivityRead,
    Capabilities,
    Channel,
    Completed,
    Controller,
    DeviceIdentity,
    Direction,
    Event,
    Failed,
    PositionerKind,
    PositionerType,
    PositionKnownRead,
    PositionRead,
    ReferenceKind,
    SafeDirectionRead,
    SensorPresentRead,
    Serial,
    TypeRead,
)

logger = logging.getLogger(__name__)

POLL_S: Final = 0.02
"""An axis that moves is asked so often whether it still does, in wall time."""
FARTHEST: Final = 1e8
"""No stage goes farther, in um or degrees."""


class StageAxis(Protocol):
    """One axis with a sensor. Every call is thread-safe and returns within one exchange.

    Each raises `DeviceError` where the axis or its line fails.
    """

    kind: PositionerKind
    """`LINEAR` counts in um, `ROTARY` in degrees."""
    name: str
    """What the maker calls it."""

    @abstractmethod
    def position(self) -> float:
        """Ask where it is."""

    @abstractmethod
    def moving(self) -> bool:
        """Ask whether it moves; True from the moment that a movement was accepted."""

    @abstractmethod
    def referenced(self) -> bool:
        """Ask whether its position means anything."""

    @abstractmethod
    def move_to(self, target: float) -> None:
        """Begin to go to `target`, in place of where it was going."""

    @abstractmethod
    def home(self) -> None:
        """Begin to find the reference."""

    @abstractmethod
    def stop(self) -> None:
        """Stop at once; may be called while another call waits for its answer."""


class StageUnit(Protocol):
    """One open controller box."""

    serial: Serial
    firmware: str
    axes: Sequence[StageAxis]
    """By channel, from 0."""

    @abstractmethod
    def close(self) -> None:
        """Give the line back; harmless the second time."""


@dataclass
class _Device:
    """One open unit, its events, and what its axes were told."""

    unit: StageUnit
    events: deque[Event] = field(default_factory=deque)
    running: dict[int, Activity] = field(default_factory=dict)
    holding: set[int] = field(default_factory=set)
    hold_asked: dict[int, bool] = field(default_factory=dict)
    reporting: set[int] = field(default_factory=set)
    changed: Condition = field(default_factory=Condition)


class PolledController(Controller):
    """Drives units that only answer questions; thread-safe as they are.

    Parameters
    ----------
    name : str
        What the operator reads, such as "My stage 1.2".
    find : callable
        Returns what opens each unit that is connected, by its serial number; nothing is opened by
        looking. Raises `NotConnectedError` where nobody can look.
    simulated : bool
        No hardware moves.

    Notes
    -----
    There is no command for a calibration, an end stop or open-loop steps: they are refused with
    `DeviceFault.UNSUPPORTED`. Positions are held as long as the stage does so by itself. The limit
    of the closed-loop frequency is taken and has no meaning.
    """

    def __init__(
        self,
        name: str,
        find: Callable[[], Mapping[Serial, Callable[[], StageUnit]]],
        *,
        simulated: bool = False,
    ) -> None:
        self._name = name
        self._find = find
        self._simulated = simulated
        self._lifecycle = Lock()
        self._devices: tuple[_Device, ...] = ()

    @property
    @override
    def name(self) -> str:
        return self._name

    @property
    @override
    def simulated(self) -> bool:
        return self._simulated

    @property
    @override
    def capabilities(self) -> Capabilities:
        most = max((len(each.unit.axes) for each in self._devices), default=1)
        return self._able(most)

    @override
    def device_capabilities(self, device: int) -> Capabilities:
        return self._able(len(self._device(device).unit.axes))

    @staticmethod
    def _able(channels: int) -> Capabilities:
        return Capabilities(
            group_start=False, velocity=False, position_known=True, channels=channels
        )

    # Opening and closing

    @override
    def find_devices(self) -> tuple[Serial, ...]:
        return tuple(self._find())

    @override
    def open(self, serials: Sequence[Serial] = ()) -> tuple[DeviceIdentity, ...]:
        with self._lifecycle:
            if self._devices:
                raise DeviceError(f"{self.name} is open already", fault=DeviceFault.STATE)
            there = self._find()
            missing = [each for each in serials if each not in there]
            if missing or not there:
                wanted = f"no device {', '.join(map(str, missing))}" if missing else "no device"
                raise NotConnectedError(
                    f"{self.name}: {wanted} is connected; there are: "
                    f"{', '.join(map(str, there)) or 'none'}. Check power and cable",
                    fault=DeviceFault.COMMUNICATION,
                )
            opened: list[_Device] = []
            try:
                for serial in serials or there:
                    opened.append(_Device(there[serial]()))
            except DeviceError:
                for each in opened:
                    each.unit.close()
                raise
            self._devices = tuple(opened)
        units = [each.unit for each in opened]
        return tuple(
            DeviceIdentity(index, each.serial, each.firmware) for index, each in enumerate(units)
        )

    @override
    def close(self) -> None:
        with self._lifecycle:
            devices, self._devices = self._devices, ()
        for each in devices:
            with each.changed:
                each.changed.notify_all()
            each.unit.close()

    # Events

    @override
    def receive(self, device: int, timeout_s: float) -> Event | None:
        found = self._device(device)
        ends_s = WALL.now_s() + timeout_s
        while True:
            if found.events:
                return found.events.popleft()
            for channel in tuple(found.running):
                self._look(found, device, channel)
            left_s = ends_s - WALL.now_s()
            if left_s <= 0.0 or found not in self._devices:
                return found.events.popleft() if found.events else None
            with found.changed:
                if not found.events:
                    found.changed.wait(min(left_s, POLL_S) if found.running else left_s)

    def _look(self, found: _Device, device: int, channel: int) -> None:
        """Note that an axis has become stationary, and say so."""
        told = found.running.get(channel)
        if told is None or found.unit.axes[channel].moving():
            return
        with found.changed:
            if found.running.get(channel) is not told:
                return  # a newer command came in between
            del found.running[channel]
            if found.hold_asked.get(channel, False):
                found.holding.add(channel)
            if channel in found.reporting:
                found.events.append(Completed(Channel(device, channel)))

    def _answer(self, channel: Channel, make: Callable[[StageAxis], Event]) -> None:
        """Ask an axis; what it says, or how it failed, is the event."""
        found, axis = self._axis(channel)
        try:
            event: Event = make(axis)
        except DeviceError as exc:
            event = Failed(channel, exc)
        with found.changed:
            found.events.append(event)
            found.changed.notify_all()

    # Questions

    @override
    def report_completion(self, channel: Channel) -> None:
        found, _ = self._axis(channel)
        found.reporting.add(channel.channel)

    @override
    def ask_sensor_present(self, channel: Channel) -> None:
        self._answer(channel, lambda _axis: SensorPresentRead(channel, True))

    @override
    def ask_type(self, channel: Channel) -> None:
        def read(axis: StageAxis) -> Event:
            found = PositionerType(0, axis.name, axis.kind, ReferenceKind.MARK)
            return TypeRead(channel, found)

        self._answer(channel, read)

    @override
    def ask_position_known(self, channel: Channel) -> None:
        self._answer(channel, lambda axis: PositionKnownRead(channel, axis.referenced()))

    @override
    def ask_safe_direction(self, channel: Channel) -> None:
        self._answer(channel, lambda _axis: SafeDirectionRead(channel, Direction.BACKWARD))

    @override
    def ask_position(self, channel: Channel, unit: AxisUnit) -> None:
        def read(axis: StageAxis) -> Event:
            if unit != _unit(axis):
                raise _error(channel, f"counts in {_unit(axis)}", DeviceFault.WRONG_KIND)
            return PositionRead(channel, axis.position(), unit)

        self._answer(channel, read)

    @override
    def ask_activity(self, channel: Channel) -> None:
        def read(_axis: StageAxis) -> Event:
            found, _ = self._axis(channel)
            self._look(found, channel.device, channel.channel)
            rest = Activity.HOLDING if channel.channel in found.holding else Activity.STOPPED
            return ActivityRead(channel, found.running.get(channel.channel, rest))

        self._answer(channel, read)

    # Commands

    @override
    def set_closed_loop_frequency(self, channel: Channel, frequency_hz: int) -> None:
        self._axis(channel)
        low, high = self.capabilities.frequency_hz
        if not (isinstance(frequency_hz, int) and low <= frequency_hz <= high):
            raise _error(channel, f"{frequency_hz!r} Hz is not {low} to {high}")

    @override
    def step(self, channel: Channel, steps: int, *, amplitude_v: float, frequency_hz: int) -> None:
        self._axis(channel)
        raise _error(channel, "this stage makes no open-loop steps", DeviceFault.UNSUPPORTED)

    @override
    def move_to(self, channel: Channel, target: float, unit: AxisUnit, *, hold_s: float) -> None:
        _, axis = self._axis(channel)
        if unit != _unit(axis):
            raise _error(channel, f"counts in {_unit(axis)}", DeviceFault.WRONG_KIND)
        if not -FARTHEST <= target <= FARTHEST:
            raise _error(channel, f"a target of {target!r} {unit} cannot be sent")
        self._begin(channel, Activity.TARGETING, hold_s, lambda axis: axis.move_to(target))

    @override
    def move_by(self, channel: Channel, distance: float, unit: AxisUnit, *, hold_s: float) -> None:
        _, axis = self._axis(channel)
        if not -FARTHEST <= distance <= FARTHEST:
            raise _error(channel, f"a distance of {distance!r} {unit} cannot be sent")
        self.move_to(channel, axis.position() + distance, unit, hold_s=hold_s)

    @override
    def calibrate(self, channel: Channel) -> None:
        self._axis(channel)
        raise _error(channel, "this stage has no calibration", DeviceFault.UNSUPPORTED)

    @override
    def reference(self, channel: Channel, *, hold_s: float) -> None:
        self._begin(channel, Activity.REFERENCING, hold_s, lambda axis: axis.home())

    @override
    def move_to_end_stop(self, channel: Channel, direction: Direction, *, hold_s: float) -> None:
        self._axis(channel)
        _check_hold(channel, hold_s)
        raise _error(channel, "this stage has no end stop to go to", DeviceFault.UNSUPPORTED)

    @override
    def stop(self, channel: Channel) -> None:
        found, axis = self._axis(channel)
        axis.stop()
        with found.changed:
            found.holding.discard(channel.channel)
            found.hold_asked[channel.channel] = False
            found.changed.notify_all()

    def _begin(
        self,
        channel: Channel,
        activity: Activity,
        hold_s: float,
        begin: Callable[[StageAxis], None],
    ) -> None:
        found, axis = self._axis(channel)
        _check_hold(channel, hold_s)
        begin(axis)
        with found.changed:
            found.holding.discard(channel.channel)
            found.hold_asked[channel.channel] = hold_s > 0.0
            found.running[channel.channel] = activity
            found.changed.notify_all()

    def _device(self, device: int) -> _Device:
        devices = self._devices
        if not devices:
            raise DeviceError(f"{self.name} is not open", fault=DeviceFault.STATE, device=device)
        if not 0 <= device < len(devices):
            text = f"device {device}: there is no such device"
            raise DeviceError(text, fault=DeviceFault.NO_CHANNEL, device=device)
        return devices[device]

    def _axis(self, channel: Channel) -> tuple[_Device, StageAxis]:
        devices = self._devices
        if devices and not 0 <= channel.device < len(devices):
            raise _error(channel, "there is no such device", DeviceFault.NO_CHANNEL)
        found = self._device(channel.device)
        if not 0 <= channel.channel < len(found.unit.axes):
            raise _error(channel, "there is no such channel", DeviceFault.NO_CHANNEL)
        return found, found.unit.axes[channel.channel]


def _unit(axis: StageAxis) -> AxisUnit:
    return "deg" if axis.kind is PositionerKind.ROTARY else "um"


def _check_hold(channel: Channel, hold_s: float) -> None:
    if not (0.0 <= hold_s < 3600.0 or hold_s == math.inf):
        raise _error(channel, f"a hold time of {hold_s!r} s cannot be kept")


def _error(
    channel: Channel, reason: str, fault: DeviceFault = DeviceFault.PARAMETER
) -> DeviceError:
    return DeviceError(
        f"device {channel.device}, channel {channel.channel}: {reason}",
        fault=fault,
        device=channel.device,
        channel=channel.channel,
    )
