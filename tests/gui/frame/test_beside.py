"""STOP can be clicked whatever is open: a dialog, a question, a menu, the list of a box."""

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QComboBox,
    QDialog,
    QInputDialog,
    QMenu,
    QMessageBox,
    QVBoxLayout,
    QWidget,
)
from pytestqt.qtbot import QtBot

from cosmic.frame.gui.beside import open_beside
from cosmic.frame.gui.stop_button import StopButton

LEFT = Qt.MouseButton.LeftButton


class Window(QWidget):
    """A window with STOP, and room for what pops up below."""

    def __init__(self) -> None:
        super().__init__()
        self.stop, self.box, self.stops = StopButton(), QComboBox(), 0
        self.box.addItems(["a", "b", "c"])
        column = QVBoxLayout(self)
        column.addWidget(self.stop)
        column.addWidget(self.box)
        self.resize(400, 400)
        self.stop.stop_requested.connect(self._on_stop)

    def _on_stop(self) -> None:
        self.stops += 1

    def click_stop(self) -> None:
        """Click where STOP is on the screen, as a mouse does; the system finds who gets it."""
        at = self.stop.mapTo(self, self.stop.rect().center())
        QTest.mouseClick(self.windowHandle(), LEFT, Qt.KeyboardModifier.NoModifier, at)


@pytest.fixture
def window(qtbot: QtBot) -> Window:
    made = Window()
    qtbot.addWidget(made)
    with qtbot.waitExposed(made):
        made.show()
    return made


def test_stop_is_pressed_through_an_open_menu(qtbot: QtBot, window: Window) -> None:
    menu = QMenu(window)
    menu.addAction("one")
    menu.popup(window.mapToGlobal(QPoint(200, 300)))
    qtbot.waitUntil(menu.isVisible)
    window.click_stop()
    assert window.stops == 1
    assert not menu.isVisible()
    window.click_stop()
    assert window.stops == 2


def test_stop_is_pressed_once_through_the_open_list_of_a_box(qtbot: QtBot, window: Window) -> None:
    window.box.showPopup()
    qtbot.waitUntil(window.box.view().isVisible)
    window.click_stop()
    qtbot.wait(50)  # Qt may hand the press on once the list has closed
    assert window.stops == 1


def test_a_press_on_a_menu_over_the_button_is_for_the_menu(qtbot: QtBot, window: Window) -> None:
    menu = QMenu(window)
    action = menu.addAction("one")
    corner = window.stop.mapToGlobal(QPoint(0, 0))
    menu.popup(corner)
    qtbot.waitUntil(menu.isVisible)
    at = menu.actionGeometry(action).center()
    QTest.mousePress(menu.windowHandle(), LEFT, Qt.KeyboardModifier.NoModifier, at)
    menu.close()
    assert window.stops == 0


@pytest.mark.parametrize("kind", [QDialog, QMessageBox, QInputDialog])
def test_stop_is_pressed_beside_a_dialog(window: Window, kind: type[QDialog]) -> None:
    dialog = kind(window)
    open_beside(dialog)
    assert dialog.isVisible()
    window.click_stop()
    assert window.stops == 1
    assert dialog.isVisible()
    dialog.reject()


def test_what_is_open_already_comes_to_the_front(window: Window) -> None:
    first, again, other = QInputDialog(window), QInputDialog(window), QInputDialog(window)
    for each in (first, again):
        each.setWindowTitle("Name")
    other.setWindowTitle("Number")
    for each in (first, again, other):
        open_beside(each)
    assert [each.isVisible() for each in (first, again, other)] == [True, False, True]


def test_a_question_takes_the_place_of_the_one_before(window: Window) -> None:
    first, again = QMessageBox(window), QMessageBox(window)
    answers: list[int] = []
    first.finished.connect(answers.append)
    open_beside(first)
    open_beside(again)
    assert (first.isVisible(), again.isVisible()) == (False, True)
    assert answers == [QDialog.DialogCode.Rejected.value]
    again.reject()


def test_a_dialog_waits_for_the_one_that_it_opened(window: Window) -> None:
    outer = QDialog(window)
    open_beside(outer)
    inner = QInputDialog(outer)
    open_beside(inner)
    assert (outer.isEnabled(), inner.isEnabled()) == (False, True)
    window.click_stop()
    assert window.stops == 1
    inner.reject()
    assert outer.isEnabled()
