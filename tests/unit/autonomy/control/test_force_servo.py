"""The force-servo against a spring, in no time at all."""

from collections import deque
from dataclasses import dataclass, field

import pytest

from cosmic.autonomy.control.force_servo import ForceGoal, ForceServo, guarded_speed
from cosmic.autonomy.control.law import ControlState
from cosmic.autonomy.control.settings import ControlSettings

SETTINGS = ControlSettings()
DT_S = 0.005


@dataclass
class Spring:
    """Something elastic 10 um away, moved in packets and felt a while later."""

    stiffness_un_um: float
    direction: int = -1
    contact_um: float = 10.0
    zero_un: float = 0.9
    target_um: float = 0.0
    wanted_um: float = 0.0
    since_s: float = 1.0
    peak_un: float = 0.0
    felt: deque[float] = field(default_factory=lambda: deque([0.9] * 6, maxlen=6))

    def force_un(self) -> float:
        depth = self.direction * self.target_um - self.contact_um
        return self.zero_un + max(depth, 0.0) * self.stiffness_un_um

    def step(self, velocity: float) -> None:
        self.since_s += DT_S
        self.wanted_um = self.wanted_um + velocity * DT_S if velocity else self.target_um
        if self.since_s >= SETTINGS.latency_s and abs(self.wanted_um - self.target_um) > 0.02:
            self.target_um, self.since_s = self.wanted_um, 0.0
        self.felt.append(self.force_un())
        self.peak_un = max(self.peak_un, self.felt[-1])


def servo(set_point_un: float, direction: int = -1) -> ForceServo:
    tolerance_un = SETTINGS.tolerance(set_point_un)
    return ForceServo(ForceGoal(set_point_un, -150.0, 150.0, direction, tolerance_un), SETTINGS)


def run(law: ForceServo, spring: Spring, seconds: float) -> list[float]:
    """Return the forces of the last half second."""
    forces = []
    for _ in range(round(seconds / DT_S)):
        answer = law.step(spring.felt[0], spring.target_um, DT_S)
        assert abs(answer.velocity) <= SETTINGS.speed_um_s
        spring.step(answer.velocity)
        forces.append(spring.felt[-1])
    return forces[-round(0.5 / DT_S) :]


@pytest.mark.parametrize("stiffness_un_um", [0.2, 0.7, 2.3, 7.0, 20.0])
@pytest.mark.parametrize("direction", [1, -1])
def test_it_holds_the_force_whatever_the_stiffness_and_does_not_overshoot_much(
    stiffness_un_um: float, direction: int
) -> None:
    spring = Spring(stiffness_un_um, direction)
    last = run(servo(50.0, direction), spring, 30.0)
    assert all(abs(force - 50.0) <= 2.5 for force in last)
    assert spring.peak_un < 55.0


def test_a_stiffness_that_changes_while_it_holds_is_learnt_anew() -> None:
    spring, law = Spring(2.0), servo(50.0)
    run(law, spring, 5.0)
    spring.stiffness_un_um = 6.0
    last = run(law, spring, 3.0)
    assert all(abs(force - 50.0) <= 2.5 for force in last)
    spring.stiffness_un_um = 0.5
    last = run(law, spring, 8.0)
    assert all(abs(force - 50.0) <= 2.5 for force in last)


def test_it_learns_the_stiffness() -> None:
    law = servo(60.0)
    run(law, Spring(2.3), 5.0)
    assert law.stiffness_un_um == pytest.approx(2.3, rel=0.3)


def test_it_goes_to_another_force_up_and_down_and_follows_a_drift() -> None:
    spring, law = Spring(2.0), servo(50.0)
    run(law, spring, 5.0)
    for goal in (90.0, 15.0):
        law.aim(goal)
        last = run(law, spring, 4.0)
        assert all(abs(force - goal) <= 2.5 for force in last)
    spring.zero_un += 10.0
    last = run(law, spring, 2.0)
    assert all(abs(force - 15.0) <= 2.5 for force in last)


def test_the_approach_stays_below_the_guarded_speed() -> None:
    slow = SETTINGS.model_copy(update={"stiffness_un_um": 1000.0})
    law = ForceServo(ForceGoal(50.0, -150.0, 150.0, 1, 2.5), slow)
    speeds = {law.step(0.9, 0.0, DT_S).velocity for _ in range(100)} - {0.0}
    (speed,) = speeds
    room_un = 150.0 - 0.9
    assert speed == pytest.approx(guarded_speed(0.5 * room_un, 1000.0, slow.latency_s))


def test_it_does_not_move_before_it_has_seen_the_force_at_rest() -> None:
    law = servo(50.0)
    answers = [law.step(0.9, 0.0, DT_S) for _ in range(15)]
    assert {answer.state for answer in answers} == {ControlState.STARTING}
    assert not any(answer.velocity for answer in answers)


def test_what_breaks_or_slips_away_is_approached_again() -> None:
    spring, law = Spring(2.0), servo(50.0)
    run(law, spring, 5.0)
    spring.contact_um += 60.0
    states = set()
    for _ in range(300):
        answer = law.step(spring.felt[0], spring.target_um, DT_S)
        states.add(answer.state)
        spring.step(answer.velocity)
    assert ControlState.APPROACHING in states
    last = run(law, spring, 8.0)
    assert all(abs(force - 50.0) <= 2.5 for force in last)
    assert spring.peak_un < 60.0


def test_a_fixed_gain_is_left_alone() -> None:
    from cosmic.autonomy.control.pid import PidGains

    goal = ForceGoal(50.0, -150.0, 150.0, -1, 2.5)
    law = ForceServo(goal, SETTINGS, PidGains(1.0))
    run(law, Spring(2.0), 3.0)
    assert law.stiffness_un_um == SETTINGS.stiffness_un_um
