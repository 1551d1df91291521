"""Ways round what is in the way, on small scenes."""

import math
import pickle
from dataclasses import replace

import pytest

from cosmic.mico.core.collision.checker import AxisSpan
from cosmic.mico.core.collision.sweep import Sweep
from cosmic.mico.core.planning.planner import plan_path
from cosmic.mico.core.planning.problem import NoPath, Plan, Problem
from unit.mico.planning_problems import (
    LIMITS,
    arms,
    at,
    certified,
    corners,
    holds_with_sloppy_stages,
    least_gap,
    solved,
    table_and_arm,
)

BEHIND = Problem(
    at(left_x=2500.0, left_y=-600.0),
    {"left.x": 2500.0, "left.y": 600.0, "left.z": 10.0},
    LIMITS,
    budget_s=20.0,
)
"""The other side of the right arm."""


def test_a_free_path_is_one_leg_of_all_axes_at_once() -> None:
    found = solved(Sweep(arms()), Problem(at(), {"left.x": 1000.0, "left.y": 500.0}, LIMITS))
    assert found.method == "straight"
    assert [dict(leg.targets) for leg in found.segments] == [{"left.x": 1000.0, "left.y": 500.0}]
    assert found.length == pytest.approx(found.straight_length)


def test_no_legs_are_needed_where_everything_stands_at_the_goal_already() -> None:
    assert solved(Sweep(arms()), Problem(at(), {"left.x": 0.0}, LIMITS)).segments == ()


def test_a_straight_line_that_is_free_is_driven_in_steps_where_its_box_is_not() -> None:
    start = at(left_x=1700.0, left_y=300.0)
    found = solved(Sweep(arms()), Problem(start, {"left.x": 2600.0, "left.y": 1500.0}, LIMITS))
    straight = solved(Sweep(arms()), Problem(start, {"left.x": 1900.0, "left.y": -900.0}, LIMITS))
    assert straight.method == "straight"
    assert found.method in ("straight", "steps")
    assert found.length == pytest.approx(found.straight_length)


def test_a_height_that_is_too_low_for_axes_that_stop_short_is_not_used() -> None:
    model = arms(overshoot=20.0, lift=60.0)
    limits = LIMITS | {"left.x": (2400.0, 4000.0)}
    found = solved(Sweep(model), replace(BEHIND, limits=limits))
    assert max(place["left.z"] for place in corners(found)) > 75.0
    assert holds_with_sloppy_stages(model, found, 20.0)


def test_axes_go_one_after_the_other_where_together_they_would_touch() -> None:
    start = at(left_x=1900.0, left_y=0.0)
    found = solved(Sweep(arms()), Problem(start, {"left.x": 2100.0, "left.y": 120.0}, LIMITS))
    assert found.method == "one by one"
    assert corners(found)[1]["left.y"] > 106.0
    assert corners(found)[1]["left.x"] < 1994.0
    assert certified(arms(), found)


def test_a_lifting_axis_leads_over_what_is_in_the_way() -> None:
    long = replace(BEHIND, limits={**LIMITS, "left.x": (2400.0, 4000.0)})
    found = solved(Sweep(arms(lift=60.0)), long)
    assert found.method == "detour"
    assert max(place["left.z"] for place in corners(found)) == pytest.approx(60.0)
    assert certified(arms(), found)


@pytest.mark.parametrize("lift", [None, 2000.0])
def test_a_detour_around_the_other_arm_is_short_and_every_leg_is_clear(lift: float | None) -> None:
    model = arms(lift=lift)
    found = solved(Sweep(model), BEHIND)
    assert corners(found)[-1] == {**BEHIND.start, **BEHIND.goal}
    assert found.length <= 1.5 * found.straight_length
    assert found.length <= found.found_length
    assert certified(model, found)
    assert least_gap(model, found) > 5.0


