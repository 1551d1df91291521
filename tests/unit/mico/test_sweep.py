"""The pure collision gate on small scenes."""

import math

import pytest

from cosmic.mico.core.collision.checker import AxisSpan, Spans
from cosmic.mico.core.collision.sweep import Sweep
from unit.mico.small_scenes import turntable, two_arms


def resting(**positions: float) -> dict[str, AxisSpan]:
    axes = ("left.x", "left.y", "left.z", "right.x", "right.y", "right.z", "table.rotation")
    given = {name.replace("_", "."): value for name, value in positions.items()}
    return {
        axis: AxisSpan(given.get(axis, 0.0), given.get(axis, 0.0), given.get(axis, 0.0))
        for axis in axes
    }


def moving(start: float, end: float) -> AxisSpan:
    return AxisSpan(min(start, end), max(start, end), start, moving=True)


def with_moves(spans: Spans, **moves: AxisSpan) -> Spans:
    return {**spans, **{name.replace("_", "."): span for name, span in moves.items()}}


def test_a_move_into_the_other_arm_is_not_clear_and_names_both() -> None:
    answer = Sweep(two_arms()).check(with_moves(resting(), left_x=moving(0.0, 3000.0)))
    assert not answer.clear
    assert answer.approach is not None
    assert answer.approach.bodies == ("left_z", "right_z")
    assert answer.approach.distance_um <= 5.0


def test_a_move_that_ends_just_outside_the_margin_is_clear() -> None:
    sweep = Sweep(two_arms())
    assert sweep.check(with_moves(resting(), left_x=moving(0.0, 1994.9))).clear
    assert not sweep.check(with_moves(resting(), left_x=moving(0.0, 1995.1))).clear


def test_a_move_through_a_thin_body_is_seen_though_its_end_is_free() -> None:
    beside = resting(left_x=1000.0, right_x=-1500.0, right_y=-900.0)
    answer = Sweep(two_arms()).check(with_moves(beside, right_y=moving(-900.0, 900.0)))
    assert not answer.clear


def test_two_arms_that_swap_positions_are_not_clear_though_each_alone_would_be() -> None:
    sweep = Sweep(two_arms())
    start = resting(left_x=500.0, right_x=0.0)
    assert sweep.check(with_moves(start, left_x=moving(500.0, 1400.0))).clear
    assert sweep.check(with_moves(start, right_x=moving(0.0, -1400.0))).clear
    together = with_moves(start, left_x=moving(500.0, 1400.0), right_x=moving(0.0, -1400.0))
    assert not sweep.check(together).clear


def test_a_body_inside_its_margin_may_only_retreat() -> None:
    sweep = Sweep(two_arms())
    inside = resting(left_x=1997.0)
    away = sweep.check(with_moves(inside, left_x=moving(1997.0, 0.0)))
    along = sweep.check(with_moves(inside, left_z=moving(0.0, 40.0)))
    closer = sweep.check(with_moves(inside, left_x=moving(1997.0, 1998.0)))
    assert away.clear
    assert along.clear
    assert not closer.clear
    assert "already" in closer.reason


def test_a_body_that_overlaps_another_may_leave_on_the_shorter_side_but_not_go_on() -> None:
    sweep = Sweep(two_arms())
    overlapping = resting(left_x=2010.0)
    assert sweep.check(with_moves(overlapping, left_x=moving(2010.0, 0.0))).clear
    assert not sweep.check(with_moves(overlapping, left_x=moving(2010.0, 2500.0))).clear


def test_a_body_wholly_inside_another_is_seen() -> None:
    sweep = Sweep(two_arms())
    buried = resting(left_z=-1500.0)
    assert not sweep.check(with_moves(buried, left_x=moving(0.0, 100.0))).clear


def test_overshoot_keeps_the_axis_farther_away() -> None:
    from dataclasses import replace

    model = two_arms()
    drives = tuple(replace(drive, overshoot=10.0) for drive in model.drives)
    sweep = Sweep(replace(model, drives=drives))
    assert sweep.check(with_moves(resting(), left_x=moving(0.0, 1984.0))).clear
    assert not sweep.check(with_moves(resting(), left_x=moving(0.0, 1986.0))).clear


def test_an_estimated_position_may_be_anywhere_within_its_uncertainty() -> None:
    sweep = Sweep(two_arms())
    spans = with_moves(resting(), left_y=moving(0.0, 10.0))
    assert sweep.check(spans).clear
    spans = {**spans, "left.x": AxisSpan(0.0, 0.0, 0.0, estimated=True)}
    assert not sweep.check(spans).clear


def test_axes_of_unknown_position_may_be_anywhere() -> None:
    assert not Sweep(two_arms()).check({"left.x": moving(0.0, 10.0)}).clear


@pytest.mark.parametrize("bad", [math.nan])
def test_numbers_that_are_none_are_no_answer(bad: float) -> None:
    sweep = Sweep(two_arms())
    answer = sweep.check(with_moves(resting(), left_x=AxisSpan(0.0, bad, 0.0, moving=True)))
    assert not answer.clear
    assert "left.x" in answer.reason


def test_an_axis_that_is_not_in_the_scene_cannot_be_checked() -> None:
    answer = Sweep(two_arms()).check({**resting(), "middle.x": moving(0.0, 1.0)})
    assert not answer.clear
    assert "middle.x" in answer.reason


def test_a_pair_that_no_moving_axis_concerns_is_left_alone() -> None:
    overlapping = resting(left_z=-1010.0, right_x=2000.0)
    assert Sweep(two_arms()).check(with_moves(overlapping, right_x=moving(2000.0, 1990.0))).clear


def test_turning_under_an_arm_is_clear_and_turning_into_it_is_not() -> None:
    sweep = Sweep(turntable())
    quarter = moving(90.0, -90.0)
    assert sweep.check(with_moves(resting(table_rotation=90.0), table_rotation=quarter)).clear
    lowered = resting(table_rotation=90.0, left_z=-300.0)
    answer = sweep.check(with_moves(lowered, table_rotation=quarter))
    assert not answer.clear
    assert answer.approach is not None
    assert abs(answer.approach.pose["table.rotation"]) < 20.0


def test_turning_up_to_the_arm_is_clear() -> None:
    sweep = Sweep(turntable())
    lowered = resting(table_rotation=90.0, left_z=-300.0)
    assert sweep.check(with_moves(lowered, table_rotation=moving(90.0, 10.0))).clear
    assert not sweep.check(with_moves(lowered, table_rotation=moving(90.0, 1.0))).clear


def test_the_nearest_pair_is_reported_with_its_distance_and_position() -> None:
    nearest = Sweep(two_arms()).nearest({"left.x": 500.0})
    assert nearest is not None
    assert nearest.distance_um == pytest.approx(1000.0)
    nearest = Sweep(two_arms()).nearest({"left.x": 1500.0})
    assert nearest is not None
    assert nearest.bodies == ("left_z", "right_z")
    assert nearest.distance_um == pytest.approx(500.0)
    assert nearest.place_um[0] == pytest.approx(750.0)
