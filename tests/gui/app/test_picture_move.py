"""Moving the chosen tool in the pictures: in the scene, and by a pad that points as shown."""

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtWidgets import QToolButton
from pytestqt.qtbot import QtBot

from cosmic.app.windows.operator_window import OperatorWindow
from cosmic.app.windows.picture_move import directions_on
from cosmic.app.windows.tasks import HANDLE, TaskLayout
from cosmic.mico.gui.scene.projection_view import ProjectionView
from gui.app.windows import Make, mico, wait_until_ready
from gui.mico.panels import position

LEFT = Qt.MouseButton.LeftButton


@pytest.mark.parametrize(
    ("x_px", "y_px", "shown"),
    [
        ((1, 0), (0, -1), {("x", 1): "right", ("y", 1): "up"}),
        ((-1, 0), (0, -1), {("x", 1): "left", ("y", 1): "up"}),
        ((1, 0.2), (0.2, 1), {("x", 1): "right", ("y", 1): "down"}),
        ((0, 1), (-1, 0), {("x", 1): "down", ("y", 1): "left"}),
    ],
)
def test_the_pad_points_where_the_picture_shows_that_an_axis_goes(
    x_px: tuple[float, float], y_px: tuple[float, float], shown: dict[tuple[str, int], str]
) -> None:
    found = directions_on(np.array(x_px, float), np.array(y_px, float))
    assert shown.items() <= found.items()
    assert sorted(found.values()) == ["down", "left", "right", "up"]


def test_buttons_of_the_pad_change_places_with_the_picture(make: Make, qtbot: QtBot) -> None:
    window = make(applications=("mico", "daqco", "vico"), hardware=False)
    tool = tasks(window).tool
    assert tool.pad["x", 1].text().startswith("→")
    tool.show_directions(directions_on(np.array([-1.0, 0.0]), np.array([0.0, -1.0])))
    assert tool.pad["x", 1].text().startswith("←")
    assert "left in the picture" in tool.pad["x", 1].toolTip()
    assert tool.pad["x", 1].x() <= tool.pad["x", -1].x()


def tasks(window: OperatorWindow) -> TaskLayout:
    assert window.tasks is not None
    return window.tasks


def test_a_drag_in_the_scene_moves_the_chosen_tool_at_its_height(make: Make, qtbot: QtBot) -> None:
    window = make(applications=("mico", "daqco", "vico"))
    wait_until_ready(window, qtbot)
    assert window.workspaces is not None
    window.workspaces.choose(HANDLE)
    central_view, bar = tasks(window).central_view, tasks(window).bar
    central_view.show_large("Scene")
    tasks(window).watch()
    move = bar.findChild(QToolButton, "barMove")
    assert isinstance(move, QToolButton)
    qtbot.mouseClick(move, LEFT)
    assert move.isChecked()
    panel = window.scene_panel
    assert panel is not None
    assert panel.scene is not None
    view = panel.scene.view
    assert isinstance(view, ProjectionView)
    card = mico(window).cards["left.x"]
    height = mico(window).cards["left.z"]
    qtbot.waitUntil(lambda: card.axis.details.present)
    before = position(card), position(height)
    top = view.panels()[0]
    here = window.platform.mico
    assert here is not None
    tip = tasks(window).tool.tool.name
    tool = mico(window).mico.tools[tip].position()
    x_mm, y_mm = tool[0] / 1000.0, tool[1] / 1000.0
    middle = top.box.center()
    begin = QPoint(
        round(middle.x() + (x_mm - top.centre_mm[0]) * top.px_mm),
        round(middle.y() - (y_mm - top.centre_mm[1]) * top.px_mm),
    )
    aside = QPoint(-round(0.5 * top.px_mm) or -1, 0)
    qtbot.mousePress(view, LEFT, pos=begin)
    qtbot.mouseMove(view, begin + aside)
    assert position(card) == pytest.approx(before[0], abs=0.5), "nothing moves before the end"
    qtbot.mouseRelease(view, LEFT, pos=begin + aside)
    wanted = before[0] + 1000.0 * aside.x() / top.px_mm
    slack = 1000.0 / top.px_mm
    qtbot.waitUntil(lambda: abs(position(card) - wanted) <= slack)
    assert position(height) == pytest.approx(before[1], abs=1.0)
