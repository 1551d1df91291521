"""The axes of a station with the face of a `DeviceManager`, for core that commands axes."""

from collections.abc import Callable, Mapping
from functools import partial
from threading import Lock
from weakref import WeakKeyDictionary

from PySide6.QtCore import QObject, Signal, SignalInstance

from cosmic.frame.background import BackgroundJobs
from cosmic.frame.clock import Clock
from cosmic.frame.errors import CosmicError, MoveCancelled, NotAvailable, UnknownAxisError, refusal
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.operation import Operation, Task
from cosmic.frame.verdict import MoveVerdict, Reason, refuse
from cosmic.mico.api.axis import Axis
from cosmic.mico.api.group import GroupMovement
from cosmic.mico.api.mico import Mico
from cosmic.mico.api.mirrors import (
    CollisionElsewhere,
    ControllerElsewhere,
    LatchElsewhere,
    LinksElsewhere,
)
from cosmic.mico.api.news import (
    AxesStarted,
    AxisBegun,
    AxisEnded,
    AxisRefused,
    MovementNews,
    SentMotion,
)
from cosmic.mico.core.motion.device_commander import CommanderType, DeviceCommander
from cosmic.mico.core.motion.group_start import GroupStart, GroupStarted
from cosmic.mico.core.motion.lease import Lease
from cosmic.mico.core.motion.messages import Order
from cosmic.mico.core.motion.movement import Movement
from cosmic.mico.core.motion.orders import Jog, Motion
from cosmic.mico.core.motion.positioner import (
    Confidence,
    PositionerBase,
    PositionerState,
    class_for,
)
from cosmic.mico.core.settings import MicoSettings
from cosmic.mico.core.state_news import StateNews
from cosmic.mico.hw.interface import Channel, Direction


class Queues:
    """Gives orders one after the other, and stops past them, so that nobody waits; any thread.

    Attributes
    ----------
    keys : mapping of Movement
        Under which key the station knows a movement.
    """

    def __init__(self, policy: FailurePolicy) -> None:
        self.orders = BackgroundJobs("mico orders", policy)
        self._stops = BackgroundJobs("mico halts", policy)
        self._policy = policy
        self.keys: WeakKeyDictionary[Movement, str] = WeakKeyDictionary()

    def stop(self, action: Callable[[], None], what: str) -> None:
        """Have something stopped; loud where that fails."""

        def told(_result: None, error: CosmicError | None) -> None:
            if error is not None:
                self._policy.report(error, f"{what} was NOT carried out at the station")

        self._stops.do(action, told)

    def close(self) -> None:
        """End the threads."""
        for each in (self.orders, self._stops):
            each.request_end()
            each.join()


