"""A run: its states, pauses and steps, its thread, and what it tells."""

import threading
import time
from collections.abc import Callable

import pytest

from cosmic.autonomy.procedures.combinators import Guard, Parallel, Repeat, Retry, Sequence
from cosmic.autonomy.procedures.failures import ProcedureAborted
from cosmic.autonomy.procedures.operation import SAFE_POINT, OperationFailed
from cosmic.autonomy.procedures.procedure import Part, Procedure
from cosmic.autonomy.procedures.run import ProcedureRun
from cosmic.autonomy.procedures.tree import NodeEvent
from cosmic.frame.clock import ManualClock, RatedClock
from cosmic.frame.errors import DeviceTimeout, NotAvailable, WrongThreadError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.threads import declare_gui_thread
from unit.autonomy.procedures.parts import MOVE, FakeMove, Op, Work, done, ends, run_of

LIMIT_S = 10.0


class Watcher:
    """Waits for a run to be at something, and remembers its states."""

    def __init__(self, run: ProcedureRun[Work]) -> None:
        self._run = run
        self._changed = threading.Condition()
        self.states: list[str] = []
        run.on_change(self._note)

    def _note(self) -> None:
        with self._changed:
            state = str(self._run.state)
            if not self.states or self.states[-1] != state:
                self.states.append(state)
            self._changed.notify_all()

    def until(self, condition: Callable[[], bool]) -> None:
        with self._changed:
            assert self._changed.wait_for(condition, LIMIT_S), self._run

    def state(self, state: str) -> None:
        self.until(lambda: self._run.state == state)


def begun(part: Part[Work], rate: float = 100.0) -> tuple[ProcedureRun[Work], Watcher]:
    run = run_of(part, Work(RatedClock(rate)))
    return run, Watcher(run)


def wait_until(condition: Callable[[], bool]) -> None:
    """Wait for what nobody tells of."""
    ring = threading.Event()
    end_s = time.monotonic() + LIMIT_S
    while not condition():
        assert time.monotonic() < end_s
        ring.wait(0.005)


# Pause, resume, step


def test_a_pause_rests_at_the_next_safe_point_and_nowhere_else() -> None:
    part = Sequence("all", Op("a"), Op("b", steps=(MOVE, SAFE_POINT, 1.0)), Op("c"))
    run, watcher = begun(part)
    run.work.at_point = lambda number: run.pause() if number == 0 else None
    run.start()
    watcher.state("paused")
    assert done(run) == ["a", "b"]
    assert not run.work.moving
    assert run.work.points == 3, "it rests where the safe point was yielded"
    assert watcher.states == ["running", "pausing", "paused"]
    run.resume()
    run.wait(LIMIT_S)
    assert done(run) == ["a", "b", "c"]
    assert watcher.states[3:] == ["running", "done"]


def test_a_pause_without_a_safe_point_comes_to_nothing() -> None:
    run = run_of(Sequence("all", Op("a"), Op("b")))
    run.work.at_point = lambda _number: run.pause()
    run.run_here()
    assert run.state == "done"


def test_a_pause_that_is_taken_back_before_the_safe_point_does_not_rest() -> None:
    run = run_of(Op("a", steps=(1.0, SAFE_POINT)))
    states: list[str] = []

    def at(number: int) -> None:
        if number == 0:
            run.pause()
            states.append(str(run.state))
            run.resume()
            states.append(str(run.state))

    run.work.at_point = at
    run.run_here()
    assert states == ["pausing", "running"]


def test_a_procedure_may_rest_between_two_rounds() -> None:
    run, watcher = begun(Repeat(Op("fibre"), lambda work: len(work.log) >= 6))
    run.work.at_point = lambda number: run.pause() if number == 1 else None
    run.start()
    watcher.state("paused")
    assert done(run) == ["fibre"] * 2
    run.resume()
    run.wait(LIMIT_S)
    assert done(run) == ["fibre"] * 3


