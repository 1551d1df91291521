"""`Device`: all calls to the controller library for one device (thesis 5.4, 6.1)."""

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from queue import Empty
from threading import Event as ThreadEvent
from threading import Lock
from typing import Final

from PySide6.QtCore import QObject, Signal
from typing_extensions import override

from cosmic.frame.clock import Clock
from cosmic.frame.errors import (
    CosmicError,
    DeviceError,
    DeviceFault,
    MoveCancelled,
    NotConnectedError,
    refusal,
)
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.inbox import Inbox
from cosmic.frame.job_queue import JobQueue
from cosmic.frame.operation import Operation
from cosmic.frame.threads import JOIN_TIMEOUT_S, WorkerThread
from cosmic.frame.verdict import Reason, refuse
from cosmic.mico.core.motion.channel import (
    Asking,
    ChannelController,
    Judged,
    OnAnswer,
    PilotContext,
)
from cosmic.mico.core.motion.data_container import DeviceDataContainer
from cosmic.mico.core.motion.gate import Gate, Question
from cosmic.mico.core.motion.messages import (
    Departed,
    DeviceLost,
    Halt,
    Lost,
    MovementEnded,
    PositionChanged,
    SetFrequency,
    StopAll,
    Tell,
    Wake,
)
from cosmic.mico.core.motion.orders import Order
from cosmic.mico.core.motion.positioner import CountedTravel, PositionerState
from cosmic.mico.core.settings import MicoSettings
from cosmic.mico.hw.interface import (
    Channel,
    Controller,
    Event,
    Failed,
    PositionerKind,
    ReferenceKind,
    SensorPresentRead,
    TypeRead,
)

logger = logging.getLogger(__name__)


class ChannelDiscovery:
    """Asks each channel what it has and makes a pilot for what answers; device thread.

    It is over when every channel has answered, stands, and has told its position.
    """

    def __init__(self, context: PilotContext) -> None:
        self._context = context
        self._over = ThreadEvent()
        self.pilots: dict[int, ChannelController] = {}

    @property
    def over(self) -> bool:
        """True when everything is known; any thread."""
        return self._over.is_set()

    def wait(self, timeout_s: float) -> bool:
        """Wait until it is over; False after `timeout_s` of wall time. Any thread."""
        return self._over.wait(timeout_s)

    def give_up(self) -> dict[int, ChannelController]:
        """Part from all pilots, as of a device that is gone."""
        pilots, self.pilots = self.pilots, {}
        self._over.set()
        return pilots

    def begin(self) -> None:
        """Ask every channel whether it has a sensor."""
        container, controller = self._context.container, self._context.controller
        channels = container.possible_channels()
        for channel in channels:
            container.expect(channel)
        for channel in channels:
            address = container.address(channel)
            try:
                controller.report_completion(address)
                controller.ask_sensor_present(address)
            except DeviceError as exc:
                if exc.fault is not DeviceFault.NO_CHANNEL:
                    raise
                container.settle(channel, None, "no such channel")
        self.look()

    def take(self, event: Event, channel: int) -> None:
        """Take an event of a channel that has no pilot yet."""
        if isinstance(event, SensorPresentRead) and event.present:
            self._context.controller.ask_type(event.channel)
        elif isinstance(event, (SensorPresentRead, TypeRead)):
            self._welcome(channel)
        else:
            logger.debug("device %d: %s", self._context.container.device, event)

    def _welcome(self, channel: int) -> None:
        positioner = self._context.container.positioner(channel)
        if positioner is None or not positioner.state.present:
            return
        pilot = ChannelController(positioner, self._context)
        self.pilots[channel] = pilot
        if positioner.state.kind is not PositionerKind.OPEN_LOOP:
            usual_hz = self._context.settings.defaults.closed_loop_frequency_hz
            pilot.speed.set_usual(positioner.frequency_hz or usual_hz)
            pilot.ask_position_known()
            found = positioner.state.positioner
            if found is not None and found.reference is ReferenceKind.END_STOP:
                self._ask_safe_direction(positioner.state.address)
        pilot.ask_activity()
        pilot.ask_position()

    def _ask_safe_direction(self, address: Channel) -> None:
        """Ask which way a search for the reference goes; where unknown, it may go both."""
        try:
            self._context.controller.ask_safe_direction(address)
        except DeviceError as exc:
            if exc.fault is not DeviceFault.UNSUPPORTED:
                raise

    def look(self) -> None:
        """See whether it is over."""
        container = self._context.container
        if self._over.is_set() or not container.clear:
            return
        # The listener settles a channel before its answer gets here, so that a pilot may lack.
        present = {
            channel
            for channel in container.channels()
            if (state := container.state(channel)) is not None and state.present
        }
        if present <= self.pilots.keys() and all(each.located for each in self.pilots.values()):
            self._over.set()


