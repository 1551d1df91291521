"""The recorder's panel: steps appear as they are done, are edited, saved, opened and replayed."""

from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QDialogButtonBox
from pytestqt.qtbot import QtBot

from cosmic.app.panels.recorded import RecorderPanel, ValuesDialog
from cosmic.autonomy.recorded.steps import (
    LensStep,
    LightStep,
    MoveStep,
    OperationStep,
    PauseStep,
    RecordedProcedure,
    RecordedStep,
)
from cosmic.autonomy.shipped.single_operation import SingleOperation

LEFT = Qt.MouseButton.LeftButton


class FakeRecorder:
    """Notes what a test has it see."""

    def __init__(self) -> None:
        self.steps: list[RecordedStep] = []
        self.relative_to = ""
        self.seen: list[RecordedStep] = []

    def look(self) -> bool:
        found, self.seen = self.seen, []
        self.steps += found
        return bool(found)

    def begin(self) -> None: ...


@pytest.fixture
def recorder() -> FakeRecorder:
    return FakeRecorder()


@pytest.fixture
def panel(qtbot: QtBot, recorder: FakeRecorder, tmp_path: Path) -> RecorderPanel:
    made = RecorderPanel(lambda: recorder, lambda: ("platform", "fibre"), lambda: tmp_path)
    qtbot.addWidget(made)
    made.show()
    return made


def texts(panel: RecorderPanel) -> list[str]:
    return [panel.list.item(row).text() for row in range(panel.list.count())]


def test_steps_appear_while_they_are_recorded_and_are_put_in_order(
    panel: RecorderPanel, recorder: FakeRecorder, qtbot: QtBot
) -> None:
    assert not panel.replay.isEnabled()
    panel.frame.setCurrentText("fibre")
    qtbot.mouseClick(panel.record, LEFT)
    assert recorder.relative_to == "fibre"
    recorder.seen = [LightStep(percent=40.0), MoveStep(axes={"left.x": 5.0})]
    qtbot.waitUntil(lambda: panel.list.count() == 2)
    assert not panel.replay.isEnabled(), "not while it records"
    qtbot.mouseClick(panel.record, LEFT)
    qtbot.mouseClick(panel.up, LEFT)
    assert texts(panel) == ["1  Move left.x to 5.0", "2  Light 40 %"]
    panel.add_wait("Wait for key")
    assert texts(panel)[1] == "2  Wait for key"
    qtbot.mouseClick(panel.delete, LEFT)
    assert len(texts(panel)) == 2


def test_a_replay_asks_for_its_values_and_hands_them_on(panel: RecorderPanel, qtbot: QtBot) -> None:
    push = OperationStep(operation=SingleOperation.PUSH, force_un=50.0)
    panel.show_steps([push])
    qtbot.mouseClick(panel.ask, LEFT)
    assert "(asks)" in texts(panel)[0]
    wanted: list[RecordedProcedure] = []
    panel.replay_requested.connect(wanted.append)
    qtbot.mouseClick(panel.replay, LEFT)
    dialog = panel.findChild(ValuesDialog)
    assert dialog is not None
    dialog.fields[0].setText("30")
    qtbot.mouseClick(dialog.buttons.button(QDialogButtonBox.StandardButton.Ok), LEFT)
    assert wanted[0].step[0].words == "Push to 30 µN"
    assert panel.procedure.step[0].words == "Push to 50 µN", "the list keeps what was recorded"


def test_a_procedure_is_saved_as_a_file_and_as_python_and_opened_again(
    panel: RecorderPanel, tmp_path: Path
) -> None:
    panel.show_steps([LightStep(percent=40.0)])
    panel.name.setText("bright")
    panel.save_as(tmp_path / "bright.toml")
    assert "LightStep(percent=40.0)" in (tmp_path / "bright.py").read_text("utf-8")
    panel.show_steps([])
    panel.open_file(tmp_path / "bright.toml")
    assert texts(panel) == ["1  Light 40 %"]
    panel.open_file(tmp_path / "none.toml")
    assert "none.toml" in panel.line.toolTip()


def test_the_script_never_takes_the_place_of_the_procedure(
    panel: RecorderPanel, tmp_path: Path
) -> None:
    panel.show_steps([LightStep(percent=40.0)])
    panel.save_as(tmp_path / "bright.py")
    assert "ends in .toml" in panel.line.text()
    assert not list(tmp_path.iterdir())


