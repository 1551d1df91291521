"""The initialisation sequence: what its steps come to, how it ends, what it says."""

import pytest
from pydantic import ValidationError

import cosmic
from cosmic.frame.errors import DeviceError, DeviceFault
from cosmic.mico.core.motion.orders import Calibrate, MoveTo, Reference, Step, ToEndStop
from cosmic.mico.core.sequence.plan import plan_sequence
from cosmic.mico.core.sequence.report import StepState
from cosmic.mico.core.sequence.settings import StepKind
from cosmic.mico.hw.interface import Channel, Direction
from unit.mico.rigs import listen, mico, settings, wait_until

GROUP = [{"title": "all", "positioners": ["d0.c0", "d0.c1", "d0.c2"]}]
X, Y = Channel(0, 0), Channel(0, 1)


def steps(*steps, **changes):
    return {"initialisation": {"step": list(steps)}, "group": GROUP, **changes}


def planned(*of, **how):
    with mico(("LLN",), **steps(*of)) as (rig, _):
        manager = rig.application.manager
        return plan_sequence(manager.settings, manager.states(), **how)


def power_up(controller):
    controller.known = False


# What the steps come to


def test_each_kind_of_step_becomes_its_motion():
    found = planned(
        {"do": "calibrate", "axes": ["d0.c0"]},
        {"do": "reference", "group": "all"},
        {"do": "end_stop", "axes": ["d0.c1"], "direction": "forward"},
        {"do": "move", "axes": ["d0.c1"], "targets_um": {"d0.c0": 9}},
        {"do": "open_gripper", "group": "all", "steps": 5},
        {"do": "close_gripper", "axes": ["d0.c2"], "amplitude_v": 50.0, "frequency_hz": 10},
        {"do": "zero", "axes": ["d0.c0"]},
        {"do": "wait", "wait_s": 2},
        {"do": "confirm", "text": "Well?"},
    )
    motions = [dict(step.motions) for step in found]
    assert motions[:6] == [
        {"d0.c0": Calibrate()},
        {"d0.c0": Reference(), "d0.c1": Reference()},
        {"d0.c1": ToEndStop(Direction.FORWARD)},
        {"d0.c1": MoveTo(0.0, "um"), "d0.c0": MoveTo(9.0, "um")},
        {"d0.c2": Step(5, 100.0, 1000)},
        {"d0.c2": Step(-100, 50.0, 10)},
    ]
    assert (found[6].zeros, found[7].wait_s, found[8].text) == (("d0.c0",), 2.0, "Well?")


def test_without_configured_steps_every_axis_is_referenced_and_taken_to_its_start():
    titles = [step.title for step in planned()]
    assert titles == [
        "referencing d0.c0",
        "referencing d0.c1",
        "moving d0.c1",
        "moving d0.c0",
    ]


def test_what_is_known_is_left_out_on_request_and_moves_are_made_all_the_same():
    found = planned(
        {"do": "calibrate", "axes": ["d0.c0"]},
        {"do": "reference", "group": "all"},
        {"do": "zero", "axes": ["d0.c0"]},
        {"do": "move", "axes": ["d0.c0"]},
        skip_known=True,
    )
    assert [step.idle for step in found] == [True, True, True, False]
    assert found[1].left_out == ("d0.c0 is known already", "d0.c1 is known already")


def test_an_axis_that_is_not_connected_is_left_out_and_the_step_says_so():
    with mico(("LLN",), configured=("LLN", "L"), **steps()) as (rig, _):
        manager = rig.application.manager
        found = plan_sequence(manager.settings, manager.states())
    assert [step.left_out for step in found if step.idle] == [("d1.c0 is not connected",)] * 2


@pytest.mark.parametrize(
    ("step", "said"),
    [
        ({"do": "fly"}, "Input should be"),
        ({"do": "reference"}, "name its axes"),
        ({"do": "reference", "axes": ["nobody"]}, "no positioner 'nobody'"),
        ({"do": "reference", "group": "none"}, "no group 'none'"),
        ({"do": "reference", "axes": ["d0.c2"]}, "d0.c2 has no sensor"),
        ({"do": "open_gripper", "axes": ["d0.c0"]}, "d0.c0 is not a gripper"),
        ({"do": "end_stop", "axes": ["d0.c0"]}, "direction is missing"),
        ({"do": "wait"}, "wait_s is missing"),
        ({"do": "confirm"}, "text is missing"),
        ({"do": "wait", "wait_s": 1, "axes": ["d0.c0"]}, "axes does not fit"),
        ({"do": "move", "targets_deg": {"d0.c0": 1}}, "d0.c0 is linear"),
        ({"do": "wait", "wait_s": float("nan")}, "finite number"),
    ],
)
def test_a_step_that_makes_no_sense_stops_the_start(step, said):
    with pytest.raises(ValidationError, match=said):
        settings(("LLN",), **steps(step))


