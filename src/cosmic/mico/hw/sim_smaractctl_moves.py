"""The movements of a channel of the simulated MCS2, each planned as a whole when it starts."""

import math
from collections.abc import Callable
from typing import Final

from cosmic.mico.hw import smaractctl_ctypes as sa
from cosmic.mico.hw.sim_smaractctl_channel import SLICES, Channel, stalled
from cosmic.mico.hw.sim_smaractctl_types import TYPE_NAMES, Phase, Refused, Turn
from cosmic.twin.stage import Route

MOST_STEPS: Final = 100_000
FARTHEST: Final = 10**14
"""No target lies farther away, pm or n-degree."""
FULL_SCAN: Final = 65_535
RESIDUAL_PART: Final = 0.15
"""With its speed controlled, a stage ends so much nearer than its target threshold."""
FOR_EVER_MS: Final = -1


def move(channel: Channel, now_s: float, value: int) -> None:
    """Make the movement that the mode of the channel says; raises `Refused`."""
    mode = channel.value(sa.SA_CTL_PKEY_MOVE_MODE)
    _MODES[mode](channel, now_s, value)


def _absolute(channel: Channel, now_s: float, value: int) -> None:
    channel.require_sensor()
    if channel.value(sa.SA_CTL_PKEY_CONTROL_LOOP_INPUT) == sa.SA_CTL_CONTROL_LOOP_INPUT_DISABLED:
        raise Refused(sa.SA_CTL_ERROR_CONTROL_LOOP_INPUT_DISABLED)
    _drive(channel, now_s, value)


def _relative(channel: Channel, now_s: float, value: int) -> None:
    channel.require_sensor()
    options = channel.value(sa.SA_CTL_PKEY_POSITIONER_CONTROL_OPTIONS)
    here = channel.counts(now_s)
    fresh = options & sa.SA_CTL_POS_CTRL_OPT_BIT_ACC_REL_POS_DIS or value == 0
    base = here if fresh or channel.target is None else channel.target
    _absolute(channel, now_s, base + value)


def _within_range(channel: Channel, now_s: float, target: int) -> int:
    """Return the target, or the border of the range that lies before it."""
    low = channel.value(sa.SA_CTL_PKEY_RANGE_LIMIT_MIN)
    high = channel.value(sa.SA_CTL_PKEY_RANGE_LIMIT_MAX)
    if high <= low or low <= target <= high:
        return target
    here = channel.logical(channel.stage.position(now_s))
    border = min(max(target, low), high)
    # Beyond the border already: outward nothing moves.
    return here if (here - border) * (target - border) > 0 else border


def _range_limit_reached(time_s: float) -> Turn:
    """Return the end of a movement at the border of the range that is set."""
    return Turn(
        time_s,
        Phase.STOPPED,
        result=sa.SA_CTL_ERROR_RANGE_LIMIT_REACHED,
        marks=sa.SA_CTL_CH_STATE_BIT_RANGE_LIMIT_REACHED,
    )


def _drive(channel: Channel, now_s: float, wanted: int) -> None:
    if abs(wanted) > FARTHEST:
        raise Refused(sa.SA_CTL_ERROR_INVALID_PARAMETER)
    target = _within_range(channel, now_s, wanted)
    route = channel.begin(now_s)
    channel.target = wanted
    goal = channel.position(target)
    channel.obstruct_if_faulty(route.position, goal)
    low, high = channel.stage.bounds
    threshold = channel.stage.kind.target_threshold
    if low - threshold <= goal <= high + threshold:
        goal = min(max(goal, low), high)
    lagging_s = _lag_time_s(channel, goal - route.position)
    arrived = glide(channel, route, goal)
    start = Turn(now_s, Phase.MOVING)
    if lagging_s is not None and now_s + lagging_s < route.end_s:
        _fall_behind(channel, route, start, now_s + lagging_s)
    elif not arrived:
        route.wait(channel.settings.stall_s)
        channel.launch(route, [start, stalled(route.end_s)], now_s=now_s, held_until_s=route.end_s)
    elif target != wanted:
        over = _range_limit_reached(route.end_s)
        channel.launch(route, [start, over], now_s=now_s, held_until_s=route.end_s)
    else:
        part = RESIDUAL_PART if channel.velocity > 0.0 else 1.0
        residual = channel.random.uniform(-threshold, threshold) * part
        settings = channel.settings
        settle_s = channel.random.uniform(settings.settle_low_s, settings.settle_high_s)
        route.settle(goal + residual, settle_s)
        arrive(channel, route, start)


