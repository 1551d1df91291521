"""Procedures on the simulated platform: real movements are waited for, cancelled and stopped."""

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from typing_extensions import override

import cosmic
from cosmic.autonomy.procedures.failures import ProcedureAborted, ProcedureStopped
from cosmic.autonomy.procedures.parts import (
    Guard,
    NodeEvent,
    OperationFailed,
    Parallel,
    Procedure,
    Retry,
    Sequence,
    Steps,
    UnitOperation,
)
from cosmic.autonomy.procedures.procedure import Part
from cosmic.autonomy.procedures.run import ProcedureRun
from cosmic.autonomy.recorded.steps import PauseStep, RecordedProcedure, RecordStep
from cosmic.mico.api.axis import Axis

LIMIT_S = 20.0
AXES = ("left.x", "right.x")


class Go(UnitOperation[cosmic.Rig]):
    """Moves an axis to a place."""

    def __init__(self, axis: str, target_um: float) -> None:
        self.name = f"{axis} to {target_um:g}"
        self.axis, self.target_um = axis, target_um

    @override
    def run(self, work: cosmic.Rig) -> Steps:
        reached = yield work.mico[self.axis].move_to(self.target_um, wait=False)
        assert reached == pytest.approx(self.target_um, abs=1.0)

    @override
    def undo(self, work: cosmic.Rig) -> Steps:
        yield work.mico[self.axis].move_to(0.0, wait=False)


class Again(UnitOperation[cosmic.Rig]):
    """Does what was recorded."""

    name = "as it was recorded"

    def __init__(self, path: Path) -> None:
        self.path = path

    @override
    def run(self, work: cosmic.Rig) -> Steps:
        yield work.mico.trajectories.run(self.path, start="straight", wait=False)


class Wait(UnitOperation[cosmic.Rig]):
    name = "wait"

    @override
    def run(self, work: cosmic.Rig) -> Steps:
        yield 1e6


@pytest.fixture(scope="module")
def rig() -> Iterator[cosmic.Rig]:
    with cosmic.connect(rate=20.0, applications=("mico",)) as rig:
        yield rig


@pytest.fixture(autouse=True)
def at_zero(rig: cosmic.Rig) -> None:
    rig.reset_stop()
    for axis in AXES:
        rig.mico[axis].set_closed_loop_frequency(18_500)
    rig.mico.move(dict.fromkeys(AXES, 0.0))
    for axis in AXES:
        rig.mico[axis].set_closed_loop_frequency(60)  # slow enough to be ended on the way


def started(rig: cosmic.Rig, part: Part[cosmic.Rig], event: str) -> ProcedureRun[cosmic.Rig]:
    """Start a run and wait for the begin of an operation."""
    begun = threading.Event()

    def note(heard: NodeEvent) -> None:
        if heard.name == event:
            begun.set()

    run = rig.procedure(Procedure("trial", part), rig)
    run.subscribe(note)
    run.start()
    assert begun.wait(LIMIT_S)
    return run


def wait_for(axis: Axis, beyond_um: float) -> None:
    """Wait until an axis is on its way."""
    pause = threading.Event()
    for _ in range(int(LIMIT_S / 0.002)):
        if abs(axis.position_um) > beyond_um:
            return
        pause.wait(0.002)
    raise AssertionError(f"{axis.key} does not move")


def standing(rig: cosmic.Rig) -> bool:
    """Tell whether the axes stand where they may have got, short of their targets."""
    return all(-4000.0 < place < 4000.0 for place in places(rig))


def places(rig: cosmic.Rig) -> list[float]:
    return [rig.mico[axis].position_um for axis in AXES]


def test_movements_side_by_side_are_made_and_undone(rig: cosmic.Rig) -> None:
    both = Parallel("both", Go("left.x", 300.0), Go("right.x", -300.0))
    rig.procedure(Procedure("trial", both), rig).run_here()
    reached = places(rig)
    assert reached == pytest.approx([300.0, -300.0], abs=1.0)
    whole = Sequence("all", both, Guard(Wait(), lambda _rig: False, "not now"))
    with pytest.raises(OperationFailed, match="not now"):
        rig.procedure(Procedure("trial", Retry(whole, 2)), rig).run_here()
    reached = places(rig)
    assert reached == pytest.approx([300.0, -300.0], abs=1.0), "the last try is not undone"


def test_a_refusal_of_the_gate_is_a_failure_that_is_counted(rig: cosmic.Rig) -> None:
    run = rig.procedure(Procedure("trial", Go("left.x", 9000.0)), rig)
    with pytest.raises(OperationFailed) as caught:
        run.run_here()
    assert caught.value.cause == "refused: limit"
    assert isinstance(caught.value.__cause__, cosmic.LimitError)
    assert run.times.causes == {"refused: limit": 1}


