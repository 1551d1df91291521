"""The shape that a fibre has in the jaws, from how it lay."""

import math

import numpy as np
import pytest

from cosmic.autonomy.handling.grasp import held_shape


def arc(radius_um: float, length_um: float, turned_deg: float) -> np.ndarray:
    angles = np.linspace(0.0, length_um / radius_um, 200)
    line = radius_um * np.column_stack([np.sin(angles), 1.0 - np.cos(angles)])
    turn = math.radians(turned_deg)
    matrix = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    return np.asarray(line @ matrix.T + np.array([400.0, -300.0]))


def test_a_straight_fibre_gives_way_as_the_straight_one_it_is():
    line = np.column_stack([np.linspace(0.0, 1200.0, 50), np.zeros(50)])
    shape = held_shape(line, 250.0, 1.0)
    assert shape.reach_um == pytest.approx(950.0)
    assert shape.bow_um(500.0) == pytest.approx(0.0, abs=1e-9)
    assert shape.natural(500.0, 1.0).lever_um() == pytest.approx(500.0, rel=1e-6)


@pytest.mark.parametrize("turned_deg", [-100.0, 0.0, 35.0])
def test_a_bowed_fibre_leaves_the_jaws_straight_ahead_whatever_way_it_lay(turned_deg: float):
    shape = held_shape(arc(1500.0, 1300.0, turned_deg), 250.0, 1.0)
    for ahead in (100.0, 300.0, 500.0):
        bow = 1500.0 - math.sqrt(1500.0**2 - ahead**2)
        assert shape.bow_um(ahead) == pytest.approx(bow, abs=1.0)


def test_the_other_gripper_holds_it_the_other_way_round():
    left = held_shape(arc(1500.0, 1300.0, 0.0), 250.0, 1.0)
    right = held_shape(arc(1500.0, 1300.0, 0.0), 250.0, -1.0)
    assert right.reach_um == pytest.approx(left.reach_um)
    assert right.bow_um(400.0) == pytest.approx(-left.bow_um(400.0), abs=1e-6), (
        "turned by half a turn in the plane"
    )


def test_a_bowed_fibre_gives_way_to_a_push_along_its_normal():
    radius, span = 1500.0, 500.0
    natural = held_shape(arc(radius, 1300.0, 0.0), 250.0, 1.0).natural(span, 1.0)
    slope = math.asin(span / radius)
    assert natural.slope_rad == pytest.approx(slope, abs=0.01)
    u = np.linspace(0.0, span, 4001)
    rise = np.sqrt(radius**2 - u**2) - math.sqrt(radius**2 - span**2)
    arm = (span - u) + rise * math.tan(slope)
    compliance = np.trapezoid(arm**2 / np.sqrt(1.0 - (u / radius) ** 2), u)
    assert natural.lever_um() == pytest.approx(np.cbrt(3.0 * compliance), rel=3e-3)


def test_a_fibre_is_pushed_only_as_far_out_as_it_is_not_steep():
    shape = held_shape(arc(1000.0, 1300.0, 0.0), 250.0, 1.0)
    assert shape.gentle_um(30.0) == pytest.approx(500.0, rel=0.03)
    assert held_shape(arc(9000.0, 1300.0, 0.0), 250.0, 1.0).gentle_um(30.0) > 1000.0


def test_it_reaches_no_further_than_to_where_it_turns_back():
    shape = held_shape(arc(300.0, 1300.0, 0.0), 100.0, 1.0)
    assert shape.reach_um == pytest.approx(300.0, rel=0.02)
