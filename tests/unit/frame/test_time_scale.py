"""A hurried clock lets a procedure think as long as it would on a real platform."""

import math
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import pytest
from typing_extensions import override

from cosmic.frame.clock import WALL, Clock, ManualClock, RatedClock
from cosmic.frame.inbox import Inbox
from cosmic.frame.time_scale import (
    LONGEST_HOLD_S,
    MOST_EXPECTED,
    Expectations,
    ScaledHorizon,
    ScaledWorker,
    TimeScale,
)

RATE = 20.0


class Bench:
    """A pace whose wall a test moves."""

    def __init__(self) -> None:
        self.wall_s = 100.0
        self.time_scale = TimeScale(RATE, lambda: self.wall_s)
        self.workers: list[ScaledWorker] = []

    def worker(self, *, leads: bool = False) -> ScaledWorker:
        self.workers.append(ScaledWorker(self.time_scale, leads=leads))
        return self.workers[-1]

    def passes(self, wall_s: float) -> float:
        """Return how much time passes in so much wall time."""
        before_s = self.time_scale.now_s()
        self.wall_s += wall_s
        return self.time_scale.now_s() - before_s


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_without_a_procedure_time_runs_at_its_rate_whoever_works(bench: Bench) -> None:
    bench.worker().busy()
    bench.time_scale.begin_wait("somebody", threading.Condition(), 1.0)
    assert bench.passes(2.0) == pytest.approx(40.0)


def test_a_procedure_hurries_while_it_waits_and_thinks_at_leisure(bench: Bench) -> None:
    procedure = bench.worker(leads=True)
    procedure.busy()
    assert bench.passes(2.0) == pytest.approx(2.0)
    procedure.idle()
    assert bench.passes(2.0) == pytest.approx(40.0)
    procedure.busy()
    procedure.busy()
    procedure.idle()
    procedure.close()
    procedure.busy()  # one that is over holds nobody up
    assert bench.passes(2.0) == pytest.approx(40.0)


def test_all_who_work_are_waited_for_while_a_procedure_is_under_way(bench: Bench) -> None:
    bench.worker(leads=True)
    one, other = bench.worker(), bench.worker()
    one.busy()
    other.busy()
    one.idle()
    assert bench.passes(1.0) == pytest.approx(1.0)
    other.close()
    assert bench.passes(1.0) == pytest.approx(RATE)


def test_whoever_wakes_late_is_waited_for(bench: Bench) -> None:
    bench.worker(leads=True)
    condition = threading.Condition()
    assert bench.time_scale.begin_wait("a", condition, 10.0) == pytest.approx(0.5)
    bench.time_scale.begin_wait("b", condition, 30.0)
    assert bench.passes(1.5) == pytest.approx(10.0 + 1.0)  # due after 0.5 s of the wall
    bench.time_scale.end_wait("a")
    assert bench.passes(0.5) == pytest.approx(10.0)


def test_a_wait_for_what_has_passed_is_none(bench: Bench) -> None:
    assert bench.time_scale.begin_wait("a", threading.Condition(), 0.0) == 0.0
    bench.worker(leads=True)
    assert bench.passes(1.0) == pytest.approx(RATE)


def test_who_waits_while_others_work_is_woken_at_their_end(bench: Bench) -> None:
    bench.worker(leads=True)
    working, woken = bench.worker(), list[str]()

    class OnResult(threading.Condition):
        @override
        def notify_all(self) -> None:
            woken.append("told")
            super().notify_all()

    condition = OnResult()
    working.busy()
    assert bench.time_scale.begin_wait("a", condition, 0.015) == pytest.approx(0.015)
    with condition:
        working.idle()  # it holds the lock itself, as many do
    assert woken == ["told"]
    working.busy()
    with ThreadPoolExecutor(1) as pool, condition:
        pool.submit(working.idle).result(5.0)  # and never waits for one
    assert woken == ["told"]


class Told(threading.Condition):
    """Counts how often it was notified."""

    def __init__(self) -> None:
        super().__init__()
        self.times = 0

    @override
    def notify_all(self) -> None:
        self.times += 1
        super().notify_all()


def test_only_who_is_due_next_is_woken_at_the_end_of_work(bench: Bench) -> None:
    bench.worker(leads=True)
    working, first, second = bench.worker(), Told(), Told()
    working.busy()
    bench.time_scale.begin_wait("second", second, 0.04)
    bench.time_scale.begin_wait("first", first, 0.015)
    working.idle()
    assert (first.times, second.times) == (1, 0)
    bench.time_scale.end_wait("first")
    working.busy()
    working.idle()
    assert (first.times, second.times) == (1, 1)


