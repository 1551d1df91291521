"""`Device`: all calls to the controller library for one device (thesis 5.4, 6.1)."""

import logging
from collections.abc import Callable
from functools import partial
from queue import Empty
from threading import Lock
from typing import Final

from PySide6.QtCore import QObject, Signal
from typing_extensions import override

from cosmic.frame.clock import Clock
from cosmic.frame.errors import (
    CosmicError,
    DeviceError,
    DeviceFault,
    DeviceTimeout,
    MoveCancelled,
    NotAvailable,
    NotConnectedError,
    refusal,
)
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.forked import FORKED
from cosmic.frame.heartbeat import STALL_S
from cosmic.frame.inbox import Inbox
from cosmic.frame.operation import Task
from cosmic.frame.threads import JOIN_TIMEOUT_S, WorkerThread
from cosmic.frame.verdict import MoveVerdict, Reason, refuse
from cosmic.mico.core.motion.channel import ChannelController
from cosmic.mico.core.motion.channel_context import AxisReports, ChannelContext, GateQueue
from cosmic.mico.core.motion.data_container import DeviceDataContainer
from cosmic.mico.core.motion.discovery import ChannelDiscovery
from cosmic.mico.core.motion.driver_watch import DriverCalls
from cosmic.mico.core.motion.gate import Gate
from cosmic.mico.core.motion.messages import (
    DeviceLost,
    GateAnswer,
    GroupMoveSent,
    Halt,
    Lost,
    Message,
    Order,
    PublishState,
    SetFrequency,
    SetUp,
    StopAll,
    Wake,
)
from cosmic.mico.core.motion.positioner import CountedTravel, PositionerBase, PositionerState
from cosmic.mico.core.settings import MicoSettings
from cosmic.mico.hw.interface import (
    Controller,
    Direction,
    Event,
    Failed,
)

logger = logging.getLogger(__name__)

MOST_AT_ONCE: Final = 100
"""How many messages are taken before positions are polled again."""
GUARD_LOOK_S: Final = 0.03
"""How often it is looked whether another process that commanded a motion is still there."""


