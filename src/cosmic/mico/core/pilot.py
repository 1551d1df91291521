"""`ChannelPilot`: takes one channel from order to standstill; device thread only."""

import logging
import math

from typing_extensions import override

from cosmic.frame.errors import DeviceError, MoveCancelled, refusal
from cosmic.frame.verdict import MoveVerdict, Reason, refuse
from cosmic.mico.core.departure import ChannelDeparture
from cosmic.mico.core.flight import Flight
from cosmic.mico.core.follower import ChannelFollower
from cosmic.mico.core.jog import SLOWER, JogRun
from cosmic.mico.core.judgement import Request
from cosmic.mico.core.lease import Guard
from cosmic.mico.core.messages import Departed, MovementBegun
from cosmic.mico.core.orders import (
    Grant,
    Jog,
    Motion,
    MoveBy,
    MoveTo,
    Order,
    Reference,
    Steer,
)
from cosmic.mico.core.quietly import quietly
from cosmic.mico.core.rules import malformed
from cosmic.mico.core.steer import SteerRun

logger = logging.getLogger(__name__)


class ChannelPilot(ChannelFollower):
    """Launches the orders for one channel; what follows is the follower's."""

    # Starting

    def launch(self, order: Order) -> None:
        """Ask the gate, send `order` to the library, and begin to follow it."""
        gate = self._context.gate
        if order.movement.cancelled or (order.follows and order.follows is not self.newest):
            gate.withdraw(order.grant)
            why = "a newer command came first" if order.follows else "cancelled before it started"
            order.movement.fail(MoveCancelled(f"{self.name}: {why}"))
            return
        refused = self._void(order)
        if refused is not None:
            self.turn_away(order, refused)
            return
        self.newest = order.movement
        if isinstance(order.motion, Jog):
            self._start_jog(order, order.motion)
            return
        grant = self._granted(order)
        if grant is None:
            return
        if not gate.still_valid(grant):
            gate.withdraw(grant)
            self.turn_away(order, _stopped(self.name))
            return
        replaced = self._begin(order, grant)
        if order.start is not None:
            self._await_start(order, replaced)
            return
        try:
            self._set_speed_for(order, replaced)
            self._send(order.motion, grant)
        finally:
            self._tell_begun(order, replaced)
        self.ask_activity()

    def _void(self, order: Order) -> MoveVerdict | None:
        """Return why `order` must not be sent any more, or never was to be; None if it may."""
        gate, guard, over = self._context.gate, order.guard, None
        if guard is not None and guard.expired:
            over = _unguarded(self.name, guard)
        elif order.epoch is not None and order.epoch != gate.stop_state.epoch:
            over = _stopped(self.name)
        elif order.grant is not None:
            over = gate.objection(order.grant, self.name, order.motion)
            if over is not None and over.reason is not Reason.STOPPED:
                return over  # whoever it was given to may still use it
        if over is not None:
            gate.withdraw(order.grant)
        return over

    def _set_speed_for(self, order: Order, replaced: Flight | None) -> None:
        """Give the channel the speed of `order`, or its usual one back."""
        own_hz = order.frequency_hz
        if own_hz is not None:
            self.speed.limit(own_hz)
        elif replaced is not None and replaced.has_own_speed:
            self.speed.restore()

    def _await_start(self, order: Order, replaced: Flight | None) -> None:
        """Get everything ready, and leave the call itself to the one that starts the group."""
        flight, start = self.flight, order.start
        if flight is None or start is None:
            return
        flight.awaiting = True
        try:
            self._set_speed_for(order, replaced)
        finally:
            self._tell_begun(order, replaced)
        start.arrive(ChannelDeparture(self._positioner, self._context, flight))

    def depart(self, departed: Departed) -> None:
        """Follow an order that was sent together with others."""
        flight = self.flight
        if flight is None or flight.order is not departed.order:
            return
        flight.awaiting = False
        flight.progress_s = self._context.clock.now_s()
        if isinstance(departed.error, DeviceError):
            self._blame(departed.error)
        elif departed.error is not None:
            self.halt(departed.error)
        elif flight.error is None and not self._context.gate.still_valid(flight.grant):
            self.halt(refusal(_stopped(self.name)))
        self.ask_activity()

    def _granted(self, order: Order) -> Grant | None:
        flight, grant = self.flight, order.grant
        nowhere = flight is not None and (flight.error is not None or flight.grant.target is None)
        if nowhere and isinstance(order.motion, MoveBy) and grant is None:
            text = f"{self.name}: it does not stand yet, so there is no place to go on from"
            self.turn_away(order, refuse(Reason.NO_ANSWER, text, axis=self.name))
            return None
        if grant is not None and self._context.gate.superseded(grant):
            # The axis was sent elsewhere since this was decided: the volume is another one now.
            self._context.gate.withdraw(grant)
            grant = None
        return grant or self._grant(order, order.motion)

    def _grant(self, order: Order, motion: Motion) -> Grant | None:
        request = Request(self.name, motion, order.token, order.consent, guard=order.guard)
        verdict, grants = self._context.gate.decide([request])
        if verdict.allowed:
            return grants[self.name]
        if self.flight is not None and self.flight.order is order:
            self._end_jog(refusal(verdict))
            self._context.on_refused(verdict)
        else:
            self.turn_away(order, verdict)
        return None

    def turn_away(self, order: Order, verdict: MoveVerdict) -> None:
        """Tell everybody that `order` was refused."""
        logger.warning("refused (%s): %s", order.source, verdict)
        order.movement.fail(refusal(verdict))
        self._context.on_refused(verdict)

    def _begin(self, order: Order, grant: Grant, jog: JogRun | None = None) -> Flight | None:
        """Make `order` the movement under way and return the one that it replaces.

        Nothing here takes long, for the controller waits: telling and logging come after `_send`.
        """
        now_s = self._context.clock.now_s()
        flight = Flight(order, grant, started_s=now_s, progress_s=now_s, jog=jog)
        flight.known_pending = isinstance(order.motion, Reference)
        replaced, self.flight = self.flight, flight
        if replaced is not None:
            replaced.replaced = True
        self.next_poll_s = self._context.clock.wall_s() + self._context.poll_s
        return replaced

    def _tell_begun(self, order: Order, replaced: Flight | None) -> None:
        """Tell everybody that `order` was sent, and that it ended the one before."""
        state = self._positioner.state
        failed = self.flight is not None and self.flight.error is not None
        error = self._positioner.state.error if failed else ""
        self._context.container.update(self._address.channel, in_motion=True, error=error)
        if replaced is not None:
            self._count(replaced)
            self._give_back(replaced.grant)
            if not replaced.told:
                over = MoveCancelled(f"{self.name}: replaced by a newer command")
                replaced.order.movement.fail(over)
                self._context.on_failed(self.name, over)
        # What goes on from an order told already would fill the log.
        level = logging.INFO if order.follows is None else logging.DEBUG
        logger.log(level, "%s: %s (%s)", self.name, order.motion, order.source)
        if self.flight is not None:
            self._context.on_begun(
                MovementBegun(
                    name=self.name,
                    motion=order.motion,
                    from_position=state.position,
                    target=self.flight.grant.target,
                    unit=state.unit,
                    time_s=self.flight.started_s,
                    source=order.source,
                )
            )
        self._announce()

    def _send(self, motion: Motion, grant: Grant) -> None:
        refused = self._context.gate.claim(grant, self.name, motion)
        if refused is not None:
            logger.warning("refused: %s", refused)
            self.halt(refusal(refused))
            self._context.on_refused(refused)
            return
        if isinstance(motion, MoveBy):
            motion = MoveTo(math.nan if grant.target is None else grant.target, motion.unit)
        try:
            self._positioner.send(self._context.controller, motion)
        except DeviceError as exc:
            self._blame(exc)
        if not self._context.gate.still_valid(grant):
            self.halt(refusal(_stopped(self.name)))

    # Jogging

    def renew(self, order_number: int) -> None:
        """Keep a jog alive; any thread."""
        flight = self.flight
        if flight is not None and flight.jog is not None and flight.order.number == order_number:
            flight.jog.renew()

    def steer(self, order_number: int, velocity: float) -> bool:
        """Say how fast a steered axis is to go; True if the thread should look. Any thread."""
        flight = self.flight
        if flight is None or flight.order.number != order_number:
            return False
        return isinstance(flight.jog, SteerRun) and flight.jog.steer(velocity)

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
        jog.slow_down(self._free_share(order, jog))
        packet = jog.packet(self._positioner.state, self._context.clock.now_s())
        if packet is None:
            order.movement.finish(self._positioner.state.shown_position)
            return
        grant = self._grant(order, packet)
        if grant is not None:
            replaced = self._begin(order, grant, jog=jog)
            try:
                self.speed.limit_jog(jog)
                self._send(packet, grant)
            finally:
                self._tell_begun(order, replaced)

    def _free_share(self, order: Order, jog: JogRun) -> float:
        """Return how much of its speed a jog may keep with what is in its way."""
        for share in SLOWER:
            ahead = jog.look_ahead(self._positioner.state, share)
            request = Request(self.name, ahead, order.token, order.consent, guard=order.guard)
            verdict = self._context.gate.check([request], advice=False)
            if verdict.reason is not Reason.COLLISION:
                return share
        return SLOWER[-1]

    @override
    def poll(self) -> None:
        flight = self.flight
        guard = flight.order.guard if flight is not None and flight.error is None else None
        if guard is not None and guard.expired:
            logger.warning("%s: stopped, %s", self.name, guard.why)
            self.halt(MoveCancelled(f"{self.name}: stopped, {guard.why}"))
        jog = flight.jog if flight is not None else None
        if flight is not None and jog is not None and jog.due(self._context.clock.now_s()):
            self._next_packet(flight, jog)
        super().poll()

    def _next_packet(self, flight: Flight, jog: JogRun) -> None:
        now_s = self._context.clock.now_s()
        if not self._context.gate.still_valid(flight.grant):
            self.halt(refusal(_stopped(self.name)))
            return
        jog.follow_hand()
        if jog.must_look() and jog.slow_down(self._free_share(flight.order, jog)):
            quietly(self.name, lambda: self.speed.limit_jog(jog))
        packet = jog.packet(self._positioner.state, now_s)
        if packet is None:
            self._end_jog(jog.lost)
            return
        grant = self._grant(flight.order, packet)
        if grant is not None:
            before, flight.grant = flight.grant, grant
            self._give_back(before)
            self._send(packet, grant)
            flight.progress_s = now_s
            if isinstance(jog, SteerRun) and jog.must_locate():
                self.ask_position()


def _unguarded(name: str, guard: Guard) -> MoveVerdict:
    return refuse(Reason.NO_LEASE, f"{name}: {guard.why}", axis=name)


def _stopped(name: str) -> MoveVerdict:
    return refuse(Reason.STOPPED, f"{name}: stopped before it got there", axis=name)
