"""Where the twin's lens truly is: ramps, stops, play, lost steps; and how bright the lamp is."""

import math

import pytest
from pydantic import ValidationError

from cosmic.twin.lens import TwinLens
from cosmic.twin.lens_motor import LensPhase, ramp_down, ramp_over
from cosmic.twin.lens_settings import LensMotorSettings
from cosmic.twin.light import TwinLight
from cosmic.twin.settings import shipped_settings

SETTINGS = shipped_settings().lens
LONG_S = 60.0


@pytest.fixture
def lens() -> TwinLens:
    return TwinLens(SETTINGS)


@pytest.mark.parametrize("way", [1.0, 50.0, 1599.0, 12000.0])
def test_a_ramp_leads_as_far_as_asked_and_never_beyond_its_speed(way: float) -> None:
    ramp = ramp_over(way, SETTINGS.zoom)
    assert ramp.travel_counts == pytest.approx(way)
    steps = [ramp.duration_s * part / 500 for part in range(501)]
    gone = [ramp.gone(each) for each in steps]
    assert gone == sorted(gone) and gone[-1] == pytest.approx(way)
    fastest = max(ramp.speed(each)[0] for each in steps)
    assert fastest <= SETTINGS.zoom.top_speed_counts_s + 1e-6
    speed = (gone[251] - gone[250]) / (steps[251] - steps[250])
    assert speed == pytest.approx(ramp.speed((steps[250] + steps[251]) / 2)[0], rel=1e-3)


def test_no_travel_takes_no_time_and_slow_motors_stop_at_once() -> None:
    assert ramp_over(0.0, SETTINGS.zoom).duration_s == 0.0
    assert ramp_down(100.0, SETTINGS.zoom).travel_counts == 0.0


def test_a_warm_lens_is_homed_at_the_lowest_zoom_and_focused_on_the_plate(lens: TwinLens) -> None:
    assert lens.position_counts("zoom", 0.0) == 0.0
    assert lens.position_counts("focus", 0.0) == SETTINGS.focus.start_counts == 4000.0
    assert lens.counter("focus", 0.0) == 4000
    assert lens.zoom_range_counts == (0.0, 12000.0)
    assert lens.focus_range_counts == (0.0, 8000.0)


def test_a_cold_lens_stands_somewhere_that_its_seed_gives() -> None:
    cold = [TwinLens(SETTINGS, seed, cold=True) for seed in (1, 1, 2)]
    zooms = [each.position_counts("zoom", 0.0) for each in cold]
    assert zooms[0] == zooms[1] != zooms[2]
    assert all(0.0 <= each <= 12000.0 for each in zooms)
    assert cold[0].counter("zoom", 0.0) == 0


def test_a_movement_can_be_looked_at_at_any_time_past_or_future(lens: TwinLens) -> None:
    lens.seek("zoom", 6000, 1.0)
    end_s = 1.0 + ramp_over(6000, SETTINGS.zoom).duration_s
    assert lens.position_counts("zoom", 0.5) == 0.0
    middle = lens.position_counts("zoom", (1.0 + end_s) / 2.0)
    assert middle == pytest.approx(3000.0, abs=SETTINGS.zoom.backlash_counts)
    assert lens.position_counts("zoom", end_s) == pytest.approx(6000.0)
    lens.seek("zoom", 0, 100.0)
    assert lens.position_counts("zoom", (1.0 + end_s) / 2.0) == middle, "the past stays"


def test_phases_are_reported_with_direction_and_slowing(lens: TwinLens) -> None:
    lens.seek("zoom", 6000, 0.0)
    assert lens.phase("zoom", 0.1) == (LensPhase.SEEK, 1, False)
    end_s = ramp_over(6000, SETTINGS.zoom).duration_s
    assert lens.phase("zoom", end_s - 0.01) == (LensPhase.SEEK, 1, True)
    assert lens.phase("zoom", end_s)[0] is LensPhase.IDLE
    lens.seek("zoom", 100, LONG_S)
    assert lens.phase("zoom", LONG_S + 0.1) == (LensPhase.SEEK, -1, False)


