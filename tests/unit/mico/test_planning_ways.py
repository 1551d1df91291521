"""Ways round what is in the way, on small scenes."""

import pytest

from cosmic.mico.core.collision.sweep import Sweep
from cosmic.mico.core.planning.problem import Problem
from unit.mico.planning_problems import LIMITS, arms, at, certified, corners, solved


def test_a_free_way_is_one_leg_of_all_axes_at_once() -> None:
    found = solved(Sweep(arms()), Problem(at(), {"left.x": 1000.0, "left.y": 500.0}, LIMITS))
    assert found.method == "straight"
    assert [dict(leg.targets) for leg in found.segments] == [{"left.x": 1000.0, "left.y": 500.0}]
    assert found.length == pytest.approx(found.straight_length)


def test_a_way_round_the_other_arm_is_found_and_every_leg_is_clear() -> None:
    sweep = Sweep(arms())
    start = at(left_x=2500.0, left_y=-600.0)
    found = solved(sweep, Problem(start, {"left.y": 600.0, "left.z": 10.0}, LIMITS))
    assert found.method in ("detour", "search")
    assert len(found.segments) > 1
    assert corners(found)[-1] == {**start, "left.y": 600.0, "left.z": 10.0}
    assert certified(arms(), found)
