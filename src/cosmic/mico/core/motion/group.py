"""Several axes ordered at once: links, speeds that match, and one start for all."""

import logging
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, Protocol

from cosmic.frame.clock import Clock
from cosmic.frame.errors import refusal
from cosmic.frame.verdict import MoveVerdict
from cosmic.mico.core.motion.checks import Request, planned_target
from cosmic.mico.core.motion.data_container import DeviceDataContainer
from cosmic.mico.core.motion.gate import Gate
from cosmic.mico.core.motion.group_start import GroupStart, GroupStarted, LineStart
from cosmic.mico.core.motion.lease import Lease
from cosmic.mico.core.motion.links import LinkTable
from cosmic.mico.core.motion.messages import Order
from cosmic.mico.core.motion.movement import Movement
from cosmic.mico.core.motion.orders import FREQUENCY_HZ, Motion, Reservation
from cosmic.mico.core.motion.positioner import Confidence, PositionerState, class_for
from cosmic.mico.core.motion.settings import MotionDefaults
from cosmic.mico.core.motion.straight import AxisTravel, StraightLine
from cosmic.mico.core.settings import MicoSettings
from cosmic.mico.hw.interface import Capabilities, Channel, Controller, MatchedMove

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Leg:
    """What one axis has before it.

    Attributes
    ----------
    distance : float
        How far it goes, without sign, in its unit.
    step : float
        How far it goes with one step, in its unit.
    approach : float
        What its slow end costs, as a way in its unit gone at full speed.
    top_hz : int
        The most steps per second that it may make.
    low_hz : int
        The fewest that its controller can be told.
    """

    distance: float
    step: float
    approach: float
    top_hz: int
    low_hz: int = FREQUENCY_HZ[0]

    @property
    def steps(self) -> float:
        """How many steps its way is worth."""
        return (self.distance + self.approach) / self.step


def matched_frequencies(legs: Mapping[str, Leg]) -> dict[str, int]:
    """Return the steps per second of every axis that has a way to go.

    The axis that takes longest keeps the speed that it has; the others are slowed down to it.
    """
    moving = {name: leg for name, leg in legs.items() if leg.distance > 0.0}
    longest_s = max((leg.steps / leg.top_hz for leg in moving.values()), default=0.0)
    return {
        name: max(leg.low_hz, min(leg.top_hz, math.ceil(leg.steps / longest_s - 1e-9)))
        for name, leg in moving.items()
    }


AT_REST: Final = 1e-3
"""A shorter way, in um or degrees, is none."""


def straight_line(
    targets: Mapping[str, float],
    states: Mapping[str, PositionerState],
    speeds: Mapping[str, float],
    hold_s: Mapping[str, float],
    defaults: MotionDefaults,
    spread_s: float,
) -> StraightLine | None:
    """Return the line from where axes stand to `targets`, as fast as the slowest allows.

    Parameters
    ----------
    targets, speeds, hold_s : mapping of float
        By axis: where it goes, how fast it can, per second, and how long it holds there.
    spread_s : float
        How much later than the first axis the last may stop, in platform time.

    Returns
    -------
    StraightLine or None
        None where fewer than two axes have a way to go.
    """
    lengths = {name: target - (states[name].position or 0.0) for name, target in targets.items()}
    going = {name: abs(distance) for name, distance in lengths.items() if abs(distance) >= AT_REST}
    if len(going) < 2:
        return None
    duration_s = max(distance / speeds[name] for name, distance in going.items())
    rate = min(
        defaults.acceleration(states[name].unit) / distance for name, distance in going.items()
    )
    errors = {name: defaults.following_error(states[name].unit) for name in going}
    travels: dict[str, AxisTravel] = {}
    for name, distance in going.items():
        state, speed = states[name], distance / duration_s
        others = [other for other in going if other != name]
        beside = min(others, key=lambda other: errors[other] / going[other])
        lag = errors[name] + distance * errors[beside] / going[beside] + speed * spread_s
        move = MatchedMove(
            channel=state.address,
            target=targets[name],
            unit=state.unit,
            hold_s=hold_s[name],
            speed=speed,
            acceleration=rate * distance,
            following_error=errors[name],
        )
        start = targets[name] - lengths[name]
        wide = lag + speed * spread_s
        travels[name] = AxisTravel(start, targets[name], move, beside=beside, lag=lag, wide=wide)
    return StraightLine(travels)


def runs_straight(state: PositionerState, can: Capabilities) -> bool:
    """Return whether an axis, as it is now, can keep to a line with others of its device."""
    return (
        can.group_start
        and can.velocity
        and state.present
        and state.position is not None
        and state.confidence is Confidence.KNOWN
        and state.activity.at_rest
        and not state.in_motion
    )


