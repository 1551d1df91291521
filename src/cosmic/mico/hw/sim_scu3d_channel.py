"""State of one simulated channel: what it does, when that changes, and what it remembers."""

import math
import random
from collections import deque
from collections.abc import Callable
from typing import Final

from typing_extensions import override

from cosmic.mico.hw.scu3d_ctypes import (
    SA_CALIBRATING_STATUS,
    SA_COMMAND_OVERRIDDEN_ERROR,
    SA_COMPLETED_PACKET_TYPE,
    SA_END_STOP_REACHED_ERROR,
    SA_ERROR_PACKET_TYPE,
    SA_HOLDING_STATUS,
    SA_HV_RANGE_ERROR,
    SA_MOVING_STATUS,
    SA_MOVING_TO_REFERENCE_STATUS,
    SA_NO_SENSOR_PRESENT_ERROR,
    SA_STOPPED_STATUS,
    SA_TARGETING_STATUS,
    SA_TEMP_OVERHEAT_ERROR,
)
from cosmic.mico.hw.sim_device import SimulatedChannel
from cosmic.mico.hw.sim_faults import Faults
from cosmic.mico.hw.sim_queue import Packet
from cosmic.mico.hw.sim_scu3d_scale import FINE_PER_UNIT, CountScale
from cosmic.mico.hw.sim_scu3d_types import TYPES, Movement, Reference, Refusal, Turn
from cosmic.twin.scene import AtPowerUp
from cosmic.twin.settings import ControllerSettings
from cosmic.twin.stage import Route, Stage

