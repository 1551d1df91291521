"""A stage of somebody else that fails, lies or hangs: what `StageController` makes of it."""

import threading

import pytest

from contract.controller_rig import Rig
from contract.own_stage import OwnStage
from cosmic.frame.errors import DeviceError, DeviceFault
from cosmic.mico.hw.interface import ActivityRead, Channel, Failed, TypeRead
from cosmic.mico.hw.stages import StageController

FIRST, SECOND = Channel(0, 0), Channel(0, 1)


@pytest.fixture
def made():
    unit = OwnStage()
    with Rig(StageController("own stage", [lambda: unit])) as rig:
        yield rig, unit


def raising(error):
    def fails(_axis):
        raise error

    return fails


@pytest.mark.parametrize("error", [DeviceError("the motor stalled"), ValueError("no number")])
def test_an_axis_that_fails_in_the_middle_of_a_movement_spares_the_device(made, error):
    rig, unit = made
    rig.controller.move_to(FIRST, 100.0, "um", hold_s=0.0)
    unit.wrong["moving"] = raising(error)
    failed = rig.event(Failed, FIRST)
    assert str(error) in str(failed.error)
    assert failed.error.fault is not DeviceFault.COMMUNICATION
    del unit.wrong["moving"]
    rig.controller.ask_activity(SECOND)
    assert rig.event(ActivityRead, SECOND).activity.at_rest


def test_a_device_that_goes_in_the_middle_of_a_movement_is_reported_as_gone(made):
    rig, unit = made
    rig.controller.move_to(FIRST, 100.0, "um", hold_s=0.0)
    unit.wrong["moving"] = raising(DeviceError("unplugged", fault=DeviceFault.COMMUNICATION))
    with pytest.raises(DeviceError, match="unplugged"):
        for _ in range(50):
            rig.controller.receive(0, 0.1)


def test_a_stop_that_fails_names_the_axis_that_goes_on(made):
    rig, unit = made
    unit.wrong["stop"] = raising(DeviceError("not now"))
    with pytest.raises(DeviceError, match=r"channel 1.*not now") as caught:
        rig.controller.stop(SECOND)
    assert caught.value.channel == 1
    assert "not now" in str(rig.event(Failed, SECOND).error)


def test_the_unit_is_asked_for_its_reference_by_one_thread_at_a_time(made):
    rig, unit = made
    asked_by = []
    unit.wrong["has_reference"] = lambda _axis: asked_by.append(threading.get_ident()) or True
    held, go_on = threading.Event(), threading.Event()

    def slowly(axis):
        held.set()
        go_on.wait(5.0)
        return unit.where[axis]

    unit.wrong["position"] = slowly
    rig.controller.ask_position(FIRST, "um")
    receiving = threading.Thread(target=rig.controller.receive, args=(0, 1.0))
    receiving.start()
    assert held.wait(5.0)
    rig.controller.ask_type(SECOND)  # returns at once, and waits for its turn
    assert not asked_by
    go_on.set()
    receiving.join()
    assert rig.event(TypeRead, SECOND).positioner.kind == "linear"
    assert asked_by


def test_a_question_for_the_reference_that_fails_names_the_axis(made):
    rig, unit = made
    unit.wrong["has_reference"] = raising(ValueError("no number"))
    rig.controller.ask_type(SECOND)
    assert "no number" in str(rig.event(Failed, SECOND).error)
    with pytest.raises(DeviceError, match=r"channel 1.*no number"):
        rig.controller.reference(SECOND, hold_s=0.0)


def test_a_call_that_never_returns_does_not_keep_the_controller_from_closing(made, caplog):
    rig, unit = made
    held, go_on = threading.Event(), threading.Event()

    def never(axis):
        held.set()
        go_on.wait(30.0)
        return unit.where[axis]

    unit.wrong["position"] = never
    rig.controller.ask_position(FIRST, "um")
    receiving = threading.Thread(target=_received, args=(rig.controller,))
    receiving.start()
    assert held.wait(5.0)
    closing = threading.Thread(target=rig.controller.close)
    closing.start()
    closing.join(15.0)
    closed = not closing.is_alive()
    go_on.set()
    receiving.join()
    closing.join()
    assert closed
    assert "has not returned" in caplog.text


def _received(controller):
    try:
        controller.receive(0, 1.0)
    except DeviceError:
        return