class _Device(Protocol):
    @property
    def container(self) -> DeviceDataContainer:
        """What is known of the device."""

    def submit(self, order: Order) -> None:
        """Queue an order."""


class Axes(Protocol):
    """What is known of the axes of a platform, and the way to their devices."""

    @property
    def settings(self) -> MicoSettings:
        """Settings of the platform."""

    def address(self, name: str) -> Channel:
        """Return where an axis is connected; raises `UnknownAxisError`."""

    def states(self) -> dict[str, PositionerState]:
        """Return the state of every axis by name."""

    def usual_frequency_hz(self, name: str) -> int:
        """Return the closed-loop frequency limit that is set on an axis."""

    def device(self, name: str) -> _Device:
        """Return the device that drives an axis."""

    @property
    def controller(self) -> Controller:
        """The library behind all devices."""

    @property
    def clock(self) -> Clock:
        """The platform's time."""


class GroupOrders:
    """Has movements of several axes decided together and started back to back; any thread.

    Parameters
    ----------
    check_ready : callable
        Raises `MoveRefused` while axes cannot be moved.
    on_refused, on_started : callable
        Told that the gate refused a group, and that one was started, by whoever found out.
    """

    def __init__(
        self,
        axes: Axes,
        *,
        gate: Gate,
        links: LinkTable,
        lease: Lease,
        check_ready: Callable[[], None],
        on_refused: Callable[[MoveVerdict], None],
        on_started: Callable[[GroupStarted], None],
    ) -> None:
        self._axes = axes
        self._gate = gate
        self._links = links
        self._lease = lease
        self._check_ready = check_ready
        self._on_refused = on_refused
        self._on_started = on_started

    def check(self, motions: Mapping[str, Motion], *, consent: bool = False) -> MoveVerdict:
        """Return what the gate says to `motions`, and those linked to them, as they are now."""
        self._check_names(motions)
        return self._gate.check(self._requests(self._with_linked(motions), consent=consent))

    def order_together(
        self,
        motions: Mapping[str, Motion],
        *,
        source: str,
        consent: bool = False,
        linked: bool = True,
        match_arrival: bool = False,
        follows: Mapping[str, Movement] | None = None,
        slow_hz: Mapping[str, int] | None = None,
    ) -> dict[str, Order]:
        """Decide `motions` together and start them back to back, or none.

        `slow_hz` limits the steps per second of single axes for this movement.
        """
        follows = follows or {}
        self._check_names(motions)
        if linked:
            named = len(motions)
            motions = self._with_linked(motions)
            match_arrival = match_arrival or len(motions) > named
        requests = self._requests(motions, consent=consent, alone=not linked)
        self._check_ready()
        in_line = match_arrival and not (slow_hz or follows)
        lines = self._lines(motions) if in_line else None
        reservations = self._reserved(requests, source, None if lines is None else lines[1])
        speeds = self._matched_speeds(reservations) if match_arrival and lines is None else {}
        speeds |= {name: hertz for name, hertz in (slow_hz or {}).items() if name in motions}
        start = self._start(reservations, lines) if len(motions) > 1 else None
        token, guard = self._lease.local_token, self._lease.guard()
        orders = {
            name: Order(
                self._axes.address(name).channel,
                motion,
                token,
                source,
                consent,
                reservation=reservations[name],
                follows=follows.get(name),
                start=start,
                frequency_hz=speeds.get(name),
                guard=guard,
            )
            for name, motion in motions.items()
        }
        if start is not None and start.line is not None:
            start.line.follow([order.movement for order in orders.values()])
        self._submit(orders)
        return orders

    def _start(
        self, reservations: Mapping[str, Reservation], lines: tuple[StraightLine, ...] | None
    ) -> GroupStart:
        """Return what starts the axes: by one command where they keep to a line."""
        if lines is None:
            return GroupStart(len(reservations), self._on_started)
        narrow = any(each.straight for each in reservations.values())
        line = LineStart(lines[1 if narrow else 0], self._axes.controller.move_together)
        return GroupStart(len(reservations), self._on_started, line)

    def _lines(self, motions: Mapping[str, Motion]) -> tuple[StraightLine, StraightLine] | None:
        """Return how `motions` run along a line, usually and where only the line is clear.

        None where they cannot: not all on one device, moving, not known, or not so commanded.
        """
        states, going = self._axes.states(), self._gate.held()
        targets: dict[str, float] = {}
        devices: set[int] = set()
        hold_s: dict[str, float] = {}
        for name, motion in motions.items():
            state, container = states.get(name), self._axes.device(name).container
            axis = container.positioner(self._axes.address(name).channel)
            if state is None or axis is None or name in going:
                return None
            target = planned_target(motion, state, None)
            if target is None or not runs_straight(state, container.capabilities):
                return None
            targets[name], hold_s[name] = target, axis.hold_s
            devices.add(state.address.device)
        return self._paced_lines(targets, states, hold_s) if len(devices) == 1 else None

    def _paced_lines(
        self,
        targets: Mapping[str, float],
        states: Mapping[str, PositionerState],
        hold_s: Mapping[str, float],
    ) -> tuple[StraightLine, StraightLine] | None:
        axes, defaults = self._axes, self._axes.settings.defaults
        usual = {
            name: axes.usual_frequency_hz(name) * defaults.nominal_step(states[name].unit)
            for name in targets
        }
        slow = {
            name: min(speed, defaults.line_speed(states[name].unit))
            for name, speed in usual.items()
        }
        spread_s = defaults.stop_spread_s * max(axes.clock.rate, 1.0)
        lines = [
            straight_line(targets, states, speeds, hold_s, defaults, spread_s)
            for speeds in (usual, slow)
        ]
        free, narrow = lines
        return None if free is None or narrow is None else (free, narrow)

    def _check_names(self, motions: Mapping[str, Motion]) -> None:
        """Raise `UnknownAxisError` where one of the axes does not exist."""
        for name in motions:
            self._axes.address(name)

    def _with_linked(self, motions: Mapping[str, Motion]) -> dict[str, Motion]:
        """Return `motions` with those of the axes linked to them."""
        if not self._links.links:
            return dict(motions)
        going = self._gate.targets()
        stand = {
            name: going.get(name, state.position)
            for name, state in self._axes.states().items()
            if state.position is not None
        }
        known = {name: where for name, where in stand.items() if where is not None}
        watch = self._axes.settings.watch
        return self._links.expanded(motions, known, watch.tolerance_um, watch.tolerance_deg)

    def _requests(
        self, motions: Mapping[str, Motion], *, consent: bool, alone: bool = False
    ) -> list[Request]:
        token, guard = self._lease.local_token, self._lease.guard()
        return [
            Request(name, motion, token, consent, alone=alone, guard=guard)
            for name, motion in motions.items()
        ]

    def _reserved(
        self, requests: list[Request], source: str, line: StraightLine | None
    ) -> dict[str, Reservation]:
        verdict, reservations = self._gate.decide(requests, line=line)
        if not verdict.allowed:
            logger.warning("refused (%s): %s", source, verdict)
            self._on_refused(verdict)
            raise refusal(verdict)
        self._links.sent(
            {name: each.target for name, each in reservations.items() if each.target is not None}
        )
        return reservations

    def _matched_speeds(self, reservations: Mapping[str, Reservation]) -> dict[str, int]:
        axes = self._axes
        return _frequencies(
            reservations, axes.states(), axes.settings.defaults, axes.usual_frequency_hz
        )

    def _submit(self, orders: Mapping[str, Order]) -> None:
        _fail_together(orders)
        for name, order in orders.items():
            self._axes.device(name).submit(order)