def test_parts_side_by_side_rest_when_each_has_come_to_its_own_safe_point() -> None:
    left = Op("left", steps=(0.1, SAFE_POINT, 0.1))
    right = Op("right", steps=(MOVE, MOVE, SAFE_POINT, 0.1))
    run, watcher = begun(Parallel("both", left, right))
    run.work.at_point = lambda number: run.pause() if number == 0 else None
    run.start()
    watcher.state("paused")
    assert not run.work.moving
    assert len(run.work.moves) == 2
    assert "left ran" not in run.work.log
    run.resume()
    run.wait(LIMIT_S)
    assert "left ran" in run.work.log


def test_a_pause_takes_no_time_of_the_operations_and_no_guard_trips_in_it() -> None:
    clock = ManualClock()
    work = Work(clock)
    asked, looked = [0], [0]

    def high(_work: Work) -> bool:
        asked[0] += 1
        return run.state != "paused"

    def stopped() -> None:
        looked[0] += 1

    part = Guard(Op("hold", steps=(SAFE_POINT, 1.0)), high, "low")
    run = ProcedureRun(Procedure("trial", part), work, clock, FailurePolicy(), stopped=stopped)
    watcher = Watcher(run)
    work.at_point = lambda number: run.pause() if number == 0 else None
    run.start()
    watcher.state("paused")
    asked_before, looked_before = asked[0], looked[0]
    clock.advance(100.0)
    wait_until(lambda: looked[0] > looked_before + 1)
    assert asked[0] == asked_before
    assert run.state == "paused"
    assert run.tree.duration_s == 0.0
    run.resume()

    def ended() -> bool:
        clock.advance(0.1)
        return run.over

    wait_until(ended)
    run.wait(LIMIT_S)
    times = run.times.summary()[0]
    assert (times.name, times.done) == ("hold", 1)
    assert 1.0 <= times.total_s < 50.0


def test_a_step_carries_out_one_operation_and_rests() -> None:
    part = Sequence("all", Op("a", steps=(SAFE_POINT, 0.1)), Retry(Op("b"), 2), Op("c"))
    run, watcher = begun(part)
    states: list[str] = []
    run.subscribe(lambda _event: states.append(str(run.state)))
    for name in ("a", "b", "c"):
        run.step()
        watcher.until(lambda name=name: run.state == "paused" and f"{name} ran" in run.work.log)
        assert done(run)[-1] == name
    run.resume()
    run.wait(LIMIT_S)
    assert watcher.states[:3] == ["pausing", "paused", "pausing"]
    assert "paused" not in states, "while an operation runs it is on its way to the rest"


def test_a_step_rests_after_a_failure_too_before_anything_is_undone() -> None:
    run, watcher = begun(Retry(Op("a", fails_in="run", times=1), 2))
    run.step()
    watcher.state("paused")
    assert done(run) == ["a"]
    assert run.tree.children[0].state == "failed"
    run.step()
    watcher.until(lambda: "a ran" in run.work.log and run.state == "paused")
    assert done(run) == ["a", "undo a", "a"]
    run.resume()
    run.wait(LIMIT_S)


def test_a_step_of_parts_side_by_side_is_one_operation_of_each() -> None:
    left = Sequence("left", Op("l1"), Op("l2"))
    right = Sequence("right", Op("r1", steps=(MOVE, MOVE)), Op("r2"))
    run, watcher = begun(Parallel("both", left, right))
    run.step()
    watcher.state("paused")
    assert sorted(done(run)) == ["l1", "r1"]
    run.step()
    watcher.until(lambda: "r2 ran" in run.work.log and run.state == "paused")
    assert sorted(done(run)) == ["l1", "l2", "r1", "r2"]
    run.resume()
    run.wait(LIMIT_S)


