from collections.abc import Iterator

import pytest
from PySide6.QtCore import QEvent, Qt
from PySide6.QtGui import QKeyEvent, QKeySequence, QShortcut
from PySide6.QtWidgets import (
    QApplication,
    QComboBox,
    QDialog,
    QLineEdit,
    QMenu,
    QPushButton,
    QTableWidget,
    QTableWidgetItem,
    QWidget,
)
from pytestqt.qtbot import QtBot

from cosmic.frame.gui.application_events import ApplicationEvents, at_one_go
from cosmic.frame.gui.quantity_field import QuantityField
from cosmic.frame.gui.stop_key import StopKeyFilter

F12, ESCAPE = Qt.Key.Key_F12, Qt.Key.Key_Escape


@pytest.fixture
def moves() -> list[bool]:
    """Empty while nothing moves."""
    return [True]


@pytest.fixture
def key(qapp: QApplication, moves: list[bool]) -> Iterator[StopKeyFilter]:
    """The stop key of a platform that moves."""
    key = StopKeyFilter(qapp, "F12", moving=lambda: bool(moves))
    yield key
    ApplicationEvents.of(qapp).remove(key)
    key.deleteLater()


@pytest.fixture
def stops(key: StopKeyFilter) -> list[str]:
    """What the stop key asked for, in order."""
    received: list[str] = []
    key.stop_requested.connect(received.append)
    return received


def show(qtbot: QtBot, window: QWidget) -> None:
    qtbot.addWidget(window)
    with qtbot.waitActive(window):
        window.show()
        window.activateWindow()


@pytest.mark.parametrize("name", ["line", "button"])
def test_the_key_stops_from_any_focus(
    qtbot: QtBot, form: QWidget, stops: list[str], name: str
) -> None:
    widget = form.findChild(QWidget, name)
    widget.setFocus()
    qtbot.keyClick(widget, F12)
    assert stops == ["F12"]


def test_the_key_stops_from_another_window(qtbot: QtBot, form: QWidget, stops: list[str]) -> None:
    other = QLineEdit()
    show(qtbot, other)
    qtbot.keyClick(other, F12)
    assert stops == ["F12"]


def test_the_key_stops_from_a_modal_dialog_and_from_a_menu(
    qtbot: QtBot, form: QWidget, stops: list[str]
) -> None:
    dialog = QDialog(form)
    dialog.setModal(True)
    dialog.show()
    qtbot.keyClick(dialog, F12)
    dialog.close()
    menu = QMenu(form)
    menu.addAction("something")
    menu.popup(form.pos())
    qtbot.keyClick(menu, F12)
    menu.close()
    assert stops == ["F12", "F12"]


def test_the_key_stops_with_a_modifier_held_and_before_a_shortcut(
    qtbot: QtBot, form: QWidget, stops: list[str]
) -> None:
    taken: list[bool] = []
    shortcut = QShortcut(QKeySequence("F12"), form)
    shortcut.activated.connect(lambda: taken.append(True))
    qtbot.keyClick(form, F12)
    qtbot.keyClick(form, F12, Qt.KeyboardModifier.ShiftModifier)
    assert stops == ["F12", "F12"]
    assert taken == []


def test_a_key_held_down_stops_once(qtbot: QtBot, form: QWidget, stops: list[str]) -> None:
    for repeat in (False, True, True):
        press = QKeyEvent(QEvent.Type.KeyPress, F12, Qt.KeyboardModifier.NoModifier, "", repeat)
        QApplication.sendEvent(form, press)
    assert stops == ["F12"]


def test_escape_stops_once_on_its_way_through_the_window(
    qtbot: QtBot, form: QWidget, stops: list[str]
) -> None:
    button = form.findChild(QPushButton, "button")
    button.setFocus()
    qtbot.keyClick(form.windowHandle(), ESCAPE)
    assert stops == ["Esc"]
    qtbot.keyClick(form.windowHandle(), ESCAPE)
    assert stops == ["Esc", "Esc"]


def test_escape_closes_a_dialog_and_does_not_stop(
    qtbot: QtBot, form: QWidget, stops: list[str]
) -> None:
    dialog = QDialog(form)
    with qtbot.waitActive(dialog):
        dialog.show()
        dialog.activateWindow()
    qtbot.waitUntil(lambda: QApplication.activeWindow() is dialog)
    qtbot.keyClick(dialog, ESCAPE)
    assert not dialog.isVisible()
    assert stops == []


