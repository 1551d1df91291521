"""The gate's checks of a single axis, as pure functions in the order they are made."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final, Self

from cosmic.frame.units import format_quantity
from cosmic.frame.verdict import MoveVerdict, Reason, refuse
from cosmic.mico.core.estimate import CountedTravel, counted_travels
from cosmic.mico.core.orders import (
    AMPLITUDE_V,
    FREQUENCY_HZ,
    LARGEST_STEPS,
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
from cosmic.mico.core.positioner import Confidence, PositionerState, class_for
from cosmic.mico.core.settings import MicoSettings
from cosmic.mico.hw.interface import Direction, PositionerKind, ReferenceKind

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
            counted=counted_travels(settings),
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
            return place.hull(Interval(target, target))
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


def _extended(place: Interval, way: float) -> Interval:
    return Interval(place.low + min(way, 0.0), place.high + max(way, 0.0))


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
            fine, text = type(motion) in MOTION_WORDS, f"{name}: {motion!r} is no movement"
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
        ("steps", motion.steps, -LARGEST_STEPS, LARGEST_STEPS, "steps"),
        ("amplitude", motion.amplitude_v, *AMPLITUDE_V, "V"),
        ("frequency", motion.frequency_hz, *FREQUENCY_HZ, "Hz"),
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
    return refuse(
        Reason.POSITION_UNKNOWN,
        f"{state.name}: its position is unknown; initialise the platform, or give consent",
        axis=state.name,
    )


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
        way = motion.steps * travel.step_um * motion.amplitude_v / AMPLITUDE_V[1]
        return travel.refuse_beyond(state, way, held)
    if state.limits is None:
        return None
    low, high = state.limits
    if target is None:
        if not isinstance(motion, Step):
            return None
        stands = 0.0 if state.position is None else state.position
        place = Interval(stands, stands)
        if held is not None:
            place = place.hull(held)
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