def _lag_time_s(channel: Channel, travel: float) -> float | None:
    """Return after which time the stage lags too far behind its setpoint; None: it does not."""
    limit = channel.value(sa.SA_CTL_PKEY_FOLLOWING_ERROR_LIMIT)
    behind = channel.velocity - channel.step_speed(1 if travel > 0.0 else -1)
    if limit == 0 or behind <= 0.0:
        return None
    lag = abs(channel.position(limit) - channel.position(0))
    return lag / behind if abs(travel) > lag else None


def _fall_behind(channel: Channel, route: Route, start: Turn, time_s: float) -> None:
    mark = sa.SA_CTL_CH_STATE_BIT_FOLLOWING_LIMIT_REACHED
    event = sa.SA_CTL_EVENT_FOLLOWING_ERR_LIMIT
    options = channel.value(sa.SA_CTL_PKEY_POSITIONER_CONTROL_OPTIONS)
    if not options & sa.SA_CTL_POS_CTRL_OPT_BIT_STOP_ON_FOLLOWING_ERR:
        behind = Turn(time_s, Phase.MOVING, marks=mark, event=event)
        arrive(channel, route, start, between=[behind])
        return
    over = Turn(
        time_s,
        Phase.STOPPED,
        result=sa.SA_CTL_ERROR_FOLLOWING_ERR_LIMIT,
        marks=mark,
        event=event,
        then=lambda: channel.halt(time_s),
    )
    channel.launch(route, [start, over], now_s=start.time_s, held_until_s=route.end_s)


def glide(channel: Channel, route: Route, goal: float) -> bool:
    """Go to `goal` as speed and acceleration say; False when something stood in the way."""
    gap = goal - route.position
    step_speed = channel.step_speed(1 if gap > 0.0 else -1)
    if channel.velocity <= 0.0:
        kind = channel.stage.kind
        near = math.copysign(min(kind.slow_zone, abs(gap)), gap)
        return route.go(goal - near, step_speed) and route.go(goal, step_speed * kind.slow_factor)
    top = min(channel.velocity, step_speed)
    rate = channel.acceleration
    if rate <= 0.0 or gap == 0.0:
        return route.go(goal, top)
    # All ramps take the same share of the way, so that axes with matched speeds stay in line.
    top = min(top, math.sqrt(rate * abs(gap)))
    start, slice_s = route.position, top / rate / SLICES
    direction = math.copysign(1.0, gap)
    speeds = [top * (number + 0.5) / SLICES for number in range(SLICES)]
    for speed in speeds:
        if not route.go(route.position + direction * speed * slice_s, speed):
            return False
    ramp = abs(route.position - start)
    legs = [(goal - direction * ramp, top)]
    for speed in reversed(speeds):
        legs.append((legs[-1][0] + direction * speed * slice_s, speed))
    legs[-1] = (goal, speeds[0])
    return all(route.go(target, speed) for target, speed in legs)


def arrive(
    channel: Channel,
    route: Route,
    start: Turn,
    *,
    between: list[Turn] | None = None,
    then: Callable[[], None] | None = None,
) -> None:
    """Start a movement that ends well, and hold there for the time that is set."""
    hold_ms = channel.value(sa.SA_CTL_PKEY_HOLD_TIME)
    end_s = route.end_s
    held_until_s = end_s
    phase = Phase.HOLDING if hold_ms else Phase.STOPPED
    turns = [start, *(between or ())]
    turns.append(Turn(end_s, phase, result=sa.SA_CTL_ERROR_NONE, then=then))
    if hold_ms == FOR_EVER_MS:
        held_until_s = math.inf
    elif hold_ms:
        held_until_s = end_s + hold_ms / 1e3
        turns.append(Turn(held_until_s, Phase.STOPPED))
    channel.launch(route, turns, now_s=start.time_s, held_until_s=held_until_s)


