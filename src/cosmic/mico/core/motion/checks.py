"""The gate's pure part: the platform at one moment in, an answer out."""

import logging
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Final, NamedTuple, Self, TypeVar

from cosmic.frame.units import format_quantity
from cosmic.frame.verdict import ALLOWED, MoveVerdict, Reason, refuse
from cosmic.mico.core.collision.checker import AxisSpan, CollisionChecker, Spans
from cosmic.mico.core.motion.lease import Guard
from cosmic.mico.core.motion.orders import (
    AMPLITUDE_V,
    MOTION_WORDS,
    Interval,
    Jog,
    Motion,
    MoveBy,
    MoveTo,
    Reference,
    Step,
    ToEndStop,
)
from cosmic.mico.core.motion.positioner import (
    TIMES_STD,
    Confidence,
    CountedTravel,
    PositionerState,
    class_for,
    counted_travels,
)
from cosmic.mico.core.motion.straight import StraightLine, check_line
from cosmic.mico.core.settings import MicoSettings
from cosmic.mico.hw.interface import Direction, PositionerKind, ReferenceKind

logger = logging.getLogger(__name__)

Answer = TypeVar("Answer", MoveVerdict, MoveVerdict | None)

ROUNDING: Final = 1e-6
"""What adding and taking away a user's zero may cost a limit that is shown and typed again."""
EVERYWHERE: Final = Interval(-math.inf, math.inf)


@dataclass(frozen=True, slots=True)
class Limits:
    """What the rules take from the configuration.

    Attributes
    ----------
    largest_step : mapping of float
        By unit, the longest way that one step can go: bounds what open-loop steps may sweep.
    stale_s : float
        Age in wall seconds beyond which a position is no answer.
    counted : mapping of CountedTravel
        Bounds and uncertainty of the axes without sensor, by name.
    """

    largest_step: dict[str, float]
    stale_s: float
    counted: Mapping[str, CountedTravel] = field(default_factory=dict)

    @classmethod
    def of(cls, settings: MicoSettings) -> Self:
        """Return those of a platform file."""
        defaults = settings.defaults
        return cls(
            largest_step={"um": defaults.largest_step_um, "deg": defaults.largest_step_deg},
            stale_s=settings.watch.stale_s,
            counted=counted_travels(settings.positioner, defaults),
        )


def check_axis(
    motion: Motion,
    state: PositionerState,
    *,
    consent: bool,
    running_target: float | None,
    held: Interval | None,
    age_s: float,
    rules: Limits,
) -> MoveVerdict | None:
    """Return why this axis must not make `motion`, or None."""
    checks: tuple[Callable[[], MoveVerdict | None], ...] = (
        lambda: malformed(motion, state),
        lambda: _not_finite(motion, state),
        lambda: _wrong_kind(motion, state),
        lambda: _step_range(motion, state),
        lambda: _device(state),
        lambda: _position_unknown(state, consent=consent),
        lambda: _stale(state, age_s, rules),
        lambda: _limit(motion, state, planned_target(motion, state, running_target), held, rules),
    )
    refusals = (check() for check in checks)
    return next((refusal for refusal in refusals if refusal is not None), None)


def planned_target(
    motion: Motion, state: PositionerState, running_target: float | None
) -> float | None:
    """Return where a closed-loop movement will end, in gate coordinates; None if open-loop."""
    match motion:
        case MoveTo():
            return motion.target
        case MoveBy():
            base = state.position if running_target is None else running_target
            return None if base is None else base + motion.distance
        case _:
            return None


def heading(motion: Motion, state: PositionerState, target: float | None) -> int | None:
    """Return which way a movement goes from where the axis stands, 1 or -1; None if either."""
    direction: Direction | None = None
    if target is not None and state.position is not None and target != state.position:
        return 1 if target > state.position else -1
    match motion:
        case Step() if motion.steps != 0:
            return 1 if motion.steps > 0 else -1
        case ToEndStop():
            direction = motion.direction
        case Reference():
            found = state.positioner
            if found is not None and found.reference is ReferenceKind.END_STOP:
                direction = state.safe_direction
    return None if direction is None else 1 if direction is Direction.FORWARD else -1