def test_noting_is_said_only_while_steps_are_noted(
    panel: RecorderPanel, recorder: FakeRecorder, qtbot: QtBot
) -> None:
    qtbot.mouseClick(panel.record, LEFT)
    assert "Noting" in panel.line.text()
    qtbot.mouseClick(panel.record, LEFT)
    assert panel.line.text() == ""


def test_continue_is_offered_where_it_stands_and_moves_nothing_under_the_mouse(
    panel: RecorderPanel,
) -> None:
    panel.show_steps([LightStep(percent=40.0)])
    buttons = (panel.go_on, panel.replay, panel.save, panel.add)
    before = [each.geometry() for each in buttons]
    assert not panel.go_on.isEnabled()
    panel.show_waiting("Wait for key")
    assert panel.go_on.isEnabled()
    assert panel.line.text() == "Wait for key"
    panel.grab()  # lays it out
    assert [each.geometry() for each in buttons] == before
    panel.show_waiting("")
    assert not panel.go_on.isEnabled()
    assert panel.line.text() == ""


def test_no_replay_is_offered_while_an_operation_runs(panel: RecorderPanel) -> None:
    panel.show_steps([LightStep(percent=40.0)])
    panel.show_running("Take with left")
    assert not panel.replay.isEnabled()
    assert panel.replay.toolTip() == "Take with left is running; end it first"
    panel.show_running("")
    assert panel.replay.isEnabled()


def test_the_numbers_of_a_step_are_changed_in_the_list(panel: RecorderPanel, qtbot: QtBot) -> None:
    panel.show_steps([LightStep(percent=40.0), LensStep(zoom=2.0, focus_counts=4000)])
    panel.list.setFocus()
    panel.list.itemActivated.emit(panel.list.item(1))  # by a double click, or Enter
    dialog = panel.findChild(ValuesDialog)
    assert dialog is not None
    zoom, focus = dialog.fields
    zoom.setText("1")
    focus.setText("3900")
    qtbot.mouseClick(dialog.buttons.button(QDialogButtonBox.StandardButton.Ok), LEFT)
    assert texts(panel) == ["1  Light 40 %", "2  Lens: zoom 1x, focus 3900 counts"]
    assert panel.list.currentRow() == 1


def accept(qtbot: QtBot, panel: RecorderPanel, value: str) -> None:
    dialog = panel.findChild(ValuesDialog)
    assert dialog is not None
    dialog.fields[0].setText(value)
    qtbot.mouseClick(dialog.buttons.button(QDialogButtonBox.StandardButton.Ok), LEFT)


def test_a_number_goes_to_its_step_wherever_that_stands_by_then(
    panel: RecorderPanel, qtbot: QtBot
) -> None:
    panel.show_steps([PauseStep(seconds=1.0), PauseStep(seconds=2.0), PauseStep(seconds=3.0)], 1)
    panel.edit()
    panel.list.setCurrentRow(0)
    qtbot.mouseClick(panel.delete, LEFT)
    accept(qtbot, panel, "20")
    assert texts(panel) == ["1  Pause 20 s", "2  Pause 3 s"]


def test_a_number_for_a_step_that_is_gone_changes_no_other(
    panel: RecorderPanel, qtbot: QtBot
) -> None:
    panel.show_steps([PauseStep(seconds=1.0), PauseStep(seconds=2.0)], 1)
    panel.edit()
    qtbot.mouseClick(panel.delete, LEFT)
    accept(qtbot, panel, "20")
    assert texts(panel) == ["1  Pause 1 s"]
    assert "is no longer in the list" in panel.line.text()


def test_no_replay_begins_with_steps_that_are_no_longer_shown(
    panel: RecorderPanel, qtbot: QtBot
) -> None:
    replayed: list[object] = []
    panel.replay_requested.connect(replayed.append)
    panel.show_steps([PauseStep(seconds=1.0), PauseStep(seconds=2.0)], 1)
    qtbot.mouseClick(panel.ask, LEFT)
    qtbot.mouseClick(panel.replay, LEFT)
    panel.list.setCurrentRow(0)
    qtbot.mouseClick(panel.delete, LEFT)
    accept(qtbot, panel, "20")
    assert not replayed
    assert "press Replay again" in panel.line.text()


def test_what_an_operation_does_not_use_is_not_asked_for(panel: RecorderPanel) -> None:
    panel.show_steps([OperationStep(operation=SingleOperation.TAKE, gripper="left")])
    assert not panel.ask.isEnabled()
    panel.edit()
    assert panel.findChild(ValuesDialog) is None