def test_who_is_due_later_waits_longer_and_is_woken_when_the_next_has_gone_on(
    bench: Bench,
) -> None:
    bench.worker(leads=True)
    second, wait_s = Told(), bench.time_scale.begin_wait
    assert wait_s("first", Told(), 0.02) == pytest.approx(0.02 / RATE)
    assert wait_s("second", second, 0.04) == pytest.approx(0.02), "it looks again now and then"
    bench.time_scale.end_wait("first")
    assert second.times == 0, "the first may be at work in a moment"
    wait_s("first", Told(), 5.0)
    assert second.times == 1
    bench.time_scale.end_wait("second")
    assert wait_s("second", second, 0.02) == pytest.approx(0.02 / RATE)


def test_the_time_waits_at_the_nearest_horizon_and_makes_up_for_nothing(bench: Bench) -> None:
    near, far = ScaledHorizon(bench.time_scale), ScaledHorizon(bench.time_scale)
    near.move_to(10.0)
    far.move_to(30.0)
    assert bench.passes(2.0) == pytest.approx(10.0)
    near.move_to(11.0)
    assert bench.passes(2.0) == pytest.approx(1.0)
    near.close()
    near.close()
    assert bench.passes(0.1) == pytest.approx(2.0)  # as if the four seconds had not been
    far.move_to(math.inf)
    assert bench.passes(2.0) == pytest.approx(40.0)


def test_a_horizon_behind_the_time_takes_none_of_it_back(bench: Bench) -> None:
    bench.passes(1.0)
    now_s = bench.time_scale.now_s()
    ScaledHorizon(bench.time_scale).move_to(now_s - 5.0)
    assert bench.passes(1.0) == 0.0


def test_who_hangs_stops_nobody_for_ever(bench: Bench) -> None:
    hanging, other = ScaledHorizon(bench.time_scale), ScaledHorizon(bench.time_scale)
    hanging.move_to(1.0)
    other.move_to(500.0)
    looks = round(LONGEST_HOLD_S / 0.5)
    assert sum(bench.passes(0.5) for _ in range(looks)) == pytest.approx(1.0)
    assert bench.passes(1.0) + bench.passes(1.0) >= 20.0  # it goes on without it
    hanging.move_to(bench.time_scale.now_s() + 1.0)  # there it is again, and is waited for
    assert bench.passes(2.0) == pytest.approx(1.0)


def test_all_who_are_silent_hold_the_time_but_once(bench: Bench) -> None:
    horizons = [ScaledHorizon(bench.time_scale) for _ in range(7)]
    for number, each in enumerate(horizons):
        each.move_to(1.0 + 0.01 * number)
    talking = ScaledHorizon(bench.time_scale)
    held_s = 0.0
    while bench.time_scale.now_s() < 2.0:
        talking.move_to(100.0)
        bench.passes(0.1)
        held_s += 0.1
    assert held_s <= LONGEST_HOLD_S + 0.5
    bench.passes(30.0)
    assert bench.time_scale.now_s() == pytest.approx(100.0), "who talks is still waited for"
    talking.move_to(bench.time_scale.now_s() + 1.0)
    assert bench.passes(2.0) == pytest.approx(1.0)


def test_who_waits_is_woken_when_the_time_goes_on_and_does_not_spin_before(bench: Bench) -> None:
    woken = list[str]()

    class OnResult(threading.Condition):
        @override
        def notify_all(self) -> None:
            woken.append("told")
            super().notify_all()

    horizon = ScaledHorizon(bench.time_scale)
    horizon.move_to(1.0)
    bench.passes(1.0)
    assert bench.time_scale.begin_wait("a", OnResult(), 1.001) > 0.01
    horizon.move_to(3.0)
    assert woken == ["told"]


def test_the_rate_reached_is_reported(bench: Bench) -> None:
    horizon = ScaledHorizon(bench.time_scale)
    for _ in range(20):
        bench.passes(0.2)
    assert bench.time_scale.reached == pytest.approx(RATE)
    for _ in range(20):
        horizon.move_to(bench.time_scale.now_s() + 1.0)
        bench.passes(0.2)
    assert bench.time_scale.reached == pytest.approx(5.0)


@pytest.mark.parametrize("rate", [0.5, 1.0])
def test_a_clock_that_waits_runs_at_its_rate_below_that_of_the_wall_too(rate: float) -> None:
    wall_s = [0.0]
    time_scale = TimeScale(rate, lambda: wall_s[0])
    wall_s[0] = 10.0
    assert time_scale.now_s() == pytest.approx(10.0 * rate)


def test_only_a_clock_that_was_set_so_waits() -> None:
    for rate in (1.0, 20.0):
        clock = RatedClock(rate)
        clock.horizon().move_to(clock.now_s())
        before_s = clock.now_s()
        WALL.sleep(0.001)
        assert clock.now_s() > before_s
        waiting = RatedClock(rate, waits=True)
        waiting.horizon().move_to(waiting.now_s())
        before_s = waiting.now_s()
        WALL.sleep(0.001)
        assert waiting.now_s() == before_s