def swept_interval(
    motion: Motion,
    state: PositionerState,
    target: float | None,
    place: Interval,
    rules: Limits,
) -> Interval:
    """Return all places the movement can take the axis to, whatever is interrupted when.

    Parameters
    ----------
    place : Interval
        Where the axis may be now: where it stands, what it may have swept already, or, while its
        position is unknown, anywhere it can be.
    """
    if state.position is None:
        return EVERYWHERE
    if target is not None:
        if state.confidence is not Confidence.UNKNOWN:
            return place.union(Interval(target, target))
        # The counter is somewhere; what it will count is known.
        return _extended(place, target - state.position)
    match motion:
        case Step():
            return _extended(place, motion.steps * rules.largest_step[state.unit])
        case ToEndStop():
            return _to_the_stop(place, motion.direction)
        case Reference():
            found = state.positioner
            if found is not None and found.reference is ReferenceKind.END_STOP:
                return _to_the_stop(place, state.safe_direction)
    return EVERYWHERE


def _extended(place: Interval, travelled: float) -> Interval:
    return Interval(place.low + min(travelled, 0.0), place.high + max(travelled, 0.0))


def _to_the_stop(place: Interval, direction: Direction | None) -> Interval:
    match direction:
        case Direction.FORWARD:
            return Interval(place.low, math.inf)
        case Direction.BACKWARD:
            return Interval(-math.inf, place.high)
        case None:
            return EVERYWHERE


def malformed(motion: Motion, state: PositionerState) -> MoveVerdict | None:
    """Return why `motion` is nothing that can be asked of any axis, or None."""
    name = state.name
    match motion:
        case Jog():
            fine = motion.direction in (1, -1) and _finite(motion.speed) and motion.speed > 0.0
            text = f"{name}: jog in direction 1 or -1 with a speed above 0"
        case ToEndStop():
            fine, text = isinstance(motion.direction, Direction), f"{name}: no direction is given"
        case _:
            fine, text = type(motion) in MOTION_WORDS, f"{name}: {motion!r} is not a movement"
    return None if fine else refuse(Reason.NOT_FINITE, text, axis=name)


def _finite(number: object) -> bool:
    fine = isinstance(number, (int, float)) and not isinstance(number, bool)
    return fine and math.isfinite(number)  # type: ignore[arg-type]


def _returns(state: PositionerState, target: float) -> bool:
    """Return True for a way from outside the limits towards the inside.

    It counts from where the axis stands now, whatever is under way: a jog is made of packets.
    """
    if state.limits is None or state.position is None:
        return False
    low, high = state.limits
    return state.position < target <= low or high <= target < state.position


def _not_finite(motion: Motion, state: PositionerState) -> MoveVerdict | None:
    match motion:
        case MoveTo():
            numbers: tuple[object, ...] = (motion.target,)
        case MoveBy():
            numbers = (motion.distance,)
        case Step():
            numbers = (motion.steps, motion.amplitude_v, motion.frequency_hz)
        case _:
            return None
    for number in numbers:
        if not _finite(number):
            return refuse(
                Reason.NOT_FINITE,
                f"{state.name}: {number!r} is not a finite number",
                axis=state.name,
            )
    return None


def _wrong_kind(motion: Motion, state: PositionerState) -> MoveVerdict | None:
    cls = class_for(state.kind, state.positioner)
    unit = getattr(motion, "unit", None)
    if isinstance(motion, cls.motions) and unit in (None, state.unit):
        return None
    asked = f"a movement in {unit}" if unit else MOTION_WORDS[type(motion)]
    return refuse(
        Reason.WRONG_KIND,
        f"{state.name}: {asked} does not fit: the axis is {state.kind}; {cls.advice}",
        axis=state.name,
        unit=state.unit,
    )


def _step_range(motion: Motion, state: PositionerState) -> MoveVerdict | None:
    if not isinstance(motion, Step):
        return None
    checks = (
        ("steps", motion.steps, -state.most_steps, state.most_steps, "steps"),
        ("amplitude", motion.amplitude_v, *state.amplitude_range_v, "V"),
        ("frequency", motion.frequency_hz, *state.frequency_range_hz, "Hz"),
    )
    for what, value, low, high, unit in checks:
        if not low <= value <= high:
            return refuse(
                Reason.LIMIT,
                f"{state.name}: {what} {value:g} {unit} is outside {low:g} to {high:g} {unit}",
                axis=state.name,
                value=float(value),
                limit=float(high if value > high else low),
                unit=unit,
            )
    return None


