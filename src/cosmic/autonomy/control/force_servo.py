"""`ForceServo`: approaches what it is to push, and holds a force on it."""

from dataclasses import dataclass
from typing import Final

from typing_extensions import override

from cosmic.autonomy.control.law import Answer, ControlState, Law, Ramp
from cosmic.autonomy.control.pid import Pid, PidGains
from cosmic.autonomy.control.settings import ControlSettings

FILTER_S: Final = 0.02
REST_S: Final = 0.1
"""So long it looks at the force before it moves."""
SOFTEST_UN_UM: Final = 0.05
LEARN_UM: Final = 1.0
LEARN_UN: Final = 5.0
"""A look at the stiffness is over after so long a way, or so large a change of the force."""
LEARN_S: Final = 0.15
SHARE: Final = 0.5
"""Part of the room up to the limit that an unforeseen contact may use up."""
ASLEEP: Final = 0.2
AWAKE: Final = 0.6
"""Parts of the tolerance within which the axis comes to rest, and beyond which it moves again."""
LEAD: Final = 2.0
"""The ramp waits while the force is that many tolerances behind."""


def guarded_speed(margin_un: float, stiffness_un_um: float, latency_s: float) -> float:
    """Return the speed at which a contact uses up `margin_un` before it can be noticed, um/s."""
    return max(margin_un, 0.0) / (stiffness_un_um * latency_s)


@dataclass(frozen=True, slots=True)
class ForceGoal:
    """What to hold, uN, and between which forces everything is well.

    Attributes
    ----------
    direction : int
        Which way of the axis makes the force rise.
    tolerance_un : float
        How far off the force may be and count as held.
    """

    set_point_un: float
    low_un: float
    high_un: float
    direction: int
    tolerance_un: float


class ForceServo(Law):
    """Feels its way to a contact, then holds the force with a gain that suits the stiffness.

    The axis integrates, so that a velocity in proportion to the error leaves no error. How stiff
    what it pushes is, it learns from its own moves: the gain is one over stiffness and response
    time. It begins as for the stiffest contact to be expected, and its speed is always one at
    which such a contact would not reach the limit before it is noticed. The zero of the sensor is
    taken once, before the first move: one that followed a slow rise would miss a soft fibre.

    Parameters
    ----------
    gains : PidGains or None
        Fixed gains, (um/s)/uN and so on; None: a P part that follows the stiffness.
    """

    def __init__(
        self, goal: ForceGoal, settings: ControlSettings, gains: PidGains | None = None
    ) -> None:
        self._goal = goal
        self._aim_un = goal.set_point_un
        self._settings = settings
        self._adapts = gains is None
        self._pid = Pid(
            gains or PidGains(1.0 / (settings.stiffness_un_um * settings.response_s)),
            low=-settings.speed_um_s,
            high=settings.speed_um_s,
            sign=goal.direction,
        )
        self._force_un: float | None = None
        self._rest_un = 0.0
        self._rested_s = 0.0
        self._state = ControlState.STARTING
        self._ramp = Ramp(0.0, settings.ramp_un_s)
        self._touching = False
        self._rests = False
        self.stiffness_un_um = settings.stiffness_un_um
        self._mark: tuple[float, float] | None = None
        self._mark_s = 0.0

    @override
    def aim(self, set_point: float) -> None:
        self._aim_un = set_point

    @override
    def step(self, measured: float, position: float, dt_s: float) -> Answer:
        force = self._filtered(measured, dt_s)
        goal = self._aim_un
        if self._rested_s < REST_S:
            self._rested_s += dt_s
            self._rest_un = force
            return Answer(0.0, goal, ControlState.STARTING)
        self._learn(force, position, dt_s)
        self._touch(force, goal)
        if not self._touching:
            return Answer(self._approach(force, goal), goal, ControlState.APPROACHING)
        return self._press(force, goal, dt_s)

    def _filtered(self, measured: float, dt_s: float) -> float:
        before = measured if self._force_un is None else self._force_un
        self._force_un = before + (measured - before) * min(1.0, dt_s / FILTER_S)
        return self._force_un

    def _touch(self, force: float, goal: float) -> None:
        """Notice that something is touched, or that it is gone."""
        away, contact = abs(force - self._rest_un), self._settings.contact_un
        near = abs(goal - force) <= self._goal.tolerance_un
        if not self._touching and (away > contact or near):
            self._touching = True
            self._ramp.value = force
            self._mark = None
            if self._adapts:
                self.stiffness_un_um = self._settings.stiffness_un_um
                self._suit()
            self._pid.reset(set_point=force, measured=force)
        elif self._touching and away < 0.3 * contact and not abs(goal - self._rest_un) <= contact:
            self._touching = False

    def _approach(self, force: float, goal: float) -> float:
        speed = min(self._settings.approach_um_s, self._guarded(force, goal))
        rising = goal > force
        return self._goal.direction * (speed if rising else -speed)

    def _guarded(self, force: float, goal: float) -> float:
        room = self._goal.high_un - force if goal > force else force - self._goal.low_un
        stiffness = self.stiffness_un_um if self._touching else self._settings.stiffness_un_um
        return guarded_speed(SHARE * room, stiffness, self._settings.latency_s)

    def _press(self, force: float, goal: float, dt_s: float) -> Answer:
        ramp = self._ramp
        if abs(ramp.value - force) <= LEAD * self._goal.tolerance_un or abs(goal - force) < abs(
            goal - ramp.value
        ):
            ramp.towards(goal, dt_s)
        holding = ramp.value == goal
        off = abs(goal - force) / self._goal.tolerance_un
        self._rests = holding and off <= (AWAKE if self._rests else ASLEEP)
        if self._rests:
            return Answer(0.0, goal, ControlState.HOLDING)
        most = min(self._settings.speed_um_s, max(self._guarded(force, ramp.value), 1e-3))
        self._pid.set_limits(-most, most)
        velocity = self._pid.step(ramp.value, force, dt_s)
        return Answer(
            velocity, ramp.value, ControlState.HOLDING if holding else ControlState.RAMPING
        )

    # Learning

    def _learn(self, force: float, position: float, dt_s: float) -> None:
        """Take the stiffness from how the force changed over the last stretch of the way."""
        self._mark_s += dt_s
        if not self._touching:
            return
        if self._mark is None:
            self._mark, self._mark_s = (position, force), 0.0
            return
        travelled = self._goal.direction * (position - self._mark[0])
        changed = force - self._mark[1]
        if self._mark_s < LEARN_S or (abs(travelled) < LEARN_UM and abs(changed) < LEARN_UN):
            return
        slope = changed / travelled if travelled else 0.0
        self._mark, self._mark_s = (position, force), 0.0
        if self._adapts and slope > 0.0:
            seen = min(max(slope, SOFTEST_UN_UM), self._settings.stiffness_un_um)
            self.stiffness_un_um += 0.5 * (seen - self.stiffness_un_um)
            self._suit()

    def _suit(self) -> None:
        self._pid.set_gains(PidGains(1.0 / (self.stiffness_un_um * self._settings.response_s)))