AT_REST: Final = (SA_STOPPED_STATUS, SA_HOLDING_STATUS)
_MOVEMENTS: Final = (
    SA_MOVING_STATUS,
    SA_TARGETING_STATUS,
    SA_CALIBRATING_STATUS,
    SA_MOVING_TO_REFERENCE_STATUS,
)


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
        Takes a packet and the time at which it is sent, s.
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
        post: Callable[[Packet, float], None],
    ) -> None:
        own = random.Random(f"channel {device}.{index} {seed}")
        super().__init__(device, index, stage, settings=settings, faults=faults, random=own)
        self._post = post
        # kept without power
        self.positioner_type = stage.kind.positioner_type
        self.safe_direction = int(memory.safe_forward)
        self.calibrated = memory.calibrated
        self.alignment = (0, 1000, 1000)
        self.default_frequency_hz = settings.closed_loop_frequency_hz
        self.advanced_stepping = 0
        fine_per_unit = FINE_PER_UNIT[stage.unit]
        self.scale = CountScale(stage.unit, round(memory.scale * fine_per_unit))
        # lost with power
        self.status = SA_STOPPED_STATUS
        self.report = 0
        self.hv_error = False
        self._lost_at: float | None = None
        self._turns: deque[Turn] = deque()
        self._movement = False
        self._drive_s = 0.0
        self._frequency_hz = 1
        self.power_cycle(now_s)
        if memory.known:
            self.scale.read_as(0.0, 0.0)
            self.scale.reference(memory.scale)

    def power_cycle(self, now_s: float) -> None:
        """Lose power and get it back: nothing moves, the position is zero and unknown."""
        self._turns.clear()
        if self.status != SA_STOPPED_STATUS:
            self.stage.halt(now_s, coast_s=0.0, within_s=0.0)
        self.status = SA_STOPPED_STATUS
        self.report = 0
        self.hv_error = False
        self.scale.power_up(self.stage.position(now_s))
        self._lost_at = None if self._lost_at is None else 0.0
        self.amplitude_dv = self.settings.amplitude_dv
        self.frequency_hz = self.default_frequency_hz
        fine = self.stage.kind.target_threshold * FINE_PER_UNIT[self.stage.unit]
        self.threshold_fine = max(1, round(fine))
        self.p_gain = self.settings.p_gain
        self.p_gain_divisor = self.settings.p_gain_divisor

    # What it is

    @property
    def moving(self) -> bool:
        """Whether a movement goes on or is about to start."""
        return self.status not in AT_REST

    @property
    def _interruptible(self) -> bool:
        # Setting an amplitude alone is no movement, hence never completed.
        return self.moving and self._movement

    @property
    def sensor_present(self) -> bool:
        """Whether a sensor answers."""
        return self.stage.kind.sensor and self._lost_at is None

    @property
    def movement(self) -> Movement:
        """How its type moves."""
        return TYPES[self.positioner_type][0]

    @property
    def reference(self) -> Reference:
        """What its type is referenced at."""
        return TYPES[self.positioner_type][1]

    @property
    def threshold(self) -> float:
        """Residual allowed after a closed-loop movement, in the stage's unit."""
        return self.threshold_fine / FINE_PER_UNIT[self.stage.unit]

    def require_sensor(self) -> None:
        """Refuse what needs a sensor where there is none."""
        if not self.sensor_present:
            raise Refusal(SA_NO_SENSOR_PRESENT_ERROR)

    def counts(self, now_s: float) -> int:
        """Return the position as the controller answers it."""
        return self.scale.counts(self.stage.position(now_s))

    def closed_loop_speed(self, direction: int) -> float:
        """Return the full speed of closed-loop movements, in the stage's unit per second."""
        alignment, forward_dv, backward_dv = self.alignment
        amplitude_dv = (forward_dv if direction > 0 else backward_dv) if alignment else 1000
        return self.frequency_hz * self.stage.step_size(amplitude_dv / 10.0, direction)

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
            self.status = turn.status
            if turn.then is not None:
                turn.then()
            if turn.error:
                self.post_error(turn.error, turn.time_s)
            elif turn.completed:
                self._post_completed(turn.time_s)

    def post_error(self, code: int, time_s: float) -> None:
        """Send an error packet."""
        self._post((SA_ERROR_PACKET_TYPE, self.index, code, 0, 0), time_s)

    def _post_completed(self, time_s: float) -> None:
        if not self.report or self.faults.find("lost_completed", self.device, self.index):
            return
        doubled = self.faults.find("doubled_completed", self.device, self.index)
        for _ in range(2 if doubled else 1):
            self._post((SA_COMPLETED_PACKET_TYPE, self.index, 0, 0, 0), time_s)

    # Movements

    def begin(self, now_s: float) -> None:
        """Make way for a new movement, or refuse it."""
        if self.hv_error:
            raise Refusal(SA_HV_RANGE_ERROR)
        if self.faults.find("overheated", self.device, self.index):
            raise Refusal(SA_TEMP_OVERHEAT_ERROR)
        # The race of an overridden movement with its own end: one COMPLETED for both, or two.
        if self._interruptible and self.random.random() < self.settings.double_completed_share:
            self._post_completed(now_s)
        self._turns.clear()

    def launch(
        self,
        route: Route,
        turns: list[Turn],
        *,
        now_s: float,
        held_until_s: float,
        drive_s: float,
        frequency_hz: int,
    ) -> None:
        """Start a planned movement.

        Parameters
        ----------
        turns : list of Turn
            What happens when, from now on.
        held_until_s : float
            Until when the stage does not creep.
        drive_s, frequency_hz : float, int
            When the first step starts, and how many follow a second.
        """
        self.stage.follow(route, held_until_s=held_until_s)
        self._turns.extend(turns)
        self._drive_s = drive_s
        self._frequency_hz = frequency_hz
        self._movement = any(turn.status in _MOVEMENTS for turn in turns)
        if self._movement and self.faults.find("overridden", self.device, self.index):
            end_s = next((t.time_s for t in turns if t.completed or t.error), math.inf)
            self._take_over(min((now_s + end_s) / 2.0, now_s + 0.1))
        self.advance(now_s)

    def _take_over(self, time_s: float) -> None:
        """Have the hand control unit end the movement at `time_s`."""
        self.stage.halt(time_s, coast_s=0.0, within_s=0.0)
        kept = [turn for turn in self._turns if turn.time_s < time_s]
        self._turns.clear()
        self._turns.extend(kept)
        self._turns.append(Turn(time_s, SA_STOPPED_STATUS, error=SA_COMMAND_OVERRIDDEN_ERROR))

    def stop(self, now_s: float) -> None:
        """Stop; the step in hand is finished."""
        if self.status == SA_STOPPED_STATUS:
            return
        interrupted = self._interruptible
        end_s = self._halt(now_s)
        if interrupted:
            self._post_completed(end_s)

    def _halt(self, now_s: float) -> float:
        driven_s = now_s - self._drive_s
        coast_s = 0.0
        if self.moving and driven_s > 0.0:
            steps = driven_s * self._frequency_hz
            coast_s = (math.ceil(steps) - steps) / self._frequency_hz
        self._turns.clear()
        self.status = SA_STOPPED_STATUS
        return self.stage.halt(now_s, coast_s=coast_s, within_s=self.settings.stop_finish_s)

    # Trouble

    def interrupt(self, code: int, now_s: float) -> None:
        """End whatever goes on with an error."""
        if self.status != SA_STOPPED_STATUS:
            self._halt(now_s)
            self.post_error(code, now_s)

    def meet_obstacle(self, now_s: float) -> None:
        """Run into something right now, if a movement goes on."""
        position = self.stage.position(now_s)
        ahead = self.stage.path.at(self.stage.path.end_s) - position
        if self.status not in (SA_MOVING_STATUS, SA_TARGETING_STATUS) or ahead == 0.0:
            return
        self.stage.obstruct(position, 1 if ahead > 0.0 else -1)
        self.stage.halt(now_s, coast_s=0.0, within_s=0.0)
        if self.status == SA_TARGETING_STATUS:
            self._turns.clear()
            end_s = now_s + self.settings.stall_s
            self._turns.append(Turn(end_s, SA_STOPPED_STATUS, error=SA_END_STOP_REACHED_ERROR))

    def lose_sensor(self, now_s: float) -> None:
        """Count no further."""
        if self._lost_at is None and self.stage.kind.sensor:
            self._lost_at = self.scale.logical(self.stage.position(now_s))
            self.scale.known = False
            if self.status != SA_MOVING_STATUS:
                self.interrupt(SA_NO_SENSOR_PRESENT_ERROR, now_s)

    @override
    def regain_sensor(self, now_s: float) -> None:
        if self._lost_at is not None:
            self.scale.read_as(self.stage.position(now_s), self._lost_at)
            self._lost_at = None
