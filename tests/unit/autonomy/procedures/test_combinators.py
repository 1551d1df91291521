"""What each way of putting operations together does when all goes well, and when not."""

import pytest

from cosmic.autonomy.procedures.combinators import (
    Fallback,
    Guard,
    Parallel,
    Repeat,
    Retry,
    Sequence,
)
from cosmic.autonomy.procedures.failures import UndoFailed
from cosmic.autonomy.procedures.operation import OperationFailed, Steps
from cosmic.frame.errors import CosmicError, DeviceError, DeviceFault
from unit.autonomy.procedures.parts import (
    MOVE,
    Op,
    Work,
    done,
    ends,
    missed,
    moving_when_undone,
    run_of,
)


def broken() -> CosmicError:
    return DeviceError("camera 0: no answer", fault=DeviceFault.TIMEOUT)


def test_a_sequence_carries_its_parts_out_in_order() -> None:
    run = run_of(Sequence("all", Op("a", looks=(1.0,)), Op("b", steps=(MOVE,)), Op("c")))
    run.run_here()
    assert done(run) == ["a", "see a", "b", "c"]
    assert run.state == "done"
    assert run.work.clock.now_s() == pytest.approx(4.0, abs=0.05)
    assert set(ends(run)) == {("all", "done"), ("a", "done"), ("b", "done"), ("c", "done")}


@pytest.mark.parametrize("phase", ["precondition", "run", "verify", "move"])
def test_a_sequence_ends_at_the_first_part_that_fails(phase: str) -> None:
    bad = Op("b", steps=(MOVE,), fails_in=phase)
    run = run_of(Sequence("all", Op("a"), bad, Op("c")))
    with pytest.raises(OperationFailed, match="nothing between the jaws") as caught:
        run.run_here()
    assert caught.value.cause == "missed grasp"
    assert run.failure is caught.value
    assert run.state == "failed"
    assert "c" not in run.work.log
    assert dict(ends(run))["c"] == "waiting"


@pytest.mark.parametrize(
    ("phase", "undone"), [("precondition", False), ("run", True), ("verify", True), ("move", True)]
)
def test_what_failed_is_undone_unless_it_was_never_begun(phase: str, undone: bool) -> None:
    bad = Op("b", steps=(MOVE,), fails_in=phase)
    run = run_of(Sequence("all", Op("a"), bad))
    with pytest.raises(OperationFailed):
        run.run_here()
    assert ("undo b" in run.work.log) is undone
    assert "undo a" not in run.work.log, "what was done well stays"
    assert done(run)[-1] == "safe", "a procedure that failed leaves things safe"
    assert dict(ends(run))["b"] == ("undone" if undone else "failed")


def test_a_retry_tries_again_after_undoing_all_that_the_part_did() -> None:
    part = Sequence("grasp", Op("down"), Op("close", fails_in="verify", times=2))
    run = run_of(Retry(part, 3))
    run.run_here()
    once = ["down", "close", "see close", "undo close", "undo down"]
    assert done(run) == [*once, *once, "down", "close", "see close"]
    assert run.tree.children[0].attempt == 3
    assert run.times.causes == {"missed grasp": 2}


def test_a_retry_gives_up_after_its_last_try() -> None:
    run = run_of(Retry(Op("close", fails_in="run"), 3))
    with pytest.raises(OperationFailed, match="missed grasp"):
        run.run_here()
    assert done(run) == ["close", "undo close"] * 3 + ["safe"]


def test_a_retry_does_what_lies_between_two_tries_only_there() -> None:
    run = run_of(Retry(Op("close", fails_in="run", times=2), 3, between=Op("shift")))
    run.run_here()
    assert done(run) == ["close", "undo close", "shift"] * 2 + ["close"]


def test_a_retry_ends_where_what_lies_between_fails() -> None:
    run = run_of(Retry(Op("close", fails_in="run"), 3, between=Op("shift", fails_in="run")))
    with pytest.raises(OperationFailed):
        run.run_here()
    assert done(run) == ["close", "undo close", "shift", "undo shift", "safe"]


def test_a_retry_leaves_other_causes_than_its_own_alone() -> None:
    run = run_of(Retry(Op("look", fails_in="run", error=broken), 3, only={"missed grasp"}))
    with pytest.raises(OperationFailed, match="camera 0") as caught:
        run.run_here()
    assert caught.value.cause == "device: no answer in time"
    assert done(run).count("look") == 1


def test_a_part_that_could_not_be_undone_is_not_begun_again() -> None:
    part = Sequence("grasp", Op("down", fails_in="undo"), Op("close", fails_in="run"))
    run = run_of(Retry(part, 3))
    with pytest.raises(UndoFailed, match="down could not be undone: missed grasp"):
        run.run_here()
    assert done(run) == ["down", "close", "undo close", "undo down", "safe"]
    assert dict(ends(run))["down"] == "not undone"