def _device(state: PositionerState) -> MoveVerdict | None:
    if state.present:
        return None
    why = state.error or "its device does not answer"
    return refuse(Reason.DEVICE, f"{state.name}: {why}", axis=state.name)


def _position_unknown(state: PositionerState, *, consent: bool) -> MoveVerdict | None:
    if state.kind is PositionerKind.OPEN_LOOP or consent:
        return None
    if state.confidence is not Confidence.UNKNOWN:
        return None
    found = state.positioner
    why = "its position is unknown; initialise the platform, or give consent"
    if found is not None and found.reference is ReferenceKind.NONE:
        why = "its position is unknown, and it has no reference to look for; give consent"
    return refuse(Reason.POSITION_UNKNOWN, f"{state.name}: {why}", axis=state.name)


def _stale(state: PositionerState, age_s: float, rules: Limits) -> MoveVerdict | None:
    if state.kind is PositionerKind.OPEN_LOOP:
        return None
    if state.position is None:
        return refuse(
            Reason.NO_ANSWER, f"{state.name}: no position has been read yet", axis=state.name
        )
    if age_s <= rules.stale_s:
        return None
    return refuse(
        Reason.NO_ANSWER,
        f"{state.name}: its position was last read {age_s:.1f} s ago; is the device connected?",
        axis=state.name,
    )


def _limit(
    motion: Motion,
    state: PositionerState,
    target: float | None,
    held: Interval | None,
    rules: Limits,
) -> MoveVerdict | None:
    travel = rules.counted.get(state.name)
    if travel is not None and isinstance(motion, Step):
        travelled = motion.steps * travel.step_um * motion.amplitude_v / AMPLITUDE_V[1]
        return travel.refuse_beyond(state, travelled, held)
    if state.limits is None:
        return None
    low, high = state.limits
    if target is None:
        if not isinstance(motion, Step):
            return None
        stands = 0.0 if state.position is None else state.position
        place = Interval(stands, stands)
        if held is not None:
            place = place.union(held)
        swept = swept_interval(motion, state, None, place, rules)
        target = swept.high if motion.steps > 0 else swept.low
    if low - ROUNDING <= target <= high + ROUNDING or _returns(state, target):
        return None
    value, limit = target - state.zero, (high if target > high else low) - state.zero
    what = "could reach" if isinstance(motion, Step) else "target"
    return refuse(
        Reason.LIMIT,
        f"{state.name}: {what} {format_quantity(value, state.unit)} is outside its limit "
        f"{format_quantity(limit, state.unit)}",
        axis=state.name,
        value=value,
        limit=limit,
        unit=state.unit,
    )


STILL: Final = {"um": 0.1, "deg": 0.001}
"""By unit: a reading that changed by less says that the axis stands."""


class Request(NamedTuple):
    """One axis' part of a query to the gate."""

    axis: str
    motion: Motion
    token: str
    consent: bool = False
    alone: bool = False
    """Move it without the axes that it is linked to."""
    guard: Guard | None = None
    """What watches over a command of another process; None for those of this one."""


@dataclass(frozen=True, slots=True)
class PlatformSnapshot:
    """What the pure part of the gate looks at: the platform at one moment.

    Attributes
    ----------
    held : mapping of Interval
        What axes in flight may sweep.
    begun_at : mapping of (float or None)
        Where axes in flight stood before; None where that was not known.
    headings : mapping of int
        Which way axes in flight go, 1 or -1; those are left out that may go either way.
    regions : mapping of Interval
        Where axes may be whose position is unknown.
    links : mapping of frozenset of str
        By axis, those that must move with it.
    token, holder : str
        Of this process while it may move, otherwise empty; and who may.
    """

    stop_reason: str | None
    token: str
    states: Mapping[str, PositionerState]
    held: Mapping[str, Interval]
    targets: Mapping[str, float]
    now_wall_s: float
    rules: Limits
    begun_at: Mapping[str, float | None] = field(default_factory=dict)
    headings: Mapping[str, int] = field(default_factory=dict)
    regions: Mapping[str, Interval] = field(default_factory=dict)
    links: Mapping[str, frozenset[str]] = field(default_factory=dict)
    holder: str = "somebody else"

    def place(self, state: PositionerState) -> Interval:
        """Return where an axis may be, if nobody moves it."""
        place = self.held.get(state.name)
        if state.confidence is Confidence.UNKNOWN:
            region = self.regions.get(state.name, EVERYWHERE)
            return region if place is None else region.union(place)
        if state.position is None:
            return EVERYWHERE
        here = Interval(state.position, state.position)
        return here if place is None else here.union(place)


