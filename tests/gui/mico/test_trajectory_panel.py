"""The panel of SCM on the simulated platform."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtWidgets import QApplication, QComboBox, QLineEdit, QScrollArea
from pytestqt.qtbot import QtBot

from cosmic.app.platform import build_platform
from cosmic.frame.verdict import MoveVerdict, Reason
from cosmic.mico.api.mico import Mico
from cosmic.mico.api.trajectory_state import PlayState
from cosmic.mico.gui.trajectory_panel import TrajectoryPanel, make_trajectory_panel
from gui.mico.panels import click, part, show

HEAD = "cosmic-trajectory 1\nplatform FiberStation\n"


@pytest.fixture(scope="module")
def mico() -> Iterator[Mico]:
    """One platform for all tests here; none of them leaves it stopped."""
    with pytest.MonkeyPatch.context() as patched:
        from cosmic.mico.core.collision import collision_manager
        from gui.conftest import InProcess

        patched.setattr(collision_manager, "GateProcess", InProcess)
        platform = build_platform(applications=("mico",), rate=50.0)
        assert platform.mico is not None
        platform.initialize()
        yield Mico(platform.mico, "window")
        platform.shut_down()


@pytest.fixture
def panel(mico: Mico, qtbot: QtBot) -> TrajectoryPanel:
    panel = make_trajectory_panel(mico)
    qtbot.addWidget(panel)
    show(qtbot, panel, 620, 700)
    return panel


def opened(panel: TrajectoryPanel, qtbot: QtBot, tmp_path: Path, text: str) -> None:
    path = tmp_path / "some.trajectory"
    path.write_text(text, encoding="utf-8")
    panel.open(path)
    qtbot.waitUntil(lambda: panel.lines.lines.rowCount() > 0)


def wait_for(panel: TrajectoryPanel, qtbot: QtBot, state: PlayState) -> None:
    def reached() -> bool:
        return panel.player is not None and panel.player.state is state

    qtbot.waitUntil(reached, timeout=8000)
    qtbot.waitUntil(lambda: str(state) in panel.run_bar.left.text())


def at(panel: TrajectoryPanel, mico: Mico, axis: str) -> float:
    position = mico[axis].details.position
    assert position is not None
    return position


def test_a_file_with_mistakes_is_shown_with_each_at_its_line(
    panel: TrajectoryPanel, qtbot: QtBot, tmp_path: Path
) -> None:
    opened(panel, qtbot, tmp_path, HEAD + "left.x to 5\nleft.gripper to 5 um\n")
    assert list(panel.lines.lines.problems) == [3]
    opened(panel, qtbot, tmp_path, HEAD + "left.gripper to 5 um\nnobody to 5 um\n")
    qtbot.waitUntil(lambda: list(panel.lines.lines.problems) == [3, 4])
    assert "line 3: left.gripper has no sensor" in panel.report.text()
    assert "and 1 more" in panel.report.text()
    assert "no sensor" in str(panel.lines.lines.index(2).data())
    assert panel.trajectory is None
    assert not panel.run_bar.run.isEnabled()
    assert not panel.rehearse_button.isEnabled()


def test_a_rehearsal_reports_clearance_duration_and_end_and_gives_a_preview(
    panel: TrajectoryPanel, mico: Mico, qtbot: QtBot, tmp_path: Path
) -> None:
    opened(panel, qtbot, tmp_path, HEAD + "left.z to 300 um\nwait 2 s\nleft.z to 0 um\n")
    with qtbot.waitSignal(panel.preview_changed) as signal:
        click(qtbot, panel, "rehearse")
    assert [round(pose["left.z"]) for pose in signal.args[0]][1:] == [300, 0]
    assert "smallest clearance" in panel.report.text()
    assert "in about 2." in panel.report.text()
    assert "left.z 0.0" in panel.report.text()


def test_a_rehearsal_that_is_refused_marks_the_line(
    panel: TrajectoryPanel, qtbot: QtBot, tmp_path: Path
) -> None:
    text = HEAD + "left.z to 10 um\ntogether\nleft.x to 5400 um\nright.x to -5400 um\nend\n"
    opened(panel, qtbot, tmp_path, text)
    with qtbot.waitSignal(panel.refused) as signal:
        panel.rehearse()
    verdict: MoveVerdict = signal.args[0]
    assert verdict.reason is Reason.COLLISION
    assert list(panel.lines.lines.problems) == [4]


def test_it_steps_pauses_runs_and_reports_how_far_it_is(
    panel: TrajectoryPanel, mico: Mico, qtbot: QtBot, tmp_path: Path
) -> None:
    opened(panel, qtbot, tmp_path, HEAD + "left.y to 200 um\nwait 1 s\nleft.y to 0 um\n")
    click(qtbot, panel, "step")
    wait_for(panel, qtbot, PlayState.PAUSED)
    assert at(panel, mico, "left.y") == pytest.approx(200.0, abs=1.0)
    assert panel.lines.lines.current == 4
    assert panel.run_bar.run.text() == "Resume"
    assert panel.badge.word == "PAUSED"
    assert "s left" in panel.run_bar.left.text()
    click(qtbot, panel, "runTrajectory")
    wait_for(panel, qtbot, PlayState.ENDED)
    assert at(panel, mico, "left.y") == pytest.approx(0.0, abs=1.0)
    assert panel.report.text().startswith("done.")
    assert panel.run_bar.progress.value() == 100
    click(qtbot, panel, "runTrajectory")
    qtbot.waitUntil(lambda: panel.run_bar.progress.value() < 100)
    wait_for(panel, qtbot, PlayState.ENDED)


def test_a_line_that_was_stopped_is_marked_until_it_goes_on(
    panel: TrajectoryPanel, mico: Mico, qtbot: QtBot, tmp_path: Path
) -> None:
    opened(panel, qtbot, tmp_path, HEAD + "left.y to 100 um\nwait 1 s\nleft.y to 0 um\n")
    click(qtbot, panel, "step")
    wait_for(panel, qtbot, PlayState.PAUSED)
    mico.stop("a test")
    try:
        click(qtbot, panel, "runTrajectory")
        wait_for(panel, qtbot, PlayState.FAILED)
        assert list(panel.lines.lines.problems)
    finally:
        mico.reset_stop()
    click(qtbot, panel, "runTrajectory")
    wait_for(panel, qtbot, PlayState.ENDED)
    assert not panel.lines.lines.problems
    assert panel.report.text().startswith("done.")


def test_what_a_rehearsal_says_does_not_push_the_buttons_below_it(
    panel: TrajectoryPanel, qtbot: QtBot, tmp_path: Path
) -> None:
    column = QScrollArea()
    qtbot.addWidget(column)
    column.setWidgetResizable(True)
    column.setWidget(panel)
    show(qtbot, column, 370, 580)
    opened(panel, qtbot, tmp_path, HEAD + "left.z to 200 um\nwait 1 s\nleft.z to 0 um\n")
    QApplication.processEvents()
    before = panel.run_bar.run.mapTo(column, QPoint(0, 0))
    click(qtbot, panel, "rehearse")
    qtbot.waitUntil(lambda: "smallest clearance" in panel.report.text())
    QApplication.processEvents()
    assert panel.run_bar.run.mapTo(column, QPoint(0, 0)) == before
    column.takeWidget()


def test_it_can_be_cancelled_while_it_loops_for_ever_at_another_speed(
    panel: TrajectoryPanel, qtbot: QtBot, tmp_path: Path
) -> None:
    opened(panel, qtbot, tmp_path, HEAD + "left.y by 100 um\nleft.y by -100 um\n")
    panel.run_bar.loops.setValue(0)
    click(qtbot, panel, "runTrajectory")
    qtbot.waitUntil(lambda: panel.player is not None and panel.player.progress.loop > 1)
    panel.run_bar.speed.setValue(0.5)
    assert panel.player is not None
    assert panel.player.speed == 0.5
    click(qtbot, panel, "cancelRun")
    wait_for(panel, qtbot, PlayState.CANCELLED)


def test_away_from_the_start_it_asks_and_goes_there(
    panel: TrajectoryPanel, mico: Mico, qtbot: QtBot, tmp_path: Path
) -> None:
    opened(panel, qtbot, tmp_path, HEAD + "start left.y 400 um\nleft.y by 50 um\n")
    click(qtbot, panel, "runTrajectory")
    assert panel.question.isVisible()
    assert "left.y at" in panel.question.words.text()
    assert panel.question.around.isVisible()
    click(qtbot, panel, "goStraight")
    wait_for(panel, qtbot, PlayState.ENDED)
    assert at(panel, mico, "left.y") == pytest.approx(450.0, abs=1.0)
    assert not panel.question.isVisible()


def test_what_is_recorded_is_shown_and_can_be_mirrored(
    panel: TrajectoryPanel, mico: Mico, qtbot: QtBot, tmp_path: Path
) -> None:
    panel.record_bar.timed.setChecked(False)
    panel.record_bar.source.setCurrentText("window and keys")
    panel.record(tmp_path / "mine.trajectory")
    assert panel.record_bar.button.text() == "Stop recording"
    assert not panel.record_bar.source.isEnabled()
    movement = mico["left.x"].move_to(-30.0, wait=False)
    qtbot.waitUntil(lambda: movement.done)
    qtbot.mouseClick(panel.record_bar.button, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: panel.trajectory is not None)
    assert panel.trajectory is not None
    assert "left.x to -30 um" in panel.trajectory.lines
    click(qtbot, panel, "mirror")
    assert "right.x to 30 um" in panel.trajectory.lines


def test_poses_are_taught_gone_to_and_offered_to_recordings(
    panel: TrajectoryPanel, mico: Mico, qtbot: QtBot
) -> None:
    box = panel.poses_box
    qtbot.keyClicks(part(box, "poseName", QLineEdit), "over the fibre")
    box.group.setCurrentText("Left assembly")
    click(qtbot, box, "teachPose")
    assert "3 axes" in box.message.text()
    assert part(box, "poses", QComboBox).currentText() == "over the fibre"
    offered = panel.record_bar.pose
    assert [offered.itemText(n) for n in range(offered.count())] == ["no pose", "over the fibre"]
    before = at(panel, mico, "left.x")
    qtbot.keyClicks(part(box, "poseName", QLineEdit), "over the fibre")
    box.group.setCurrentText("all axes")
    click(qtbot, box, "teachPose")
    assert "There is a pose over the fibre already" in box.message.text()
    assert len(mico.poses["over the fibre"].positions) == 3
    click(qtbot, box, "teachPose")
    assert len(mico.poses["over the fibre"].positions) > 3
    movement = mico["left.x"].move_to(before + 90.0, wait=False)
    qtbot.waitUntil(lambda: movement.done)
    click(qtbot, box, "goPose")
    qtbot.waitUntil(lambda: box.message.text() == "there", timeout=5000)
    assert at(panel, mico, "left.x") == pytest.approx(before, abs=1.0)
    click(qtbot, box, "removePose")
    assert mico.poses.names == []


def test_nothing_is_moved_under_an_operation_that_moves_the_axes(
    panel: TrajectoryPanel,
    mico: Mico,
    qtbot: QtBot,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    before = at(panel, mico, "left.x")
    mico.poses.teach("here", ["left.x"])
    mico["left.x"].move_to(before + 20.0)
    opened(panel, qtbot, tmp_path, HEAD + "left.x by 5 um\n")
    qtbot.waitUntil(lambda: panel.trajectory is not None)
    monkeypatch.setattr(mico.application, "busy", lambda: "take with left moves the axes")
    panel.poses_box.refresh()
    panel.poses_box.poses.setCurrentText("here")
    click(qtbot, panel.poses_box, "goPose")
    assert panel.poses_box.message.text() == "take with left moves the axes"
    panel.run_bar.run.click()
    assert panel.report.text() == "take with left moves the axes"
    qtbot.wait(200)
    assert at(panel, mico, "left.x") == pytest.approx(before + 20.0, abs=1.0)
    mico.poses.remove("here")


def test_a_rehearsal_is_shown_with_its_own_trajectory_only(
    panel: TrajectoryPanel, mico: Mico, qtbot: QtBot, tmp_path: Path
) -> None:
    opened(panel, qtbot, tmp_path, HEAD + "left.x by 5 um\nleft.x by -5 um\n")
    qtbot.waitUntil(panel.mirror_button.isEnabled)
    drawn: list[object] = []
    panel.preview_changed.connect(drawn.append)
    panel.rehearse()
    panel.mirror()
    task = mico.application.running_task
    qtbot.waitUntil(lambda: task is None or task.done)
    qtbot.wait(200)
    assert "Rehearse it to see what it does" in panel.report.text()
    assert drawn == [None]