class Device(WorkerThread):
    """Drives one device in a thread of its own; its public methods return at once.

    Signals are emitted in the device thread, in the order in which things happened.

    Signals
    -------
    position_changed(PositionChanged), state_changed(PositionerState),
    movement_begun(MovementBegun), movement_ended(MovementEnded), movement_refused(MoveVerdict),
    lost(DeviceLost)
    stop_late()
        The library does not return from a stop; in the thread of the watch.

    Attributes
    ----------
    calls : DriverCalls
        Whether the library returns from its calls for this device.
    """

    may_wait = False

    position_changed = Signal(object)
    state_changed = Signal(object)
    movement_begun = Signal(object)
    movement_ended = Signal(object)
    movement_refused = Signal(object)
    lost = Signal(object)
    stop_late = Signal()

    def __init__(
        self,
        controller: Controller,
        container: DeviceDataContainer,
        *,
        gate: Gate,
        clock: Clock,
        settings: MicoSettings,
        policy: FailurePolicy,
        parent: QObject | None = None,
    ) -> None:
        super().__init__(f"device {container.device}", policy, parent)
        self.calls = DriverCalls(self.name, policy, self._on_stall, self._on_late_stop)
        self._controller = controller
        self.container = container
        self._settings = settings
        self._inbox: Inbox[Message] = Inbox(clock)
        self._intake = Lock()
        self._open = False
        self._nudged = False
        self._stops_seen = 0
        self._newest: dict[int, Order] = {}
        self._stall = self._unstopped = ""
        self._void: dict[int, int] = {}
        self._queries = GateQueue(
            gate, clock=clock, inbox=self._inbox, policy=policy, device=container.device
        )
        self._context = ChannelContext(
            controller=controller,
            container=container,
            gate=gate,
            clock=clock,
            settings=settings,
            queries=self._queries,
            reports=AxisReports(self, container),
            inbox=self._inbox,
        )
        self._discovery = ChannelDiscovery(self._context)
        self._channels: dict[int, ChannelController] = {}
        container.observe(lambda event, _state: self._inbox.put(event))

    @property
    def index(self) -> int:
        """Number of the device in the configuration."""
        return self.container.device

    @property
    def stall(self) -> str:
        """Why it takes no orders: the library does not return; empty while it does."""
        return self._stall

    # For any thread

    def set_poll_period(self, poll_s: float) -> None:
        """Say how often the position of a moving axis is asked for, in wall seconds."""
        self._context.poll_s = poll_s

    def begin(self) -> None:
        """Start the thread and take orders."""
        self._open = True
        self._queries.start()
        self.start()

    @override
    def on_fork(self) -> None:
        super().on_fork()
        self._intake = Lock()  # whoever held it is not here
        self._stall = FORKED

    def submit(self, order: Order) -> None:
        """Queue `order`; how it goes is reported by its movement and by signals.

        Raises
        ------
        MoveRefused
            It was submitted before: an order is carried out once, and what it began goes on.
        """
        if not order.movement.order():
            raise refusal(self._spent(order))
        stop = self._context.gate.stop_state
        if stop.reason is not None:
            why = f"motion is stopped ({stop.reason}); reset the stop first"
            self._refuse_stopped(order, why)
            return
        if order.epoch not in (None, stop.epoch):
            self._refuse_stopped(order, "a stop came after the order was made; give a new one")
            return
        # First, for the device thread cannot begin before this one lets it. Cancelled in between,
        # the order finds that out before it is sent.
        order.movement.on_cancel(partial(self._cancel, order))
        if order.epoch is None:
            order = order._replace(epoch=stop.epoch)
        with self._intake:
            taken = self._open and not self._stall
            if taken:
                self._newest[order.channel] = order
                self._inbox.put(order)
        if not taken:
            self._turn_away(order, self.container.state(order.channel))

    def renew_jog(self, order: Order) -> None:
        """Keep the jog started by `order` alive."""
        axis = self._channels.get(order.channel)
        if axis is not None:
            axis.renew(order.number)

    def steer_jog(self, order: Order, velocity: float) -> None:
        """Keep the movement started by `order` alive at a signed speed; only the newest counts."""
        axis = self._channels.get(order.channel)
        if axis is not None and axis.steer(order.number, velocity) and not self._nudged:
            self._nudged = True
            self._inbox.put(Wake())

    def halt(self, channel: int, why: str) -> None:
        """Stop one channel past every queue; its movement fails with `MoveCancelled`."""
        self._withdraw(channel, MoveCancelled(f"{self._shown(channel)}: {why}"))
        self.stop_channel(channel)

    def _withdraw(self, channel: int, error: CosmicError) -> None:
        """Void what was ordered of a channel so far."""
        with self._intake:
            newest = self._newest.get(channel)
            self._void[channel] = 0 if newest is None else newest.number
        # Before the stop: the device thread knows of the halt before it sees the axis at rest.
        self._inbox.put(Halt(channel, error))

    def stop_channel(self, channel: int) -> None:
        """Have the library stop one channel, past every queue."""
        self.calls.stop(partial(self._stop_channel, channel))

    def _stop_channel(self, channel: int) -> None:
        try:
            self._controller.stop(self.container.address(channel))
        except DeviceError as exc:
            logger.error("%s: stop failed: %s", self._shown(channel), exc)
        except Exception:  # of a controller that somebody brought: the others are stopped too
            logger.exception("%s: stop failed", self._shown(channel))

    def _cancel(self, order: Order) -> None:
        """Stop one movement; another one that has replaced it goes on."""
        error = MoveCancelled("cancelled")
        self._inbox.put(Halt(order.channel, error, order.movement))
        axis = self._channels.get(order.channel)
        active = axis.monitor.active if axis is not None else None
        if active is None or active.order.movement is not order.movement:
            return  # not begun, or over: the device thread sees to the rest
        self.stop_channel(order.channel)

    def _spent(self, order: Order) -> MoveVerdict:
        name = self._shown(order.channel)
        text = f"{name}: order {order.number} was submitted before; give a new one"
        verdict = refuse(Reason.NO_LEASE, text, axis=name)
        logger.warning("refused (%s): %s", order.source, verdict)
        return verdict

    def _shown(self, channel: int) -> str:
        state = self.container.state(channel)
        return state.name if state else f"device {self.index} channel {channel}"

    def _refuse_stopped(self, order: Order, why: str) -> None:
        name = self._shown(order.channel)
        verdict = refuse(Reason.STOPPED, f"{name}: {why}", axis=name)
        self._context.gate.withdraw(order.reservation)
        logger.warning("refused (%s): %s", order.source, verdict)
        self._context.reports.refused(order, verdict)

    def stop_later(self, error: CosmicError) -> None:
        """Have the device thread repeat the stop of all channels after the call it is in."""
        self._inbox.put(StopAll(error))

    def lose(self, error: DeviceError) -> None:
        """Say that the device cannot be reached any more."""
        self._inbox.put(Lost(error))

    def set_frequency(self, channel: int, frequency_hz: int) -> None:
        """Limit the closed-loop speed of one channel, 1 to 18500 Hz."""
        self._inbox.put(SetFrequency(channel, frequency_hz))

    def set_zero(self, channel: int, zero: float) -> None:
        """Show the positions of one channel relative to `zero`, in gate coordinates."""
        self.container.update(channel, zero=zero)
        self._inbox.put(PublishState(channel))

    def set_estimate(self, channel: int, position: float, std: float) -> None:
        """Say where an axis without sensor is, in gate coordinates, and how well that is known.

        Raises
        ------
        NotAvailable
            It has a sensor, or is moving.
        MoveRefused
            The numbers are none, or lie outside its travel.
        """
        found = self.container.positioner(channel)
        counts = found is not None and not found.has_sensor
        travel = None
        if found and counts:
            travel = CountedTravel.of(found.settings, self._settings.defaults)
        self.container.set_estimate(channel, travel, position, std)
        self._inbox.put(PublishState(channel))

    def set_up(self, channel: int, change: int | Direction) -> Task:
        """Begin to store a positioner type or a safe direction in the controller.

        The task fails with `NotAvailable` while the axis moves, and with `DeviceError` where the
        controller refuses. Afterwards the axis has to be calibrated and referenced; after a new
        type it is away until the devices are searched again.
        """
        done = Task(f"setting up device {self.index} channel {channel}")
        self._inbox.put(SetUp(channel, change, done))
        return done

    def wait_until_discovered(self, timeout_s: float) -> bool:
        """Wait until types and positions are known; False after `timeout_s` of wall time."""
        return self._discovery.wait(timeout_s)

    @override
    def request_end(self) -> None:
        super().request_end()
        self._queries.request_end()
        self._inbox.put(Wake())

    @override
    def join(self, timeout_s: float = JOIN_TIMEOUT_S) -> bool:
        ended = super().join(timeout_s)
        return self._queries.join(timeout_s) and ended

    # The device thread

    @override
    def run_body(self) -> None:
        try:
            self.calls.device.beat()
            self._guarded(self._discovery.begin)
            while not self.end_requested:
                self._take_waiting()
                self._guarded(self._look_at_latch)
                self._guarded(self._poll)
        except BaseException as exc:
            self._on_lost(DeviceError(f"its thread failed: {exc!r}"))
            raise
        finally:
            self._close_intake()
            self.calls.device.end()

    def _take_waiting(self) -> None:
        """Wait for a message, then take all there are, so that none waits behind a poll."""
        timeout_s = self._pause_s()
        self.calls.device.beat(timeout_s + STALL_S)
        for _ in range(MOST_AT_ONCE):
            try:
                message = self._inbox.get(timeout_s)
            except Empty:
                break
            finally:
                self.calls.device.beat()
            try:
                self._take(message)
            except DeviceError as exc:
                self._on_device_error(exc)
            timeout_s = 0.0

    def _pause_s(self) -> float:
        active_moves = [
            active
            for axis in self._channels.values()
            if (active := axis.monitor.active) is not None
        ]
        if not active_moves:
            return self._settings.watch.idle_poll_s
        jogs = [active.jog for active in active_moves if active.jog is not None]
        if jogs:
            rate = self._context.clock.rate or 1.0
            return max(0.002, min(jog.pause_s for jog in jogs) / rate)
        if any(active.order.guard is not None for active in active_moves):
            return min(self._context.poll_s, GUARD_LOOK_S)
        return self._context.poll_s

    def _guarded(self, action: Callable[[], None]) -> None:
        try:
            action()
        except DeviceError as exc:
            self._on_device_error(exc)

    def _on_device_error(self, error: DeviceError) -> None:
        if error.fault in (DeviceFault.COMMUNICATION, DeviceFault.TIMEOUT):
            self._on_lost(error)
        else:
            logger.error("device %d: %s", self.index, error)

    def _take(self, message: Message) -> None:
        match message:
            case Order():
                self._on_order(message)
            case GateAnswer():
                self._on_answer(message)
            case GroupMoveSent():
                self._on_group_move_sent(message)
            case StopAll():
                self._stop_all(message.error)
            case Lost():
                self._on_lost(message.error)
            case Halt() | SetFrequency():
                self._on_channel_message(message)
            case SetUp():
                self._on_set_up(message)
            case Wake():
                self._nudged = False
            case PublishState():
                self._context.reports.state(message.channel)
            case _:
                self._on_event(message)

    def _look_at_latch(self) -> None:
        """Stop although nobody woke this thread: who stopped may hang in a foreign device."""
        stop = self._context.gate.stop_state
        if stop.latched and stop.epoch != self._stops_seen:
            self._stop_all(refusal(refuse(Reason.STOPPED, f"stopped: {stop.reason}")))

    def _stop_all(self, error: CosmicError) -> None:
        self._stops_seen = self._context.gate.stop_state.epoch
        for order in self._queries.orders:
            if order.epoch != self._context.gate.stop_state.epoch:
                self._drop(order, error)
        for axis in self._channels.values():
            axis.monitor.halt(error)

    def _on_channel_message(self, message: Halt | SetFrequency) -> None:
        axis = self._channels.get(message.channel)
        if axis is None:
            return
        if isinstance(message, Halt):
            self._drop_halted(message)
            active = axis.monitor.active
            if message.only is None or (active and active.order.movement is message.only):
                axis.monitor.halt(message.error)
        else:
            axis.set_frequency(message.frequency_hz)

    def _on_set_up(self, message: SetUp) -> None:
        axis = self._channels.get(message.channel)
        if axis is None:
            where = f"device {self.index} channel {message.channel}"
            message.done.fail(NotAvailable(f"{where}: there is no axis to set up"))
            return
        asked = any(each.channel == message.channel for each in self._queries.orders)
        axis.set_up(message, asked=asked)

    def _on_order(self, order: Order) -> None:
        axis = self._channels.get(order.channel)
        if axis is None or not self._discovery.over:
            self._turn_away(order, None)
            return
        if order.number <= self._void.get(order.channel, 0):
            self._context.gate.withdraw(order.reservation)
            order.movement.fail(MoveCancelled(f"{axis.name}: halted before it started"))
            return
        try:
            axis.launch(order)
        except BaseException as exc:
            self._fail_with_defect(order, axis.name, exc)
            raise

    def _on_answer(self, answer: GateAnswer) -> None:
        checked = answer.checked
        order = checked.order
        wanted = self._queries.take(answer)
        axis = self._channels.get(order.channel)
        active = axis.monitor.active if axis is not None else None
        begun = active is not None and active.order is order
        if not wanted or axis is None or (order.movement.done and not begun):
            self._context.gate.withdraw(checked.reservation)
            return
        try:
            answer.on_checked(checked)
        except BaseException as exc:
            self._fail_with_defect(order, axis.name, exc)
            raise

    def _drop_halted(self, halt: Halt) -> None:
        """End the orders of a channel that was halted before the gate has answered."""
        for order in self._queries.orders:
            if halt.only is None:
                meant = order.number <= self._void.get(order.channel, 0)
            else:
                meant = order.movement is halt.only
            if order.channel == halt.channel and meant:
                self._drop(order, halt.error)

    def _drop(self, order: Order, error: CosmicError) -> None:
        """End an order that was not begun; one that was ends when the axis is stationary."""
        axis = self._channels.get(order.channel)
        if axis is None or axis.monitor.active is None or axis.monitor.active.order is not order:
            self._queries.withdraw(order)
            order.movement.fail(error)

    def _fail_with_defect(self, order: Order, name: str, defect: BaseException) -> None:
        """Fail `order` with a mistake in the program that keeps it from being sent."""
        if not isinstance(defect, DeviceError):  # the end of a device is reported by its channel
            order.movement.fail(DeviceError(f"{name}: {defect}"))

    def _on_group_move_sent(self, sent: GroupMoveSent) -> None:
        axis = self._channels.get(sent.order.channel)
        if axis is not None:
            axis.on_group_move_sent(sent)

    def _turn_away(self, order: Order, state: PositionerState | None) -> None:
        state = state or self.container.state(order.channel)
        name = state.name if state else f"device {self.index} channel {order.channel}"
        why = state.error if state and state.error else "it is not connected; check it, then rescan"
        why = self._stall or why
        verdict = refuse(Reason.DEVICE, f"{name}: {why}", axis=name)
        self._context.gate.withdraw(order.reservation)
        self._context.reports.refused(order, verdict)

    def _poll(self) -> None:
        for axis in self._channels.values():
            axis.poll()

    def _on_event(self, event: Event) -> None:
        channel = event.channel.channel if event.channel else -1
        axis = self._channels.get(channel)
        if event.channel is None:
            self._on_device_event(event)
        elif axis is None:
            self._welcome(channel, self._discovery.take(event, channel))
        else:
            axis.monitor.take(event)
            self._context.reports.state(channel)
        if not self._discovery.over and all(
            each.monitor.located for each in self._channels.values()
        ):
            self._discovery.look(self._channels.keys())

    def _welcome(self, channel: int, found: PositionerBase | None) -> None:
        if found is not None:
            axis = self._channels[channel] = ChannelController(found, self._context)
            axis.begin()

    def _on_device_event(self, event: Event) -> None:
        """Take what concerns the device as a whole, and so each of its channels."""
        if isinstance(event, Failed):
            logger.error("device %d: %s", self.index, event.error)
        for channel, axis in self._channels.items():
            axis.monitor.take(event)
            self._context.reports.state(channel)

    # Trouble and the end

    def _on_stall(self, stalled_s: float) -> None:
        """Say that the library hangs, or that it goes on; thread of the watch."""
        if not stalled_s:
            text, self._stall = self._stall, ""
            logger.warning("device %d: the controller has returned, and goes on", self.index)
            self._mark(text, self._unstopped)
            return
        text = (
            f"{self._with_axes()}: its controller has not returned from a call for "
            f"{stalled_s:g} s; whether these axes move is unknown. Check its power and cable, or "
            "unplug it and plug it in again; if that does not help, restart the program"
        )
        with self._intake:  # what is taken from now on would wait for ever
            self._stall = text
        error = DeviceTimeout(text, fault=DeviceFault.TIMEOUT)
        waiting = [each for each in self._newest.values() if not each.movement.done]
        for order in waiting:
            self._withdraw(order.channel, error)
            self.stop_channel(order.channel)
        self._mark("", text)
        self._policy.report(error, self.name)
        for order in waiting:
            order.movement.fail(error)

    def _on_late_stop(self, late_s: float) -> None:
        """Say that a stop is not carried out, or that it is now; thread of the watch."""
        if not late_s:
            text, self._unstopped = self._unstopped, ""
            logger.warning("device %d: the controller has returned from the stop", self.index)
            self._mark(text, self._stall)
            return
        text = (
            f"{self._with_axes()}: a stop is not carried out: its controller has not returned from "
            f"it for {late_s:g} s; whether these axes move is unknown. Cut its power if they do"
        )
        self._unstopped = text
        self._mark("", text)
        self.stop_late.emit()
        self._policy.report(DeviceTimeout(text, fault=DeviceFault.TIMEOUT), self.name)

    def _with_axes(self) -> str:
        axes = ", ".join(map(self._shown, self.container.channels())) or "no axes yet"
        return f"device {self.index} ({axes})"

    def _mark(self, before: str, text: str) -> None:
        """Show `text` at every axis that is here, in place of `before`."""
        for channel in self.container.channels():
            state = self.container.state(channel)
            if state is not None and state.present and (text or state.error == before):
                self.state_changed.emit(self.container.update(channel, error=text))

    def _on_lost(self, error: DeviceError) -> None:
        self._open = False
        logger.error("device %d is lost: %s", self.index, error)
        axes, self._channels = self._channels, {}
        self._discovery.give_up()
        # What the gate is asked for belongs to a movement that goes on, such as that of a loop.
        moving = any(each.monitor.active is not None for each in axes.values())
        in_motion = moving or bool(self._queries.orders)
        reason = f"device {self.index} does not answer: {error}; rescan when it is back"
        self.container.lose(reason)
        # Before anybody is woken: who sees the movement fail must find everything stopped.
        self.lost.emit(DeviceLost(self.index, reason, in_motion))
        for channel, axis in axes.items():
            axis.monitor.lose(NotConnectedError(f"{axis.name}: {reason}", fault=error.fault))
            self._context.reports.state(channel)
        self._queries.fail_all(NotConnectedError(reason, fault=error.fault))

    def _close_intake(self) -> None:
        """Leave no order unanswered and nothing moving."""
        with self._intake:
            self._open = False
        self._queries.close_intake()
        error = MoveCancelled(f"device {self.index} was closed")
        for channel, axis in self._channels.items():
            self._stop_channel(channel)
            axis.monitor.lose(error)
        self._queries.fail_all(error)
        self._queries.close()
        while not self._inbox.empty():
            message = self._inbox.get_nowait()
            if isinstance(message, Order):
                self._context.gate.withdraw(message.reservation)
                message.movement.fail(error)
            elif isinstance(message, GateAnswer):
                self._context.gate.withdraw(message.checked.reservation)
        self._inbox.close()
