"""Time that runs, runs faster, or stands until a test moves it."""

import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import pytest

from cosmic.frame.clock import WALL, Clock, ManualClock, RatedClock, WallClock

LONG_S = 20.0


@pytest.mark.parametrize("rate", [0.0, -1.0, float("nan"), float("inf"), 1e6])
def test_a_rate_that_makes_no_sense_is_refused(rate: float) -> None:
    with pytest.raises(ValueError, match="rate"):
        RatedClock(rate)


@pytest.mark.parametrize("clock", [WALL, WallClock(), RatedClock(50.0)])
def test_a_running_clock_never_goes_back_and_moves_on(clock: Clock) -> None:
    first = clock.now_s()
    clock.sleep(0.001)
    times = [clock.now_s() for _ in range(1000)]
    assert times == sorted(times)
    assert first < times[0]


def test_the_wall_runs_at_rate_one() -> None:
    assert WALL.rate == 1.0


def test_a_rated_clock_sleeps_shorter_by_its_rate() -> None:
    clock = RatedClock(1000.0)
    wall_s, own_s = WALL.now_s(), clock.now_s()
    clock.sleep(100.0)
    assert clock.now_s() - own_s >= 100.0
    assert 0.1 <= WALL.now_s() - wall_s < LONG_S


def test_a_rated_clock_keeps_its_ratio_to_the_wall() -> None:
    clock = RatedClock(1000.0)
    wall_s, own_s = WALL.now_s(), clock.now_s()
    clock.sleep(20.0)
    own_s, wall_s = clock.now_s() - own_s, WALL.now_s() - wall_s
    assert own_s == pytest.approx(1000.0 * wall_s, rel=0.2)


@pytest.mark.parametrize(
    "clock", [RatedClock(1000.0), ManualClock(), ManualClock(auto_advance=True)]
)
@pytest.mark.parametrize("duration_s", [0.0, -1.0])
def test_sleeping_for_no_time_returns_at_once(clock: Clock, duration_s: float) -> None:
    before_s = clock.now_s()
    clock.sleep(duration_s)
    assert clock.now_s() >= before_s


@pytest.mark.parametrize("clock", [RatedClock(1000.0), ManualClock(auto_advance=True)])
def test_waiting_reaches_the_time_waited_for(clock: Clock) -> None:
    condition = threading.Condition()
    until_s = clock.now_s() + 50.0
    with condition:
        while clock.now_s() < until_s:
            clock.wait(condition, until_s)
    assert clock.now_s() >= until_s


@pytest.mark.parametrize("clock", [RatedClock(), ManualClock()])
def test_a_notification_ends_a_wait_early(clock: Clock) -> None:
    condition, notified = threading.Condition(), []

    def wait() -> None:
        with condition:
            while not notified:
                clock.wait(condition, clock.now_s() + 1e6)

    with ThreadPoolExecutor() as pool:
        waiting = pool.submit(wait)
        with condition:
            notified.append(True)
            condition.notify_all()
        waiting.result(LONG_S)


def test_waiting_for_ever_does_not_move_a_manual_clock() -> None:
    clock, condition = ManualClock(auto_advance=True), threading.Condition()
    with condition:
        clock.wait(condition, float("inf"))
    assert clock.now_s() == 0.0


def test_a_manual_clock_stands_until_it_is_advanced() -> None:
    clock = ManualClock()
    assert (clock.rate, clock.now_s()) == (0.0, 0.0)
    clock.advance(0.25)
    clock.advance(0.0)
    assert clock.now_s() == 0.25


@pytest.mark.parametrize("step_s", [-0.1, float("nan"), float("inf")])
def test_a_manual_clock_moves_forward_by_finite_steps_only(step_s: float) -> None:
    clock = ManualClock()
    with pytest.raises(ValueError, match="forward"):
        clock.advance(step_s)
    assert clock.now_s() == 0.0


def _sleeper(clock: Clock) -> float:
    clock.sleep(2.0)
    return clock.now_s()


def _waiter(clock: Clock) -> float:
    condition = threading.Condition()
    with condition:
        while clock.now_s() < 2.0:
            clock.wait(condition, 2.0)
    return clock.now_s()


@pytest.mark.parametrize("body", [_sleeper, _waiter])
def test_threads_wait_for_a_manual_clock_until_it_is_advanced_far_enough(
    body: Callable[[Clock], float],
) -> None:
    clock = ManualClock()
    with ThreadPoolExecutor() as pool:
        ends = [pool.submit(body, clock) for _ in range(3)]
        clock.advance(1.5)
        assert not any(end.done() for end in ends)
        clock.advance(1.0)
        assert [end.result(LONG_S) for end in ends] == [2.5, 2.5, 2.5]


def test_a_clock_that_advances_itself_sleeps_in_no_time_and_arrives_exactly() -> None:
    clock, wall_s = ManualClock(auto_advance=True), WALL.now_s()
    clock.sleep(3600.0)
    clock.sleep(0.5)
    assert clock.now_s() == 3600.5
    assert WALL.now_s() - wall_s < LONG_S