@dataclass(frozen=True, slots=True)
class Decision:
    """The gate's answer with what it would reserve.

    Attributes
    ----------
    straight : bool
        It is allowed along a straight line only.
    """

    verdict: MoveVerdict
    intervals: Mapping[str, Interval]
    targets: Mapping[str, float]
    headings: Mapping[str, int]
    straight: bool = False


def check_move(
    requests: Sequence[Request],
    snapshot: PlatformSnapshot,
    checker: CollisionChecker,
    *,
    advice: bool = True,
    line: StraightLine | None = None,
) -> Decision:
    """Decide several movements together; pure: state in, answer out, nothing else touched.

    Parameters
    ----------
    line : StraightLine or None
        Where it is not clear for the axes in any order, they can keep to this line.
    """
    planned = _planned(requests, snapshot)
    if not planned.verdict.allowed:
        return planned
    check = partial(checker.check, advice=advice and line is None)
    verdict = _clear_of_everything(planned, snapshot, check)
    straight = False
    if line is not None and verdict.reason is Reason.COLLISION:
        along = partial(check_line, line, check=partial(checker.check, advice=False))
        verdict = _clear_of_everything(planned, snapshot, along)
        straight = verdict.allowed
    intervals = planned.intervals if verdict.allowed else {}
    return replace(planned, verdict=verdict, intervals=intervals, straight=straight)


def check_move_promptly(
    requests: Sequence[Request], snapshot: PlatformSnapshot, checker: CollisionChecker
) -> Decision | None:
    """Decide as `check_move` where that takes a few milliseconds at most; None where it may not."""
    planned = _planned(requests, snapshot)
    if not planned.verdict.allowed:
        return planned
    verdict = _clear_of_everything(planned, snapshot, checker.check_promptly)
    if verdict is None or not verdict.allowed:
        return None if verdict is None else replace(planned, verdict=verdict, intervals={})
    return replace(planned, verdict=verdict)


def _planned(requests: Sequence[Request], snapshot: PlatformSnapshot) -> Decision:
    """Return what the rules say, and what would be swept; the bodies are not looked at yet."""
    intervals: dict[str, Interval] = {}
    targets: dict[str, float] = {}
    headings = dict(snapshot.headings)
    asked = {request.axis for request in requests}
    for request in requests:
        verdict = _first_refusal(request, snapshot)
        if verdict is None:
            verdict = _torn_apart(request, asked, snapshot)
        if verdict is not None:
            return Decision(verdict, {}, {}, {})
        state = snapshot.states[request.axis]
        target = planned_target(request.motion, state, snapshot.targets.get(request.axis))
        if target is not None:
            targets[request.axis] = target
        place = snapshot.place(state)
        travelled = heading(request.motion, state, target)
        headings.pop(request.axis, None)
        if travelled is not None:
            headings[request.axis] = travelled
        intervals[request.axis] = swept_interval(
            request.motion, state, target, place, snapshot.rules
        )
    return Decision(ALLOWED, intervals, targets, headings)


def still_true(requests: Sequence[Request], then: PlatformSnapshot, now: PlatformSnapshot) -> bool:
    """Return whether what was checked by the snapshot `then` may be done by the snapshot `now`.

    Axes in flight may go on within what they hold; nothing else may have changed. Stops are
    counted by the reservations.
    """
    if (then.token, then.links) != (
        now.token,
        now.links,
    ) or then.states.keys() != now.states.keys():
        return False
    if any(_no_right(request, now) for request in requests):
        return False
    return all(
        _unchanged(state, now.states[name], then, now) for name, state in then.states.items()
    )