def test_escape_closes_a_menu_and_the_list_of_a_combo_box_and_does_not_stop(
    qtbot: QtBot, form: QWidget, stops: list[str]
) -> None:
    menu = QMenu(form)
    menu.addAction("something")
    menu.popup(form.pos())
    qtbot.keyClick(menu, ESCAPE)
    assert not menu.isVisible()
    combo = QComboBox(form)
    combo.addItems(["one", "two"])
    combo.show()
    combo.showPopup()
    qtbot.keyClick(combo.view(), ESCAPE)
    assert not combo.view().isVisible()
    assert stops == []


def test_escape_leaves_the_cell_that_is_open_and_stops_the_next_time(
    qtbot: QtBot, stops: list[str]
) -> None:
    table = QTableWidget(1, 1)
    table.setItem(0, 0, QTableWidgetItem("12"))
    show(qtbot, table)
    table.setFocus()
    table.editItem(table.item(0, 0))
    qtbot.waitUntil(lambda: isinstance(QApplication.focusWidget(), QLineEdit))
    qtbot.keyClick(QApplication.focusWidget(), ESCAPE)
    assert stops == []
    qtbot.waitUntil(lambda: table.state() == QTableWidget.State.NoState)
    qtbot.keyClick(table, ESCAPE)
    assert stops == ["Esc"]


def test_escape_puts_a_tool_away_before_it_stops(
    qtbot: QtBot, form: QWidget, key: StopKeyFilter, stops: list[str]
) -> None:
    tools = ["distance"]
    key.add_cancel(lambda: bool(tools and tools.pop()))
    qtbot.keyClick(form, ESCAPE)
    assert (tools, stops) == ([], [])
    qtbot.keyClick(form, ESCAPE)
    assert stops == ["Esc"]


def test_escape_that_is_held_cancels_one_thing_and_does_not_go_on_to_stop(
    qtbot: QtBot, form: QWidget, stops: list[str]
) -> None:
    dialog = QDialog(form)
    with qtbot.waitActive(dialog):
        dialog.show()
        dialog.activateWindow()
    qtbot.waitUntil(lambda: QApplication.activeWindow() is dialog)
    qtbot.keyPress(dialog, ESCAPE)
    assert not dialog.isVisible()
    for repeat in (True, True):
        press = QKeyEvent(QEvent.Type.KeyPress, ESCAPE, Qt.KeyboardModifier.NoModifier, "", repeat)
        QApplication.sendEvent(form, press)
    assert stops == []


def test_escape_does_not_stop_what_stands(
    qtbot: QtBot, form: QWidget, moves: list[bool], stops: list[str]
) -> None:
    moves.clear()
    qtbot.keyClick(form, ESCAPE)
    assert stops == []
    qtbot.keyClick(form, F12)
    assert stops == ["F12"]


def test_escape_reverts_an_edited_field_and_stops_the_next_time(
    qtbot: QtBot, stops: list[str]
) -> None:
    field = QuantityField("um", value=5.0)
    show(qtbot, field)
    field.setFocus()
    qtbot.keyClicks(field, "123")
    qtbot.keyClick(field.windowHandle(), ESCAPE)
    assert field.text() == "5.0"
    assert stops == []
    qtbot.keyClick(field.windowHandle(), ESCAPE)
    assert stops == ["Esc"]


def test_escape_belongs_to_a_plain_line_once_it_was_typed_into(
    qtbot: QtBot, form: QWidget, stops: list[str]
) -> None:
    line = form.findChild(QLineEdit, "line")
    line.setFocus()
    qtbot.keyClick(line, ESCAPE)
    assert stops == ["Esc"]
    qtbot.keyClicks(line, "abc")
    qtbot.keyClick(line, ESCAPE)
    assert stops == ["Esc"]


@pytest.mark.parametrize("name", ["", "nonsense", "A, B"])
def test_what_is_no_key_is_refused(qapp: QApplication, name: str) -> None:
    with pytest.raises(ValueError, match="is not the name of a key"):
        StopKeyFilter(qapp, name)


def test_the_key_stops_after_a_change_at_one_go_even_one_that_failed(
    qtbot: QtBot, form: QWidget, stops: list[str]
) -> None:
    with at_one_go(form), at_one_go(form):
        form.resize(300, 200)
    qtbot.keyClick(form, F12)
    assert stops == ["F12"]
    with pytest.raises(ZeroDivisionError), at_one_go(form):
        raise ZeroDivisionError
    qtbot.keyClick(form, F12)
    assert stops == ["F12", "F12"]
