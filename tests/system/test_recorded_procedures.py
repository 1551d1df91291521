"""A procedure recorded by hand on the twin, and replayed on another fibre with another force."""

from pathlib import Path
from types import SimpleNamespace
from unittest.mock import PropertyMock, patch

import numpy as np
import pytest

import cosmic
from cosmic.autonomy.handling.marked import MarkedFibre
from cosmic.autonomy.procedures.operation import OperationFailed
from cosmic.autonomy.recorded.operations import Surroundings
from cosmic.autonomy.recorded.recorder import ProcedureRecorder
from cosmic.autonomy.recorded.replay import replay_on
from cosmic.autonomy.recorded.steps import (
    MoveStep,
    OperationStep,
    PauseStep,
    RecordedProcedure,
    WaitForForceStep,
    WaitForOperatorStep,
    load_recorded,
)
from cosmic.autonomy.shipped.single_operation import OperationRequest, SingleOperation
from cosmic.frame.errors import ConfigError
from cosmic.twin.truth import read_truth
from cosmic.vico.core.vision.finding import find_fibres


@pytest.mark.slow
def test_movements_by_hand_become_steps_and_are_replayed(tmp_path: Path) -> None:
    with cosmic.connect(rate=20.0) as rig:
        recorder = ProcedureRecorder(rig, rig.handling, lambda: None)
        assert not recorder.look(), "nothing was done yet"
        rig.mico.move({"left.x": -300.0, "left.y": 200.0})
        assert recorder.look()
        rig.mico["left.gripper"].steps(50)
        recorder.look()
        rig.mico["table.rotation"].move_to(5.0)
        recorder.look()
        with rig.daqco.record(tmp_path / "one.h5"):
            recorder.look()
        recorder.look()
        kinds = [each.words.split(" ")[0] for each in recorder.steps]
        assert kinds == ["Move", "Open", "Move", "Record", "End"]
        there = {name: each.position for name, each in rig.mico.states().items()}
        rig.mico.move({"left.x": 0.0, "left.y": 0.0, "table.rotation": 0.0})
        rig.mico["left.gripper"].steps(-30)
        again = RecordedProcedure(name="again", step=recorder.steps)
        replay_on(rig.handling, again, Surroundings(folder=lambda: tmp_path)).run_here()
        assert rig.handling.result is not None
        assert rig.handling.result.good
        for name, state in rig.mico.states().items():
            assert state.position == pytest.approx(there[name], abs=2.0), name
        assert (tmp_path / "one_1.h5").exists()


def test_a_light_that_becomes_known_was_set_by_nobody() -> None:
    with cosmic.connect(rate=20.0) as rig:
        with patch.object(type(rig.vico), "light", PropertyMock()) as light:
            light.return_value = SimpleNamespace(percent=None)
            recorder = ProcedureRecorder(rig, rig.handling, lambda: None)
            light.return_value = SimpleNamespace(percent=50.0)
            assert not recorder.look()
            light.return_value = SimpleNamespace(percent=60.0)
            assert recorder.look()
        assert [each.words for each in recorder.steps] == ["Light 60 %"]


def test_a_force_that_no_push_may_have_is_refused_before_anything_moves() -> None:
    with cosmic.connect(rate=20.0) as rig:
        step = OperationStep(operation=SingleOperation.PUSH, force_un=9999.0)
        with pytest.raises(ConfigError, match="Push to 9999 µN: the force is not between 0 and"):
            replay_on(rig.handling, RecordedProcedure(name="p", step=[step]), Surroundings())


def test_a_force_is_waited_for_on_the_channel_that_the_step_names() -> None:
    with cosmic.connect(rate=20.0) as rig:
        for channel, why in (("elsewhere", "no force channel 'elsewhere'"), ("force", "in 0.2 s")):
            step = WaitForForceStep(channel=channel, force_un=150.0, timeout_s=0.2)
            run = replay_on(rig.handling, RecordedProcedure(name="w", step=[step]), Surroundings())
            with pytest.raises(OperationFailed, match=why):
                run.run_here()