def test_an_abort_stops_the_axes(rig: cosmic.Rig) -> None:
    both = Parallel("both", Go("left.x", -4900.0), Go("right.x", 4900.0))
    run = started(rig, both, "right.x to 4900")
    for name in AXES:
        wait_for(rig.mico[name], 50.0)
    run.abort("enough")
    with pytest.raises(ProcedureAborted, match="enough"):
        run.wait(LIMIT_S)
    assert standing(rig)
    rig.mico["left.x"].move_by(5.0)  # nothing else moves it any more


def test_a_stop_ends_a_procedure_whatever_it_does(rig: cosmic.Rig) -> None:
    go = Go("left.x", -4900.0)
    for part, name in ((Retry(go, 5), go.name), (Retry(Wait(), 5), "wait")):
        run = started(rig, part, name)
        if name == go.name:
            wait_for(rig.mico["left.x"], 50.0)
        rig.stop("pressed")
        with pytest.raises(ProcedureStopped, match="pressed"):
            run.wait(LIMIT_S)
        assert run.tree.children[0].attempt == 1
        rig.reset_stop()
    assert standing(rig)


def test_closing_the_platform_ends_what_runs() -> None:
    with cosmic.connect(rate=20.0, applications=("mico",)) as rig:
        run = started(rig, Wait(), "wait")
    with pytest.raises(ProcedureAborted, match="the platform is closed"):
        run.wait(LIMIT_S)


def recorded(rig: cosmic.Rig, path: Path) -> Path:
    """Return a trajectory from 0 to 200 um, with the axis back at 0."""
    with rig.mico.trajectories.record(path, timed=False):
        rig.mico["left.x"].move_to(200.0)
    rig.mico["left.x"].move_to(0.0)
    return path


def test_a_recorded_trajectory_is_a_step_like_any_other(rig: cosmic.Rig, tmp_path: Path) -> None:
    for axis in AXES:
        rig.mico[axis].set_closed_loop_frequency(18_500)
    again = Again(recorded(rig, tmp_path / "there.trajectory"))
    parts = Sequence("there and on", again, Go("left.x", 250.0))
    rig.procedure(Procedure("repeated", parts), rig).run_here()
    assert rig.mico["left.x"].position_um == pytest.approx(250.0, abs=1.0)


def test_an_abort_ends_a_trajectory_on_its_way(rig: cosmic.Rig, tmp_path: Path) -> None:
    axis = rig.mico["left.x"]
    axis.set_closed_loop_frequency(18_500)
    again = Again(recorded(rig, tmp_path / "there.trajectory"))
    axis.set_closed_loop_frequency(20)
    run = started(rig, again, again.name)
    wait_for(axis, 5.0)
    run.abort("not there")
    with pytest.raises(ProcedureAborted, match="not there"):
        run.wait(LIMIT_S)
    assert standing(rig)
    assert 5.0 < (axis.position_um or 0.0) < 200.0


def test_nothing_that_moves_axes_begins_beside_a_campaign_or_a_calibration(
    tmp_path: Path,
) -> None:
    with cosmic.connect(sample="three-dry", rate=20.0) as rig:
        campaign = rig.campaign("quick", tmp_path / "one")
        early, made = rig.calibrate(), rig.procedure(Procedure("wait", Wait()), rig)
        campaign.start()
        try:
            for begin in (rig.calibrate, early.run_here, made.run_here):
                with pytest.raises(cosmic.NotAvailable, match="a campaign is running"):
                    begin()
        finally:
            campaign.abort()
            campaign.join()
        other = rig.campaign("quick", tmp_path / "two")
        second = rig.calibrate()
        replayed = rig.replay(RecordedProcedure(name="light", step=[PauseStep(seconds=0.1)]))
        early.start()
        try:
            with pytest.raises(cosmic.NotAvailable, match="calibrate is running"):
                rig.campaign("quick", tmp_path / "three")
            for begin in (other.start, second.start, replayed.start):
                with pytest.raises(cosmic.NotAvailable, match="calibrate is running"):
                    begin()
        finally:
            early.abort()
            early.join()
        other.abort()
        assert not (tmp_path / "three").exists()


def test_a_recording_that_a_replay_began_ends_with_it(tmp_path: Path) -> None:
    replayed = RecordedProcedure(name="left open", step=[RecordStep(name="left open")])
    with cosmic.connect(rate=20.0) as rig:
        rig.replay(replayed, folder=tmp_path).run_here()
        assert not rig.daqco.recording.active
        assert rig.daqco.recording.path == tmp_path / "left-open_1.h5"
        with rig.daqco.record(tmp_path / "own.h5"):
            rig.replay(RecordedProcedure(name="pause", step=[PauseStep(seconds=0.1)])).run_here()
            assert rig.daqco.recording.active, "it was not the replay's own"
