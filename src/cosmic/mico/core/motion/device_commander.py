"""`DeviceCommander`: the run-time API of one device, joined to it at run time (thesis 6.1.2)."""

from abc import abstractmethod
from collections.abc import Callable
from enum import Flag, auto
from typing import Protocol
from weakref import finalize, ref

from PySide6.QtCore import QMetaObject, QObject, Qt, Signal

from cosmic.frame.errors import NotConnectedError
from cosmic.frame.units import AxisUnit
from cosmic.mico.core.motion.messages import DeviceSignals, Order
from cosmic.mico.core.motion.movement import Movement
from cosmic.mico.core.motion.orders import (
    Calibrate,
    Jog,
    Motion,
    MoveBy,
    MoveTo,
    Reference,
    Steer,
    Step,
    ToEndStop,
)
from cosmic.mico.core.motion.stop_latch import StopLatch
from cosmic.mico.hw.interface import Direction


class CommanderType(Flag):
    """What a commander is connected for (thesis program 6.2)."""

    INPUT = auto()
    """It commands movements."""
    OUTPUT = auto()
    """It hears what became of them."""
    INPUT_OUTPUT = INPUT | OUTPUT


class Commanded(DeviceSignals, Protocol):
    """What a commander is joined to: a `Device`."""

    @abstractmethod
    def submit(self, order: Order) -> None:
        """Queue `order`."""

    @abstractmethod
    def renew_jog(self, order: Order) -> None:
        """Keep the jog started by `order` alive."""

    @abstractmethod
    def steer_jog(self, order: Order, velocity: float) -> None:
        """Keep the movement started by `order` alive at a signed speed."""

    @abstractmethod
    def halt(self, channel: int, why: str) -> None:
        """Stop one channel past every queue."""

    @abstractmethod
    def set_frequency(self, channel: int, frequency_hz: int) -> None:
        """Limit the closed-loop speed of one channel."""


class DeviceCommander(QObject):
    """Commands the channels of whatever device it is connected to, and hears from it.

    It knows nothing of the device: `DeviceManager.connect_device_commander` joins the two. Each
    command goes into the device's queue in the caller's thread, so that no event loop is needed
    to make a move, and returns at once with the `Movement`; any thread. Positions are in gate
    coordinates.

    Parameters
    ----------
    token : str
        Proof of the lease.
    source : str
        Where its commands come from, for the log.

    Signals
    -------
    position_changed(PositionChanged), state_changed(PositionerState),
    movement_ended(MovementEnded), movement_refused(MoveVerdict)
        From the device, in its thread.
    """

    position_changed = Signal(object)
    state_changed = Signal(object)
    movement_ended = Signal(object)
    movement_refused = Signal(object)

    def __init__(self, token: str, source: str = "script", parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._token = token
        self.source = source
        self._device: Commanded | None = None
        self._latch: StopLatch | None = None
        self._connections: list[QMetaObject.Connection] = []
        finalize(self, _part, self._connections).atexit = False

    def attach(
        self, device: Commanded, kind: CommanderType, latch: StopLatch | None = None
    ) -> None:
        """Join it to a device, parting it from any other; for `connect_device_commander`."""
        self.detach()
        self._latch = latch
        if CommanderType.OUTPUT in kind:
            direct = Qt.ConnectionType.DirectConnection
            self._connections += [
                device.position_changed.connect(_relay(self, "position_changed"), direct),
                device.state_changed.connect(_relay(self, "state_changed"), direct),
                device.movement_ended.connect(_relay(self, "movement_ended"), direct),
                device.movement_refused.connect(_relay(self, "movement_refused"), direct),
            ]
        if CommanderType.INPUT in kind:
            self._device = device

    def detach(self) -> None:
        """Part from the device."""
        self._device = None
        _part(self._connections)

    def move_absolute(
        self, channel: int, target: float, unit: AxisUnit, *, consent: bool = False
    ) -> Movement:
        """Move to `target`."""
        return self.order(channel, MoveTo(target, unit), consent=consent).movement

    def move_relative(
        self, channel: int, distance: float, unit: AxisUnit, *, consent: bool = False
    ) -> Movement:
        """Move by `distance`."""
        return self.order(channel, MoveBy(distance, unit), consent=consent).movement

    def move_steps(
        self,
        channel: int,
        steps: int,
        *,
        amplitude_v: float,
        frequency_hz: int,
        consent: bool = False,
    ) -> Movement:
        """Make steps without looking at a sensor."""
        return self.send(channel, Step(steps, amplitude_v, frequency_hz), consent=consent)

    def calibrate(self, channel: int, *, consent: bool = False) -> Movement:
        """Calibrate the sensor."""
        return self.send(channel, Calibrate(), consent=consent)

    def reference(self, channel: int, *, consent: bool = False) -> Movement:
        """Find the reference."""
        return self.send(channel, Reference(), consent=consent)

    def move_to_end_stop(
        self, channel: int, direction: Direction, *, consent: bool = False
    ) -> Movement:
        """Drive until the travel ends."""
        return self.send(channel, ToEndStop(direction), consent=consent)

    def jog(self, channel: int, direction: int, speed: float, *, consent: bool = False) -> Order:
        """Begin to move continuously; call `renew_jog` several times within the dead-man time."""
        return self.order(channel, Jog(direction, speed), consent=consent)

    def renew_jog(self, order: Order) -> None:
        """Keep the jog begun by `order` alive."""
        if self._device is not None:
            self._device.renew_jog(order)

    def steer(self, channel: int, velocity: float, *, dead_man_s: float) -> Order:
        """Begin to move at a signed speed that `steer_on` changes; it ends when that stays away."""
        return self.order(channel, Steer.at(velocity, dead_man_s), consent=False)

    def steer_on(self, order: Order, velocity: float) -> None:
        """Keep the movement begun by `steer` alive at `velocity`; only the newest counts."""
        if self._device is not None:
            self._device.steer_jog(order, velocity)

    def stop(self, channel: int, why: str = "stopped") -> None:
        """Stop one channel; nothing is latched."""
        if self._device is not None:
            self._device.halt(channel, why)

    def send(
        self,
        channel: int,
        motion: Motion,
        *,
        consent: bool = False,
        follows: Movement | None = None,
    ) -> Movement:
        """Send any motion; with `follows`, only if that is still the newest on its channel."""
        return self.order(channel, motion, consent=consent, follows=follows).movement

    def order(
        self,
        channel: int,
        motion: Motion,
        *,
        consent: bool,
        follows: Movement | None = None,
        source: str = "",
    ) -> Order:
        """Send any motion, and return the order that it is; from `source` where one is given."""
        device = self._device
        if device is None:
            raise NotConnectedError("this commander is connected to no device, or only listens")
        epoch = None if self._latch is None else self._latch.state.epoch
        said = source or self.source
        order = Order(channel, motion, self._token, said, consent, follows=follows, epoch=epoch)
        device.submit(order)
        return order


def _relay(commander: DeviceCommander, name: str) -> Callable[[object], None]:
    """Return what emits by a signal of a commander what its device emitted.

    The commander is held meanwhile. A signal joined to a signal would not: one that is dropped is
    deleted by the collector, in any thread, and the device's thread would emit by what is gone.
    """
    weak = ref(commander)

    def emit(value: object) -> None:
        alive = weak()
        if alive is not None:
            getattr(alive, name).emit(value)

    return emit


def _part(connections: list[QMetaObject.Connection]) -> None:
    while connections:
        QObject.disconnect(connections.pop())