@pytest.mark.slow
def test_a_replay_waits_for_the_operator_and_can_be_ended() -> None:
    with cosmic.connect(rate=20.0) as rig:
        asked: list[str] = []
        around = Surroundings(asks=asked.append)
        waiting = RecordedProcedure(
            name="wait", step=[WaitForOperatorStep(text="look"), MoveStep(axes={"left.x": -50.0})]
        )
        run = replay_on(rig.handling, waiting, around)
        run.start()
        around.going_on.give()
        while not run.over:
            around.going_on.give()
        assert run.failure is None
        assert asked == ["Wait for key: look", ""]
        assert rig.mico["left.x"].position_um == pytest.approx(-50.0, abs=1.0)
        again = replay_on(rig.handling, waiting, Surroundings())
        again.start()
        again.abort("enough")
        again.join()
        assert rig.mico["left.x"].position_um == pytest.approx(-50.0, abs=1.0)


def test_the_result_of_a_replay_has_the_values_it_was_given() -> None:
    step = PauseStep(seconds=60.0, ask={"seconds": "How long, s"})
    given = RecordedProcedure(name="wait", step=[step]).with_values({(0, "seconds"): 0.1})
    with cosmic.connect(rate=20.0) as rig:
        replay_on(rig.handling, given, Surroundings()).run_here()
        result = rig.handling.result
        assert result is not None
        assert (result.title, result.values) == ("Replay wait", (("step 1, time", "0.1 s"),))


def test_a_script_that_replays_asks_whether_to_go_on() -> None:
    step = [WaitForOperatorStep(text="look"), MoveStep(axes={"left.x": -50.0})]
    waiting = RecordedProcedure(name="wait", step=step)
    with cosmic.connect(rate=20.0) as rig:
        with pytest.raises(cosmic.NotAvailable, match="'Wait for key: look' waits for an operator"):
            rig.replay(waiting)
        with pytest.raises(OperationFailed, match="Wait for key: look: it was not to go on"):
            rig.replay(waiting, confirm=lambda _words: False).run_here()
        assert rig.mico["left.x"].position_um == pytest.approx(0.0, abs=1.0)
        asked: list[str] = []
        rig.replay(waiting, confirm=lambda words: not asked.append(words)).run_here()
        assert asked == ["Wait for key: look"]
        assert rig.mico["left.x"].position_um == pytest.approx(-50.0, abs=1.0)


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_what_was_done_with_one_fibre_is_done_with_another_at_another_force(
    tmp_path: Path,
) -> None:
    truth = tmp_path / "truth.jsonl"
    with cosmic.connect(sample="three-dry", rate=8.0, seed=0, truth=truth) as rig:
        assert rig.vico.lens is not None
        rig.vico.lens.home().wait(60.0)
        rig.vico.lens.zoom_to(0.58).wait(60.0)
        image = rig.vico.camera().next_image(20.0)
        fibres = [each for each in find_fibres(np.asarray(image.data)) if each.certain]
        first, second = (MarkedFibre(image, fibres[each].centre_line_px) for each in (0, 2))
        handling = rig.handling
        recorder = ProcedureRecorder(rig, handling, lambda: first)
        for request in (
            OperationRequest(SingleOperation.TAKE, "left", marked=first),
            OperationRequest(SingleOperation.BRING),
            OperationRequest(SingleOperation.PUSH, force_un=40.0),
            OperationRequest(SingleOperation.PUT_AWAY),
        ):
            handling.prepare(request).run_here()
            assert recorder.look()
        file = tmp_path / "bend.toml"
        RecordedProcedure(name="bend", step=recorder.steps).save(file)
        read = load_recorded(file)
        assert [each.words for each in read.step][2] == "Push to 40 µN"
        (asked,) = read.asked
        changed = read.with_values({asked: 25.0})
        rig.replay(changed, second).run_here()
        assert handling.result is not None
        assert handling.result.good
        assert rig.mico.allowed_contacts == ()
    record = read_truth(truth)
    assert len({each.facts["fibre"] for each in record.of("grasped")}) == 2
