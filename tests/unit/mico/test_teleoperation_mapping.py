"""From deflections to speeds, without threads."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from cosmic.mico.core.teleoperation.mapping import ProfileMapping, shaped
from cosmic.mico.core.teleoperation.settings import (
    TeleoperationProfileSettings,
    TeleoperationSettings,
)
from cosmic.mico.hw.input_device import InputState
from unit.mico.rigs import settings

USUAL = {"a": 200.0, "b": 2.0}


def profile(*rows: dict[str, object], **changes: object) -> TeleoperationProfileSettings:
    return TeleoperationProfileSettings.model_validate({"name": "p", "axis": rows, **changes})


def mapping(*rows: dict[str, object], place: float | None = 0.0, **changes: object):
    return ProfileMapping(profile(*rows, **changes), USUAL, lambda _name: place)


def inputs(**axes: float) -> InputState:
    buttons = {name: True for name, value in axes.items() if value is True}
    return InputState(
        {name: value for name, value in axes.items() if value is not True},
        buttons,
        connected=True,
        time_s=0.0,
    )


@given(st.floats(-1.0, 1.0), st.floats(0.0, 0.9))
def test_the_dead_zone_moves_nothing_and_nothing_jumps_at_its_end(value, dead_zone):
    part = shaped(value, dead_zone)
    assert abs(part) <= 1.0
    assert (part == 0.0) == (abs(value) <= dead_zone) or math.isclose(abs(value), dead_zone)
    assert shaped(-value, dead_zone) == -part
    assert shaped(1.0, dead_zone) == 1.0
    assert abs(shaped(min(1.0, dead_zone + 1e-6), dead_zone)) < 1e-4


def test_scale_direction_and_speed_limit_are_kept():
    steer = mapping(
        {
            "input": "x",
            "positioner": "a",
            "scale": 2.0,
            "direction": -1,
            "speed_um_s": 50.0,
            "dead_zone": 0.0,
        }
    )
    assert steer.convert(inputs(x=0.25), fine=False) == {"a": -25.0}
    assert steer.convert(inputs(x=0.9), fine=False) == {"a": -50.0}


def test_fine_leaves_a_part_of_the_speed():
    steer = mapping({"input": "x", "positioner": "a"}, fine_share=0.1)
    assert steer.convert(inputs(x=1.0), fine=False) == {"a": 200.0}
    assert steer.convert(inputs(x=1.0), fine=True) == {"a": pytest.approx(20.0)}


def test_two_inputs_of_one_positioner_are_added_and_limited():
    steer = mapping(
        {"input": "open", "positioner": "a"},
        {"input": "close", "positioner": "a", "direction": -1},
        {"input": "up", "positioner": "a"},
    )
    assert steer.convert(inputs(open=1.0, close=1.0), fine=False) == {"a": 0.0}
    assert steer.convert(inputs(open=1.0, up=True), fine=False) == {"a": 200.0}


def test_an_input_the_device_does_not_have_moves_nothing():
    steer = mapping({"input": "wheel", "positioner": "b"})
    assert steer.convert(inputs(x=1.0), fine=False) == {"b": 0.0}
    assert not steer.deflected(inputs(x=1.0))


def test_a_positioner_follows_a_position_from_where_it_stood():
    row = {"input": "x", "positioner": "a", "mode": "position", "travel_um": 100.0}
    place = 40.0
    steer = ProfileMapping(profile(row | {"dead_zone": 0.0}), USUAL, lambda _name: place)
    assert steer.convert(inputs(x=0.0), fine=False) == {"a": 0.0}
    towards = steer.convert(inputs(x=0.5), fine=False)["a"]
    assert towards > 0.0
    place = 90.0
    assert steer.convert(inputs(x=0.5), fine=False) == {"a": 0.0}
    assert steer.convert(inputs(x=0.0), fine=False)["a"] < 0.0
    steer.recentre()
    assert steer.convert(inputs(x=0.5), fine=False) == {"a": 0.0}, "from where it stands now"


def test_a_positioner_of_unknown_position_does_not_follow():
    row = {"input": "x", "positioner": "a", "mode": "position", "travel_um": 100.0}
    assert mapping(row, place=None).convert(inputs(x=1.0), fine=False) == {"a": 0.0}


@pytest.mark.parametrize(
    "row",
    [
        {"input": "x", "positioner": "a", "sped_um_s": 1.0},
        {"input": "", "positioner": "a"},
        {"input": "x", "positioner": "a", "speed_um_s": 0.0},
        {"input": "x", "positioner": "a", "dead_zone": 1.0},
        {"input": "x", "positioner": "a", "direction": 0},
        {"input": "x", "positioner": "a", "mode": "position"},
        {"input": "x", "positioner": "a", "travel_um": 10.0},
        {"input": "x", "positioner": "a", "scale": float("nan")},
    ],
)
def test_a_wrong_row_is_refused(row):
    with pytest.raises(ValidationError):
        profile(row)


@pytest.mark.parametrize(
    ("row", "why"),
    [
        ({"input": "x", "positioner": "left.w"}, "no positioner 'left.w'"),
        ({"input": "x", "positioner": "d0.c0", "speed_deg_s": 1.0}, "speed_deg_s does not fit"),
        ({"input": "x", "positioner": "d0.c2", "speed_um_s": 1.0}, "speed_um_s does not fit"),
        (
            {"input": "x", "positioner": "d0.c2", "mode": "position", "travel_um": 1.0},
            "travel_um does not fit",
        ),
    ],
)
def test_a_profile_that_does_not_fit_the_platform_stops_the_start(row, why):
    with pytest.raises(ValidationError, match=why):
        settings(teleoperation={"profile": [{"name": "p", "axis": [row]}]})


def test_profile_names_and_force_limits_must_make_sense():
    with pytest.raises(ValidationError, match="used 2 times"):
        TeleoperationSettings.model_validate({"profile": [{"name": "p", "axis": []}] * 2})
    with pytest.raises(ValidationError, match="soft_force_un"):
        TeleoperationSettings.model_validate({"soft_force_un": 150.0})
    row = {"input": "x", "positioner": "a", "mode": "position", "travel_um": 1.0}
    with pytest.raises(ValidationError, match="nothing else can move it"):
        profile(row, {"input": "y", "positioner": "a"})