class PositionersElsewhere:
    """What is known of the channels of one device; any thread."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._of: dict[int, PositionerBase] = {}

    def put(self, state: PositionerState, axis: Axis) -> None:
        """Keep the newest state of a channel."""
        channel = state.address.channel
        with self._lock:
            found = self._of.get(channel)
            if found is None or found.kind is not state.kind:
                make = class_for(state.kind, state.positioner)
                found = self._of[channel] = make(axis.settings, state.address, state.positioner)
            found.state = state
            found.frequency_hz = axis.closed_loop_frequency_hz

    def positioner(self, channel: int) -> PositionerBase | None:
        """Return what is known of a channel."""
        with self._lock:
            return self._of.get(channel)


class DeviceElsewhere(QObject):
    """Sends the orders for one device to its station; any thread.

    The signals are those of `Device`, emitted in the threads that hear from the station.
    """

    position_changed = Signal(object)
    state_changed = Signal(object)
    movement_begun = Signal(object)
    movement_ended = Signal(object)
    movement_refused = Signal(object)

    def __init__(self, index: int, axis_at: Callable[[Channel], Axis], queues: "Queues") -> None:
        super().__init__()
        self._index = index
        self._axis_at = axis_at
        self._queues = queues
        self._lock = Lock()
        self._newest: dict[int, int] = {}
        self._void: dict[int, int] = {}
        self.container = PositionersElsewhere()
        self.slots = CommanderSlots(self, queues)
        self.news = StateNews(self.state_changed.emit, self.position_changed.emit)

    def axis(self, channel: int) -> Axis:
        """Return the axis on a channel; raises `NotAvailable`."""
        return self._axis_at(Channel(self._index, channel))

    def submit(self, order: Order) -> None:
        """Send `order`; how it goes is told by its movement and by signals. Returns at once."""
        with self._lock:
            self._newest[order.channel] = order.number
        self._queues.keys[order.movement] = str(order.number)

        def told(begun: Operation[float | None] | None, error: CosmicError | None) -> None:
            if begun is None:
                order.movement.fail(error or MoveCancelled("it was not begun"))
                return
            order.movement.on_cancel(begun.cancel)
            begun.add_callback(lambda ended: _end_as(ended, order.movement))

        self._queues.orders.do(partial(self._begin, order), told)

    def _begin(self, order: Order) -> Operation[float | None]:
        axis = self.axis(order.channel)
        if order.movement.cancelled or order.number <= self._void.get(order.channel, 0):
            raise MoveCancelled(f"{axis.name}: halted before it started")
        motion, key, follows = order.motion, str(order.number), order.follows
        if isinstance(motion, Jog):
            return axis.begin_jog(motion, key, consent=order.consent, source=order.source)
        before = "" if follows is None else self._queues.keys.get(follows, "forgotten")
        return axis.begin(
            motion, consent=order.consent, key=key, follows=before, source=order.source
        )

    def renew_jog(self, order: Order) -> None:
        """Keep the jog started by `order` alive."""
        self.axis(order.channel).renew(str(order.number))

    def steer_jog(self, order: Order, velocity: float) -> None:
        """Keep the movement started by `order` alive at a signed speed."""
        self.axis(order.channel).renew(str(order.number), velocity)

    def void(self, channel: int) -> None:
        """Let nothing begin that was ordered for a channel so far."""
        with self._lock:
            self._void[channel] = self._newest.get(channel, 0)

    def halt(self, channel: int, why: str) -> None:
        """Stop one channel past every queue, here and there."""
        self.void(channel)
        self.axis(channel).halt(why)

    def set_frequency(self, channel: int, frequency_hz: int) -> None:
        """Limit the closed-loop speed of one channel, 1 to 18500 Hz."""
        self.axis(channel).limit_frequency(frequency_hz)

    def set_zero(self, channel: int, zero: float) -> None:
        """Show the positions of one channel relative to `zero`, in gate coordinates."""
        self.axis(channel).show_from(zero)

    def set_estimate(self, channel: int, position: float, std: float) -> None:
        """Say where an axis without sensor stands; see `Device.set_estimate`."""
        self.axis(channel).place_at(position, std)

    def set_up(self, channel: int, change: int | Direction) -> Task:
        """Store what is connected; see `Device.set_up`."""
        done = Task(f"setting up channel {channel}: {change}")
        done.fail(NotAvailable("positioners are set up at the station that has them"))
        return done


class CommanderSlots(QObject):
    """A device as commanders are joined to it: its slots never wait, and raise nothing."""

    def __init__(self, device: DeviceElsewhere, queues: "Queues") -> None:
        super().__init__(device)
        self._device = device
        self._queues = queues
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
        self._device.void(channel)
        self._queues.stop(partial(self._device.halt, channel, why), f"halt of channel {channel}")

    def set_frequency(self, channel: int, frequency_hz: int) -> None:
        """Limit the closed-loop speed of one channel; the log says where that fails."""
        self._queues.orders.do(
            partial(self._device.set_frequency, channel, frequency_hz), lambda *_: None
        )


class KnownStart(GroupStart):
    """The common start of axes at a station, which tells how it went."""

    def __init__(self, count: int) -> None:
        super().__init__(count, lambda _started: None)

    def note(self, skew_ms: float | None) -> None:
        """Take what was told."""
        self._skew_ms = skew_ms


class ManagerElsewhere(QObject):
    """The axes of a station, as they were told of last; any thread.

    Reading asks nobody. The signals are those of `DeviceManager`, in the threads that hear.
    """

    changed = Signal()
    device_lost = Signal(object)
    group_refused = Signal(object)
    group_started = Signal(object)
    links_changed = Signal()

    def __init__(self, mico: Mico, policy: FailurePolicy) -> None:
        super().__init__()
        self._mico = mico
        self._queues = Queues(policy)
        self._lock = Lock()
        self._devices: dict[int, DeviceElsewhere] = {}
        self._followed: dict[str, Axis] = {}
        self._outline: tuple[object, ...] = ()
        self.latch = LatchElsewhere()
        self.lease = Lease()
        self.links = LinksElsewhere(mico)
        self.links.subscribe(self.links_changed.emit)
        self.collision = CollisionElsewhere(mico)

    # What there is

    @property
    def settings(self) -> MicoSettings:
        """What the platform file says."""
        return self._mico.settings

    @property
    def clock(self) -> Clock:
        """The platform's clock."""
        return self._mico.clock

    @property
    def controller(self) -> ControllerElsewhere:
        """What is known of the controller."""
        return ControllerElsewhere(self._mico.controller, self._mico.simulated)

    @property
    def exemptions(self) -> CollisionElsewhere | None:
        """What is left out of the collision check; None without a collision model."""
        return self.collision if self.collision.available else None

    @property
    def missing(self) -> tuple[str, ...]:
        """What was configured and is not there, a line each."""
        return self._mico.missing

    @property
    def ready(self) -> bool:
        """True while axes can be moved."""
        return self._mico.ready

    @property
    def devices(self) -> Mapping[int, DeviceElsewhere]:
        """The devices by index."""
        return dict(self._devices)

    def names(self) -> list[str]:
        """Return the names of all axes."""
        return list(self._mico.axes)

    def address(self, name: str) -> Channel:
        """Return where an axis is connected; raises `UnknownAxisError`."""
        return self.state(name).address

    def state(self, name: str) -> PositionerState:
        """Return the state of an axis as it was last told; raises `UnknownAxisError`."""
        axis = self._mico.axes.get(name) if isinstance(name, str) else None
        if axis is None:
            raise UnknownAxisError(name, self.names())
        return axis.details

    def states(self) -> dict[str, PositionerState]:
        """Return the state of every axis by name."""
        return {name: axis.details for name, axis in self._mico.axes.items()}

    def positions(self) -> dict[str, float] | None:
        """Return the position of every axis in gate coordinates; None while one is unknown."""
        positions: dict[str, float] = {}
        for state in self.states().values():
            unknown = state.confidence is Confidence.UNKNOWN or not state.present
            if state.position is None or unknown:
                return None
            positions[state.name] = state.position
        return positions or None

    def device(self, name: str) -> DeviceElsewhere:
        """Return the device that drives an axis; raises `UnknownAxisError`."""
        return self._device(self.address(name).device)

    def connect_device_commander(
        self,
        index: int,
        commander: DeviceCommander,
        kind: CommanderType = CommanderType.INPUT_OUTPUT,
    ) -> None:
        """Join a commander to the device `index`; raises `NotAvailable`."""
        if index not in self._devices:
            raise NotAvailable(f"there is no device {index}")
        commander.attach(self._devices[index].slots, kind)

    def _device(self, index: int) -> DeviceElsewhere:
        with self._lock:
            device = self._devices.get(index)
            if device is None:
                device = DeviceElsewhere(index, self._axis_at, self._queues)
                self._devices = {**self._devices, index: device}
        return device

    def _axis_at(self, address: Channel) -> Axis:
        for axis in self._mico.axes.values():
            if axis.details.address == address:
                return axis
        raise NotAvailable(f"there is no axis at device {address.device}, {address.channel}")

    # What the station tells

    def take_state(self) -> None:
        """Take note that the state of MiCo is another; for whoever hears of it."""
        mico = self._mico
        for name, axis in mico.axes.items():
            if self._followed.get(name) is not axis and axis.far is not None:
                self._followed[name] = axis
                axis.far.changed.subscribe(partial(self._on_axis, axis))
                self._on_axis(axis, axis.details)
        self.latch.show(mico.stop_state)
        self.links.show(mico.links)
        self.collision.show(mico.taken_out, mico.allowed_contacts)
        outline = (mico.ready, mico.failure, tuple(mico.axes), mico.missing)
        if outline != self._outline:
            self._outline = outline
            self.changed.emit()

    def _on_axis(self, axis: Axis, state: PositionerState) -> None:
        device = self._device(state.address.device)
        device.container.put(state, axis)
        device.news.tell(state)

    def take_news(self, news: MovementNews) -> None:
        """Take one thing that happened; for whoever hears of it."""
        match news:
            case AxisRefused(together=True):
                self.group_refused.emit(news.verdict)
            case AxisRefused():
                self._tell(news.verdict.axis, lambda device: device.movement_refused, news.verdict)
            case AxisBegun():
                self._tell(news.name, lambda device: device.movement_begun, news.heard())
            case AxisEnded():
                self._tell(news.name, lambda device: device.movement_ended, news.heard())
            case AxesStarted():
                self.group_started.emit(GroupStarted(news.names, news.skew_ms))

    def _tell(
        self, name: str, signal: Callable[[DeviceElsewhere], SignalInstance], what: object
    ) -> None:
        if name in self._mico.axes:
            signal(self.device(name)).emit(what)

    # Commands

    def check(self, motions: Mapping[str, Motion], *, consent: bool = False) -> MoveVerdict:
        """Return what the gate of the station says; see `Mico.judge`."""
        return self._mico.judge(_sendable(motions), consent=consent)

    def order_together(
        self,
        motions: Mapping[str, Motion],
        *,
        source: str,
        consent: bool = False,
        linked: bool = True,
        match_arrival: bool = False,
        follows: Mapping[str, Movement] | None = None,
    ) -> dict[str, Order]:
        """Have `motions` decided together and started back to back, or none of them.

        Where this thread must not wait, a refusal is how the movements end; otherwise raises as
        `DeviceManager.order_together`.
        """
        del follows  # only what runs at the station follows another group
        names: dict[str, Motion] = dict(motions)
        for name, motion in motions.items():
            for other in self.links.companions(name) if linked else ():
                names.setdefault(other, motion)
        begun = self._mico.begin_together(
            _sendable(motions),
            consent=consent,
            linked=linked,
            match_arrival=match_arrival,
            source=source,
        )
        start = KnownStart(len(names)) if len(names) > 1 else None
        orders = {
            name: Order(self.address(name).channel, motion, "", source, start=start)
            for name, motion in names.items()
        }
        for order in orders.values():
            order.movement.on_cancel(begun.cancel)
        begun.add_callback(lambda ended: _end_together(ended, orders, start))
        return orders

    def stop(self, reason: str = "stop") -> None:
        """Stop every axis of the station, past every queue; see `Mico.stop`."""
        self._mico.stop(reason)

    def reset_stop(self) -> None:
        """Allow motion again; only the holder of the lease may, and the station's operator."""
        self._mico.reset_stop()

    def close(self) -> None:
        """End the threads, and show that nobody knows how the axes are any more."""
        self._queues.close()


def _sendable(motions: Mapping[str, Motion]) -> dict[str, SentMotion]:
    """Return motions that may be asked for together; raises `MoveRefused` for a jog."""
    found: dict[str, SentMotion] = {}
    for name, motion in motions.items():
        if isinstance(motion, Jog):
            text = f"{name}: an axis jogs alone"
            raise refusal(refuse(Reason.WRONG_KIND, text, axis=name))
        found[name] = motion
    return found


def _end_as(ended: Operation[float | None], movement: Movement) -> None:
    error = ended.failure
    if error is not None:
        movement.fail(error)
    else:
        movement.finish(ended.result)


def _end_together(
    ended: GroupMovement, orders: Mapping[str, Order], start: KnownStart | None
) -> None:
    """End the movements of a group as the whole has ended."""
    error = ended.failure
    if start is not None:
        start.note(ended.start_skew_ms)
    for name, order in orders.items():
        if error is not None:
            order.movement.fail(error)
        else:
            order.movement.finish(ended.result.get(name))
