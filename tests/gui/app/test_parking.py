"""Closing the window offers to park the tools, and never while something may be held."""

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QAbstractButton
from pytestqt.qtbot import QtBot

from cosmic.app.windows.closing import ParkDialog
from cosmic.app.windows.operator_window import OperatorWindow
from gui.app.windows import mico

LEFT = Qt.MouseButton.LeftButton


def dialog_of(window: OperatorWindow) -> ParkDialog | None:
    found = window.findChild(ParkDialog)
    return found if isinstance(found, ParkDialog) else None


def press(qtbot: QtBot, button: QAbstractButton) -> None:
    qtbot.mouseClick(button, LEFT)


def test_closing_parks_first_where_there_is_a_pose_for_it(
    window: OperatorWindow, qtbot: QtBot
) -> None:
    api = mico(window).mico
    api.poses.teach("park", ["left.x"])
    axis = mico(window).cards["left.x"].axis
    axis.move_to(150.0, wait=False)
    qtbot.waitUntil(lambda: abs((axis.position_um or 0.0) - 150.0) < 1.0)
    qtbot.waitUntil(lambda: not axis.details.in_motion)
    window.close()
    dialog = dialog_of(window)
    assert dialog is not None
    assert window.isVisible()
    press(qtbot, dialog.cancel)
    assert window.isVisible()
    qtbot.waitUntil(lambda: dialog_of(window) is None)
    window.close()
    again = dialog_of(window)
    assert again is not None
    press(qtbot, again.park)
    qtbot.waitUntil(lambda: not window.isVisible())


def test_closing_asks_nothing_while_a_gripper_may_hold_something(
    window: OperatorWindow, qtbot: QtBot
) -> None:
    mico(window).mico.poses.teach("park", ["left.x"])
    gripper = mico(window).cards["left.gripper"].axis
    for steps in (60, -40):
        gripper.steps(steps, wait=False)
        qtbot.waitUntil(lambda: not gripper.details.in_motion)
        qtbot.wait(100)
    window.close()
    assert dialog_of(window) is None
    assert not window.isVisible()


def test_the_end_of_the_program_is_not_held_up_by_the_question(
    window: OperatorWindow, qtbot: QtBot
) -> None:
    mico(window).mico.poses.teach("park", ["left.x"])
    window.close()
    assert dialog_of(window) is not None
    window.close_now()
    assert not window.isVisible()