# Carrying it out


def test_steps_are_made_in_order_and_the_zero_is_set_where_the_axis_stands():
    sequence = steps(
        {"do": "calibrate", "axes": ["d0.c0"]},
        {"do": "reference", "axes": ["d0.c0"]},
        {"do": "move", "targets_um": {"d0.c0": 40}},
        {"do": "zero", "axes": ["d0.c0"]},
        {"do": "open_gripper", "axes": ["d0.c2"], "steps": 7},
    )
    with mico(prepare=power_up, **sequence) as (rig, controller):
        reports = listen(rig.application.initialisation_changed)
        rig.initialise()
        names = [call[0] for call in controller.calls if call[0] != "frequency"]
        assert names == ["calibrate", "reference", "move_to", "step"]
        assert controller.of("step")[0][2] == 7
        assert rig["d0.c0"].position_um == 0.0
        assert rig["d0.c0"].details.zero == 40.0
    assert {step.state for step in reports[-1].steps} == {StepState.DONE}
    assert reports[0].steps[0].state is StepState.WAITING


def test_a_failed_step_says_which_why_and_what_to_do_and_nothing_follows():
    sequence = steps({"do": "reference", "axes": ["d0.c1"]}, {"do": "reference", "axes": ["d0.c0"]})
    with mico(("LLN",), instant=False, **sequence) as (rig, controller):
        reports = listen(rig.application.initialisation_changed)
        task = rig.initialise(wait=False)
        wait_until(lambda: len(controller.of("reference")) == 1)
        controller.fail(Y, DeviceFault.REFERENCE)
        with pytest.raises(DeviceError) as failed:
            task.wait(3)
        text = str(failed.value)
        assert text.startswith("step 1 of 2, referencing d0.c1: ")
        assert "calibrate its sensor, then initialise again" in text
        assert failed.value.fault is DeviceFault.REFERENCE
        assert len(controller.of("reference")) == 1
    assert [step.state for step in reports[-1].steps] == [StepState.FAILED, StepState.WAITING]


def test_a_refused_step_keeps_its_verdict():
    sequence = steps({"do": "move", "targets_um": {"d0.c0": 9999}})
    with mico(**sequence) as (rig, controller):
        with pytest.raises(cosmic.LimitError, match=r"step 1 of 1.*correct the step") as refused:
            rig.initialise()
        assert refused.value.verdict.axis == "d0.c0"
        assert not controller.of("move_to")


def test_nobody_to_confirm_is_a_no():
    sequence = steps({"do": "confirm", "text": "Ready?"}, {"do": "reference", "axes": ["d0.c0"]})
    with mico(**sequence) as (rig, controller):
        with pytest.raises(cosmic.MoveCancelled, match="'Ready\\?'; pass confirm"):
            rig.initialise()
        with pytest.raises(cosmic.MoveCancelled, match="answered with no"):
            rig.initialise(confirm=lambda _text: False)
        with pytest.raises(cosmic.MoveCancelled, match="answered with no"):
            rig.initialise(confirm=lambda _text: bool(1 / 0))
        assert not controller.of("reference")
        asked = []
        rig.initialise(confirm=lambda text: not asked.append(text))
        assert asked == ["Ready?"]
        assert controller.of("reference")


@pytest.mark.parametrize("end", ["stop", "cancel"])
def test_a_wait_ends_at_once_when_it_is_stopped_or_cancelled(end):
    sequence = steps({"do": "wait", "wait_s": 3000}, {"do": "reference", "axes": ["d0.c0"]})
    with mico(**sequence) as (rig, controller):
        task = rig.initialise(wait=False)
        wait_until(lambda: "waiting" in task.progress.text)
        if end == "stop":
            rig.application.manager.stop("test")
            rig.application.manager.reset_stop()
        else:
            task.cancel()
        with pytest.raises((cosmic.MoveCancelled, cosmic.StoppedError)):
            task.wait(2)
        assert not controller.of("reference")


def test_a_stop_that_was_reset_between_two_steps_ends_the_sequence_all_the_same():
    sequence = steps({"do": "confirm", "text": "?"}, {"do": "reference", "axes": ["d0.c0"]})
    with mico(**sequence) as (rig, controller):
        manager = rig.application.manager

        def stop_and_agree(_text):
            manager.stop("test")
            manager.reset_stop()
            return True

        with pytest.raises(cosmic.StoppedError, match="reset the stop, then initialise again"):
            rig.initialise(confirm=stop_and_agree)
        assert not controller.of("reference")


def test_the_kinds_of_steps_know_what_they_need():
    assert not StepKind.WAIT.moves
    assert not StepKind.OPEN_GRIPPER.needs_sensor
    assert StepKind.ZERO.needs_sensor
