import logging
from collections.abc import Iterator

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLabel, QPushButton, QWidget
from pytestqt.qtbot import QtBot

from cosmic.mico.gui.mico_widget import MicoWidget
from gui.mico.panels import click, enter, field, part, position, show, simulated_panel


@pytest.fixture
def slow(qtbot: QtBot) -> Iterator[MicoWidget]:
    """Slow enough to be watched while it moves."""
    with simulated_panel(qtbot, rate=4.0) as panel:
        part(panel, "initialise", QPushButton).setFocus()
        yield panel


def at_rest(panel: MicoWidget, name: str) -> bool:
    return not panel.cards[name].axis.details.in_motion


def hold(qtbot: QtBot, panel: MicoWidget, key: Qt.Key, name: str) -> None:
    """Press `key` and wait until its axis has moved far enough to be sure of it."""
    before = position(panel.cards[name])
    qtbot.keyPress(panel.focusWidget() or panel, key)
    qtbot.waitUntil(lambda: abs(position(panel.cards[name]) - before) > 30.0)


def test_a_held_key_moves_and_its_release_stops(slow: MicoWidget, qtbot: QtBot) -> None:
    hold(qtbot, slow, Qt.Key.Key_D, "left.x")
    qtbot.keyRelease(slow.focusWidget(), Qt.Key.Key_D)
    qtbot.waitUntil(lambda: at_rest(slow, "left.x"))
    assert position(slow.cards["left.x"]) > 0.0
    assert position(slow.cards["left.y"]) == 0.0


def test_the_log_says_which_way_how_fast_and_that_a_key_was_held(
    slow: MicoWidget, qtbot: QtBot, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.INFO, "cosmic.mico"):
        hold(qtbot, slow, Qt.Key.Key_D, "left.x")
        qtbot.keyRelease(slow.focusWidget(), Qt.Key.Key_D)
        qtbot.waitUntil(lambda: at_rest(slow, "left.x"))
    assert "left.x jogs right at 200 um/s, by key" in caplog.messages


def test_the_other_key_of_an_axis_moves_it_back(slow: MicoWidget, qtbot: QtBot) -> None:
    hold(qtbot, slow, Qt.Key.Key_A, "left.x")
    qtbot.keyRelease(slow.focusWidget(), Qt.Key.Key_A)
    qtbot.waitUntil(lambda: at_rest(slow, "left.x"))
    assert position(slow.cards["left.x"]) < 0.0


def test_a_sign_on_the_keyboard_can_jog(slow: MicoWidget, qtbot: QtBot) -> None:
    table = slow.cards["table.rotation"]
    qtbot.keyPress(slow.focusWidget(), Qt.Key.Key_Comma)
    qtbot.waitUntil(lambda: position(table) > 0.3)
    qtbot.keyRelease(slow.focusWidget(), Qt.Key.Key_Comma)
    qtbot.waitUntil(lambda: at_rest(slow, "table.rotation"))


def test_two_axes_jog_at_once(slow: MicoWidget, qtbot: QtBot) -> None:
    hold(qtbot, slow, Qt.Key.Key_D, "left.x")
    hold(qtbot, slow, Qt.Key.Key_R, "left.z")
    assert not at_rest(slow, "left.x")
    slow.release_keys()
    qtbot.waitUntil(lambda: at_rest(slow, "left.x") and at_rest(slow, "left.z"))


def test_a_stop_ends_the_jog_though_the_key_is_held(slow: MicoWidget, qtbot: QtBot) -> None:
    hold(qtbot, slow, Qt.Key.Key_D, "left.x")
    manager = slow.mico.application.manager
    manager.stop("test")
    qtbot.waitUntil(lambda: at_rest(slow, "left.x"))
    manager.reset_stop()
    stood = position(slow.cards["left.x"])
    qtbot.wait(300)
    assert abs(position(slow.cards["left.x"]) - stood) < 1.0


def test_a_window_without_the_focus_jogs_nothing(slow: MicoWidget, qtbot: QtBot) -> None:
    hold(qtbot, slow, Qt.Key.Key_D, "left.x")
    other = QWidget()
    qtbot.addWidget(other)
    show(qtbot, other, 200, 200)
    qtbot.waitUntil(lambda: at_rest(slow, "left.x"))


def test_a_text_field_swallows_the_keys(slow: MicoWidget, qtbot: QtBot) -> None:
    card = slow.cards["left.x"]
    enter(qtbot, field(card, "MiCoCL_8"), "d")
    qtbot.wait(200)
    assert at_rest(slow, "left.x")
    assert position(card) == 0.0


def test_the_focus_in_a_text_field_ends_the_jog(slow: MicoWidget, qtbot: QtBot) -> None:
    hold(qtbot, slow, Qt.Key.Key_D, "left.x")
    field(slow.cards["left.y"], "MiCoCL_8").setFocus()
    qtbot.waitUntil(lambda: at_rest(slow, "left.x"))