@pytest.mark.parametrize("seed", range(6))
def test_legs_stay_clear_where_axes_stop_short_or_go_too_far(seed: int) -> None:
    model = arms(overshoot=20.0, lift=None)
    found = solved(Sweep(model), replace(BEHIND, seed=seed))
    assert holds_with_sloppy_stages(model, found, 20.0)


def test_two_arms_swap_sides() -> None:
    start = at(left_x=2000.0, right_x=-2000.0, left_y=-400.0, right_y=400.0)
    goal = {"left.x": 2100.0, "right.x": -1900.0, "left.y": 400.0, "right.y": -400.0}
    goal |= {"left.z": 5.0, "right.z": 10.0}
    model = arms()
    found = solved(Sweep(model), Problem(start, goal, LIMITS, budget_s=20.0))
    assert corners(found)[-1] == {**start, **goal}
    assert certified(model, found)
    assert least_gap(model, found, steps=2) > 5.0


def test_a_turning_axis_takes_part() -> None:
    model = table_and_arm()
    start = {"left.x": 0.0, "left.y": 0.0, "left.z": -300.0, "table.rotation": 90.0}
    goal = {"left.y": 200.0, "left.z": -250.0, "table.rotation": -80.0}
    limits = dict.fromkeys(("left.x", "left.y", "left.z"), (-3000.0, 3000.0))
    problem = Problem(start, goal, {**limits, "table.rotation": (-170.0, 170.0)}, budget_s=20.0)
    found = solved(Sweep(model), problem)
    assert corners(found)[-1] == {**start, **goal}
    assert certified(model, found)
    assert least_gap(model, found) > 5.0


def test_a_degree_counts_as_the_travel_of_the_farthest_point_that_turns() -> None:
    model = table_and_arm()
    start = {"left.x": -2000.0, "left.y": 0.0, "left.z": 1000.0, "table.rotation": 0.0}
    found = solved(Sweep(model), Problem(start, {"table.rotation": 1.0}))
    assert found.length == pytest.approx(3001.67 * 3.14159 / 180.0, rel=1e-4)


def test_the_same_seed_gives_the_same_way() -> None:
    problem = replace(BEHIND, seed=5, budget_s=60.0)
    model = arms(lift=None)
    first, second = plan_path(Sweep(model), problem), plan_path(Sweep(model), problem)
    assert isinstance(first, Plan)
    assert first == second


def test_problems_and_answers_go_through_a_pipe() -> None:
    problem = pickle.loads(pickle.dumps(BEHIND))
    found = solved(Sweep(arms()), problem)
    assert pickle.loads(pickle.dumps(found)) == found
    refused = plan_path(Sweep(arms()), Problem(at(), {"left.x": 3000.0}, LIMITS))
    assert isinstance(refused, NoPath)
    assert pickle.loads(pickle.dumps(refused)) == refused


def test_axes_that_may_be_anywhere_are_kept_clear_of_wherever_they_are() -> None:
    start = {axis: place for axis, place in at().items() if axis != "right.y"}
    anywhere = {"right.y": AxisSpan(-math.inf, math.inf), "stranger": AxisSpan(0.0, 0.0, 0.0)}
    found = solved(Sweep(arms()), Problem(start, {"left.x": 1900.0}, LIMITS, anywhere))
    assert found.clearance_um is not None
    assert math.isfinite(found.clearance_um)
    assert isinstance(plan_path(Sweep(arms()), Problem(start, {"left.x": 2100.0}, LIMITS)), NoPath)


def test_a_plan_reports_the_least_distance_at_its_corners() -> None:
    found = solved(Sweep(arms()), Problem(at(), {"left.x": 1900.0}, LIMITS))
    assert found.clearance_um == pytest.approx(100.0)


def test_looking_on_makes_the_path_no_longer() -> None:
    model = arms(lift=None)
    quick = solved(Sweep(model), BEHIND)
    better = solved(Sweep(model), replace(BEHIND, optimise=True, budget_s=2.0))
    assert better.length <= quick.length * 1.001
    assert certified(model, better)
