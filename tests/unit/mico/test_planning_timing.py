"""Speeds and durations of planned legs."""

import math
from collections.abc import Mapping

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosmic.frame.errors import NotAvailable
from cosmic.mico.core.planning.problem import Plan, Segment
from cosmic.mico.core.planning.timing import duration_s, profile, speeds, timed

START = {"left.x": 0.0, "left.y": 100.0, "left.z": -50.0}
LEG = Segment({"left.x": 6000.0, "left.y": -1400.0, "left.z": 250.0})
FAST = {"left.x": 2000.0, "left.y": 1000.0, "left.z": 500.0}
PULL = {"left.x": 8000.0, "left.y": 20000.0, "left.z": 3000.0}


def off_the_line_um(in_phase: bool) -> float:
    leg = profile(LEG, START, FAST, PULL, in_phase=in_phase)
    farthest = 0.0
    for number in range(2001):
        place = leg.at(leg.duration_s * number / 2000.0)
        share = (place["left.x"] - START["left.x"]) / 6000.0
        line = {axis: START[axis] + share * (LEG.targets[axis] - START[axis]) for axis in START}
        farthest = max(farthest, math.dist(list(place.values()), [line[axis] for axis in place]))
    return farthest


def test_axes_that_keep_step_stay_on_the_straight_line() -> None:
    assert off_the_line_um(in_phase=True) <= 1e-6


def test_axes_that_do_not_keep_step_leave_it() -> None:
    assert off_the_line_um(in_phase=False) > 10.0


def test_a_profile_ends_at_the_target_and_keeps_to_top_speed() -> None:
    leg = profile(LEG, START, FAST, PULL)
    assert leg.at(leg.duration_s) == pytest.approx(dict(LEG.targets))
    assert leg.duration_s >= 3.0


@pytest.mark.parametrize("in_phase", [True, False])
@given(
    ways=st.tuples(*[st.floats(-1e4, 1e4).filter(lambda way: abs(way) > 1e-2)] * 3),
    speeds_um_s=st.tuples(*[st.floats(10.0, 1e4)] * 3),
    pulls=st.tuples(*[st.floats(10.0, 1e5)] * 3),
)
def test_no_axis_is_ever_faster_or_pulls_harder_than_it_may(
    in_phase: bool,
    ways: tuple[float, ...],
    speeds_um_s: tuple[float, ...],
    pulls: tuple[float, ...],
) -> None:
    target = {axis: START[axis] + way for axis, way in zip(START, ways, strict=True)}
    speed = dict(zip(START, speeds_um_s, strict=True))
    pull = dict(zip(START, pulls, strict=True))
    leg = profile(Segment(target), START, speed, pull, in_phase=in_phase)
    times_s = np.linspace(0.0, leg.duration_s, 400)
    step_s = times_s[1]
    for axis in START:
        place = np.array([leg.at(time_s)[axis] for time_s in times_s])
        assert place[0] == START[axis]
        assert place[-1] == pytest.approx(target[axis])
        # Rounding of places of up to 1e4 um, divided by the step once and twice.
        speeds = np.diff(place) / step_s
        assert np.abs(speeds).max() <= speed[axis] * (1.0 + 1e-9) + 1e-11 / step_s
        ends = np.concatenate(([0.0], speeds, [0.0]))
        pulled = np.abs(np.diff(ends)).max() / step_s
        assert pulled <= pull[axis] * (1.0 + 1e-9) + 1e-10 / step_s**2


def time_s(way: float, speed: float, pull: float) -> float:
    """How long the fastest movement from rest to rest takes."""
    if way * pull <= speed**2:
        return 2.0 * math.sqrt(way / pull)
    return way / speed + speed / pull


def test_each_axis_by_itself_is_as_fast_as_it_can_be() -> None:
    leg = profile(LEG, START, FAST, PULL, in_phase=False)
    ways: Mapping[str, float] = {axis: abs(LEG.targets[axis] - START[axis]) for axis in START}
    times = {axis: time_s(ways[axis], FAST[axis], PULL[axis]) for axis in ways}
    assert leg.duration_s == pytest.approx(max(times.values()))
    for axis, took_s in times.items():
        assert leg.at(took_s)[axis] == pytest.approx(LEG.targets[axis])
        assert leg.at(took_s - 0.01)[axis] != pytest.approx(LEG.targets[axis], abs=1e-3)


def test_a_short_leg_never_comes_to_top_speed() -> None:
    leg = profile(Segment({"left.x": 100.0}), START, FAST, PULL)
    assert leg.duration_s == pytest.approx(2.0 * math.sqrt(100.0 / 8000.0))
    assert leg.at(leg.duration_s / 2.0)["left.x"] == pytest.approx(50.0)


def test_axes_that_stand_have_no_profile() -> None:
    leg = profile(Segment({"left.x": 0.0}), START, FAST, PULL)
    assert (leg.axes, leg.duration_s, leg.at(1.0)) == ((), 0.0, {})


def test_all_axes_of_a_leg_arrive_together_and_the_slowest_goes_at_top_speed() -> None:
    chosen = speeds(LEG, START, FAST)
    times = {axis: abs(LEG.targets[axis] - START[axis]) / chosen[axis] for axis in chosen}
    assert len({round(time_s, 9) for time_s in times.values()}) == 1
    assert chosen["left.x"] == 2000.0
    assert all(chosen[axis] <= FAST[axis] for axis in chosen)


def test_an_axis_that_stands_has_no_speed() -> None:
    assert speeds(Segment({"left.x": 0.0, "left.y": 0.0}), START, FAST) == {"left.y": 1000.0}


def test_a_plan_takes_as_long_as_its_legs() -> None:
    legs = (Segment({"left.x": 1000.0}), Segment({"left.x": 0.0}))
    plan = Plan({"left.x": 0.0}, legs, "detour", 2000.0, 0.0)
    one_s = 1000.0 / 2000.0 + 2000.0 / 8000.0
    assert duration_s(plan, FAST, PULL) == pytest.approx(2.0 * one_s)
    assert timed(plan, FAST, PULL).duration_s == pytest.approx(2.0 * one_s)


@pytest.mark.parametrize("wrong", [0.0, -1.0, math.nan, math.inf])
def test_a_speed_that_is_none_is_refused(wrong: float) -> None:
    with pytest.raises(NotAvailable, match=r"left\.x"):
        speeds(LEG, START, {**FAST, "left.x": wrong})
    with pytest.raises(NotAvailable, match=r"left\.x"):
        profile(LEG, START, FAST, {**PULL, "left.x": wrong})