def test_a_jog_that_a_text_field_ended_says_so_at_its_axis(
    slow: MicoWidget, qtbot: QtBot, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("INFO")
    line = part(slow.cards["left.x"], "status", QLabel)
    hold(qtbot, slow, Qt.Key.Key_D, "left.x")
    field(slow.cards["left.y"], "MiCoCL_8").setFocus()
    qtbot.waitUntil(lambda: "the jog ended: a text field has the keyboard" in line.text())
    assert "left.x: the jog by the key D ended: a text field" in caplog.text


def test_a_jog_that_another_window_ended_says_so_at_its_axis(
    slow: MicoWidget, qtbot: QtBot
) -> None:
    line = part(slow.cards["left.x"], "status", QLabel)
    hold(qtbot, slow, Qt.Key.Key_D, "left.x")
    other = QWidget()
    qtbot.addWidget(other)
    show(qtbot, other, 200, 200)
    qtbot.waitUntil(lambda: "another window has the keyboard" in line.text())


def test_a_jog_that_came_to_the_limit_says_so_at_its_axis(panel: MicoWidget, qtbot: QtBot) -> None:
    card = panel.cards["left.x"]
    card.axis.move_to(5400.0)
    part(panel, "initialise", QPushButton).setFocus()
    qtbot.keyPress(panel.focusWidget(), Qt.Key.Key_D)
    line = part(card, "status", QLabel)
    qtbot.waitUntil(lambda: "limit of its travel, 5500.0 µm, is reached" in line.text())
    qtbot.keyRelease(panel.focusWidget(), Qt.Key.Key_D)


def test_a_window_that_was_busy_says_that_the_jog_ended(
    slow: MicoWidget, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    hold(qtbot, slow, Qt.Key.Key_D, "left.x")
    monkeypatch.setattr("cosmic.mico.api.jogging.Jogging.renew", lambda _jogging: None)
    line = part(slow.cards["left.x"], "status", QLabel)
    qtbot.waitUntil(lambda: "not renewed in time" in line.text())
    qtbot.keyRelease(slow.focusWidget(), Qt.Key.Key_D)


def test_letting_go_says_nothing(slow: MicoWidget, qtbot: QtBot) -> None:
    hold(qtbot, slow, Qt.Key.Key_D, "left.x")
    qtbot.keyRelease(slow.focusWidget(), Qt.Key.Key_D)
    qtbot.waitUntil(lambda: at_rest(slow, "left.x"))
    assert "jog ended" not in part(slow.cards["left.x"], "status", QLabel).text()


def test_the_dead_man_stops_a_window_that_hangs(slow: MicoWidget, qtbot: QtBot) -> None:
    card = slow.cards["left.x"]
    with qtbot.waitSignal(card.axis.commander.movement_ended, timeout=5000) as ended:
        jogging = card.axis.jog(1, 200.0)  # nobody renews it
    assert jogging.done
    assert ended.args is not None


def test_the_speed_field_says_how_fast(slow: MicoWidget, qtbot: QtBot) -> None:
    enter(qtbot, field(slow, "jogSpeed_um"), "1 mm", accept=True)
    part(slow, "initialise", QPushButton).setFocus()
    device = slow.mico.application.manager.device("left.x")
    with qtbot.waitSignal(device.movement_begun) as begun:
        qtbot.keyPress(slow.focusWidget(), Qt.Key.Key_D)
    qtbot.keyRelease(slow.focusWidget(), Qt.Key.Key_D)
    assert begun.args is not None
    assert begun.args[0].motion.speed == 1000.0
    qtbot.waitUntil(lambda: at_rest(slow, "left.x"))


def test_a_refused_jog_says_why(slow: MicoWidget, qtbot: QtBot) -> None:
    slow.mico.application.manager.stop("test")
    qtbot.keyPress(slow.focusWidget(), Qt.Key.Key_D)
    line = part(slow.cards["left.x"], "status", QLabel)
    qtbot.waitUntil(lambda: "REFUSED" in line.text())
    qtbot.keyRelease(slow.focusWidget(), Qt.Key.Key_D)
    assert position(slow.cards["left.x"]) == 0.0


def test_a_click_is_one_move_and_no_jog(slow: MicoWidget, qtbot: QtBot) -> None:
    card = slow.cards["left.x"]
    click(qtbot, card, "MiCoCL_6")
    qtbot.waitUntil(lambda: abs(position(card) - 100.0) < 1.0 and at_rest(slow, "left.x"))


def test_while_something_else_moves_the_axes_no_key_and_no_button_moves_one(
    slow: MicoWidget, qtbot: QtBot
) -> None:
    hold(qtbot, slow, Qt.Key.Key_D, "left.x")
    card = slow.cards["left.x"]
    slow.refuse_while(lambda: "a campaign moves the axes")
    line = part(card, "status", QLabel)
    qtbot.waitUntil(lambda: "the jog ended: a campaign moves the axes" in line.text())
    qtbot.waitUntil(lambda: at_rest(slow, "left.x"))
    there = position(card)
    qtbot.keyRelease(slow.focusWidget(), Qt.Key.Key_D)
    refusals: list[str] = []
    card.commands.refused.connect(lambda _field, why: refusals.append(why))
    qtbot.keyPress(slow.focusWidget(), Qt.Key.Key_A)
    qtbot.keyRelease(slow.focusWidget(), Qt.Key.Key_A)
    click(qtbot, card, "MiCoCL_6")
    assert refusals == ["a campaign moves the axes"] * 2
    assert at_rest(slow, "left.x")
    assert position(card) == there
    slow.refuse_while(str)
    part(slow, "initialise", QPushButton).setFocus()  # the field that was refused has it
    hold(qtbot, slow, Qt.Key.Key_W, "left.y")
    qtbot.keyRelease(slow.focusWidget(), Qt.Key.Key_W)
    qtbot.waitUntil(lambda: at_rest(slow, "left.y"))
