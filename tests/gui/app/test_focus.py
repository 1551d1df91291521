"""Where the focus goes when a pressed button is hidden: Space must press nothing else."""

import pytest
from PySide6.QtCore import QSettings, Qt
from PySide6.QtWidgets import QPushButton, QVBoxLayout, QWidget
from pytestqt.qtbot import QtBot

from cosmic.app.panels.coach import Coach, Step
from cosmic.app.panels.operation_card import OperationCard


@pytest.fixture
def window(qtbot: QtBot) -> QWidget:
    """A window with a button that comes before and after what is put into it."""
    window = QWidget()
    column = QVBoxLayout(window)
    column.addWidget(QPushButton("Set up"))
    qtbot.addWidget(window)
    return window


def show(window: QWidget, panel: QWidget, qtbot: QtBot) -> None:
    layout = window.layout()
    assert layout is not None
    layout.addWidget(panel)
    layout.addWidget(QPushButton("after"))
    with qtbot.waitActive(window):
        window.show()
        window.activateWindow()


def focused_button(window: QWidget) -> QPushButton | None:
    return next((each for each in window.findChildren(QPushButton) if each.hasFocus()), None)


def test_the_coach_is_not_switched_off_by_pressing_its_button_twice(
    window: QWidget, qtbot: QtBot, stored: QSettings
) -> None:
    steps = [Step("Look at the plate next.", "Look", lambda: steps.clear())]
    coach = Coach((lambda: steps[0] if steps else None,), stored)
    show(window, coach, qtbot)
    coach.button.setFocus()
    qtbot.keyClick(coach.button, Qt.Key.Key_Space)
    assert not coach.button.isVisible()
    assert focused_button(window) is None
    qtbot.keyClick(window.focusWidget(), Qt.Key.Key_Space)
    assert not coach.off.isChecked()


def test_the_button_of_the_coach_says_what_a_click_does(
    window: QWidget, qtbot: QtBot, stored: QSettings
) -> None:
    coach = Coach((), stored)
    show(window, coach, qtbot)
    for word in ("on", "off"):
        qtbot.mouseClick(coach.off, Qt.MouseButton.LeftButton)
        assert coach.off.text() == word
        assert coach.off.toolTip().endswith(word)


def test_a_button_of_the_card_that_goes_leaves_the_focus_in_the_card(
    window: QWidget, qtbot: QtBot
) -> None:
    card = OperationCard(50.0)
    show(window, card, qtbot)
    card.offer("Put away", push=False, undo="")
    card.next.setFocus()
    card.offer("", push=False, undo="")
    assert not card.next.isVisible()
    assert focused_button(window) is None