def _unchanged(
    then: PositionerState, now: PositionerState, old: PlatformSnapshot, new: PlatformSnapshot
) -> bool:
    known = then.present, then.confidence, then.limits, then.std, then.position is None
    if known != (now.present, now.confidence, now.limits, now.std, now.position is None):
        return False
    sensed = now.kind is not PositionerKind.OPEN_LOOP
    if sensed and now.present and new.now_wall_s - now.read_wall_s > new.rules.stale_s:
        return False
    if then.position is None or now.position is None:
        return True
    place, off = old.place(then), STILL[now.unit]
    return place.low - off <= now.position <= place.high + off


def _first_refusal(request: Request, snapshot: PlatformSnapshot) -> MoveVerdict | None:
    axis = request.axis
    if snapshot.stop_reason is not None:
        return refuse(
            Reason.STOPPED,
            f"{axis}: motion is stopped ({snapshot.stop_reason}); reset the stop first",
            axis=axis,
        )
    no_right = _no_right(request, snapshot)
    if no_right:
        return refuse(Reason.NO_LEASE, f"{axis}: {no_right}", axis=axis)
    state = snapshot.states.get(axis)
    if state is None:
        return refuse(Reason.DEVICE, f"{axis}: there is no such axis", axis=axis)
    return check_axis(
        request.motion,
        state,
        consent=request.consent,
        running_target=snapshot.targets.get(axis),
        held=snapshot.held.get(axis),
        age_s=snapshot.now_wall_s - state.read_wall_s,
        rules=snapshot.rules,
    )


def _no_right(request: Request, snapshot: PlatformSnapshot) -> str:
    """Return why whoever asks may not move anything; empty when they may."""
    if request.guard is not None:
        return request.guard.why if request.guard.expired else ""
    if request.token and request.token == snapshot.token:
        return ""
    return (
        f"{snapshot.holder} controls the platform now; take over in the window, "
        "or wait until it is released"
    )


def _torn_apart(
    request: Request, asked: Collection[str], snapshot: PlatformSnapshot
) -> MoveVerdict | None:
    """Return why an axis must not move without those that it is linked to, or None."""
    missing = snapshot.links.get(request.axis, frozenset()).difference(asked)
    if request.alone or not missing:
        return None
    return refuse(
        Reason.WRONG_KIND,
        f"{request.axis}: it is linked to {', '.join(sorted(missing))} and does not move alone; "
        "move it to or by a position, or unlink it first",
        axis=request.axis,
    )


def _clear_of_everything(
    planned: Decision, before: PlatformSnapshot, check: Callable[[Spans], Answer]
) -> Answer | MoveVerdict:
    snapshot = replace(before, headings=planned.headings)
    spans = {
        name: span_of(state, planned.intervals.get(name), snapshot)
        for name, state in snapshot.states.items()
    }
    try:
        verdict = check(spans)
    except Exception:  # a check that cannot answer says no
        logger.exception("the collision check failed")
        return refuse(
            Reason.NO_ANSWER, "the collision check failed; nothing was moved (see the log)"
        )
    return verdict


def span_of(state: PositionerState, asked: Interval | None, snapshot: PlatformSnapshot) -> AxisSpan:
    """Return where an axis may be from now on, for the collision model."""
    moving = asked is not None or state.name in snapshot.held
    sensed = state.kind is not PositionerKind.OPEN_LOOP
    fresh = not sensed or snapshot.now_wall_s - state.read_wall_s <= snapshot.rules.stale_s
    sure = state.present and fresh and (moving or state.activity.at_rest)
    place = asked or (snapshot.place(state) if sure else EVERYWHERE)
    now = origin(state, snapshot.begun_at) if sure else None
    travelled = snapshot.headings.get(state.name) if moving else None
    if travelled is not None and now is not None:
        now = state.position  # what lies behind it, it does not go to again
    estimated = state.confidence is Confidence.ESTIMATED
    counted = estimated and state.name in snapshot.rules.counted and math.isfinite(state.std)
    return AxisSpan(
        place.low,
        place.high,
        now,
        moving=moving,
        estimated=estimated,
        heading=travelled if now is not None else None,
        spread=TIMES_STD * state.std if counted else None,
    )


def origin(state: PositionerState, begun_at: Mapping[str, float | None]) -> float | None:
    """Return where an axis stands, or stood before its movement began; None where unknown."""
    if state.confidence is Confidence.UNKNOWN:
        return None
    return begun_at.get(state.name, state.position)