def test_a_part_is_tried_once_or_more() -> None:
    with pytest.raises(ValueError, match="once or more, got 0"):
        Retry(Op("a"), 0)


def test_a_fallback_does_the_next_part_when_one_fails_and_then_no_more() -> None:
    first = Sequence("by eye", Op("look"), Op("match", fails_in="run"))
    run = run_of(Fallback("find it", first, Op("feel"), Op("ask")))
    run.run_here()
    assert done(run) == ["look", "match", "undo match", "feel"]
    assert dict(ends(run))["ask"] == "waiting"


def test_a_fallback_fails_as_its_last_part_does() -> None:
    run = run_of(Fallback("find it", Op("look", fails_in="run", error=broken), _never()))
    with pytest.raises(OperationFailed, match="missed grasp"):
        run.run_here()


def test_a_fallback_needs_a_part() -> None:
    with pytest.raises(ValueError, match="find it: a fallback needs a part"):
        Fallback("find it")


def test_a_guard_lets_its_part_go_on_while_the_condition_holds() -> None:
    run = run_of(Guard(Op("lift", steps=(MOVE, 1.0)), lambda _work: True, "dropped"))
    run.run_here()
    assert done(run) == ["lift"]


def test_a_guard_whose_condition_does_not_hold_begins_nothing() -> None:
    run = run_of(Guard(Op("lift"), lambda _work: False, "dropped"))
    with pytest.raises(OperationFailed, match="dropped: it was true before the part started"):
        run.run_here()
    assert done(run) == ["safe"]


@pytest.mark.parametrize("step", [MOVE, 1.0])
def test_a_guard_ends_its_part_in_the_middle_of_a_wait_and_undoes_it(step: str | float) -> None:
    work = Work()
    part = Sequence("away", Op("lift"), Op("carry", steps=(step,)), Op("put down"))
    run = run_of(Guard(part, lambda _: work.clock.now_s() < 1.5, "dropped"), work)
    with pytest.raises(
        OperationFailed, match="dropped: it became true while the part ran"
    ) as caught:
        run.run_here()
    assert caught.value.cause == "dropped"
    cancelled = ["cancel carry"] if step == MOVE else []
    assert done(run) == ["lift", "carry", *cancelled, "undo carry", "undo lift", "safe"]
    assert work.clock.now_s() == pytest.approx(2.0, abs=0.1), "0.5 s of it to make it safe"
    assert dict(ends(run))["unless dropped"] == "failed"
    assert dict(ends(run))["away"] == "ended"


def test_a_guard_that_broke_can_be_tried_again() -> None:
    work = Work()
    lift = Guard(Op("lift"), lambda _: not 0.5 < work.clock.now_s() < 0.9, "dropped")
    run = run_of(Retry(lift, 2, between=Op("wait")), work)
    run.run_here()
    assert done(run) == ["lift", "undo lift", "wait", "lift"]


def test_a_condition_that_cannot_answer_counts_as_broken() -> None:
    def answer(_work: Work) -> bool:
        raise broken()

    run = run_of(Guard(Op("lift"), answer, "dropped"))
    with pytest.raises(OperationFailed, match="could not be evaluated: camera 0") as caught:
        run.run_here()
    assert caught.value.cause == "dropped"
    assert isinstance(caught.value.__cause__, DeviceError)


def test_a_broken_condition_stays_broken_though_it_recovers() -> None:
    answers = iter([True] * 5 + [False] + [True] * 1000)
    run = run_of(Guard(Op("lift"), lambda _: next(answers), "dropped"))
    with pytest.raises(OperationFailed, match="dropped"):
        run.run_here()


def test_what_a_guard_cancelled_comes_to_rest_before_the_undoing_begins() -> None:
    work = Work(coasts_s=0.3)
    lift = Op("lift", steps=(MOVE,), undoes=(MOVE,))
    run = run_of(Guard(lift, lambda _: work.clock.now_s() < 0.5, "dropped"), work)
    seen = moving_when_undone(run)
    with pytest.raises(OperationFailed, match="dropped"):
        run.run_here()
    assert seen == [[]]


def test_parts_side_by_side_overlap_their_waits() -> None:
    part = Parallel("both", Op("left", steps=(1.0, 1.0)), Op("right", steps=(MOVE, 0.5)))
    run = run_of(part)
    run.run_here()
    assert done(run) == ["left", "right"]
    assert run.work.log == ["left", "right", "right ran", "left ran"]
    assert run.work.clock.now_s() == pytest.approx(2.0, abs=0.05)