def test_play_is_taken_up_at_the_end_of_a_retreat(lens: TwinLens) -> None:
    play = SETTINGS.zoom.backlash_counts
    lens.seek("zoom", 6000, 0.0)
    lens.seek("zoom", 3000, 10.0)
    lowest = min(lens.counter("zoom", 10.0 + part / 100) for part in range(500))
    assert lowest == 3000 - play
    assert lens.position_counts("zoom", LONG_S) == pytest.approx(3000.0)
    started = lens.position_counts("zoom", 10.0)
    barely_s = 10.0 + ramp_over(play / 2.0, SETTINGS.zoom).duration_s / 2.0
    assert lens.position_counts("zoom", barely_s) == started, "play comes before movement"


def test_homing_runs_against_the_stop_and_finds_it_from_anywhere() -> None:
    for seed in range(5):
        lens = TwinLens(SETTINGS, seed, cold=True)
        lens.home("focus", 0.0)
        assert lens.phase("focus", 0.1)[0] is LensPhase.TO_HOME
        assert lens.counter("focus", LONG_S) == 0
        assert lens.position_counts("focus", LONG_S) == pytest.approx(0.0)
        lens.seek("focus", 1234, LONG_S)
        assert lens.position_counts("focus", 2 * LONG_S) == pytest.approx(1234.0)


def test_steps_beyond_a_stop_are_lost() -> None:
    lens = TwinLens(SETTINGS, 3, cold=True)
    start = lens.position_counts("zoom", 0.0)
    lens.seek("zoom", 12000, 0.0)  # counted from somewhere in the travel
    assert lens.position_counts("zoom", LONG_S) == 12000.0
    lens.seek("zoom", 0, LONG_S)
    assert lens.counter("zoom", 2 * LONG_S) == 0
    assert lens.position_counts("zoom", 2 * LONG_S) < start


def test_lost_steps_and_a_turn_by_hand_go_unnoticed_until_homed(lens: TwinLens) -> None:
    lens.lose_steps("zoom", 0.1)
    lens.seek("zoom", 10000, 0.0)
    assert lens.counter("zoom", LONG_S) == 10000
    assert lens.position_counts("zoom", LONG_S) == pytest.approx(9000.0)
    lens.lose_steps("zoom", 0.0)
    lens.turn_by_hand("zoom", -500.0, LONG_S)
    assert lens.position_counts("zoom", LONG_S) == pytest.approx(8500.0)
    lens.home("zoom", LONG_S)
    lens.seek("zoom", 10000, 2 * LONG_S)
    assert lens.position_counts("zoom", 3 * LONG_S) == pytest.approx(10000.0)
    with pytest.raises(ValueError, match="between 0 and 1"):
        lens.lose_steps("zoom", math.nan)


def test_abort_slows_down_and_counting_stays_true(lens: TwinLens) -> None:
    lens.seek("zoom", 12000, 0.0)
    lens.abort("zoom", 0.5)
    assert lens.phase("zoom", 0.55) == (LensPhase.ABORT, 1, True)
    end = lens.counter("zoom", LONG_S)
    assert lens.counter("zoom", 0.5) < end < 12000
    assert lens.position_counts("zoom", LONG_S) == pytest.approx(end, abs=1.0)
    lens.abort("zoom", LONG_S)
    assert lens.counter("zoom", 2 * LONG_S) == end


def test_the_limit_is_the_far_end(lens: TwinLens) -> None:
    lens.limit("focus", 0.0)
    assert lens.phase("focus", 0.1)[0] is LensPhase.TO_LIMIT
    assert lens.position_counts("focus", LONG_S) == 8000.0


def test_many_movements_forget_only_the_distant_past(lens: TwinLens) -> None:
    for number in range(300):
        lens.seek("focus", 4000 + number % 2, float(number))
    assert lens.position_counts("focus", 299.9) == pytest.approx(4001.0)


def test_the_lamp_remembers_how_bright_it_was() -> None:
    light = TwinLight(shipped_settings().light)
    for number in range(1, 500):
        light.set_percent(number % 100, float(number))
    assert light.percent(499.5) == 99.0
    assert light.percent(480.2) == 80.0
    with pytest.raises(ValueError, match="between 0 and 100"):
        light.set_percent(math.nan, 500.0)


@pytest.mark.parametrize(
    "wrong", [{"start_counts": 12001.0}, {"initial_speed_counts_s": 9000.0}, {"limit_counts": 0}]
)
def test_constants_that_cannot_be_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValidationError):
        LensMotorSettings.model_validate({**SETTINGS.zoom.model_dump(), **wrong})