def _frequencies(
    reservations: Mapping[str, Reservation],
    states: Mapping[str, PositionerState],
    defaults: MotionDefaults,
    usual_hz: Callable[[str], int],
) -> dict[str, int]:
    """Return the speed limit of every axis with which all arrive at the same time."""
    legs: dict[str, Leg] = {}
    for name, reservation in reservations.items():
        state = states[name]
        sensed = class_for(state.kind, state.positioner).has_sensor
        if not sensed or reservation.target is None or state.position is None:
            continue
        rotary = state.unit == "deg"
        legs[name] = Leg(
            distance=abs(reservation.target - state.position),
            step=defaults.nominal_step_deg if rotary else defaults.nominal_step_um,
            approach=defaults.approach_deg if rotary else defaults.approach_um,
            top_hz=usual_hz(name),
            low_hz=state.frequency_range_hz[0],
        )
    return matched_frequencies(legs)


def _fail_together(orders: Mapping[str, Order]) -> None:
    """Have the failure of one of `orders` before the common start withdraw the others."""

    def on_end(ended: Movement) -> None:
        if ended.success:
            return
        for order in orders.values():
            start = order.start
            if not order.movement.done and start is not None and start.skew_ms is None:
                order.movement.cancel()

    for order in orders.values():
        order.movement.add_callback(on_end)
