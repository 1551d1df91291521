"""The button that calibrates: what it offers, begins, says and refuses."""

from datetime import UTC, datetime, timedelta

import pytest

from cosmic.frame.errors import NotAvailable
from cosmic.vico.api.coordinate_transform import CalibrationShown, RotationShown
from cosmic.vico.gui.calibrate_menu import CalibrateButton

NOW = datetime(2026, 11, 21, 12, 0, tzinfo=UTC)


@pytest.fixture
def button(own, camera):
    made = CalibrateButton(camera, now=lambda: NOW)
    own(made)
    return made


def actions(button):
    button.fill()
    return {action.text(): action for action in button.menu().actions()}


def test_each_tool_calibrates_and_the_table_turns(button, camera):
    actions(button)["Move right gripper"].trigger()
    assert camera.calls[-1] == ("calibrate_stage", "right gripper")
    camera.task.finish()
    actions(button)["Find the table's rotation centre"].trigger()
    assert camera.calls[-1] == ("find_rotation_centre",)


def test_while_one_runs_it_can_only_be_cancelled(qtbot, button, camera):
    messages = []
    button.message.connect(messages.append)
    actions(button)["Move left gripper"].trigger()
    task = camera.task
    task.report(0.5, "place 5 of 9")
    qtbot.waitUntil(lambda: "Calibrating: place 5 of 9" in messages)
    offered = actions(button)
    assert list(offered) == ["Cancel"]
    offered["Cancel"].trigger()
    assert task.cancel_requested
    task.fail(NotAvailable("it was cancelled"))
    qtbot.waitUntil(lambda: "it was cancelled" in messages[-1])
    assert "Cancel" not in actions(button)


def test_what_is_calibrated_is_listed_with_its_age(button, camera):
    assert "not calibrated yet" in actions(button)
    camera.calibrated = (
        CalibrationShown("top", "left", 5964.0, 50.0, 2.1977, 0.12, NOW - timedelta(hours=2)),
    )
    camera.rotation = RotationShown(
        "table.rotation", (1.02, -1.7), 0.1, 0.4, NOW - timedelta(seconds=10)
    )
    line, turns = button.lines()
    assert turns.startswith("rotation centre: x 1.0, y -1.7 µm, known to 0.1 µm; 10")
    assert line.startswith("left: 2.198 µm a pixel at zoom 5964, height 50 µm; 0.12 px off, 2 h")
    assert not actions(button)[line].isEnabled()


def test_a_refusal_is_reported(button, camera):
    messages = []
    button.message.connect(messages.append)
    camera.refuse = "autofocus is running"
    actions(button)["Move left gripper"].trigger()
    assert messages[-1].endswith("autofocus is running")


def test_without_tools_the_button_is_off_and_says_why(button, camera):
    camera.targets = ()
    button.fill()
    assert not button.isEnabled()
    assert "no tool" in button.toolTip()
