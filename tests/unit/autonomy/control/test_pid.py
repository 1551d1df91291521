"""The PID against answers worked out by hand."""

import math

import pytest

from cosmic.autonomy.control.law import PidLaw
from cosmic.autonomy.control.pid import Pid, PidGains
from cosmic.frame.errors import ConfigError


def pid(kp: float = 0.0, ki: float = 0.0, kd: float = 0.0, *, most: float = 1e6) -> Pid:
    return Pid(PidGains(kp, ki, kd), low=-most, high=most)


def test_each_part_gives_what_its_definition_says() -> None:
    assert pid(kp=2.0).step(5.0, 2.0, 0.1) == pytest.approx(6.0)
    integrating = pid(ki=4.0)
    outputs = [integrating.step(1.0, 0.0, 0.5) for _ in range(3)]
    assert outputs == pytest.approx([2.0, 4.0, 6.0])
    damping = pid(kd=3.0)
    assert damping.step(0.0, 1.0, 0.1) == 0.0, "there is no slope before the second value"
    assert damping.step(0.0, 1.2, 0.1) == pytest.approx(-6.0)


def test_the_parts_add_up() -> None:
    three = pid(kp=2.0, ki=1.0, kd=0.5)
    three.step(1.0, 0.0, 0.1)
    # proportional, integral of both errors, derivative
    assert three.step(1.0, 0.2, 0.1) == pytest.approx(1.6 + 0.18 - 1.0)


def test_a_jump_of_the_set_point_gives_no_kick_of_the_derivative() -> None:
    damping = pid(kd=3.0)
    damping.step(0.0, 1.0, 0.1)
    assert damping.step(100.0, 1.0, 0.1) == 0.0


def test_it_leaves_its_limit_as_soon_as_the_error_turns() -> None:
    held = pid(kp=1.0, ki=10.0, most=5.0)
    for _ in range(1000):
        assert held.step(100.0, 0.0, 0.01) == 5.0
    assert held.step(100.0, 101.0, 0.01) < 0.0, "nothing was wound up"


def test_the_integral_comes_back_from_a_limit_by_itself() -> None:
    held = Pid(PidGains(0.0, 1.0), low=0.0, high=2.0)
    for _ in range(50):
        held.step(1.0, 0.0, 0.1)
    assert held.step(1.0, 0.0, 0.1) == pytest.approx(2.0, abs=0.11)
    assert held.step(0.0, 1.0, 1.0) == pytest.approx(1.0, abs=0.11)


def test_it_begins_without_a_bump() -> None:
    begun = pid(kp=2.0, ki=1.0)
    begun.reset(set_point=7.0, measured=4.0, output=1.5)
    assert begun.step(7.0, 4.0, 1e-9) == pytest.approx(1.5)


def test_a_falling_measurement_is_held_with_the_other_sign() -> None:
    falling = Pid(PidGains(2.0), low=-10.0, high=10.0, sign=-1)
    assert falling.step(3.0, 1.0, 0.1) == pytest.approx(-4.0)


@pytest.mark.parametrize(
    ("set_point", "measured", "dt_s"),
    [(math.nan, 0.0, 0.1), (0.0, math.nan, 0.1), (0.0, math.inf, 0.1), (0.0, 0.0, math.nan),
     (0.0, 0.0, 0.0), (0.0, 0.0, -0.1)],
)  # fmt: skip
def test_what_is_no_number_is_refused_and_not_remembered(
    set_point: float, measured: float, dt_s: float
) -> None:
    steady = pid(kp=1.0, ki=1.0, kd=1.0)
    steady.step(1.0, 0.0, 0.1)
    with pytest.raises(ConfigError, match="cannot work"):
        steady.step(set_point, measured, dt_s)
    assert steady.step(1.0, 0.0, 0.1) == pytest.approx(1.2)


@pytest.mark.parametrize("gains", [(-1.0, 0.0, 0.0), (math.nan, 0.0, 0.0), (0.0, 0.0, 0.0)])
def test_gains_that_make_no_sense_are_refused(gains: tuple[float, float, float]) -> None:
    with pytest.raises(ConfigError):
        PidGains(*gains)


def test_limits_that_do_not_rise_are_refused() -> None:
    with pytest.raises(ConfigError):
        Pid(PidGains(1.0), low=1.0, high=1.0)
    with pytest.raises(ConfigError):
        pid(kp=1.0).set_limits(math.nan, 1.0)


def test_the_plain_law_ramps_its_set_point_and_rests_within_the_dead_band() -> None:
    law = PidLaw(10.0, PidGains(1.0), speed=5.0, ramp_per_s=10.0, dead_band=0.5)
    first = law.step(4.0, 0.0, 0.1)
    assert first.set_point == pytest.approx(5.0)
    assert first.velocity == pytest.approx(1.0)
    for _ in range(5):
        last = law.step(9.6, 0.0, 0.1)
    assert last.set_point == 10.0
    assert last.state == "holding"
    assert last.velocity == 0.0
    law.aim(9.0)
    assert law.step(9.6, 0.0, 0.1).velocity < 0.0