def test_the_failure_of_one_part_ends_the_others_at_once_and_undoes_them() -> None:
    slow = Sequence("slow", Op("grip"), Op("carry", steps=(MOVE, 9.0)), Op("never"))
    quick = Sequence("quick", Op("look"), Op("see", steps=(0.5,), fails_in="run"))
    run = run_of(Parallel("both", slow, quick))
    with pytest.raises(OperationFailed, match="missed grasp"):
        run.run_here()
    assert done(run)[4:] == ["cancel carry", "undo carry", "undo grip", "undo see", "safe"]
    assert "undo look" not in run.work.log
    assert dict(ends(run))["slow"] == "ended"
    assert run.work.clock.now_s() == pytest.approx(2.0, abs=0.05)


def test_a_retry_around_parts_side_by_side_undoes_them_all() -> None:
    quick = Sequence("quick", Op("look"), Op("see", fails_in="run", times=1))
    run = run_of(Retry(Parallel("both", Op("carry", steps=(9.0,)), quick), 2))
    run.run_here()
    assert sorted(done(run)[3:6]) == ["undo carry", "undo look", "undo see"]
    assert sorted(done(run)[6:]) == ["carry", "look", "see"]


def test_what_ran_well_side_by_side_is_undone_before_another_try() -> None:
    part = Sequence("all", Parallel("both", Op("a"), Op("b")), Op("c", fails_in="run", times=1))
    run = run_of(Retry(part, 2))
    run.run_here()
    assert sorted(done(run)[3:6]) == ["undo a", "undo b", "undo c"]


def test_what_a_failure_cancelled_beside_comes_to_rest_before_the_undoing_begins() -> None:
    work = Work(coasts_s=0.3)
    beside = Op("beside", steps=(MOVE, MOVE), undoes=(MOVE,))
    run = run_of(Parallel("both", beside, Op("bad", steps=(1.5,), fails_in="run")), work)
    seen = moving_when_undone(run)
    with pytest.raises(OperationFailed, match="missed grasp"):
        run.run_here()
    assert seen == [[], []]


@pytest.mark.defects
def test_an_end_that_goes_wrong_leaves_nothing_moving_beside_it() -> None:
    class Stubborn(Op):
        def run(self, work: Work) -> Steps:
            try:
                yield 9.0
            finally:
                yield 9.0

    bad = Op("bad", steps=(0.5,), fails_in="run")
    run = run_of(Parallel("three", Stubborn("a"), Op("b", steps=(MOVE,)), bad))
    with pytest.raises(OperationFailed, match="GeneratorExit"):
        run.run_here()
    assert not run.work.moving


def test_nothing_side_by_side_is_nothing() -> None:
    run = run_of(Parallel[Work]("none"))
    run.run_here()
    assert run.state == "done"


def test_a_repeat_goes_on_until_there_is_no_more_to_do() -> None:
    left = [3]

    def no_more(_work: Work) -> bool:
        left[0] -= 1
        return left[0] < 0

    run = run_of(Repeat(Sequence("fibre", Op("a"), Op("b")), no_more, name="each fibre"))
    run.run_here()
    assert done(run) == ["a", "b"] * 3
    assert run.tree.children[0].event.round == 3


def test_a_finished_round_is_never_undone() -> None:
    rounds = iter([False, False, False, True])

    class Second(Op):
        def precondition(self, work: Work) -> None:
            if len(work.log) == 6:
                raise missed()

    fibre = Sequence("fibre", Op("a"), Second("b"))
    run = run_of(Retry(Repeat(fibre, lambda _: next(rounds)), 2))
    run.run_here()
    assert done(run) == ["a", "b", "a", "undo a", "a", "b"]


def test_a_new_round_begins_with_all_waiting() -> None:
    work = Work()
    run = run_of(Repeat(Sequence("fibre", Op("a"), Op("b")), lambda _: work.points >= 4), work)
    seen: list[dict[str, str]] = []
    work.at_point = lambda _number: seen.append(dict(ends(run)))
    run.run_here()
    assert [each["b"] for each in seen] == ["waiting", "running"] * 2
    assert [each["a"] for each in seen] == ["running", "done"] * 2


def test_an_operation_that_yields_nothing_may_be_a_plain_function() -> None:
    class Plain(Op):
        def run(self, work: Work) -> None:  # type: ignore[override]
            work.log.append("plain")

    run = run_of(Sequence("all", Plain("plain"), Op("b")))
    run.run_here()
    assert done(run) == ["plain", "b"]


def _never() -> Op:
    return Op("never", fails_in="precondition")
