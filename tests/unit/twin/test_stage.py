"""The physics of one stage, without any controller."""

import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from cosmic.twin.settings import shipped_settings
from cosmic.twin.stage import Path, Stage

LINEAR = shipped_settings().kinds["linear"]
PLACES = st.floats(-6000.0, 6000.0)
TIMES = st.floats(0.0, 1e6)


def stage(start: float = 0.0, seed: int = 0) -> Stage:
    return Stage("left.x", LINEAR, start=start, seed=seed)


def go(moved: Stage, time_s: float, target: float, speed: float) -> float:
    route = moved.route(time_s)
    route.go(target, speed)
    moved.follow(route, held_until_s=math.inf)
    return route.end_s


def test_a_stage_stands_where_it_was_put_until_it_is_moved() -> None:
    assert stage(12.5).position(0.0) == 12.5
    assert stage(12.5).position(1e6) == 12.5


def test_a_stage_cannot_stand_outside_its_travel() -> None:
    with pytest.raises(ValueError, match=r"left\.x"):
        stage(6000.1)
    with pytest.raises(ValueError):
        stage(math.nan)


@given(PLACES, PLACES, st.floats(1.0, 20_000.0), st.floats(0.0, 1.0))
def test_a_leg_is_straight_in_time(start: float, end: float, speed: float, part: float) -> None:
    moved = stage(start)
    end_s = go(moved, 5.0, end, speed)
    assert end_s - 5.0 == pytest.approx(abs(end - start) / speed)
    assert moved.position(5.0 + part * (end_s - 5.0)) == pytest.approx(
        start + part * (end - start), abs=1e-3
    )
    assert moved.position(end_s + 1e6) == pytest.approx(end, abs=1e-9)


@given(PLACES, st.floats(-1e9, 1e9), st.floats(0.0, 1e6), TIMES)
def test_a_stage_never_leaves_its_travel(
    start: float, target: float, speed: float, time_s: float
) -> None:
    moved = stage(start)
    route = moved.route(0.0)
    arrived = route.go(target, speed)
    moved.follow(route, held_until_s=0.0)
    assert arrived == (-6000.0 <= target <= 6000.0)
    assert -6000.0 <= moved.position(time_s) <= 6000.0


def test_step_size_grows_with_the_amplitude_from_a_threshold() -> None:
    assert stage().step_size(100.0, 1) == 1.5
    assert stage().step_size(55.0, 1) == pytest.approx(0.75)
    assert stage().step_size(100.0, -1) == pytest.approx(1.5 * 0.95)
    assert stage().step_size(10.0, 1) == 0.0
    assert stage().step_size(0.0, 1) == 0.0


def test_no_steps_go_no_way() -> None:
    assert stage().noisy_steps(0, 100.0) == 0.0


def test_the_same_seed_makes_the_same_steps() -> None:
    def ways(seed: int) -> list[float]:
        moved = stage(seed=seed)
        return [moved.noisy_steps(10, 100.0) for _ in range(5)]

    assert ways(1) == ways(1)
    assert ways(1) != ways(2)
    assert len(set(ways(1))) == 5


def test_halting_finishes_what_is_in_hand() -> None:
    moved = stage()
    go(moved, 0.0, 1000.0, 1000.0)
    end_s = moved.halt(0.5, coast_s=0.01, within_s=0.001)
    assert end_s == pytest.approx(0.501)
    assert moved.position(0.4) == pytest.approx(400.0)
    assert moved.position(0.501) == pytest.approx(510.0)
    assert moved.position(0.6) == pytest.approx(510.0, abs=0.01)


def test_creep_starts_when_the_hold_ends() -> None:
    moved = stage()
    route = moved.route(0.0)
    route.go(100.0, 1000.0)
    moved.follow(route, held_until_s=10.0)
    assert moved.position(10.0) == 100.0
    crept = abs(moved.position(10.0 + 60.0) - 100.0)
    assert 0.020 <= crept <= 0.050


def test_a_wall_stops_one_side_only_and_creep_does_not_pass_it() -> None:
    moved = stage()
    moved.obstruct(100.0, 1)
    route = moved.route(0.0)
    assert not route.go(200.0, 100.0)
    moved.follow(route, held_until_s=0.0)
    assert moved.position(2.0) == pytest.approx(100.0, abs=0.01)
    assert not moved.route(86_400.0).go(200.0, 100.0)
    assert moved.route(86_400.0).go(-200.0, 100.0)
    moved.clear_obstruction()
    assert moved.route(86_400.0).go(200.0, 100.0)


@given(
    st.lists(st.floats(0.0, 100.0), min_size=1, max_size=6).map(sorted),
    st.floats(0.0, 200.0),
    st.floats(0.0, 200.0),
)
@example(times_s=[1.0, 1.0], cut_s=1.0, look_s=0.0)
def test_cutting_a_path_keeps_what_was_before(
    times_s: list[float], cut_s: float, look_s: float
) -> None:
    path = Path(tuple(times_s), tuple(float(n * n) for n in range(len(times_s))))
    cut = path.cut(cut_s, end_s=cut_s, end=path.at(cut_s))
    assert list(cut.times_s) == sorted(cut.times_s)
    assert cut.at(look_s) == pytest.approx(path.at(min(look_s, cut_s)), abs=1e-6)


def test_the_past_stays_as_it_was_while_newer_movements_begin() -> None:
    moved = stage()
    go(moved, 1.0, 100.0, 100.0)
    go(moved, 1.5, -100.0, 100.0)
    moved.halt(2.0, coast_s=0.0, within_s=0.0)
    go(moved, 3.0, 500.0, 100.0)
    seen = [moved.position_then(time_s) for time_s in (0.5, 1.25, 1.5, 1.75, 2.5, 3.5)]
    assert seen == pytest.approx([0.0, 25.0, 50.0, 25.0, 0.0, 50.0], abs=0.01)
    assert moved.position_then(9.0) == moved.position(9.0)


def test_the_past_is_forgotten_in_the_end() -> None:
    moved = stage()
    for number in range(1000):
        go(moved, float(number), float(number % 7), 100.0)
    assert len(moved.paths) <= 64
    assert moved.position_then(999.5) == moved.position(999.5)