MOST_AT_ONCE: Final = 100
"""How many messages are taken before positions are polled again."""
GUARD_LOOK_S: Final = 0.03
"""How often it is looked whether another process that commanded a motion is still there."""


@dataclass(frozen=True, slots=True)
class _Answered:
    """The gate has judged an order, or the next packet of a jog."""

    judged: Judged
    on_answer: OnAnswer


_Message = _Answered | Departed | Order | Event | Halt | StopAll | Lost | SetFrequency | Tell | Wake


class Device(WorkerThread):
    """Drives one SmarAct device in a thread of its own; its public methods return at once.

    Signals are emitted in the device thread, in the order in which things happened.

    Signals
    -------
    position_changed(PositionChanged), state_changed(PositionerState),
    movement_begun(MovementBegun), movement_ended(MovementEnded), movement_refused(MoveVerdict),
    lost(DeviceLost)
    """

    may_wait = False

    position_changed = Signal(object)
    state_changed = Signal(object)
    movement_begun = Signal(object)
    movement_ended = Signal(object)
    movement_refused = Signal(object)
    lost = Signal(object)

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
        self._controller = controller
        self.container = container
        self._settings = settings
        self._inbox: Inbox[_Message] = Inbox(clock)
        self._intake = Lock()
        self._open = False
        self._closed = False
        self._nudged = False
        self._newest: dict[int, int] = {}
        self._void: dict[int, int] = {}
        self._shown: dict[int, PositionerState] = {}
        self._context = PilotContext(
            controller=controller,
            container=container,
            gate=gate,
            clock=clock,
            settings=settings,
            on_refused=self.movement_refused.emit,
            on_finished=self._emit_finished,
            on_failed=self._emit_failed,
            on_state=self._emit_state,
            on_begun=self.movement_begun.emit,
            on_departed=self._inbox.put,
            ask_gate=self._ask_gate,
            on_unasked=self._take_back,
        )
        self._asked: dict[int, tuple[Order, Question]] = {}
        self._judges = JobQueue(f"gate of device {container.device}", policy)
        self._judging = clock.worker()
        self._discovery = ChannelDiscovery(self._context)
        container.observe(lambda event, _state: self._inbox.put(event))

    @property
    def index(self) -> int:
        """Number of the device in the configuration."""
        return self.container.device

    @property
    def _pilots(self) -> dict[int, ChannelController]:
        return self._discovery.pilots

    # For any thread

    def set_poll_period(self, poll_s: float) -> None:
        """Say how often the position of a moving axis is asked for, in wall seconds."""
        self._context.poll_s = poll_s

    def begin(self) -> None:
        """Start the thread and take orders."""
        self._open = True
        if not self._context.gate.prompt:
            self._judges.start()
        self.start()

    def submit(self, order: Order) -> None:
        """Queue `order`; how it goes is told by its movement and by signals."""
        stop = self._context.gate.stop_state
        if stop.latched:
            self._refuse_stopped(order, stop.reason or "")
            return
        with self._intake:
            taken = self._open
            if taken:
                self._newest[order.channel] = order.number
                self._inbox.put(replace(order, epoch=stop.epoch))
        if taken:
            order.movement.on_cancel(lambda: self._cancel(order))
        else:
            self._turn_away(order, self.container.state(order.channel))

    def renew_jog(self, order: Order) -> None:
        """Keep the jog started by `order` alive."""
        pilot = self._pilots.get(order.channel)
        if pilot is not None:
            pilot.renew(order.number)

    def steer_jog(self, order: Order, velocity: float) -> None:
        """Keep the movement started by `order` alive at a signed speed; only the newest counts."""
        pilot = self._pilots.get(order.channel)
        if pilot is not None and pilot.steer(order.number, velocity) and not self._nudged:
            self._nudged = True
            self._inbox.put(Wake())

    def halt(self, channel: int, why: str) -> None:
        """Stop one channel past every queue; its movement fails with `MoveCancelled`."""
        state = self.container.state(channel)
        name = state.name if state else f"device {self.index} channel {channel}"
        with self._intake:
            self._void[channel] = self._newest.get(channel, 0)
        # First, so that the device thread knows of the halt before it sees the axis at rest.
        self._inbox.put(Halt(channel, MoveCancelled(f"{name}: {why}")))
        try:
            self._controller.stop(self.container.address(channel))
        except DeviceError as exc:
            logger.warning("%s: %s", name, exc)

    def _cancel(self, order: Order) -> None:
        """Stop one movement; another one that has replaced it goes on."""
        error = MoveCancelled("cancelled")
        self._inbox.put(Halt(order.channel, error, order.movement))
        pilot = self._pilots.get(order.channel)
        active = pilot.active if pilot is not None else None
        if active is None or active.order.movement is not order.movement:
            return  # not begun, or over: the device thread sees to the rest
        try:
            self._controller.stop(self.container.address(order.channel))
        except DeviceError as exc:
            logger.warning("device %d channel %d: %s", self.index, order.channel, exc)

    def _refuse_stopped(self, order: Order, reason: str) -> None:
        state = self.container.state(order.channel)
        name = state.name if state else f"device {self.index} channel {order.channel}"
        text = f"{name}: motion is stopped ({reason}); reset the stop first"
        verdict = refuse(Reason.STOPPED, text, axis=name)
        self._context.gate.withdraw(order.grant)
        logger.warning("refused (%s): %s", order.source, verdict)
        order.movement.fail(refusal(verdict))
        self.movement_refused.emit(verdict)

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
        self._inbox.put(Tell(channel))

    def set_estimate(self, channel: int, position: float, std: float) -> None:
        """Say where an axis without sensor stands, in gate coordinates, and how well that is known.

        Raises
        ------
        NotAvailable
            It has a sensor, or is moving.
        MoveRefused
            The numbers are none, or lie outside its travel.
        """
        found = self.container.positioner(channel)
        counts = found is not None and not found.has_sensor
        travel = CountedTravel.of(found.settings, self._settings) if found and counts else None
        self.container.set_estimate(channel, travel, position, std)
        self._inbox.put(Tell(channel))

    def wait_until_discovered(self, timeout_s: float) -> bool:
        """Wait until types and positions are known; False after `timeout_s` of wall time."""
        return self._discovery.wait(timeout_s)

    @override
    def request_end(self) -> None:
        super().request_end()
        self._judges.request_end()
        self._inbox.put(Wake())

    @override
    def join(self, timeout_s: float = JOIN_TIMEOUT_S) -> bool:
        ended = super().join(timeout_s)
        return self._judges.join(timeout_s) and ended

    # The device thread

    @override
    def run_body(self) -> None:
        try:
            self._guarded(self._discovery.begin)
            while not self.end_requested:
                self._take_waiting()
                self._guarded(self._poll)
        except BaseException as exc:
            self._on_lost(DeviceError(f"its thread failed: {exc!r}"))
            raise
        finally:
            self._close_intake()

    def _take_waiting(self) -> None:
        """Wait for a message, then take all there are, so that none waits behind a poll."""
        timeout_s = self._pause_s()
        for _ in range(MOST_AT_ONCE):
            try:
                message = self._inbox.get(timeout_s)
            except Empty:
                return
            self._guarded(partial(self._take, message))
            timeout_s = 0.0

    def _pause_s(self) -> float:
        moving = any(pilot.active is not None for pilot in self._pilots.values())
        if not moving:
            return self._settings.watch.idle_poll_s
        active_moves = [pilot.active for pilot in self._pilots.values() if pilot.active is not None]
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
            if exc.fault in (DeviceFault.COMMUNICATION, DeviceFault.TIMEOUT):
                self._on_lost(exc)
            else:
                logger.error("device %d: %s", self.index, exc)

    def _take(self, message: _Message) -> None:
        match message:
            case Order():
                self._on_order(message)
            case _Answered():
                self._on_answered(message)
            case Departed():
                self._on_departed(message)
            case StopAll():
                self._stop_all(message.error)
            case Lost():
                self._on_lost(message.error)
            case Halt() | SetFrequency():
                self._on_channel_message(message)
            case Wake():
                self._nudged = False
            case Tell():
                self._emit_state(message.channel)
            case _:
                self._on_event(message)

    def _stop_all(self, error: CosmicError) -> None:
        for order, _ in list(self._asked.values()):
            if order.epoch != self._context.gate.stop_state.epoch:
                self._drop(order, error)
        for pilot in self._pilots.values():
            pilot.halt(error)

    def _on_channel_message(self, message: Halt | SetFrequency) -> None:
        pilot = self._pilots.get(message.channel)
        if pilot is None:
            return
        if isinstance(message, Halt):
            self._drop_asked(message)
            active = pilot.active
            if message.only is None or (active and active.order.movement is message.only):
                pilot.halt(message.error)
        else:
            pilot.set_frequency(message.frequency_hz)

    def _on_order(self, order: Order) -> None:
        pilot = self._pilots.get(order.channel)
        if pilot is None or not self._discovery.over:
            self._turn_away(order, None)
            return
        if order.number <= self._void.get(order.channel, 0):
            self._context.gate.withdraw(order.grant)
            order.movement.fail(MoveCancelled(f"{pilot.name}: halted before it started"))
            return
        with self._telling_of(order, pilot):
            pilot.launch(order)

    def _ask_gate(self, order: Order, ask: Asking, on_answer: OnAnswer) -> None:
        """Ask the gate without waiting for it: positions and dead men are looked at meanwhile."""
        if self._context.gate.prompt:
            on_answer(ask(Question()))
            return
        question = Question()
        self._asked[order.number] = order, question
        self._judging.busy()  # a fast clock waits for the answer

        def on_end(ended: Operation[None]) -> None:
            if ended.failure is not None:
                text = f"the check of the movement failed: {ended.failure}"
                self._answer(
                    _Answered(Judged(order, None, refuse(Reason.NO_ANSWER, text)), on_answer)
                )

        def judge() -> None:
            self._answer(_Answered(ask(question), on_answer))

        job = self._judges.submit(judge, f"check of order {order.number}")
        job.add_callback(on_end)

    def _answer(self, answered: _Answered) -> None:
        """Give an answer of the gate to the device thread; any thread."""
        with self._intake:
            running = not self._closed
            if running:
                self._inbox.put(answered)
        if not running:
            self._context.gate.withdraw(answered.judged.grant)

    def _on_answered(self, answered: _Answered) -> None:
        judged = answered.judged
        order = judged.order
        asked = self._pop_asked(order)
        pilot = self._pilots.get(order.channel)
        begun = pilot is not None and pilot.active is not None and pilot.active.order is order
        if asked is None or pilot is None or (order.movement.done and not begun):
            self._context.gate.withdraw(judged.grant)
            return
        with self._telling_of(order, pilot):
            answered.on_answer(judged)

    def _pop_asked(self, order: Order) -> Question | None:
        _, question = self._asked.pop(order.number, (order, None))
        if not self._asked:
            self._judging.idle()
        return question

    def _take_back(self, order: Order) -> None:
        """Have the gate hold nothing for an order that is not wanted any more."""
        question = self._pop_asked(order)
        if question is not None:
            self._context.gate.take_back(question)

    def _drop_asked(self, halt: Halt) -> None:
        """End the orders of a channel that was halted before the gate has judged them."""
        for order, _ in list(self._asked.values()):
            if halt.only is None:
                meant = order.number <= self._void.get(order.channel, 0)
            else:
                meant = order.movement is halt.only
            if order.channel == halt.channel and meant:
                self._drop(order, halt.error)

    def _drop(self, order: Order, error: CosmicError) -> None:
        """End an order that was not begun; one under way ends when it stands."""
        pilot = self._pilots.get(order.channel)
        if pilot is None or pilot.active is None or pilot.active.order is not order:
            self._take_back(order)
            order.movement.fail(error)

    @contextmanager
    def _telling_of(self, order: Order, pilot: ChannelController) -> Iterator[None]:
        """Fail `order` with a mistake in the program that keeps it from being sent."""
        try:
            yield
        except DeviceError:
            raise  # the end of a device that is lost is told by the pilot
        except BaseException as exc:
            order.movement.fail(DeviceError(f"{pilot.name}: {exc}"))
            raise

    def _on_departed(self, departed: Departed) -> None:
        pilot = self._pilots.get(departed.order.channel)
        if pilot is not None:
            pilot.depart(departed)

    def _turn_away(self, order: Order, state: PositionerState | None) -> None:
        state = state or self.container.state(order.channel)
        name = state.name if state else f"device {self.index} channel {order.channel}"
        why = state.error if state and state.error else "it is not connected; check it, then rescan"
        verdict = refuse(Reason.DEVICE, f"{name}: {why}", axis=name)
        self._context.gate.withdraw(order.grant)
        order.movement.fail(refusal(verdict))
        self.movement_refused.emit(verdict)

    def _poll(self) -> None:
        for pilot in self._pilots.values():
            pilot.poll()

    def _on_event(self, event: Event) -> None:
        channel = event.channel.channel if event.channel else -1
        pilot = self._pilots.get(channel)
        if event.channel is None:
            self._on_device_event(event)
        elif pilot is None:
            self._discovery.take(event, channel)
        else:
            pilot.take(event)
            self._emit_state(channel)
        self._discovery.look()

    def _on_device_event(self, event: Event) -> None:
        """Take what concerns the device as a whole, and so each of its channels."""
        if isinstance(event, Failed):
            logger.error("device %d: %s", self.index, event.error)
        for channel, pilot in self._pilots.items():
            pilot.take(event)
            self._emit_state(channel)

    # Trouble and the end

    def _on_lost(self, error: DeviceError) -> None:
        self._open = False
        logger.error("device %d is lost: %s", self.index, error)
        pilots = self._discovery.give_up()
        # What the gate is asked for belongs to a movement that goes on, such as that of a loop.
        in_motion = any(each.active is not None for each in pilots.values()) or bool(self._asked)
        reason = f"device {self.index} does not answer: {error}; rescan when it is back"
        self.container.lose(reason)
        # Before anybody is woken: who sees the movement fail must find everything stopped.
        self.lost.emit(DeviceLost(self.index, reason, in_motion))
        for channel, pilot in pilots.items():
            pilot.lose(NotConnectedError(f"{pilot.name}: {reason}", fault=error.fault))
            self._emit_state(channel)
        self._fail_asked(NotConnectedError(reason, fault=error.fault))

    def _close_intake(self) -> None:
        """Leave no order unanswered and nothing moving."""
        with self._intake:
            self._open, self._closed = False, True
        error = MoveCancelled(f"device {self.index} was closed")
        for channel, pilot in self._pilots.items():
            try:
                self._controller.stop(self.container.address(channel))
            except DeviceError as exc:
                logger.warning("%s: %s", pilot.name, exc)
            pilot.lose(error)
        self._fail_asked(error)
        self._judging.close()
        while not self._inbox.empty():
            message = self._inbox.get_nowait()
            if isinstance(message, Order):
                self._context.gate.withdraw(message.grant)
                message.movement.fail(error)
            elif isinstance(message, _Answered):
                self._context.gate.withdraw(message.judged.grant)
        self._inbox.close()

    def _fail_asked(self, error: CosmicError) -> None:
        """Fail what the gate was asked for; a reservation that still comes is given back."""
        for order, _ in list(self._asked.values()):
            self._take_back(order)
            order.movement.fail(error)

    # Telling

    def _emit_state(self, channel: int) -> None:
        state = self.container.state(channel)
        if state is None:
            return
        before = self._shown.get(channel)
        if before is not None and replace(before, read_wall_s=state.read_wall_s) == state:
            return
        self._shown[channel] = state
        self.state_changed.emit(state)
        moved = before is None or before.position != state.position
        if moved and state.position is not None:
            self.position_changed.emit(PositionChanged(state.name, state.position, state.unit))

    def _emit_finished(self, name: str, position: float | None) -> None:
        self.movement_ended.emit(MovementEnded(name, position, None))

    def _emit_failed(self, name: str, error: CosmicError) -> None:
        self.movement_ended.emit(MovementEnded(name, None, error))
