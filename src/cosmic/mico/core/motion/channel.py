"""`ChannelController`: takes the orders of one channel past the gate to the library."""

import logging
import math
from functools import partial

from typing_extensions import override

from cosmic.frame.errors import (
    CosmicError,
    DeviceError,
    DeviceFault,
    MoveCancelled,
    NotAvailable,
    refusal,
)
from cosmic.frame.verdict import MoveVerdict, Reason, refuse
from cosmic.mico.core.motion.channel_context import ChannelContext
from cosmic.mico.core.motion.channel_speed import ChannelSpeed, quietly
from cosmic.mico.core.motion.checks import Request, malformed
from cosmic.mico.core.motion.gate import GateQuery
from cosmic.mico.core.motion.group_start import StartingAxis
from cosmic.mico.core.motion.jog import SLOWER, JogRun, SteerRun
from cosmic.mico.core.motion.lease import Guard
from cosmic.mico.core.motion.messages import CheckedMove, GroupMoveSent, Order, SetUp
from cosmic.mico.core.motion.motion_monitor import ActiveMove, MotionMonitor
from cosmic.mico.core.motion.orders import Jog, Motion, MoveBy, MoveTo, Reservation, Steer
from cosmic.mico.core.motion.positioner import Confidence, PositionerBase
from cosmic.mico.hw.interface import Direction, PositionerKind, ReferenceKind

logger = logging.getLogger(__name__)


class StartingChannel(StartingAxis):
    """Sends one prepared order to the controller, in whatever thread starts the group.

    Whoever withdraws the order sets that first and stops the channel then; here it is looked at
    before and after the call. So either the call is not made, or one of the two stops the channel.
    """

    def __init__(
        self, positioner: PositionerBase, context: ChannelContext, active: ActiveMove
    ) -> None:
        self._positioner = positioner
        self._context = context
        self._active = active
        self._error: CosmicError | None = None

    @property
    @override
    def name(self) -> str:
        return self._positioner.state.name

    @property
    def _void(self) -> bool:
        active = self._active
        return active.withdrawn or not self._context.gate.still_valid(active.reservation)

    @override
    def go(self) -> bool:
        if self._void:
            return False
        motion, reservation = self._active.order.motion, self._active.reservation
        refused = self._context.gate.claim(reservation, self.name, motion)
        if refused is not None:
            logger.warning("refused: %s", refused)
            self._error = refusal(refused)
            return False
        if isinstance(motion, MoveBy):
            motion = MoveTo(
                math.nan if reservation.target is None else reservation.target, motion.unit
            )
        try:
            self._positioner.send(self._context.controller, motion)
        except DeviceError as exc:
            self._error = exc
        if self._void:
            self._stop()
        return True

    @override
    def prepare(self) -> bool:
        if self._void:
            return False
        motion, reservation = self._active.order.motion, self._active.reservation
        refused = self._context.gate.claim(reservation, self.name, motion, straight=True)
        if refused is not None:
            logger.warning("refused: %s", refused)
            self._error = refusal(refused)
        return refused is None

    @override
    def conclude(self, error: CosmicError | None) -> None:
        self._error = self._error or error
        if self._void:
            self._stop()

    def _stop(self) -> None:
        try:
            self._context.controller.stop(self._positioner.state.address)
        except DeviceError as exc:
            logger.warning("%s: %s", self.name, exc)

    @override
    def report(self) -> None:
        self._context.inbox.put(GroupMoveSent(self._active.order, self._error))


