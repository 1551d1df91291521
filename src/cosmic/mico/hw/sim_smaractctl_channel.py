"""State of one channel of the simulated MCS2: what it does, when that changes, what it keeps."""

import math
import random
from collections import deque
from collections.abc import Callable
from typing import Final

from typing_extensions import override

from cosmic.mico.hw import smaractctl_ctypes as sa
from cosmic.mico.hw.sim_device import SimulatedChannel
from cosmic.mico.hw.sim_faults import Faults
from cosmic.mico.hw.sim_smaractctl_types import COUNTS, Phase, Refused, Turn, type_like
from cosmic.twin.scene import AtPowerUp
from cosmic.twin.settings import ControllerSettings
from cosmic.twin.stage import Route, Stage

SLICES: Final = 8
"""A ramp of the speed is so many straight pieces of the stage's path."""
NOTHING_MOVES: Final = (Phase.STOPPED, Phase.HOLDING)
_STOPPED_MARKS: Final = (
    sa.SA_CTL_CH_STATE_BIT_END_STOP_REACHED
    | sa.SA_CTL_CH_STATE_BIT_RANGE_LIMIT_REACHED
    | sa.SA_CTL_CH_STATE_BIT_FOLLOWING_LIMIT_REACHED
)
_INT64: Final = 2**63 - 1