def _step(channel: Channel, now_s: float, value: int) -> None:
    if abs(value) > MOST_STEPS:
        raise Refused(sa.SA_CTL_ERROR_INVALID_PARAMETER)
    route = channel.begin(now_s)
    channel.target = None
    volts = channel.value(sa.SA_CTL_PKEY_STEP_AMPLITUDE) / FULL_SCAN * 100.0
    hertz = channel.value(sa.SA_CTL_PKEY_STEP_FREQUENCY)
    travel = channel.stage.noisy_steps(value, volts)
    duration_s = abs(value) / hertz
    channel.obstruct_if_faulty(route.position, route.position + travel)
    goal = route.position + travel
    border = _border_of_range(channel, now_s, goal)
    arrived = not travel or route.go(goal if border is None else border, abs(travel) / duration_s)
    over = Turn(now_s + duration_s, Phase.STOPPED, result=sa.SA_CTL_ERROR_NONE)
    if border is not None and arrived:
        over = _range_limit_reached(route.end_s)
    # At a stop the slider slips: the steps run out where it stands.
    route.wait(max(over.time_s - route.end_s, 0.0))
    turns = [Turn(now_s, Phase.OPEN_LOOP), over]
    channel.launch(route, turns, now_s=now_s, held_until_s=over.time_s)


def _border_of_range(channel: Channel, now_s: float, goal: float) -> float | None:
    """Return where the range that is set ends before `goal`; None where it does not."""
    if not (channel.sensor_present and channel.sensor_on):
        return None  # nobody knows where it is
    wanted = channel.logical(goal)
    target = _within_range(channel, now_s, wanted)
    return None if target == wanted else channel.position(target)


def _scan_to(channel: Channel, now_s: float, value: int) -> None:
    if not 0 <= value <= FULL_SCAN:
        raise Refused(sa.SA_CTL_ERROR_INVALID_PARAMETER)
    route = channel.begin(now_s)
    channel.target = None
    change = value - channel.scan
    duration_s = abs(change) / channel.value(sa.SA_CTL_PKEY_SCAN_VELOCITY)
    travel = change / FULL_SCAN * channel.stage.kind.step_at_100v
    if travel:
        route.go(route.position + travel, abs(travel) / duration_s)
    channel.scan = value
    turns = [
        Turn(now_s, Phase.OPEN_LOOP),
        Turn(now_s + duration_s, Phase.STOPPED, result=sa.SA_CTL_ERROR_NONE),
    ]
    channel.launch(route, turns, now_s=now_s, held_until_s=now_s + duration_s)


def _scan_by(channel: Channel, now_s: float, value: int) -> None:
    if abs(value) > FULL_SCAN:
        raise Refused(sa.SA_CTL_ERROR_INVALID_PARAMETER)
    _scan_to(channel, now_s, min(max(channel.scan + value, 0), FULL_SCAN))


def reference(channel: Channel, now_s: float) -> None:
    """Find the reference; raises `Refused`."""
    channel.require_sensor()
    if not channel.calibrated:
        raise Refused(sa.SA_CTL_ERROR_NOT_CALIBRATED)
    kind = TYPE_NAMES.get(channel.type_code, TYPE_NAMES[300]).reference
    route = channel.begin(now_s)
    speed = channel.step_speed(1) * channel.settings.reference_speed_factor
    if channel.velocity > 0.0:
        speed = min(speed, channel.velocity)
    origin = _FIND[kind](channel, route, speed)
    start = Turn(now_s, Phase.REFERENCING)
    if origin is None:
        route.wait(channel.settings.stall_s)
        channel.launch(route, [start, stalled(route.end_s)], now_s=now_s, held_until_s=route.end_s)
        return
    end = route.position
    zero = channel.value(sa.SA_CTL_PKEY_REFERENCING_OPTIONS) & sa.SA_CTL_REF_OPT_BIT_AUTO_ZERO

    def found() -> None:
        channel.find_reference(origin)
        if zero:
            channel.values[sa.SA_CTL_PKEY_LOGICAL_SCALE_OFFSET] = 0
            channel.find_reference(origin)
        channel.target = channel.logical(end)

    event = sa.SA_CTL_EVENT_REFERENCE_FOUND
    mark = Turn(route.end_s, Phase.REFERENCING, event=event, then=found)
    arrive(channel, route, start, between=[mark])


def _safe_stop(channel: Channel) -> float:
    backward = channel.value(sa.SA_CTL_PKEY_SAFE_DIRECTION)
    return channel.stage.kind.low if backward else channel.stage.kind.high


