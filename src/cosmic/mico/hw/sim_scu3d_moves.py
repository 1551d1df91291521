"""The movements of a simulated channel, each planned as a whole when it starts."""

import math
from collections.abc import Callable
from typing import Final

from cosmic.mico.hw.scu3d_ctypes import (
    SA_CALIBRATING_STATUS,
    SA_CALIBRATION_FAILED_ERROR,
    SA_COMMAND_NOT_SUPPORTED_ERROR,
    SA_END_STOP_REACHED_ERROR,
    SA_HOLDING_STATUS,
    SA_MOVING_STATUS,
    SA_MOVING_TO_REFERENCE_STATUS,
    SA_REFERENCING_FAILED_ERROR,
    SA_SETTING_AMPLITUDE_STATUS,
    SA_STOPPED_STATUS,
    SA_TARGETING_STATUS,
)
from cosmic.mico.hw.sim_scu3d_channel import Channel
from cosmic.mico.hw.sim_scu3d_types import Reference, Refusal, Turn
from cosmic.twin.stage import ENDLESS_S, Route

ENDLESS_STEPS: Final = 30_000
HOLD_FOR_EVER_MS: Final = 60_000


def step(
    channel: Channel, now_s: float, steps: int, *, amplitude_dv: int, frequency_hz: int
) -> None:
    """Make `steps` steps without looking at a sensor; 30000 go on for ever, 0 stops."""
    if steps == 0:
        channel.stop(now_s)
        return
    channel.begin(now_s)
    route = channel.stage.route(now_s)
    turns = []
    if amplitude_dv != channel.amplitude_dv:
        turns.append(Turn(now_s, SA_SETTING_AMPLITUDE_STATUS))
        route.wait(channel.settings.amplitude_setting_s)
        channel.amplitude_dv = amplitude_dv
    drive_s = route.end_s
    distance = channel.stage.noisy_steps(steps, amplitude_dv / 10.0)
    duration_s = abs(steps) / frequency_hz
    endless = abs(steps) == ENDLESS_STEPS
    if endless:
        distance, duration_s = distance * (ENDLESS_S / duration_s), ENDLESS_S
    start = route.position
    channel.obstruct_if_faulty(start, start + distance)
    route.go(start + distance, abs(distance) / duration_s)
    end_s = math.inf if endless else drive_s + duration_s
    if not endless:
        # At a stop the slider slips: the steps run out where it stands.
        route.wait(max(end_s - route.end_s, 0.0))
    turns.append(Turn(drive_s, SA_MOVING_STATUS))
    if not endless:
        turns.append(Turn(end_s, SA_STOPPED_STATUS, completed=True))
    channel.launch(
        route, turns, now_s=now_s, held_until_s=end_s, drive_s=drive_s, frequency_hz=frequency_hz
    )


def set_amplitude(channel: Channel, now_s: float, amplitude_dv: int) -> None:
    """Set the amplitude for steps; a new one stops the channel and takes some time."""
    if amplitude_dv == channel.amplitude_dv:
        return
    channel.stop(now_s)
    channel.amplitude_dv = amplitude_dv
    route = channel.stage.route(now_s)
    route.wait(channel.settings.amplitude_setting_s)
    turns = [Turn(now_s, SA_SETTING_AMPLITUDE_STATUS), Turn(route.end_s, SA_STOPPED_STATUS)]
    _launch(channel, route, turns, now_s, held_until_s=route.end_s)


def drive(channel: Channel, now_s: float, target: float, hold_ms: int) -> None:
    """Go to the true position `target` in closed loop."""
    channel.begin(now_s)
    route = channel.stage.route(now_s)
    kind, settings = channel.stage.kind, channel.settings
    channel.obstruct_if_faulty(route.position, target)
    low, high = channel.stage.bounds
    if low - channel.threshold <= target <= high + channel.threshold:
        # A stop within the target window is as good as the target.
        target = min(max(target, low), high)
    gap = target - route.position
    speed = channel.closed_loop_speed(1 if gap > 0.0 else -1)
    arrived = True
    if abs(gap) > kind.slow_zone:
        arrived = route.go(target - math.copysign(kind.slow_zone, gap), speed)
    if arrived:
        arrived = route.go(target, speed * kind.slow_factor)
    if arrived:
        residual = channel.random.uniform(-channel.threshold, channel.threshold)
        settle_s = channel.random.uniform(settings.settle_low_s, settings.settle_high_s)
        route.settle(target + residual, settle_s)
    start = Turn(now_s, SA_TARGETING_STATUS)
    if not arrived:
        _fail(channel, route, start, SA_END_STOP_REACHED_ERROR)
        return
    _arrive(channel, route, start, hold_ms)


def to_end_stop(
    channel: Channel, now_s: float, *, direction: int, hold_ms: int, auto_zero: int
) -> None:
    """Go on in `direction` (0 backward, 1 forward) until the travel ends."""
    channel.require_sensor()
    limit = channel.stage.kind.high if direction else channel.stage.kind.low
    channel.begin(now_s)
    route = channel.stage.route(now_s)
    route.go(limit, channel.closed_loop_speed(1 if direction else -1))
    route.wait(channel.settings.stall_s)
    end = route.position

    def zero() -> None:
        channel.scale.read_as(end, 0.0)

    then = zero if auto_zero else None
    _arrive(channel, route, Turn(now_s, SA_TARGETING_STATUS), hold_ms, then)


