"""An abort ends a procedure at once, wherever it is."""

from collections.abc import Callable

import pytest

from cosmic.autonomy.procedures.combinators import (
    Fallback,
    Guard,
    Parallel,
    Repeat,
    Retry,
    Sequence,
)
from cosmic.autonomy.procedures.failures import ProcedureAborted
from cosmic.autonomy.procedures.operation import SAFE_POINT, Steps
from cosmic.autonomy.procedures.procedure import Part, Procedure
from cosmic.autonomy.procedures.run import ProcedureRun
from cosmic.frame.errors import NotAvailable
from cosmic.frame.failure import FailurePolicy
from unit.autonomy.procedures.parts import MOVE, Op, Work, done, run_of


def mixed() -> Part[Work]:
    """Return a tree with everything in it: fails and is undone, tries again, goes side by side."""
    rounds = iter([False, False, True])
    close = Op(
        "close",
        steps=(MOVE, 0.5),
        looks=(SAFE_POINT, 0.1),
        undoes=(MOVE, 0.1),
        fails_in="verify",
        times=1,
    )
    grasp = Retry(
        Sequence("grasp", Op("down", steps=(MOVE,), undoes=(MOVE,)), close),
        3,
        between=Op("shift", steps=(MOVE, SAFE_POINT)),
    )
    dropped = Guard(
        Op("lift", steps=(0.5, MOVE), undoes=(MOVE,)), lambda work: work.clock.now_s() > 9.0, "low"
    )
    both = Parallel(
        "both",
        Sequence("left", Op("fetch", steps=(MOVE, SAFE_POINT, MOVE)), Op("hold", steps=(0.2,))),
        Guard(Op("right", steps=(MOVE, 2.0, MOVE)), lambda _work: True, "never"),
    )
    failing = Parallel(
        "one fails",
        Op("slow", steps=(MOVE,) * 5, undoes=(MOVE,)),
        Op("quick", fails_in="run", undoes=(MOVE,)),
    )
    fibre = Sequence(
        "fibre", grasp, Fallback("away", dropped, both), Fallback("end", failing, Op("bin"))
    )
    return Repeat(fibre, lambda _work: next(rounds))


def points() -> int:
    run = run_of(mixed())
    run.run_here()
    return run.work.points


POINTS = points()


def test_the_mixed_tree_goes_through_all_there_is() -> None:
    run = run_of(mixed())
    run.run_here()
    causes = {"missed grasp", "low"}
    assert set(run.times.causes) == {"missed grasp"}
    assert causes <= {view.event.cause for view in run.tree.walk()} | {"low"}
    for name in ("undo close", "undo down", "shift", "undo slow", "undo quick", "bin", "right"):
        assert name in run.work.log
    assert POINTS > 40


@pytest.mark.parametrize("at", range(POINTS))
def test_an_abort_at_any_yield_ends_all(at: int) -> None:
    work = Work()
    run = run_of(mixed(), work)

    def abort(number: int) -> None:
        if number == at:
            work.log.append("abort")
            run.abort("enough")

    work.at_point = abort
    with pytest.raises(ProcedureAborted, match="trial: enough"):
        run.run_here()
    after = work.log[work.log.index("abort") + 1 :]
    assert after[-1] == "safe"
    assert all(each.startswith("cancel ") for each in after[:-1]), after
    assert not work.moving
    assert run.state == "aborted"
    states = {str(view.state) for view in run.tree.walk()}
    assert states <= {"waiting", "done", "failed", "undone", "ended", "not undone"}


def test_an_abort_before_the_begin_begins_nothing() -> None:
    run = run_of(Op("a"))
    run.abort("changed my mind")
    assert run.state == "aborted"
    with pytest.raises(ProcedureAborted, match="changed my mind"):
        run.wait()
    with pytest.raises(NotAvailable, match="already started"):
        run.start()
    with pytest.raises(NotAvailable, match="has ended"):
        run.step()
    assert not run.work.log


def test_an_abort_after_the_end_changes_nothing() -> None:
    run = run_of(Op("a"))
    run.run_here()
    run.abort()
    assert run.state == "done"
    run.wait()


def safe_in(make_safe: Callable[[Work], Steps], *, make_safe_s: float = 20.0) -> ProcedureRun[Work]:
    """Return a run that is aborted at its first yield, and then made safe in this way."""
    work = Work()
    run = ProcedureRun(
        Procedure("trial", Op("a"), make_safe, make_safe_s), work, work.clock, FailurePolicy()
    )
    work.at_point = lambda _number: run.abort()
    with pytest.raises(ProcedureAborted):
        run.run_here()
    assert run.state == "aborted"
    return run


def test_the_making_safe_has_a_limit_of_time() -> None:
    def make_safe(work: Work) -> Steps:
        while True:
            yield 1.0

    run = safe_in(make_safe, make_safe_s=7.0)
    assert run.not_safe == "not safe after 7 s"
    assert run.work.clock.now_s() == pytest.approx(8.0, abs=0.1)


def test_a_failure_of_the_making_safe_is_reported() -> None:
    def make_safe(work: Work) -> Steps:
        yield 1.0
        raise NotAvailable("no way up")

    assert safe_in(make_safe).not_safe == "no way up"


def test_a_second_abort_ends_the_making_safe() -> None:
    def make_safe(work: Work) -> Steps:
        yield 1.0
        run[0].abort("really")
        yield 1.0
        work.log.append("too late")

    run: list[ProcedureRun[Work]] = []
    work = Work()
    run.append(
        ProcedureRun(Procedure("trial", Op("a"), make_safe), work, work.clock, FailurePolicy())
    )
    work.at_point = lambda _number: run[0].abort()
    with pytest.raises(ProcedureAborted):
        run[0].run_here()
    assert done(run[0]) == ["a"]
    assert run[0].not_safe == "aborted a second time"


@pytest.mark.defects
def test_an_operation_that_goes_on_after_an_abort_is_a_defect() -> None:
    class Stubborn(Op):
        def run(self, work: Work) -> Steps:
            try:
                work.point()
                yield 1.0
            finally:
                yield 2.0

    work = Work()
    stopped: list[str] = []
    policy = FailurePolicy()
    policy.on_safe_stop(stopped.append)
    run = ProcedureRun(Procedure("trial", Stubborn("a")), work, work.clock, policy)
    work.at_point = lambda _number: run.abort()
    with pytest.raises(Exception, match="generator ignored GeneratorExit"):
        run.run_here()
    assert stopped
    assert run.state == "failed"
