"""What ends a procedure that is not its own: refusals, a stop, a defect."""

import pytest

from cosmic.autonomy.procedures.combinators import Fallback, Guard, Parallel, Retry, Sequence
from cosmic.autonomy.procedures.failures import ProcedureStopped, failure_of
from cosmic.autonomy.procedures.operation import OperationFailed, Steps
from cosmic.autonomy.procedures.procedure import Procedure
from cosmic.autonomy.procedures.run import ProcedureRun
from cosmic.frame.errors import (
    ConfigError,
    CosmicError,
    DeviceError,
    DeviceFault,
    DeviceTimeout,
    MoveCancelled,
    NotAvailable,
    ProtocolError,
    refusal,
)
from cosmic.frame.failure import Failure, FailurePolicy
from cosmic.frame.verdict import Reason, refuse
from unit.autonomy.procedures.parts import MOVE, FakeMove, Op, Work, done, ends, run_of, stop

EVERYWHERE = ("precondition", "run", "verify", "move")


@pytest.mark.parametrize(
    ("error", "cause"),
    [
        (refusal(refuse(Reason.COLLISION, "probe and plate")), "refused: collision"),
        (refusal(refuse(Reason.LIMIT, "left.x")), "refused: limit"),
        (refusal(refuse(Reason.POSITION_UNKNOWN, "left.x")), "refused: position unknown"),
        (DeviceError("axis", fault=DeviceFault.END_STOP), "device: end stop reached"),
        (DeviceTimeout("axis", fault=DeviceFault.TIMEOUT), "device: no answer in time"),
        (NotAvailable("no camera"), "not available"),
        (MoveCancelled("replaced"), "interrupted"),
        (ConfigError("spans"), "configuration"),
        (ProtocolError("odd"), "error"),
        (stop(), "stopped"),
    ],
)
def test_each_kind_of_failure_has_its_own_cause(error: CosmicError, cause: str) -> None:
    failure = failure_of(error)
    assert failure.cause == cause
    assert failure.text == str(error)
    assert failure.__cause__ is error
    assert failure_of(failure) is failure


@pytest.mark.parametrize("phase", EVERYWHERE)
def test_a_stop_is_never_tried_again_nor_fallen_back_from(phase: str) -> None:
    bad = Op("close", steps=(MOVE,), fails_in=phase, times=1, error=stop)
    part = Sequence("grasp", Op("down"), Guard(bad, lambda _: True, "dropped"))
    whole = Fallback("any", Retry(part, 3, between=Op("shift")), Op("other"))
    run = run_of(Parallel("both", whole, Op("beside", steps=(MOVE,) * 9)))
    with pytest.raises(ProcedureStopped, match="the stop is latched"):
        run.run_here()
    forbidden = ("undo", "shift", "other", "safe")
    assert not [each for each in done(run) if each.startswith(forbidden)]
    assert done(run).count("down") == 1
    assert not run.work.moving
    assert run.state == "failed"


def test_an_operation_that_makes_light_of_a_stop_is_ended_all_the_same() -> None:
    class Stubborn(Op):
        def run(self, work: Work) -> Steps:
            for _ in range(3):
                work.log.append("try")
                try:
                    yield FakeMove(work, self.name, stop())
                except CosmicError:
                    work.log.append("never mind")

    run = run_of(Sequence("all", Stubborn("stubborn"), Op("next")))
    with pytest.raises(ProcedureStopped):
        run.run_here()
    assert done(run)[:2] == ["try", "never mind"]
    assert "next" not in run.work.log
    assert not run.work.moving


@pytest.mark.parametrize("step", [MOVE, 1.0])
def test_a_stop_ends_a_procedure_that_only_waits(step: str | float) -> None:
    work = Work()
    part = Retry(Op("wait", steps=(step,) * 9), 3)
    run = ProcedureRun(
        Procedure("trial", part),
        work,
        work.clock,
        FailurePolicy(),
        stopped=lambda: "pressed" if work.clock.now_s() >= 2.5 else None,
    )
    with pytest.raises(ProcedureStopped, match="motion was stopped: pressed"):
        run.run_here()
    assert done(run) == ["wait", *(["cancel wait"] if step == MOVE else [])]
    assert dict(ends(run))["wait"] == "ended"


def test_a_stop_while_undoing_ends_it_there() -> None:
    class Stopped(Op):
        def undo(self, work: Work) -> Steps:
            work.log.append("undo")
            yield FakeMove(work, self.name, stop())

    part = Sequence("grasp", Op("down"), Stopped("close", fails_in="run"))
    run = run_of(Retry(part, 3))
    with pytest.raises(ProcedureStopped):
        run.run_here()
    assert done(run) == ["down", "close", "undo"]


def test_a_stop_that_a_guard_hears_of_undoes_nothing() -> None:
    work = Work()

    def calm(_work: Work) -> bool:
        if work.clock.now_s() > 0.5:
            raise stop()
        return True

    run = run_of(Retry(Guard(Op("lift", steps=(MOVE,)), calm, "dropped"), 3), work)
    with pytest.raises(ProcedureStopped):
        run.run_here()
    assert done(run) == ["lift", "cancel lift"]


def test_an_operation_may_deal_with_what_a_movement_fails_with() -> None:
    class Careful(Op):
        def run(self, work: Work) -> Steps:
            try:
                yield FakeMove(work, self.name, NotAvailable("no way"))
            except NotAvailable:
                work.log.append("another way")
            yield 1.0

    run = run_of(Careful("careful"))
    run.run_here()
    assert done(run) == ["another way"]


@pytest.mark.defects
def test_a_defect_stops_all_motion_and_is_reported_to_whoever_waits() -> None:
    def defect() -> Exception:
        return KeyError("no such thing")

    reported: list[Failure] = []
    policy = FailurePolicy()
    policy.subscribe(reported.append)
    work = Work()
    part = Parallel(
        "both", Op("beside", steps=(MOVE,) * 9), Retry(Op("bad", fails_in="run", error=defect), 3)
    )
    run = ProcedureRun(Procedure("trial", part), work, work.clock, policy)
    with pytest.raises(OperationFailed, match="KeyError: 'no such thing'") as caught:
        run.run_here()
    assert caught.value.cause == "defect"
    assert [failure.defect for failure in reported] == [True]
    assert not work.moving
    assert dict(ends(run)) == {
        "both": "failed",
        "beside": "ended",
        "up to 3 times": "failed",
        "bad": "failed",
    }


@pytest.mark.defects
@pytest.mark.parametrize(
    ("wish", "text"),
    [(None, "yielded None"), (True, "yielded True"), (-1.0, "0 s or more"), (float("nan"), "nan")],
)
def test_a_request_that_means_nothing_is_a_defect_where_it_was_yielded(
    wish: float | None, text: str
) -> None:
    class Odd(Op):
        def run(self, work: Work) -> Steps:
            yield wish  # type: ignore[misc]

    with pytest.raises(OperationFailed, match=text) as caught:
        run_of(Odd("odd")).run_here()
    assert caught.value.__cause__ is not None
    assert caught.value.__cause__.__traceback__ is not None
