"""What a hand that slips, a wheel that turns or an Escape too many must not do."""

from collections.abc import Callable
from typing import TypeVar

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QAction
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QAbstractSlider,
    QAbstractSpinBox,
    QApplication,
    QComboBox,
    QDialog,
    QLineEdit,
    QMenu,
    QMenuBar,
    QPushButton,
    QScrollBar,
    QTabBar,
    QWidget,
)
from pytestqt.qtbot import QtBot

from cosmic.app.panels.campaign.dock import CAMPAIGN
from cosmic.app.panels.motion_tabs import TRAJECTORIES
from cosmic.app.panels.recorded import RECORDER
from cosmic.app.windows.operator_window import OperatorWindow
from cosmic.frame.gui.stop_button import StopButton
from gui.app.windows import Make, card, go_to
from gui.frame.wheel import turn
from gui.mico.panels import part, position

ESCAPE = Qt.Key.Key_Escape
Asking = TypeVar("Asking", QPushButton, QAction)


@pytest.fixture
def moving(make: Make, qtbot: QtBot) -> OperatorWindow:
    """A window whose axis left.x is on a long way."""
    window = make(rate=1.0)
    axis = card(window, "left.x")
    qtbot.waitUntil(part(axis, "MiCoCL_9", QPushButton).isEnabled)
    go_to(window, qtbot, "left.x", 5000.0)
    qtbot.waitUntil(lambda: axis.axis.details.in_motion and position(axis) > 1.0)
    window.setFocus()
    return window


def _values(window: OperatorWindow) -> dict[QWidget, object]:
    """What each widget shows that a wheel could change."""
    read: dict[type[QWidget], Callable[..., object]] = {
        QComboBox: lambda each: each.currentIndex(),
        QTabBar: lambda each: each.currentIndex(),
        QAbstractSpinBox: lambda each: each.text(),
        QLineEdit: lambda each: each.text(),
        QAbstractSlider: lambda each: each.value(),
    }
    return {
        each: value(each)
        for kind, value in read.items()
        for each in window.findChildren(kind)
        if not isinstance(each, QScrollBar)
    }


def test_the_wheel_changes_no_value_anywhere_in_the_window(make: Make, qtbot: QtBot) -> None:
    window = make(applications=("mico", "daqco", "vico"), hardware=False)
    window.setFocus()
    for title in ("Campaign", "Trajectories", "Control loop", "Teleoperation", "Lens and light"):
        window.raise_panel(title)
        QApplication.processEvents()
    before = _values(window)
    assert len(before) > 100
    assert {QComboBox, QTabBar} <= {type(each) for each in before}
    for widget in before:
        if not widget.hasFocus():
            turn(widget, 1)
            turn(widget, -2)
    assert {str(key): value for key, value in _values(window).items()} == {
        str(key): value for key, value in before.items()
    }


def test_escape_in_a_menu_or_in_help_cancels_that_and_the_movement_goes_on(
    moving: OperatorWindow, qtbot: QtBot
) -> None:
    menu = moving.findChild(QMenuBar).actions()[0].menu()
    assert isinstance(menu, QMenu)
    menu.popup(moving.pos())
    qtbot.keyClick(menu, ESCAPE)
    assert not menu.isVisible()
    moving.show_keys()
    help_ = moving.keys_dialog
    assert help_ is not None
    qtbot.waitUntil(lambda: QApplication.activeWindow() is help_)
    qtbot.keyClick(help_, ESCAPE)
    assert not help_.isVisible()
    assert not moving.top_bar.latched
    assert card(moving, "left.x").axis.details.in_motion


def test_escape_stops_what_moves_where_there_is_nothing_to_cancel(
    moving: OperatorWindow, qtbot: QtBot
) -> None:
    qtbot.keyClick(moving, ESCAPE)
    qtbot.waitUntil(lambda: moving.top_bar.latched)
    qtbot.waitUntil(lambda: not card(moving, "left.x").axis.details.in_motion)


def test_escape_leaves_a_platform_alone_that_stands(window: OperatorWindow, qtbot: QtBot) -> None:
    window.setFocus()
    qtbot.keyClick(window, ESCAPE)
    QApplication.processEvents()
    assert not window.top_bar.latched


def test_stop_is_clicked_beside_every_dialog_that_the_window_opens(
    make: Make, qtbot: QtBot
) -> None:
    window = make(applications=("mico", "daqco", "vico"), hardware=False)
    for title in (RECORDER, TRAJECTORIES, CAMPAIGN):  # made when they are first seen
        before = len(_asking(window, QPushButton))
        window.raise_panel(title)
        qtbot.waitUntil(lambda before=before: len(_asking(window, QPushButton)) > before)
    buttons = [each.clicked.emit for each in _asking(window, QPushButton)]
    actions = [each.trigger for each in _asking(window, QAction)]
    actions += [each.trigger for each in window.findChildren(QAction) if each.text() == "&About"]
    seen = set()
    for opens in (*buttons, *actions):
        opens()
        dialogs = [each for each in window.findChildren(QDialog) if each.isVisible()]
        with qtbot.waitSignal(window.stop_requested):
            stop = window.top_bar.findChildren(StopButton)[0]
            at = stop.mapTo(window, stop.rect().center())
            QTest.mouseClick(
                window.windowHandle(), Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier, at
            )
        for each in dialogs:
            seen.add(each.windowTitle())
            each.reject()
    assert len(seen) >= 10, seen


def _asking(window: OperatorWindow, kind: type[Asking]) -> list[Asking]:
    """What opens a dialog, by its three dots."""
    return [each for each in window.findChildren(kind) if each.text().endswith("…")]
