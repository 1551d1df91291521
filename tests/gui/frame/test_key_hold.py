from collections.abc import Iterator

import pytest
from PySide6.QtCore import QEvent, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QApplication, QMenu, QWidget
from pytestqt.qtbot import QtBot

from cosmic.frame.gui.application_events import ApplicationEvents
from cosmic.frame.gui.key_hold import GRACE_MS, HoldKeys

LEFT, UP = Qt.Key.Key_Left, Qt.Key.Key_Up
NONE, SHIFT = Qt.KeyboardModifier.NoModifier, Qt.KeyboardModifier.ShiftModifier


@pytest.fixture
def keys(qapp: QApplication) -> Iterator[HoldKeys]:
    keys = HoldKeys(qapp, ["Left", "Up", "Shift+A"])
    yield keys
    ApplicationEvents.of(qapp).remove(keys)
    keys.deleteLater()


@pytest.fixture
def received(keys: HoldKeys) -> list[str]:
    """What was told, in order: +key and -key."""
    received: list[str] = []
    keys.hold_started.connect(lambda key: received.append(f"+{key}"))
    keys.hold_ended.connect(lambda key: received.append(f"-{key}"))
    return received


@pytest.fixture
def button(form: QWidget) -> QWidget:
    button: QWidget = form.findChild(QWidget, "button")
    button.setFocus()
    return button


def send(
    widget: QWidget, kind: str, key: Qt.Key, *, repeat: bool = False, modifiers: object = NONE
) -> None:
    event = QEvent.Type.KeyPress if kind == "press" else QEvent.Type.KeyRelease
    QApplication.sendEvent(widget, QKeyEvent(event, key, modifiers, "", repeat))  # type: ignore[arg-type]


def test_a_key_starts_when_pressed_and_ends_when_released(
    qtbot: QtBot, button: QWidget, received: list[str]
) -> None:
    send(button, "press", LEFT)
    assert received == ["+Left"]
    send(button, "release", LEFT)
    qtbot.waitUntil(lambda: received == ["+Left", "-Left"], timeout=100)


def test_repeats_that_are_not_marked_as_such_neither_start_nor_end(
    qtbot: QtBot, button: QWidget, keys: HoldKeys, received: list[str]
) -> None:
    send(button, "press", LEFT)
    for _ in range(5):  # as Qt hands it on when the pair arrives in two reads
        send(button, "release", LEFT)
        send(button, "press", LEFT)
        qtbot.wait(40)
    assert received == ["+Left"]
    keys.release_all()
    send(button, "release", LEFT)
    send(button, "press", LEFT)
    assert received == ["+Left", "-Left"]


def test_auto_repeat_neither_starts_nor_ends(
    qtbot: QtBot, button: QWidget, received: list[str]
) -> None:
    send(button, "press", LEFT)
    for _ in range(5):  # as X11 sends it: a release before each press
        send(button, "release", LEFT, repeat=True)
        send(button, "press", LEFT, repeat=True)
    assert received == ["+Left"]
    send(button, "release", LEFT)
    qtbot.waitUntil(lambda: received == ["+Left", "-Left"])


def test_a_repeat_without_a_press_starts_nothing(button: QWidget, received: list[str]) -> None:
    send(button, "press", LEFT, repeat=True)
    assert received == []


def test_two_keys_are_held_at_once(
    qtbot: QtBot, button: QWidget, keys: HoldKeys, received: list[str]
) -> None:
    send(button, "press", LEFT)
    send(button, "press", UP)
    send(button, "release", LEFT)
    qtbot.waitUntil(lambda: received == ["+Left", "+Up", "-Left"])
    assert keys.held == ("Up",)


def test_a_modifier_makes_another_key(button: QWidget, received: list[str]) -> None:
    send(button, "press", Qt.Key.Key_A)
    send(button, "press", LEFT, modifiers=SHIFT)
    assert received == []
    button.setFocus()  # an arrow key had moved it
    send(button, "press", Qt.Key.Key_A, modifiers=SHIFT)
    assert received == ["+Shift+A"]


def test_a_modifier_pressed_meanwhile_does_not_keep_a_key_held(
    qtbot: QtBot, button: QWidget, received: list[str]
) -> None:
    send(button, "press", LEFT)
    send(button, "release", LEFT, modifiers=SHIFT)
    qtbot.waitUntil(lambda: received == ["+Left", "-Left"])


def test_a_text_field_with_the_focus_swallows_the_keys(
    qtbot: QtBot, form: QWidget, received: list[str]
) -> None:
    line = form.findChild(QWidget, "line")
    line.setFocus()
    qtbot.keyClick(line, LEFT)
    assert received == []


def test_moving_the_focus_into_a_text_field_ends_the_hold(
    button: QWidget, form: QWidget, received: list[str]
) -> None:
    send(button, "press", LEFT)
    form.findChild(QWidget, "line").setFocus()
    assert received == ["+Left", "-Left"]


def test_leaving_the_window_ends_the_hold(
    qtbot: QtBot, button: QWidget, received: list[str]
) -> None:
    send(button, "press", LEFT)
    other = QWidget()
    qtbot.addWidget(other)
    with qtbot.waitActive(other):
        other.show()
        other.activateWindow()
    assert received == ["+Left", "-Left"]


def test_a_key_that_was_ended_acts_again_only_when_pressed_anew(
    qtbot: QtBot, button: QWidget, keys: HoldKeys, received: list[str]
) -> None:
    send(button, "press", LEFT)
    keys.release_all()
    send(button, "press", LEFT, repeat=True)
    send(button, "release", LEFT)
    assert received == ["+Left", "-Left"]
    qtbot.wait(2 * GRACE_MS)
    send(button, "press", LEFT)
    assert received == ["+Left", "-Left", "+Left"]


def test_a_mouse_grab_ends_the_hold(
    qtbot: QtBot, button: QWidget, form: QWidget, received: list[str]
) -> None:
    send(button, "press", LEFT)
    form.grabMouse()
    try:
        qtbot.waitUntil(lambda: received == ["+Left", "-Left"])
        send(button, "press", UP)
        assert received == ["+Left", "-Left"]
    finally:
        form.releaseMouse()


def test_an_open_menu_ends_the_hold(
    qtbot: QtBot, button: QWidget, form: QWidget, received: list[str]
) -> None:
    send(button, "press", LEFT)
    menu = QMenu(form)
    menu.addAction("something")
    menu.popup(form.pos())
    qtbot.waitUntil(lambda: received == ["+Left", "-Left"])
    menu.close()


def test_switched_off_keys_do_nothing(button: QWidget, keys: HoldKeys, received: list[str]) -> None:
    send(button, "press", LEFT)
    keys.set_enabled(False)
    send(button, "press", UP)
    assert received == ["+Left", "-Left"]


def test_what_is_no_key_is_refused(keys: HoldKeys) -> None:
    with pytest.raises(ValueError, match="is not the name of a key"):
        keys.set_keys(["Left", "nonsense"])