@pytest.fixture
def clock() -> Iterator[Clock]:
    clock = RatedClock(1000.0)
    leading = clock.worker(leads=True)
    yield clock
    leading.close()


def test_what_is_done_at_work_takes_wall_time(clock: Clock) -> None:
    with clock.at_work():
        own_s, wall_s = clock.now_s(), WALL.now_s()
        clock.sleep(0.02)
        own_s, wall_s = clock.now_s() - own_s, WALL.now_s() - wall_s
    assert own_s == pytest.approx(wall_s, abs=0.001)
    own_s, wall_s = clock.now_s(), WALL.now_s()
    clock.sleep(20.0)
    assert WALL.now_s() - wall_s < 10.0


def test_a_wait_ends_when_it_is_due_whatever_the_pace_was_meanwhile(clock: Clock) -> None:
    condition, worker = threading.Condition(), clock.worker()
    until_s = clock.now_s() + 20.0
    turns = 0
    with condition:
        while clock.now_s() < until_s:
            turns += 1
            (worker.busy if turns % 2 else worker.idle)()
            clock.wait(condition, until_s)
    assert clock.now_s() >= until_s


def test_time_never_goes_back_while_its_pace_changes(clock: Clock) -> None:
    over = threading.Event()

    def change() -> None:
        while not over.is_set():
            with clock.at_work():
                clock.sleep(1e-5)

    thread = threading.Thread(target=change)
    thread.start()
    times = [clock.now_s() for _ in range(5000)]
    over.set()
    thread.join()
    assert times == sorted(times)


@pytest.mark.parametrize("clock", [RatedClock(), RatedClock(0.5), ManualClock()])
def test_clocks_no_faster_than_the_wall_know_no_work(clock: Clock) -> None:
    worker = clock.worker(leads=True)
    with clock.at_work():
        worker.busy()
        before_s = clock.now_s()
    worker.close()
    assert clock.now_s() >= before_s


def test_what_is_put_into_an_inbox_is_work_until_its_thread_waits_for_more() -> None:
    clock = RatedClock(1000.0)
    leading, inbox = clock.worker(leads=True), Inbox[int](clock)

    def passes() -> float:
        own_s, wall_s = clock.now_s(), WALL.now_s()
        while WALL.now_s() < wall_s + 0.01:
            clock.now_s()
        return (clock.now_s() - own_s) / (WALL.now_s() - wall_s)

    assert passes() > 100.0
    inbox.put(7)
    assert passes() == pytest.approx(1.0, abs=0.1)
    assert inbox.get(0.0) == 7
    assert passes() == pytest.approx(1.0, abs=0.1)
    threading.Thread(target=lambda: inbox.put(8)).start()
    assert inbox.get(5.0) == 8
    inbox.close()
    assert passes() > 100.0
    leading.close()


def test_reading_the_time_waits_for_nobody_who_works_it_out() -> None:
    inside, go_on = threading.Event(), threading.Event()
    held_up: list[threading.Thread] = []

    def wall_s() -> float:
        if threading.current_thread() in held_up:
            inside.set()
            assert go_on.wait(20.0)
        return WALL.now_s()

    time_scale = TimeScale(1.0, wall_s)
    before_s = time_scale.now_s()
    held_up.append(threading.Thread(target=time_scale.now_s))
    held_up[0].start()
    assert inside.wait(20.0)
    assert time_scale.now_s() >= before_s  # and comes back
    go_on.set()
    held_up[0].join()
    assert time_scale.now_s() > before_s


def test_times_to_come_are_in_order_and_those_before_are_dropped():
    expectations = Expectations()
    for each in (3.0, 1.0, 2.0):
        expectations.add(each)
    assert expectations.next_s(0.5) == 1.0
    assert expectations.next_s(1.0) == 2.0, "what has come is waited for no longer"
    assert expectations.next_s(0.0) == 2.0
    assert expectations.next_s(3.0) == math.inf


def test_whoever_brings_it_hears_of_a_new_one():
    expectations, heard = Expectations(), []
    expectations.added.subscribe(heard.append)
    expectations.add(4.0)
    assert heard == [4.0]


def test_for_ever_is_waited_for_by_nobody():
    expectations, heard = Expectations(), []
    expectations.added.subscribe(heard.append)
    expectations.add(math.inf)
    expectations.add(math.nan)
    assert heard == []
    assert expectations.next_s(0.0) == math.inf


def test_what_nobody_comes_for_does_not_grow_for_ever():
    expectations = Expectations()
    for number in range(10 * MOST_EXPECTED):
        expectations.add(float(number))
    assert expectations.next_s(-1.0) == 0.0
    assert expectations.next_s(MOST_EXPECTED - 1.0) == math.inf, "the latest ones are not kept"
