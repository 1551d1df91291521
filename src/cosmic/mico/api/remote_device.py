"""A device of another process, as commanders use it."""

import logging
from collections.abc import Callable, Mapping
from threading import Lock

from PySide6.QtCore import QObject, Signal, SignalInstance

from cosmic.frame.errors import CosmicError, MoveCancelled, MoveRefused, ProtocolError
from cosmic.frame.network.ongoing import Ongoing
from cosmic.frame.network.travelling_errors import from_plain
from cosmic.mico.api.remote_line import CommandLine, when_over
from cosmic.mico.api.station_words import Begun, Ended, Outcomes, Refused
from cosmic.mico.core.motion.messages import MovementEnded
from cosmic.mico.core.motion.orders import Jog, Order
from cosmic.mico.core.motion.positioner import PositionerBase, PositionerState, class_for
from cosmic.mico.core.settings import PositionerSettings
from cosmic.mico.core.state_news import StateNews

logger = logging.getLogger(__name__)

Heed = Callable[[object], None]


class RemotePositioners:
    """What is known of the channels of one device; any thread."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._of: dict[int, PositionerBase] = {}

    def put(self, state: PositionerState, settings: PositionerSettings) -> None:
        """Keep the newest state of a channel."""
        channel = state.address.channel
        with self._lock:
            found = self._of.get(channel)
            if found is None or found.kind is not state.kind:
                make = class_for(state.kind, state.positioner)
                found = self._of[channel] = make(settings, state.address, state.positioner)
            found.state = state

    def positioner(self, channel: int) -> PositionerBase | None:
        """Return what is known of a channel."""
        with self._lock:
            return self._of.get(channel)

    def name(self, channel: int) -> str:
        """Return the name of the axis on a channel."""
        found = self.positioner(channel)
        return found.state.name if found is not None else f"channel {channel}"


class RemoteDevice(QObject):
    """Sends the orders for one device to its station; its methods return at once.

    The signals are those of `Device`, emitted in the threads that hear from the station.
    """

    position_changed = Signal(object)
    state_changed = Signal(object)
    movement_begun = Signal(object)
    movement_ended = Signal(object)
    movement_refused = Signal(object)

    def __init__(self, index: int, line: CommandLine) -> None:
        super().__init__()
        self.index = index
        self.container = RemotePositioners()
        self._line = line
        self._lock = Lock()
        self._newest: dict[int, int] = {}
        self._void: dict[int, int] = {}
        self.slots = CommanderSlots(self)
        self.news = StateNews(self.state_changed.emit, self.position_changed.emit)

    def tell(self, event: Begun | Ended | Refused) -> None:
        """Emit what the station says of a movement."""
        match event:
            case Begun():
                self.movement_begun.emit(event.heard())
            case Ended():
                error = None if event.error is None else from_plain(event.error)
                self.movement_ended.emit(MovementEnded(event.name, event.position, error))
            case Refused():
                self.movement_refused.emit(event.verdict)

    def submit(self, order: Order) -> None:
        """Send `order`; how it goes is told by its movement and by signals."""
        with self._lock:
            self._newest[order.channel] = order.number
        number, movement = order.number, order.movement
        self._line.note_number(movement, number)
        movement.on_cancel(lambda: self._line.withdraw(number))
        try:
            self._line.post(lambda: self._send(order))
        except CosmicError as exc:
            movement.fail(exc)

    def _send(self, order: Order) -> None:
        name = self.container.name(order.channel)
        void = order.number <= self._void.get(order.channel, 0)
        if order.movement.cancelled or void:
            order.movement.fail(MoveCancelled(f"{name}: halted before it started"))
            return
        arguments: dict[str, object] = {
            "axis": name,
            "number": order.number,
            "motion": order.motion,
            "consent": order.consent,
            "source": order.source,
        }
        jogs = isinstance(order.motion, Jog)
        if order.follows is not None:
            arguments["follows"] = self._line.number_of(order.follows)
        try:
            ongoing = self._line.call("jog" if jogs else "order", arguments)
            follow({name: order}, ongoing, self._line.heed)
        except CosmicError as exc:
            self._on_not_begun(order, exc)

    def _on_not_begun(self, order: Order, error: CosmicError) -> None:
        order.movement.fail(error)
        if isinstance(error, MoveRefused):
            logger.warning("refused (%s): %s", order.source, error.verdict)
            self.movement_refused.emit(error.verdict)

    def renew_jog(self, order: Order) -> None:
        """Keep the jog started by `order` alive."""
        self._line.renew("renew", self.container.name(order.channel), order.number)

    def steer_jog(self, order: Order, velocity: float) -> None:
        """Keep the movement started by `order` alive at a signed speed."""
        name = self.container.name(order.channel)
        self._line.renew("steer", name, order.number, velocity=velocity)

    def halt(self, channel: int, why: str) -> None:
        """Stop one channel past every queue, here and there; raises as `CommandLine.at_once`."""
        self._line.at_once("halt", self._halt_arguments(channel, why))

    def halt_loudly(self, channel: int, why: str) -> None:
        """Stop one channel without waiting; the policy is told where that fails."""
        self._line.at_once_later("halt", self._halt_arguments(channel, why))

    def _halt_arguments(self, channel: int, why: str) -> dict[str, object]:
        with self._lock:
            up_to = self._void[channel] = self._newest.get(channel, 0)
        return {"axis": self.container.name(channel), "up_to": up_to, "why": why}

    def set_frequency(self, channel: int, frequency_hz: int) -> None:
        """Limit the closed-loop speed of one channel, 1 to 18500 Hz."""
        positioner = self.container.positioner(channel)
        arguments = {"axis": self.container.name(channel), "frequency_hz": frequency_hz}
        self._line.do("set_frequency", arguments)
        if positioner is not None:
            positioner.frequency_hz = frequency_hz

    def set_zero(self, channel: int, zero: float) -> None:
        """Show the positions of one channel relative to `zero`, in gate coordinates."""
        self._line.do("set_zero", {"axis": self.container.name(channel), "zero": zero})

    def set_estimate(self, channel: int, position: float, std: float) -> None:
        """Say where an axis without sensor stands; see `Device.set_estimate`."""
        arguments = {"axis": self.container.name(channel), "position": position, "std": std}
        self._line.do("set_estimate", arguments)


class CommanderSlots(QObject):
    """A device as commanders are joined to it: out of a slot no exception may come."""

    def __init__(self, device: RemoteDevice) -> None:
        super().__init__(device)
        self._device = device
        self.position_changed: SignalInstance = device.position_changed
        self.state_changed: SignalInstance = device.state_changed
        self.movement_ended: SignalInstance = device.movement_ended
        self.movement_refused: SignalInstance = device.movement_refused

    def submit(self, order: Order) -> None:
        """Send `order`."""
        self._device.submit(order)

    def renew_jog(self, order: Order) -> None:
        """Keep the jog started by `order` alive."""
        self._device.renew_jog(order)

    def steer_jog(self, order: Order, velocity: float) -> None:
        """Keep the movement started by `order` alive at a signed speed."""
        self._device.steer_jog(order, velocity)

    def halt(self, channel: int, why: str) -> None:
        """Stop one channel; the policy is told where that fails."""
        self._device.halt_loudly(channel, why)

    def set_frequency(self, channel: int, frequency_hz: int) -> None:
        """Limit the closed-loop speed of one channel; the log says where that fails."""
        try:
            self._device.set_frequency(channel, frequency_hz)
        except CosmicError as exc:
            logger.warning("%s: %s", self._device.container.name(channel), exc)


def follow(
    orders: Mapping[str, Order],
    ongoing: object,
    heed: Heed,
    note_skew_ms: Callable[[float | None], None] | None = None,
) -> None:
    """End the movements of `orders` as what goes on at the station ends."""
    if not isinstance(ongoing, Ongoing):
        raise ProtocolError(f"a movement was expected from the station, not {ongoing!r:.80}")
    when_over(ongoing, lambda: _on_over(orders, ongoing, heed, note_skew_ms))


def _on_over(
    orders: Mapping[str, Order],
    ongoing: Ongoing,
    heed: Heed,
    note_skew_ms: Callable[[float | None], None] | None,
) -> None:
    try:
        outcomes = ongoing.wait(0.0)
        if not isinstance(outcomes, Outcomes):
            raise ProtocolError(f"the station does not say how a movement ended: {outcomes!r:.80}")
    except CosmicError as exc:
        for order in orders.values():
            order.movement.fail(exc)
        return
    heed(outcomes.status)
    if note_skew_ms is not None:
        note_skew_ms(outcomes.skew_ms)
    for name, order in orders.items():
        outcome = outcomes.of.get(name)
        if outcome is None:
            order.movement.fail(ProtocolError(f"{name}: the station says nothing of its end"))
            continue
        if outcome.state is not None:
            heed(outcome.state)
        if outcome.error is None:
            order.movement.finish(outcome.position)
        else:
            order.movement.fail(from_plain(outcome.error))