def test_a_paused_run_goes_on_by_steps_and_a_stepped_one_freely() -> None:
    run, watcher = begun(Sequence("all", Op("a", steps=(SAFE_POINT,)), Op("b"), Op("c"), Op("d")))
    run.work.at_point = lambda number: run.pause() if number == 0 else None
    run.start()
    watcher.state("paused")
    run.step()
    watcher.until(lambda: run.state == "paused" and "a ran" in run.work.log)
    assert done(run) == ["a"]
    run.resume()
    run.wait(LIMIT_S)
    assert done(run) == ["a", "b", "c", "d"]


def test_an_abort_in_a_pause_ends_it() -> None:
    run, watcher = begun(Op("a", steps=(SAFE_POINT, 1.0)))
    run.work.at_point = lambda number: run.pause() if number == 0 else None
    run.start()
    watcher.state("paused")
    run.abort("no more")
    with pytest.raises(ProcedureAborted, match="no more"):
        run.wait(LIMIT_S)
    assert done(run) == ["a", "safe"]
    assert not run.not_safe, "the making safe does not rest in a pause that is over"


def test_what_makes_no_sense_now_is_harmless() -> None:
    run = run_of(Op("a"))
    run.pause()
    run.resume()
    assert run.state == "ready"
    run.run_here()
    run.pause()
    run.resume()
    assert run.state == "done"
    with pytest.raises(NotAvailable, match="already started"):
        run.run_here()


# The thread and the time


def test_an_abort_reaches_a_long_wait_at_once() -> None:
    run, watcher = begun(Op("a", steps=(1000.0,)), rate=1.0)
    run.start()
    watcher.until(lambda: "a" in run.work.log)
    begun_s = time.monotonic()
    run.abort()
    with pytest.raises(ProcedureAborted):
        run.wait(LIMIT_S)
    # half a second of it to make it safe
    assert time.monotonic() - begun_s < 2.5


def test_a_rate_of_100_is_a_hundred_times_faster() -> None:
    run, _ = begun(Sequence("all", Op("a", steps=(10.0,)), Op("b", steps=(MOVE,) * 5)))
    begun_s = time.monotonic()
    run.start()
    run.wait(LIMIT_S)
    assert 0.14 < time.monotonic() - begun_s < 5.0
    assert 14.9 < run.tree.duration_s < 500.0


def test_a_movement_that_reports_its_end_is_not_waited_for_longer() -> None:
    callbacks: list[Callable[[object], None]] = []

    class Telling(FakeMove):
        @property
        def done(self) -> bool:
            return self.cancelled or bool(ended)

        def wait(self, timeout_s: float | None = None) -> None:
            assert self.done

        def add_callback(self, callback: Callable[[object], None]) -> None:
            callbacks.append(callback)

    ended: list[bool] = []

    class Moves(Op):
        def _do(self, work: Work, steps: object) -> object:  # type: ignore[override]
            move = Telling(work, self.name)
            yield move

    run, watcher = begun(Moves("a"), rate=1.0)
    run.start()
    watcher.until(lambda: bool(callbacks))
    ended.append(True)
    callbacks[0](None)
    run.wait(LIMIT_S)
    assert run.state == "done"


def test_the_end_of_the_program_aborts_a_run() -> None:
    run, watcher = begun(Op("a", steps=(1000.0,)), rate=1.0)
    run.start()
    watcher.until(lambda: "a" in run.work.log)
    assert run._thread is not None
    run._thread.request_end()
    with pytest.raises(ProcedureAborted, match="closing"):
        run.wait(LIMIT_S)


def test_waiting_has_a_limit_and_may_not_freeze_a_window() -> None:
    run, _ = begun(Op("a", steps=(1000.0,)), rate=1.0)
    run.start()
    with pytest.raises(DeviceTimeout, match=r"trial had not ended after 0\.01 s"):
        run.wait(0.01)
    take_back = declare_gui_thread()
    try:
        with pytest.raises(WrongThreadError):
            run.wait()
        with pytest.raises(WrongThreadError):
            run_of(Op("b")).run_here()
    finally:
        take_back()
    run.abort()
    with pytest.raises(ProcedureAborted):
        run.wait(LIMIT_S)