class ChannelController:
    """Takes one channel from order to library; device thread, but for `renew` and `steer`.

    Attributes
    ----------
    name : str
        Name of the axis.
    monitor : MotionMonitor
        Follows what was sent until the axis is stationary.
    """

    def __init__(self, positioner: PositionerBase, context: ChannelContext) -> None:
        self._positioner = positioner
        self._context = context
        self.name = positioner.state.name
        self.speed = ChannelSpeed(positioner, context.controller, context.settings.defaults)
        self.monitor = MotionMonitor(positioner, context, self.speed)
        self._starting: tuple[int, JogRun] | None = None

    def begin(self) -> None:
        """Set the usual speed of an axis that was found, and ask for what is not known of it."""
        if self._positioner.state.kind is not PositionerKind.OPEN_LOOP:
            usual_hz = self._context.settings.defaults.closed_loop_frequency_hz
            self.speed.set_usual(self._positioner.frequency_hz or usual_hz)
            self.monitor.ask_position_known()
            found = self._positioner.state.positioner
            if found is not None and found.reference is ReferenceKind.END_STOP:
                self._ask_safe_direction()
        self.monitor.ask_activity()
        self.monitor.ask_position()

    def _ask_safe_direction(self) -> None:
        """Ask in which direction a reference is searched; where unknown, it may be either."""
        try:
            self._context.controller.ask_safe_direction(self._positioner.state.address)
        except DeviceError as exc:
            if exc.fault is not DeviceFault.UNSUPPORTED:
                raise

    def set_frequency(self, frequency_hz: int) -> None:
        """Limit the closed-loop speed; a jog, or one that arrives with others, keeps its own."""
        own = self.monitor.active is not None and self.monitor.active.has_own_speed
        self.speed.set_usual(frequency_hz, now=not own)

    def set_up(self, message: SetUp, *, asked: bool) -> None:
        """Store what is connected while the axis is stationary, and say what has to be done then.

        Parameters
        ----------
        asked : bool
            The gate decides on an order for this channel just now.
        """
        state, controller = self._positioner.state, self._context.controller
        container, channel = self._context.container, message.channel
        if not state.present:
            message.done.fail(NotAvailable(f"{self.name}: there is no axis to set up"))
            return
        reserved = asked or self.name in self._context.gate.held()
        moving = self.monitor.active is not None or state.in_motion or not state.activity.at_rest
        if reserved or moving:
            text = f"{self.name}: it is moving; set it up when it is stationary"
            message.done.fail(NotAvailable(text))
            return
        address = container.address(channel)
        try:
            if isinstance(message.change, Direction):
                controller.set_safe_direction(address, message.change)
                container.update(channel, safe_direction=message.change)
            else:
                controller.set_sensor_type(address, message.change)
                text = f"type {message.change} was set: press Rescan, then calibrate and reference"
                container.update(channel, present=False, error=text)
        except DeviceError as exc:
            message.done.fail(exc)
            return
        container.update(channel, confidence=Confidence.UNKNOWN)
        logger.warning("%s: set up anew: %s", self.name, message.change)
        self._context.reports.state(channel)
        message.done.finish()

    # Start

    def launch(self, order: Order) -> None:
        """Ask the gate, send `order` to the library, and begin to follow it."""
        gate = self._context.gate
        follows = order.follows
        if order.movement.cancel_requested or (follows and follows is not self.monitor.newest):
            gate.withdraw(order.reservation)
            why = "a newer command came first" if follows else "cancelled before it started"
            order.movement.fail(MoveCancelled(f"{self.name}: {why}"))
            return
        refused = self._void(order) if order.reservation is not None else self._outlived(order)
        if refused is not None:
            self.turn_away(order, refused)
            return
        self.monitor.newest = order.movement
        if isinstance(order.motion, Jog):
            self._start_jog(order, order.motion)
            return
        reservation = order.reservation
        if reservation is not None and gate.superseded(reservation):
            # The axis was sent elsewhere since this was decided: the volume is another one now.
            gate.withdraw(reservation)
            if order.start is not None and order.start.line is not None:
                over = MoveCancelled(f"{self.name}: sent elsewhere; the line was not begun")
                order.movement.fail(over)
                return
            reservation = None
        if reservation is not None:
            self._go(order, reservation)
        elif not isinstance(order.motion, MoveBy) or self._has_origin(order):
            self._ask_gate(order)

    def _ask_gate(self, order: Order) -> None:
        """Begin `order` where the gate answers at once; otherwise go on, and begin it later."""
        motion = order.motion
        request = Request(self.name, motion, order.token, order.consent, guard=order.guard)
        decided = self._context.gate.decide_promptly([request])
        if decided is None:
            self._context.queries.ask(order, partial(self._ask, order, motion), self._on_checked)
            return
        verdict, reservations = decided
        self._start(order, verdict, reservations.get(self.name))

    def _on_checked(self, checked: CheckedMove) -> None:
        self._start(checked.order, checked.verdict, checked.reservation)

    def _start(self, order: Order, verdict: MoveVerdict, reservation: Reservation | None) -> None:
        """Begin an order that the gate has decided; it may have waited for that for long."""
        if not verdict.allowed:
            self.turn_away(order, verdict)
        elif reservation is not None and self._still_wanted(order, reservation):
            self._go(order, reservation)

    def _still_wanted(self, order: Order, reservation: Reservation) -> bool:
        """See whether `order` may still begin; otherwise it fails."""
        refused = self._outlived(order)
        # The gate may have answered for a newer one at once.
        overtaken = order.number < self.monitor.begun
        if refused is None and not overtaken and not order.movement.cancelled:
            return True
        self._context.gate.withdraw(reservation)
        if refused is not None:
            self.turn_away(order, refused)
        else:
            why = "a newer command came first" if overtaken else "cancelled before it started"
            order.movement.fail(MoveCancelled(f"{self.name}: {why}"))
        return False

    def _go(self, order: Order, reservation: Reservation) -> None:
        """Send `order`, or get it ready where it starts with others."""
        gate = self._context.gate
        if not gate.still_valid(reservation):
            gate.withdraw(reservation)
            self.turn_away(order, _stopped(self.name))
            return
        replaced = self.monitor.begin(order, reservation)
        if order.start is not None:
            self._await_start(order, replaced)
            return
        try:
            self._set_speed_for(order, replaced)
            self._send(order.motion, reservation)
        finally:
            self.monitor.report_begun(order, replaced)
        self.monitor.ask_activity()

    def _void(self, order: Order) -> MoveVerdict | None:
        """Return why `order` must not be sent any more, or never was to be; None if it may."""
        gate, over = self._context.gate, self._outlived(order)
        if over is None and order.reservation is not None:
            over = gate.objection(order.reservation, self.name, order.motion)
            if over is not None and over.reason is not Reason.STOPPED:
                return over  # whoever it was given to may still use it
        if over is not None:
            gate.withdraw(order.reservation)
        return over

    def _outlived(self, order: Order) -> MoveVerdict | None:
        """Return why `order` is over, whatever the gate says: who gave it is gone, or a stop."""
        guard = order.guard
        if guard is not None and guard.expired:
            return _unguarded(self.name, guard)
        if order.epoch is not None and order.epoch != self._context.gate.stop_state.epoch:
            return _stopped(self.name)
        return None

    def _set_speed_for(self, order: Order, replaced: ActiveMove | None) -> None:
        """Give the channel the speed of `order`, or its usual one back."""
        own_hz = order.frequency_hz
        if own_hz is not None:
            self.speed.limit(own_hz)
        elif replaced is not None and replaced.has_own_speed:
            self.speed.restore()

    def _await_start(self, order: Order, replaced: ActiveMove | None) -> None:
        """Get everything ready, and leave the call itself to the one that starts the group."""
        active, start = self.monitor.active, order.start
        if active is None or start is None:
            return
        active.awaiting = True
        try:
            self._set_speed_for(order, replaced)
        finally:
            self.monitor.report_begun(order, replaced)
        start.arrive(StartingChannel(self._positioner, self._context, active))

    def on_group_move_sent(self, sent: GroupMoveSent) -> None:
        """Follow an order that was sent together with others."""
        active = self.monitor.active
        if active is None or active.order is not sent.order:
            return
        active.awaiting = False
        active.progress_s = self._context.clock.now_s()
        if isinstance(sent.error, DeviceError):
            self.monitor.fail(sent.error)
        elif sent.error is not None:
            self.monitor.halt(sent.error)
        elif active.error is None and not self._context.gate.still_valid(active.reservation):
            self.monitor.halt(refusal(_stopped(self.name)))
        self.monitor.ask_activity()

    def _has_origin(self, order: Order) -> bool:
        """See whether it is known where a distance starts; otherwise `order` is refused."""
        active = self.monitor.active
        nowhere = active is not None and (
            active.error is not None or active.reservation.target is None
        )
        if nowhere and order.reservation is None:
            text = (
                f"{self.name}: it is still moving, so a distance has no start. "
                "Wait until it is stationary"
            )
            self.turn_away(order, refuse(Reason.NO_ANSWER, text, axis=self.name))
            return False
        return True

    def _ask(
        self,
        order: Order,
        motion: Motion,
        query: GateQuery,
        *,
        jog: JogRun | None = None,
        slowed: bool = False,
    ) -> CheckedMove:
        """Ask the gate for one motion; any thread, for the answer may be long in coming."""
        request = _request(self.name, order, motion)
        verdict, reservations = self._context.gate.decide([request], query)
        return CheckedMove(order, motion, verdict, reservations.get(self.name), jog, slowed)

    def turn_away(self, order: Order, verdict: MoveVerdict) -> None:
        """Refuse `order`, and report it."""
        logger.warning("refused (%s): %s", order.source, verdict)
        self._context.reports.refused(order, verdict)

    def _send(self, motion: Motion, reservation: Reservation) -> None:
        refused = self._context.gate.claim(reservation, self.name, motion)
        if refused is not None:
            logger.warning("refused: %s", refused)
            self.monitor.halt(refusal(refused))
            self._context.reports.stopped_by_gate(refused)
            return
        if isinstance(motion, MoveBy):
            motion = MoveTo(
                math.nan if reservation.target is None else reservation.target, motion.unit
            )
        active = self.monitor.active
        if active is not None and active.jog is not None:
            active.begin_burst(motion, self._context.clock.now_s())
        try:
            self._positioner.send(self._context.controller, motion)
        except DeviceError as exc:
            self.monitor.fail(exc)
        if not self._context.gate.still_valid(reservation):
            self.monitor.halt(refusal(_stopped(self.name)))

    # Jog

    def renew(self, order_number: int) -> None:
        """Keep a jog alive; any thread."""
        jog = self._jog_of(order_number)
        if jog is not None:
            jog.renew()

    def steer(self, order_number: int, velocity: float) -> bool:
        """Say how fast a steered axis is to go; True if the thread should look. Any thread."""
        jog = self._jog_of(order_number)
        return isinstance(jog, SteerRun) and jog.steer(velocity)

    def _jog_of(self, order_number: int) -> JogRun | None:
        """Return the jog of an order, also while the gate is asked for its beginning."""
        active, starting = self.monitor.active, self._starting
        if active is not None and active.order.number == order_number:
            return active.jog
        return starting[1] if starting is not None and starting[0] == order_number else None

    def _jog_run(self, motion: Jog) -> JogRun:
        settings, top_speed = self._context.settings, self.speed.top_speed
        if isinstance(motion, Steer):
            return SteerRun(motion, settings, top_speed, self._context.clock.rate or 1.0)
        return JogRun(motion, settings, top_speed)

    def _start_jog(self, order: Order, motion: Jog) -> None:
        senseless = malformed(motion, self._positioner.state)
        if senseless is not None:
            self.turn_away(order, senseless)
            return
        jog = self._jog_run(motion)
        self._starting = order.number, jog
        self._context.queries.ask(
            order, partial(self._check_first_packet, order, jog), self._begin_jog
        )

    def _check_first_packet(self, order: Order, jog: JogRun, query: GateQuery) -> CheckedMove:
        """Work out how a jog may begin; any thread."""
        jog.slow_down(self._free_share(order, jog))
        return self._ask_packet(order, jog, query, slowed=True)

    def _ask_packet(
        self, order: Order, jog: JogRun, query: GateQuery, *, slowed: bool
    ) -> CheckedMove:
        packet = jog.packet(self._positioner.state, self._context.clock.now_s())
        if packet is None:
            return CheckedMove(order, None, jog=jog)
        return self._ask(order, packet, query, jog=jog, slowed=slowed)

    def _begin_jog(self, checked: CheckedMove) -> None:
        """Begin a jog that the gate has decided, unless it was let go meanwhile."""
        order, reservation, jog, packet = (
            checked.order,
            checked.reservation,
            checked.jog,
            checked.motion,
        )
        self._starting = None
        if not checked.verdict.allowed:
            self.turn_away(order, checked.verdict)
            return
        if packet is None or reservation is None or jog is None or jog.let_go():
            self._context.gate.withdraw(reservation)
            order.movement.finish(self._positioner.state.shown_position)
            return
        if not self._still_wanted(order, reservation):
            return
        replaced = self.monitor.begin(order, reservation, jog=jog)
        try:
            self.speed.limit_jog(jog)
            self._send(packet, reservation)
        finally:
            self.monitor.report_begun(order, replaced)

    def _free_share(self, order: Order, jog: JogRun) -> float:
        """Return how much of its speed a jog may keep with what is in its way."""
        for share in SLOWER:
            ahead = jog.look_ahead(self._positioner.state, share)
            request = _request(self.name, order, ahead)
            verdict = self._context.gate.check([request], advice=False)
            if verdict.reason is not Reason.COLLISION:
                return share
        return SLOWER[-1]

    def poll(self) -> None:
        """Keep a jog going, ask what is due, and notice a movement that makes no progress."""
        active = self.monitor.active
        guard = active.order.guard if active is not None and active.error is None else None
        if guard is not None and guard.expired:
            logger.warning("%s: stopped, %s", self.name, guard.why)
            self.monitor.halt(MoveCancelled(f"{self.name}: stopped, {guard.why}"))
        jog = active.jog if active is not None else None
        if active is not None and jog is not None and jog.due(self._context.clock.now_s()):
            self._next_packet(active, jog)
        self.monitor.poll()

    def _next_packet(self, active: ActiveMove, jog: JogRun) -> None:
        if not self._context.gate.still_valid(active.reservation):
            self.monitor.halt(refusal(_stopped(self.name)))
            return
        if active.asking:
            active.progress_s = self._context.clock.now_s()
            if jog.let_go():
                self.monitor.end_jog(jog.lost)
            return
        active.asking = True
        ask = partial(self._check_next_packet, active.order, jog)
        self._context.queries.ask(active.order, ask, partial(self._on_packet, active))

    def _check_next_packet(self, order: Order, jog: JogRun, query: GateQuery) -> CheckedMove:
        """Work out how a jog may go on; any thread."""
        jog.follow_hand()
        slowed = jog.must_look() and jog.slow_down(self._free_share(order, jog))
        return self._ask_packet(order, jog, query, slowed=slowed)

    def _on_packet(self, active: ActiveMove, checked: CheckedMove) -> None:
        """Send the next packet of a jog, unless it has ended while the gate was asked."""
        reservation, jog, packet = checked.reservation, checked.jog, checked.motion
        active.asking = False
        if self.monitor.active is not active or jog is None or active.jog is not jog:
            self._context.gate.withdraw(reservation)
        elif not checked.verdict.allowed:
            self.monitor.end_jog(refusal(checked.verdict))
            self._context.reports.stopped_by_gate(checked.verdict)
        elif packet is None or reservation is None or jog.let_go():
            self._context.gate.withdraw(reservation)
            self.monitor.end_jog(jog.lost)
        else:
            if checked.slowed:
                quietly(self.name, lambda: self.speed.limit_jog(jog))
            before, active.reservation = active.reservation, reservation
            self._context.gate.release(before)
            self._send(packet, reservation)
            active.progress_s = self._context.clock.now_s()
            if isinstance(jog, SteerRun) and jog.must_locate():
                self.monitor.ask_position()


def _request(name: str, order: Order, motion: Motion) -> Request:
    return Request(name, motion, order.token, order.consent, guard=order.guard)


def _unguarded(name: str, guard: Guard) -> MoveVerdict:
    return refuse(Reason.NO_LEASE, f"{name}: {guard.why}", axis=name)


def _stopped(name: str) -> MoveVerdict:
    return refuse(Reason.STOPPED, f"{name}: stopped before it reached its target", axis=name)
