"""`Device`: all calls to the controller library for one device (thesis 5.4, 6.1)."""

import logging
from collections.abc import Callable
from dataclasses import replace
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
    MoveCancelled,
    NotConnectedError,
    refusal,
)
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.inbox import Inbox
from cosmic.frame.threads import WorkerThread
from cosmic.frame.verdict import Reason, refuse
from cosmic.mico.core.data_container import DeviceDataContainer
from cosmic.mico.core.estimate import CountedTravel
from cosmic.mico.core.flight import PilotContext
from cosmic.mico.core.gate import Gate
from cosmic.mico.core.introduction import Introduction
from cosmic.mico.core.messages import (
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
from cosmic.mico.core.orders import Order
from cosmic.mico.core.pilot import ChannelPilot
from cosmic.mico.core.positioner import PositionerState
from cosmic.mico.core.settings import MicoSettings
from cosmic.mico.hw.interface import Controller, Event, Failed

logger = logging.getLogger(__name__)

MOST_AT_ONCE: Final = 100
"""How many messages are taken before positions are polled again."""
GUARD_LOOK_S: Final = 0.03
"""How often it is looked whether another process that commanded a motion is still there."""


_Message = Departed | Order | Event | Halt | StopAll | Lost | SetFrequency | Tell | Wake


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
        )
        self._introduction = Introduction(self._context)
        container.observe(lambda event, _state: self._inbox.put(event))

    @property
    def index(self) -> int:
        """Number of the device in the configuration."""
        return self.container.device

    @property
    def _pilots(self) -> dict[int, ChannelPilot]:
        return self._introduction.pilots

    # For any thread

    def set_poll_period(self, poll_s: float) -> None:
        """Say how often the position of a moving axis is asked for, in wall seconds."""
        self._context.poll_s = poll_s

    def begin(self) -> None:
        """Start the thread and take orders."""
        self._open = True
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
        flight = pilot.flight if pilot is not None else None
        if flight is None or flight.order.movement is not order.movement:
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

    def wait_until_introduced(self, timeout_s: float) -> bool:
        """Wait until types and positions are known; False after `timeout_s` of wall time."""
        return self._introduction.wait(timeout_s)

    @override
    def request_end(self) -> None:
        super().request_end()
        self._inbox.put(Wake())

    # The device thread

    @override
    def run_body(self) -> None:
        try:
            self._guarded(self._introduction.begin)
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
        moving = any(pilot.flight is not None for pilot in self._pilots.values())
        if not moving:
            return self._settings.watch.idle_poll_s
        flights = [pilot.flight for pilot in self._pilots.values() if pilot.flight is not None]
        jogs = [flight.jog for flight in flights if flight.jog is not None]
        if jogs:
            rate = self._context.clock.rate or 1.0
            return max(0.002, min(jog.pause_s for jog in jogs) / rate)
        if any(flight.order.guard is not None for flight in flights):
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
            case Departed():
                self._on_departed(message)
            case StopAll():
                for pilot in self._pilots.values():
                    pilot.halt(message.error)
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

    def _on_channel_message(self, message: Halt | SetFrequency) -> None:
        pilot = self._pilots.get(message.channel)
        if pilot is None:
            return
        if isinstance(message, Halt):
            flight = pilot.flight
            if message.only is None or (flight and flight.order.movement is message.only):
                pilot.halt(message.error)
        else:
            pilot.set_frequency(message.frequency_hz)

    def _on_order(self, order: Order) -> None:
        pilot = self._pilots.get(order.channel)
        if pilot is None or not self._introduction.over:
            self._turn_away(order, None)
            return
        if order.number <= self._void.get(order.channel, 0):
            self._context.gate.withdraw(order.grant)
            order.movement.fail(MoveCancelled(f"{pilot.name}: halted before it started"))
            return
        try:
            pilot.launch(order)
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
            self._introduction.take(event, channel)
        else:
            pilot.take(event)
            self._emit_state(channel)
        self._introduction.look()

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
        pilots = self._introduction.give_up()
        in_motion = any(pilot.flight is not None for pilot in pilots.values())
        reason = f"device {self.index} does not answer: {error}; rescan when it is back"
        self.container.lose(reason)
        # Before anybody is woken: who sees the movement fail must find everything stopped.
        self.lost.emit(DeviceLost(self.index, reason, in_motion))
        for channel, pilot in pilots.items():
            pilot.lose(NotConnectedError(f"{pilot.name}: {reason}", fault=error.fault))
            self._emit_state(channel)

    def _close_intake(self) -> None:
        """Leave no order unanswered and nothing moving."""
        with self._intake:
            self._open = False
        error = MoveCancelled(f"device {self.index} was closed")
        for channel, pilot in self._pilots.items():
            try:
                self._controller.stop(self.container.address(channel))
            except DeviceError as exc:
                logger.warning("%s: %s", pilot.name, exc)
            pilot.lose(error)
        while not self._inbox.empty():
            message = self._inbox.get_nowait()
            if isinstance(message, Order):
                self._context.gate.withdraw(message.grant)
                message.movement.fail(error)
        self._inbox.close()

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