def test_a_run_cannot_wait_for_itself() -> None:
    caught: list[Exception] = []
    run, _ = begun(Op("a"))

    def wait(_number: int) -> None:
        try:
            run.wait()
        except WrongThreadError as exc:
            caught.append(exc)

    run.work.at_point = wait
    run.start()
    run.wait(LIMIT_S)
    assert caught


def test_an_interruption_from_the_keyboard_ends_all_and_leaves_it_safe() -> None:
    work = Work()
    run = run_of(Op("a", steps=(MOVE,)), work)

    def interrupt(_number: int) -> None:
        raise KeyboardInterrupt

    run.subscribe(lambda _event: None)
    work.at_point = interrupt
    with pytest.raises(KeyboardInterrupt):
        run.run_here()
    assert run.state == "aborted"
    assert done(run)[-1] == "safe"


# What it tells


def test_events_come_in_order_with_times_of_the_platform() -> None:
    events: list[NodeEvent] = []
    run = run_of(Retry(Op("a", fails_in="run", times=1, looks=(0.5,)), 2))
    unsubscribe = run.subscribe(events.append)
    run.run_here()
    unsubscribe()
    seen = [(each.path, str(each.state), each.attempt) for each in events]
    a = (0,)
    assert seen == [
        ((), "running", 1),
        (a, "running", 1),
        (a, "failed", 1),
        (a, "undoing", 1),
        (a, "undone", 1),
        (a, "running", 2),
        (a, "verifying", 2),
        (a, "done", 2),
        ((), "done", 1),
    ]
    failed, last = events[2], events[7]
    assert (failed.cause, failed.started_s, failed.ended_s) == ("missed grasp", 0.0, 1.0)
    assert "nothing between the jaws" in failed.text
    assert (last.cause, last.duration_s) == ("", 1.5)


def test_a_listener_that_fails_harms_nobody(caplog: pytest.LogCaptureFixture) -> None:
    def bad(_event: NodeEvent) -> None:
        raise ValueError("no")

    run = run_of(Op("a"))
    run.subscribe(bad)
    run.run_here()
    assert run.state == "done"
    assert "a subscriber failed" in caplog.text


def test_the_tree_shows_every_part_before_the_begin() -> None:
    part = Sequence("all", Retry(Op("a"), 3, between=Op("b")), Parallel("both", Op("c"), Op("d")))
    run = run_of(part)
    assert [(name, state) for name, state in ends(run)] == [
        (name, "waiting") for name in ("all", "up to 3 times", "a", "b", "both", "c", "d")
    ]
    assert [view.kind for view in run.tree.children] == ["retry", "parallel"]


def test_one_description_serves_many_runs() -> None:
    procedure = Procedure("trial", Sequence("all", Op("a"), Op("b")))
    runs = [ProcedureRun(procedure, w := Work(), w.clock, FailurePolicy()) for _ in range(2)]
    for run in runs:
        run.run_here()
    assert [done(run) for run in runs] == [["a", "b"]] * 2


def test_the_times_of_operations_add_up() -> None:
    part = Sequence(
        "all",
        Retry(Op("a", steps=(2.0,), fails_in="run", times=2), 3),
        Op("b", steps=(0.5,)),
        Op("c", fails_in="verify"),
    )
    run = run_of(part)
    with pytest.raises(OperationFailed):
        run.run_here()
    a, b, c = run.times.summary()
    assert (a.name, a.count, a.done, a.failed) == ("a", 3, 1, 2)
    assert (a.median_s, a.p95_s, a.total_s) == (2.0, 2.0, 6.0)
    assert (b.count, b.median_s) == (1, 0.5)
    assert (c.done, c.failed) == (0, 1)
    assert run.times.causes == {"missed grasp": 3}
    assert run.times.causes_of("a") == {"missed grasp": 2}
    assert run.times.causes_of("b") == {}