class Channel(SimulatedChannel):
    """One channel; everything is called with its library's lock held.

    Parameters
    ----------
    device, index : int
        Its address along the wiring.
    stage : Stage
        What hangs on it.
    memory : AtPowerUp
        What it knows of the stage when the library is loaded.
    post : callable
        Takes the type of an event, the channel, its value and the time at which it is sent, s.

    Attributes
    ----------
    values : dict of int
        Properties that are stored and nothing else, by key.
    """

    def __init__(
        self,
        device: int,
        index: int,
        stage: Stage,
        memory: AtPowerUp,
        *,
        settings: ControllerSettings,
        faults: Faults,
        seed: int,
        now_s: float,
        post: Callable[[int, int, int, float], None],
    ) -> None:
        own = random.Random(f"mcs2 {device}.{index} {seed}")
        super().__init__(device, index, stage, settings=settings, faults=faults, random=own)
        self._post = post
        self._per_unit = COUNTS[stage.unit]
        self.type_code = type_like(stage.kind.positioner_type, stage.unit)
        self.calibrated = memory.calibrated
        self.values: dict[int, int] = {
            sa.SA_CTL_PKEY_SAFE_DIRECTION: int(not memory.safe_forward),
            sa.SA_CTL_PKEY_LOGICAL_SCALE_OFFSET: round(memory.scale * self._per_unit),
        }
        self.phase = Phase.STOPPED
        self.marks = 0
        self.error = 0
        self.referenced = False
        self.target: int | None = None
        self.scan = 0
        self.max_error = 0
        self._sign = 1
        self._shift = 0.0
        self._origin = 0.0
        self._lost_at: int | None = None
        self._turns: deque[Turn] = deque()
        self._ramping = False
        self.show(now_s, 0)
        if memory.known:
            self.find_reference(memory.scale)

    # What it is

    def value(self, key: int) -> int:
        """Return a stored property, 0 where none was stored."""
        return self.values.get(key, 0)

    @property
    def sensor_present(self) -> bool:
        """Whether a sensor answers."""
        return self.stage.kind.sensor and self._lost_at is None

    @property
    def sensor_on(self) -> bool:
        """Whether the sensor has power."""
        return self.value(sa.SA_CTL_PKEY_SENSOR_POWER_MODE) != sa.SA_CTL_SENSOR_MODE_DISABLED

    @property
    def amplifier_on(self) -> bool:
        """Whether anything can move."""
        return bool(self.value(sa.SA_CTL_PKEY_AMPLIFIER_ENABLED))

    def require_sensor(self) -> None:
        """Refuse what needs a sensor where there is none, or where it is off."""
        if not self.sensor_present:
            raise Refused(sa.SA_CTL_ERROR_NO_SENSOR_PRESENT)
        if not self.sensor_on:
            raise Refused(sa.SA_CTL_ERROR_SENSOR_DISABLED)

    @property
    def state(self) -> int:
        """Its state as the library answers it."""
        bits = int(self.phase) | self.marks
        for bit, given in (
            (sa.SA_CTL_CH_STATE_BIT_AMPLIFIER_ENABLED, self.amplifier_on),
            (sa.SA_CTL_CH_STATE_BIT_SENSOR_PRESENT, self.sensor_present),
            (sa.SA_CTL_CH_STATE_BIT_IS_CALIBRATED, self.calibrated),
            (sa.SA_CTL_CH_STATE_BIT_IS_REFERENCED, self.referenced),
            (sa.SA_CTL_CH_STATE_BIT_OVER_TEMPERATURE, self.fault("overheated")),
        ):
            bits |= bit if given else 0
        return bits

    # The scale: physical position to counts

    def counts(self, now_s: float) -> int:
        """Return the position as the controller answers it; raises `Refused` without a sensor."""
        self.require_sensor()
        return self.logical(self.stage.position(now_s))

    def logical(self, position: float) -> int:
        """Return what the scale shows at a true position of the stage."""
        counts = round((self._sign * position + self._shift) * self._per_unit)
        return max(-_INT64 - 1, min(_INT64, counts))

    def position(self, counts: int) -> float:
        """Return the true position at which the scale shows `counts`."""
        return self._sign * (counts / self._per_unit - self._shift)

    def show(self, now_s: float, counts: int) -> None:
        """Shift the scale so that it shows `counts` where the stage stands."""
        here = self.stage.position(now_s)
        self._shift = counts / self._per_unit - self._sign * here
        self.target = counts
        if self.referenced:
            offset = round((self._sign * self._origin + self._shift) * self._per_unit)
            self.values[sa.SA_CTL_PKEY_LOGICAL_SCALE_OFFSET] = offset

    def find_reference(self, origin: float) -> None:
        """Take `origin` as the place of the reference; the stored offset acts from now on."""
        self._origin = origin
        self._sign = -1 if self.value(sa.SA_CTL_PKEY_LOGICAL_SCALE_INVERSION) else 1
        self.referenced = True
        offset = self.value(sa.SA_CTL_PKEY_LOGICAL_SCALE_OFFSET)
        self._shift = offset / self._per_unit - self._sign * origin

    def rescale(self) -> None:
        """Let a new offset or inversion act; without a reference it waits for one."""
        if not self.referenced:
            return
        aimed = None if self.target is None else self.position(self.target)
        self.find_reference(self._origin)
        # Where it is to stand does not change, only what that is called.
        self.target = None if aimed is None else self.logical(aimed)

    def forget(self, now_s: float) -> None:
        """Lose calibration and reference, as a new positioner type makes it."""
        self.halt(now_s)
        self.calibrated = self.referenced = False

    # Speeds, in the stage's unit

    def step_speed(self, direction: int) -> float:
        """Return the speed at the closed-loop frequency limit."""
        hertz = self.value(sa.SA_CTL_PKEY_MAX_CL_FREQUENCY)
        speed = hertz * self.stage.step_size(100.0, direction)
        worn = self.velocity > 0.0 and self.fault("lagging")
        return min(speed, self.velocity / 2.0) if worn else speed

    @property
    def velocity(self) -> float:
        """The controlled speed; 0 where only the frequency limits it."""
        return self.value(sa.SA_CTL_PKEY_MOVE_VELOCITY) / self._per_unit

    @property
    def acceleration(self) -> float:
        """The controlled acceleration; 0 is none, and without a speed there is none."""
        wanted = self.value(sa.SA_CTL_PKEY_MOVE_ACCELERATION) / self._per_unit
        return wanted if self.velocity > 0.0 else 0.0

    # Time

    @property
    @override
    def next_turn_s(self) -> float:
        return self._turns[0].time_s if self._turns else math.inf

    @override
    def advance(self, now_s: float) -> None:
        turns = self._turns
        while turns and turns[0].time_s <= now_s:
            turn = turns.popleft()
            self.phase = turn.phase
            self.marks |= turn.marks
            if turn.then is not None:
                turn.then()
            if turn.event:
                self.post(turn.event, 0, turn.time_s)
            if turn.result is not None:
                self.finish(turn.result, turn.time_s)

    def post(self, event: int, value: int, time_s: float) -> None:
        """Send an event of this channel."""
        self._post(event, self.index, value, time_s)

    def finish(self, result: int, time_s: float) -> None:
        """Say how a movement ended."""
        self._ramping = False
        if result not in (sa.SA_CTL_ERROR_NONE, sa.SA_CTL_ERROR_ABORTED):
            self.error = result
            self.marks |= sa.SA_CTL_CH_STATE_BIT_MOVEMENT_FAILED
        if self.fault("lost_completed"):
            return
        for _ in range(2 if self.fault("doubled_completed") else 1):
            self.post(sa.SA_CTL_EVENT_MOVEMENT_FINISHED, result, time_s)

    # Movements

    def begin(self, now_s: float) -> Route:
        """Make way for a new movement and return its empty route; raises `Refused`."""
        if self.fault("overheated"):
            raise Refused(sa.SA_CTL_ERROR_OVER_TEMPERATURE)
        if self.fault("hv_range"):
            raise Refused(sa.SA_CTL_ERROR_POWER_SUPPLY_DISABLED)
        if not self.amplifier_on:
            raise Refused(sa.SA_CTL_ERROR_AMPLIFIER_DISABLED)
        self._turns.clear()
        self._ramping = False
        self.marks &= ~(_STOPPED_MARKS | sa.SA_CTL_CH_STATE_BIT_MOVEMENT_FAILED)
        return self.stage.route(now_s)

    def launch(self, route: Route, turns: list[Turn], *, now_s: float, held_until_s: float) -> None:
        """Start a planned movement; `turns` say what happens from now on."""
        self.stage.follow(route, held_until_s=held_until_s)
        self._turns.extend(turns)
        if self.fault("overridden"):
            self._override(now_s)
        self.advance(now_s)

    def _override(self, now_s: float) -> None:
        """Have the hand module end the movement half-way, 0.1 s from now at the latest."""
        ends = (turn.time_s for turn in self._turns if turn.result is not None)
        time_s = min((now_s + next(ends, math.inf)) / 2.0, now_s + 0.1)
        self.stage.halt(time_s, coast_s=0.0, within_s=0.0)
        kept = [turn for turn in self._turns if turn.time_s < time_s]
        over = Turn(time_s, Phase.STOPPED, result=sa.SA_CTL_ERROR_MOVEMENT_OVERRIDDEN)
        self._turns = deque([*kept, over])

    def stop(self, now_s: float) -> None:
        """Stop; the first one follows the acceleration, the second does not."""
        moving, ramps = self.phase not in NOTHING_MOVES, self.acceleration > 0.0
        self.marks &= ~_STOPPED_MARKS
        if moving and ramps and not self._ramping:
            self._ramp_down(now_s)
        elif self.phase is not Phase.STOPPED:
            ended = moving and not self._ramping
            self.halt(now_s)
            if ended:
                self.finish(sa.SA_CTL_ERROR_ABORTED, now_s)
        self.target = self.logical(self.stage.position(now_s)) if self.stage.kind.sensor else None

    def halt(self, now_s: float) -> None:
        """Stand still at once, without a word."""
        self._turns.clear()
        self.stage.halt(now_s, coast_s=0.0, within_s=self.settings.stop_finish_s)
        self.phase = Phase.STOPPED

    def _ramp_down(self, now_s: float) -> None:
        path = self.stage.path
        speed, _ = path.leg(now_s)
        travel = path.at(path.end_s) - self.stage.position(now_s)
        direction = 1.0 if travel >= 0.0 else -1.0
        route = self.stage.route(now_s)
        slice_s = speed / self.acceleration / SLICES
        for number in range(SLICES):
            mean = speed * (1.0 - (number + 0.5) / SLICES)
            route.go(route.position + direction * mean * slice_s, mean)
        self._turns.clear()
        self.stage.follow(route, held_until_s=route.end_s)
        self._turns.append(Turn(route.end_s, Phase.STOPPED))
        self.finish(sa.SA_CTL_ERROR_ABORTED, now_s)
        self._ramping = True

    # Trouble

    def interrupt(self, code: int, now_s: float) -> None:
        """End whatever goes on with an error."""
        if self.phase is not Phase.STOPPED:
            moving = self.phase not in NOTHING_MOVES
            self.halt(now_s)
            if moving:
                self.finish(code, now_s)
            else:
                self.post(sa.SA_CTL_EVENT_HOLDING_ABORTED, code, now_s)

    def meet_obstacle(self, now_s: float) -> None:
        """Run into something right now, if a movement goes on."""
        position = self.stage.position(now_s)
        ahead = self.stage.path.at(self.stage.path.end_s) - position
        if self.phase not in (Phase.MOVING, Phase.OPEN_LOOP) or ahead == 0.0:
            return
        self.stage.obstruct(position, 1 if ahead > 0.0 else -1)
        closed = self.phase is Phase.MOVING
        self.stage.halt(now_s, coast_s=0.0, within_s=0.0)
        if closed:
            self._turns.clear()
            self._turns.append(stalled(now_s + self.settings.stall_s))

    def lose_sensor(self, now_s: float) -> None:
        """Count no further."""
        if self._lost_at is None and self.stage.kind.sensor:
            self._lost_at = self.logical(self.stage.position(now_s))
            self.referenced = False
            self.post(sa.SA_CTL_EVENT_SENSOR_STATE_CHANGED, 0, now_s)
            if self.phase is not Phase.OPEN_LOOP:
                self.interrupt(sa.SA_CTL_ERROR_NO_SENSOR_PRESENT, now_s)

    @override
    def regain_sensor(self, now_s: float) -> None:
        if self._lost_at is not None:
            self.show(now_s, self._lost_at)
            self._lost_at = None
            self.post(sa.SA_CTL_EVENT_SENSOR_STATE_CHANGED, 1, now_s)


def stalled(time_s: float) -> Turn:
    """Return the end of a movement that made no progress for a while."""
    return Turn(
        time_s,
        Phase.STOPPED,
        result=sa.SA_CTL_ERROR_END_STOP_REACHED,
        marks=sa.SA_CTL_CH_STATE_BIT_END_STOP_REACHED,
    )