def _find_end_stop(channel: Channel, route: Route, speed: float) -> float | None:
    stop = _safe_stop(channel)
    route.go(stop, speed)
    route.wait(channel.settings.stall_s)
    error = channel.random.uniform(0.0, channel.stage.kind.reference_repeatability)
    inward = -error if stop == channel.stage.kind.high else error
    route.settle(route.position + inward, channel.settings.settle_low_s)
    return route.position


def _find_mark(channel: Channel, route: Route, speed: float) -> float | None:
    kind = channel.stage.kind
    error = channel.random.uniform(-0.5, 0.5) * kind.reference_repeatability
    options = channel.value(sa.SA_CTL_PKEY_REFERENCING_OPTIONS)
    backward = options & sa.SA_CTL_REF_OPT_BIT_START_DIR
    mark = kind.reference_mark + error
    low, high = _ends(channel)
    first, second = (low, high) if backward else (high, low)
    if not min(route.position, first) <= mark <= max(route.position, first):
        # Nothing on the way there: turn round, once.
        route.go(first, speed)
        if options & sa.SA_CTL_REF_OPT_BIT_ABORT_ON_ENDSTOP:
            return None
        route.wait(channel.settings.stall_s)
        if not low <= mark <= high:
            route.go(second, speed)
            return None
    return route.position if route.go(mark, speed) else None


def _ends(channel: Channel) -> tuple[float, float]:
    """Return between which positions a reference is looked for: end stops, or the range set."""
    kind = channel.stage.kind
    low = channel.value(sa.SA_CTL_PKEY_RANGE_LIMIT_MIN)
    high = channel.value(sa.SA_CTL_PKEY_RANGE_LIMIT_MAX)
    if high <= low:
        return kind.low, kind.high
    ends = sorted((channel.position(low), channel.position(high)))
    return max(ends[0], kind.low), min(ends[1], kind.high)


def _find_coded_marks(channel: Channel, route: Route, speed: float) -> float | None:
    backward = channel.value(sa.SA_CTL_PKEY_REFERENCING_OPTIONS) & sa.SA_CTL_REF_OPT_BIT_START_DIR
    return channel.find_coded_marks(route, speed, forward=not backward)


_FIND: Final[dict[int, Callable[[Channel, Route, float], float | None]]] = {
    sa.SA_CTL_REF_TYPE_END_STOP: _find_end_stop,
    sa.SA_CTL_REF_TYPE_SINGLE_CODED: _find_mark,
    sa.SA_CTL_REF_TYPE_DISTANCE_CODED: _find_coded_marks,
}


def calibrate(channel: Channel, now_s: float) -> None:
    """Go out and back both ways to learn the sensor's signals; raises `Refused`."""
    channel.require_sensor()
    route = channel.begin(now_s)
    kind = channel.stage.kind
    speed = channel.step_speed(1) * channel.settings.calibration_speed_factor
    options = channel.value(sa.SA_CTL_PKEY_CALIBRATION_OPTIONS)
    sign = -1.0 if options & sa.SA_CTL_CALIB_OPT_BIT_DIRECTION else 1.0
    middle, span = route.position, sign * kind.calibration_span
    free = route.go(middle + span, speed) and route.go(middle - span, speed)
    free = free and route.go(middle, speed)
    start = Turn(now_s, Phase.CALIBRATING)
    if not free:
        route.wait(channel.settings.stall_s)
        channel.launch(route, [start, stalled(route.end_s)], now_s=now_s, held_until_s=route.end_s)
        return

    def learnt() -> None:
        channel.calibrated = True

    over = Turn(route.end_s, Phase.STOPPED, result=sa.SA_CTL_ERROR_NONE, then=learnt)
    channel.launch(route, [start, over], now_s=now_s, held_until_s=route.end_s)


_MODES: Final[dict[int, Callable[[Channel, float, int], None]]] = {
    sa.SA_CTL_MOVE_MODE_CL_ABSOLUTE: _absolute,
    sa.SA_CTL_MOVE_MODE_CL_RELATIVE: _relative,
    sa.SA_CTL_MOVE_MODE_SCAN_ABSOLUTE: _scan_to,
    sa.SA_CTL_MOVE_MODE_SCAN_RELATIVE: _scan_by,
    sa.SA_CTL_MOVE_MODE_STEP: _step,
}
