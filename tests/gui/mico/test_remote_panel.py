"""The panel over the axes of another station: the same widgets, and nothing freezes it."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLabel, QLineEdit, QPushButton
from pytestqt.qtbot import QtBot

from contract.mico_rig import HostedMico, hosted_mico, reachable
from contract.station_rig import connected, free_port
from cosmic.frame.clock import WALL
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.gui.theme import State
from cosmic.frame.network.client_side_connection import ClientSideConnection
from cosmic.frame.threads import declare_gui_thread
from cosmic.mico.api.client import MicoClient
from cosmic.mico.api.stepwise import StepwiseMove
from cosmic.mico.api.trajectory_state import PlayState
from cosmic.mico.gui.mico_widget import MicoWidget, make_mico_gui
from cosmic.mico.gui.positioner_gui import PositionerBaseGUI
from cosmic.mico.gui.trajectory_panel import TrajectoryPanel, make_trajectory_panel
from gui.mico.panels import click, enter, field, part, show, wait_for_position

LONG_MS = 10_000
HEAD = "cosmic-trajectory 1\nplatform FiberStation\n"


@contextmanager
def hosting(*, cold: bool = False) -> Iterator[HostedMico]:
    with hosted_mico(rate=50.0, cold=cold) as hosted:
        yield replace(hosted, endpoint=f"tcp/127.0.0.1:{free_port()}")


@contextmanager
def remote_panel(
    qtbot: QtBot, hosted: HostedMico
) -> Iterator[tuple[MicoWidget, ClientSideConnection]]:
    """A window that holds the lease of the station; its thread may wait for nobody."""
    with ExitStack() as stack:
        client = stack.enter_context(connected(hosted.endpoint))
        client.take_lease()
        application = MicoClient(client, FailurePolicy(), gui_factory=make_mico_gui)
        stack.callback(application.shut_down)
        stack.callback(declare_gui_thread())
        application.initialize()
        panel = application.get_gui()
        assert isinstance(panel, MicoWidget)
        qtbot.addWidget(panel)
        show(qtbot, panel)
        qtbot.waitUntil(lambda: len(panel.cards) == 11, timeout=LONG_MS)
        yield panel, client
        panel.close()


def line(card: PositionerBaseGUI) -> str:
    found = card.findChild(QLabel, "status")
    assert found is not None
    return found.text() + found.toolTip()


def test_the_panel_of_another_station_moves_jogs_steps_undoes_and_stops(qtbot: QtBot) -> None:
    with (
        hosting() as hosted,
        reachable(hosted),
        remote_panel(qtbot, hosted) as (panel, _),
    ):
        assert [group.title for group in panel.groups][:2] == ["Left assembly", "Right assembly"]
        card, gripper = panel.cards["left.x"], panel.cards["left.gripper"]
        qtbot.waitUntil(lambda: panel.collision.has_model, timeout=LONG_MS)

        enter(qtbot, field(card, "MiCoCL_8"), "80")
        click(qtbot, card, "MiCoCL_6")
        wait_for_position(qtbot, card, 80.0)

        enter(qtbot, field(card, "MiCoCL_8"), "9000")
        click(qtbot, card, "MiCoCL_6")
        qtbot.waitUntil(lambda: "outside its limit" in line(card), timeout=LONG_MS)

        before = gripper.axis.position_um or 0.0
        click(qtbot, gripper, gripper.forward_name)
        qtbot.waitUntil(lambda: (gripper.axis.position_um or 0.0) > before, timeout=LONG_MS)

        panel.setFocus()
        qtbot.keyPress(panel, Qt.Key.Key_D)
        qtbot.waitUntil(lambda: (card.axis.position_um or 0.0) > 200.0, timeout=LONG_MS)
        qtbot.keyRelease(panel, Qt.Key.Key_D)
        qtbot.waitUntil(lambda: not card.axis.details.in_motion, timeout=LONG_MS)

        undo = panel.findChild(QPushButton, "undo")
        assert undo is not None
        qtbot.waitUntil(undo.isEnabled, timeout=LONG_MS)
        qtbot.mouseClick(undo, Qt.MouseButton.LeftButton)
        wait_for_position(qtbot, card, 80.0)

        series = StepwiseMove(card.axis, 160.0, 30.0)
        qtbot.waitUntil(lambda: series.done, timeout=LONG_MS)
        assert series.movement.success
        assert series.begun == 3

        panel.rescan()
        task = panel.mico.application.running_task
        assert task is not None
        qtbot.waitUntil(lambda: task.done, timeout=LONG_MS)
        assert task.failure is None
        panel.mico["left.x"].move_to(240.0, wait=False)
        wait_for_position(qtbot, panel.cards["left.x"], 240.0)

        panel.mico.stop("the button")
        qtbot.waitUntil(lambda: hosted.application.manager.latch.state.latched, timeout=LONG_MS)


def test_nobody_moves_an_unknown_axis_of_another_station_without_consent(qtbot: QtBot) -> None:
    with (
        hosting(cold=True) as hosted,
        reachable(hosted),
        remote_panel(qtbot, hosted) as (panel, _),
    ):
        card = panel.cards["probe.x"]
        click(qtbot, card, "MiCoCL_6")
        qtbot.waitUntil(lambda: panel.dialog is not None, timeout=LONG_MS)
        assert not hosted.mico["probe.x"].details.in_motion


def test_a_window_that_lost_the_lease_says_who_holds_it(qtbot: QtBot) -> None:
    with (
        hosting() as hosted,
        reachable(hosted),
        remote_panel(qtbot, hosted) as (panel, _),
    ):
        card = panel.cards["left.x"]
        hosted.station.lease.take_over()
        click(qtbot, card, "MiCoCL_6")
        qtbot.waitUntil(lambda: "held by the operator at fibres" in line(card), timeout=LONG_MS)


def test_a_station_that_goes_away_greys_the_panel_and_comes_back_by_itself(qtbot: QtBot) -> None:
    with hosting() as hosted, ExitStack() as stack:
        with reachable(hosted):
            panel, _ = stack.enter_context(remote_panel(qtbot, hosted))
            card = panel.cards["left.x"]
        qtbot.waitUntil(lambda: not card.axis.details.present, timeout=LONG_MS)
        began_s = WALL.now_s()
        card.move_once(1)
        card.axis.halt()
        assert WALL.now_s() - began_s < 0.5, "the window waited for a station that is away"
        missing = panel.findChild(QLabel, "missing")
        assert missing is not None
        qtbot.waitUntil(lambda: "fibres is away" in missing.text(), timeout=LONG_MS)
        qtbot.waitUntil(lambda: panel.groups[0].state is State.UNKNOWN, timeout=LONG_MS)
        with reachable(hosted):
            qtbot.waitUntil(lambda: card.axis.details.present, timeout=LONG_MS)
            hosted.mico["left.x"].move_to(40.0, wait=False)
            wait_for_position(qtbot, card, 40.0)
            qtbot.waitUntil(lambda: not missing.isVisible(), timeout=LONG_MS)


def test_a_trajectory_and_a_pose_of_another_station_are_run_from_its_window(
    qtbot: QtBot, tmp_path: Path
) -> None:
    with (
        hosting() as hosted,
        reachable(hosted),
        remote_panel(qtbot, hosted) as (widget, _),
    ):
        panel = make_trajectory_panel(widget.mico)
        qtbot.addWidget(panel)
        show(qtbot, panel, 620, 700)
        path = tmp_path / "some.trajectory"
        path.write_text(f"{HEAD}start left.y 40 um\nleft.y by 60 um\nleft.y by -20 um\n")
        panel.open(path)
        qtbot.waitUntil(lambda: panel.trajectory is not None, timeout=LONG_MS)
        click(qtbot, panel, "rehearse")
        qtbot.waitUntil(lambda: "smallest clearance" in panel.report.text(), timeout=LONG_MS)

        click(qtbot, panel, "step")
        qtbot.waitUntil(panel.question.isVisible, timeout=LONG_MS)
        click(qtbot, panel, "goStraight")
        reached(qtbot, panel, PlayState.PAUSED)
        assert hosted.mico["left.y"].position_um == pytest.approx(100.0, abs=1.0)
        click(qtbot, panel, "runTrajectory")
        reached(qtbot, panel, PlayState.ENDED)
        assert hosted.mico["left.y"].position_um == pytest.approx(80.0, abs=1.0)
        assert panel.report.text().startswith("done.")

        box = panel.poses_box
        qtbot.keyClicks(part(box, "poseName", QLineEdit), "here")
        click(qtbot, box, "teachPose")
        qtbot.waitUntil(lambda: "axes" in box.message.text(), timeout=LONG_MS)
        click(qtbot, box, "goPose")
        qtbot.waitUntil(lambda: box.message.text() == "there", timeout=LONG_MS)
        hosted.station.lease.take_over()
        click(qtbot, box, "goPose")
        qtbot.waitUntil(lambda: "right to move" in box.message.text(), timeout=LONG_MS)
        click(qtbot, panel, "runTrajectory")
        qtbot.waitUntil(lambda: "right to move" in panel.report.text(), timeout=LONG_MS)


def reached(qtbot: QtBot, panel: TrajectoryPanel, state: PlayState) -> None:
    qtbot.waitUntil(
        lambda: panel.player is not None and panel.player.state is state, timeout=LONG_MS
    )
    qtbot.waitUntil(lambda: str(state) in panel.run_bar.left.text(), timeout=LONG_MS)