def reference(channel: Channel, now_s: float, *, hold_ms: int, auto_zero: int) -> None:
    """Find the reference, starting in the safe direction."""
    channel.require_sensor()
    if channel.reference is Reference.NONE:
        raise Refusal(SA_COMMAND_NOT_SUPPORTED_ERROR)
    if not channel.calibrated:
        raise Refusal(SA_REFERENCING_FAILED_ERROR)
    channel.begin(now_s)
    route = channel.stage.route(now_s)
    speed = channel.closed_loop_speed(1) * channel.settings.reference_speed_factor
    origin = _FIND[channel.reference](channel, route, speed)
    start = Turn(now_s, SA_MOVING_TO_REFERENCE_STATUS)
    if origin is None:
        _fail(channel, route, start, SA_REFERENCING_FAILED_ERROR)
        return
    end = route.position

    def found() -> None:
        channel.scale.reference(origin)
        if auto_zero:
            channel.scale.read_as(end, 0.0)

    _arrive(channel, route, start, hold_ms, found)


def calibrate(channel: Channel, now_s: float) -> None:
    """Go out and back both ways to learn the sensor's signals, then to the stop (type E)."""
    channel.require_sensor()
    channel.begin(now_s)
    route = channel.stage.route(now_s)
    kind = channel.stage.kind
    speed = channel.closed_loop_speed(1) * channel.settings.calibration_speed_factor
    middle, span = route.position, kind.calibration_span
    # "and" ends at the first leg that a stop cuts short.
    free = route.go(middle + span, speed) and route.go(middle - span, speed)
    free = free and route.go(middle, speed)
    start = Turn(now_s, SA_CALIBRATING_STATUS)
    if not free:
        _fail(channel, route, start, SA_CALIBRATION_FAILED_ERROR)
        return
    if channel.reference is Reference.END_STOP:
        route.go(_safe_stop(channel), speed)
        route.wait(channel.settings.stall_s)

    def learnt() -> None:
        channel.calibrated = True

    _arrive(channel, route, start, 0, learnt)


def _safe_stop(channel: Channel) -> float:
    kind = channel.stage.kind
    return kind.high if channel.safe_direction else kind.low


def _find_end_stop(channel: Channel, route: Route, speed: float) -> float | None:
    route.go(_safe_stop(channel), speed)
    route.wait(channel.settings.stall_s)
    # The stop is soft: each run ends a little before or behind the last one.
    error = channel.random.uniform(0.0, channel.stage.kind.reference_repeatability)
    landing = route.position - error if channel.safe_direction else route.position + error
    route.settle(landing, channel.settings.settle_low_s)
    return route.position


def _find_mark(channel: Channel, route: Route, speed: float) -> float | None:
    kind = channel.stage.kind
    error = channel.random.uniform(-0.5, 0.5) * kind.reference_repeatability
    mark = kind.reference_mark + error
    ahead = mark - route.position if channel.safe_direction else route.position - mark
    if ahead < 0.0:
        # Nothing in the safe direction: turn round once, at the stop.
        route.go(_safe_stop(channel), speed)
        route.wait(channel.settings.stall_s)
    return route.position if route.go(mark, speed) else None


def _find_coded_marks(channel: Channel, route: Route, speed: float) -> float | None:
    return channel.find_coded_marks(route, speed, forward=bool(channel.safe_direction))


_FIND: Final[dict[Reference, Callable[[Channel, Route, float], float | None]]] = {
    Reference.END_STOP: _find_end_stop,
    Reference.MARK: _find_mark,
    Reference.CODED_MARKS: _find_coded_marks,
}


def _arrive(
    channel: Channel,
    route: Route,
    start: Turn,
    hold_ms: int,
    then: Callable[[], None] | None = None,
) -> None:
    """Start a movement that ends well, and hold there for `hold_ms`."""
    end_s = route.end_s
    status = SA_HOLDING_STATUS if hold_ms else SA_STOPPED_STATUS
    turns = [start, Turn(end_s, status, completed=True, then=then)]
    held_until_s = end_s
    if hold_ms == HOLD_FOR_EVER_MS:
        held_until_s = math.inf
    elif hold_ms:
        held_until_s = end_s + hold_ms / 1e3
        turns.append(Turn(held_until_s, SA_STOPPED_STATUS))
    _launch(channel, route, turns, start.time_s, held_until_s=held_until_s)


def _fail(channel: Channel, route: Route, start: Turn, code: int) -> None:
    """Start a movement that ends with an error after no progress was made for a while."""
    route.wait(channel.settings.stall_s)
    turns = [start, Turn(route.end_s, SA_STOPPED_STATUS, error=code)]
    _launch(channel, route, turns, start.time_s, held_until_s=route.end_s)


def _launch(
    channel: Channel, route: Route, turns: list[Turn], now_s: float, *, held_until_s: float
) -> None:
    channel.launch(
        route,
        turns,
        now_s=now_s,
        held_until_s=held_until_s,
        drive_s=now_s,
        frequency_hz=channel.frequency_hz,
    )
