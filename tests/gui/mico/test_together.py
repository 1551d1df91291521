"""Links, Undo and the steps of the initialisation, as the operator meets them."""

import re
from collections.abc import Iterator

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QCheckBox, QComboBox, QLabel, QLineEdit, QListWidget, QPushButton
from pytestqt.qtbot import QtBot

from cosmic.frame.clock import WALL
from cosmic.mico.gui.initialisation_panel import InitialisationPanel
from cosmic.mico.gui.link_switch import LinkForm
from cosmic.mico.gui.mico_widget import MicoWidget
from gui.mico.panels import (
    click,
    field,
    initialise,
    part,
    position,
    show,
    simulated_panel,
    wait_for_position,
)
from unit.mico.rigs import mico

STEPS = (
    {"do": "confirm", "text": "Is the table empty?"},
    {"do": "reference", "axes": ("d0.c1",)},
    {"do": "move", "axes": ("d0.c0",), "targets_um": {"d0.c0": 7.0}},
)


# Links


def test_two_axes_are_linked_and_parted_with_the_switch(panel: MicoWidget, qtbot: QtBot) -> None:
    left, right = panel.cards["left.x"], panel.cards["right.x"]
    click(qtbot, left, "MiCoCL_12")
    form = part(panel.window(), "linkForm", LinkForm)
    other = part(form, "linkOther", QComboBox)
    assert "left.gripper" not in [other.itemText(n) for n in range(other.count())]
    other.setCurrentText("right.x")
    part(form, "linkRatio", QLineEdit).setText("-0.5")
    click(qtbot, form, "linkAgree")
    for card in (left, right):
        assert part(card, "MiCoCL_12", QPushButton).text() == "Link on"
        assert part(card, "MiCoCL_3", QLabel).text() == "●"
    click(qtbot, left, "MiCoCL_6")
    wait_for_position(qtbot, left, 100.0)
    wait_for_position(qtbot, right, -50.0)
    qtbot.waitUntil(lambda: "2 axes started within" in part(panel, "message", QLabel).text())
    click(qtbot, right, "MiCoCL_12")
    assert part(left, "MiCoCL_12", QPushButton).text() == "Link off"
    assert not panel.mico.links


def test_a_ratio_that_makes_no_sense_says_why(panel: MicoWidget, qtbot: QtBot) -> None:
    card = panel.cards["left.y"]
    click(qtbot, card, "MiCoCL_12")
    form = part(panel.window(), "linkForm", LinkForm)
    part(form, "linkRatio", QLineEdit).setText("twice")
    click(qtbot, form, "linkAgree")
    assert "'twice' is not a number" in part(form, "linkWhy", QLabel).text()
    part(form, "linkRatio", QLineEdit).setText("0")
    click(qtbot, form, "linkAgree")
    assert "ratio" in part(card, "status", QLabel).text()
    assert not panel.mico.links


# Undo


def test_undo_takes_the_last_movement_back(panel: MicoWidget, qtbot: QtBot) -> None:
    card, button = panel.cards["left.x"], part(panel, "undo", QPushButton)
    assert not button.isEnabled()
    assert "no movement" in button.toolTip()
    click(qtbot, card, "MiCoCL_6")
    wait_for_position(qtbot, card, 100.0)
    qtbot.waitUntil(button.isEnabled)
    assert "left.x" in button.toolTip()
    panel.setFocus()
    qtbot.keyClick(panel, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    wait_for_position(qtbot, card, 0.0)
    qtbot.waitUntil(lambda: not button.isEnabled())


def test_a_field_that_is_edited_keeps_ctrl_z(panel: MicoWidget, qtbot: QtBot) -> None:
    card = panel.cards["left.x"]
    click(qtbot, card, "MiCoCL_6")
    wait_for_position(qtbot, card, 100.0)
    entry = field(card, "MiCoCL_8")
    entry.setFocus()
    qtbot.keyClicks(entry, "5")
    qtbot.keyClick(entry, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    qtbot.wait(50)
    assert not card.axis.details.in_motion
    assert abs(position(card) - 100.0) < 1.0


def test_an_undo_that_is_refused_says_why_and_can_be_tried_again(
    panel: MicoWidget, qtbot: QtBot
) -> None:
    card = panel.cards["left.x"]
    click(qtbot, card, "MiCoCL_6")
    wait_for_position(qtbot, card, 100.0)
    manager = panel.mico.application.manager
    manager.stop("test")
    qtbot.waitUntil(part(panel, "undo", QPushButton).isEnabled)
    click(qtbot, panel, "undo")
    assert "reset the stop first" in part(panel, "message", QLabel).text()
    manager.reset_stop()
    click(qtbot, panel, "undo")
    wait_for_position(qtbot, card, 0.0)


# Initialisation


@pytest.fixture
def asking(qtbot: QtBot) -> Iterator[tuple[MicoWidget, InitialisationPanel]]:
    sequence = {"step": STEPS}
    with mico(("LLN",), initialisation=sequence) as (api, _):
        panel = MicoWidget(api)
        qtbot.addWidget(panel)
        show(qtbot, panel)
        yield panel, part(panel, "initialisationPanel", InitialisationPanel)
        panel.close()


def listed(steps: InitialisationPanel) -> list[str]:
    found = part(steps, "initialisationSteps", QListWidget)
    return [found.item(row).text() for row in range(found.count())]


def test_the_steps_are_listed_before_they_are_made(
    asking: tuple[MicoWidget, InitialisationPanel], qtbot: QtBot
) -> None:
    panel, steps = asking
    assert not steps.isVisible()
    click(qtbot, panel, "showSteps")
    assert steps.isVisible()
    assert listed(steps) == [
        "○ 1. asking: Is the table empty?",
        "○ 2. referencing d0.c1",
        "○ 3. moving d0.c0",
    ]
    part(steps, "skipKnown", QCheckBox).setChecked(True)
    assert listed(steps)[1] == "– 2. referencing d0.c1: d0.c1 is known already"


def test_a_step_that_asks_is_answered_in_the_panel(
    asking: tuple[MicoWidget, InitialisationPanel], qtbot: QtBot
) -> None:
    panel, steps = asking
    initialise(qtbot, panel)
    qtbot.waitUntil(part(steps, "confirmYes", QPushButton).isVisible)
    assert part(steps, "confirmText", QLabel).text() == "Is the table empty?"
    assert listed(steps)[0].startswith("▶")
    click(qtbot, steps, "confirmYes")
    qtbot.waitUntil(lambda: all(line.startswith("✓") for line in listed(steps)))
    assert not part(steps, "confirmYes", QPushButton).isVisible()
    qtbot.waitUntil(lambda: "finished" in part(panel, "message", QLabel).text())


def test_a_no_ends_the_sequence_there(
    asking: tuple[MicoWidget, InitialisationPanel], qtbot: QtBot
) -> None:
    panel, steps = asking
    initialise(qtbot, panel)
    qtbot.waitUntil(part(steps, "confirmNo", QPushButton).isVisible)
    click(qtbot, steps, "confirmNo")
    qtbot.waitUntil(lambda: "answered with no" in part(panel, "message", QLabel).text())
    assert [line[0] for line in listed(steps)] == ["■", "○", "○"]


def test_a_stop_ends_the_question_as_well(
    asking: tuple[MicoWidget, InitialisationPanel], qtbot: QtBot
) -> None:
    panel, steps = asking
    initialise(qtbot, panel)
    qtbot.waitUntil(part(steps, "confirmNo", QPushButton).isVisible)
    panel.mico.application.manager.stop("test")
    qtbot.waitUntil(lambda: not part(steps, "confirmNo", QPushButton).isVisible())
    qtbot.waitUntil(lambda: listed(steps)[0].startswith("■"))


PLANNED = re.compile(r"left\.x from (99\.\d|100\.\d) µm to -?0\.0 µm")


def test_undo_says_where_it_goes_and_goes_slowly(qtbot: QtBot) -> None:
    with simulated_panel(qtbot, rate=1.0) as panel:
        card = panel.cards["left.x"]
        click(qtbot, card, "MiCoCL_6")
        wait_for_position(qtbot, card, 100.0)
        button = part(panel, "undo", QPushButton)
        qtbot.waitUntil(lambda: PLANNED.search(button.toolTip()) is not None)
        plans: list[object] = []
        panel.undo_planned.connect(plans.append)
        click(qtbot, panel, "undo")
        now, then = plans[0]  # type: ignore[misc]
        assert (round(now["left.x"]), then["left.x"]) == (100, 0.0)
        began_s = WALL.now_s()
        qtbot.waitUntil(lambda: card.axis.details.in_motion)
        wait_for_position(qtbot, card, 0.0)
        assert WALL.now_s() - began_s > 0.3  # 100 um at 200 um/s; 13 ms at travel speed
        qtbot.waitUntil(lambda: plans[-1] is None)


def test_undo_asks_where_a_force_was_felt_and_no_is_the_answer_of_enter(
    panel: MicoWidget, qtbot: QtBot
) -> None:
    card = panel.cards["left.x"]
    panel.mico.application.cautions.add(lambda: "force feels 40.0 uN")
    click(qtbot, card, "MiCoCL_6")
    wait_for_position(qtbot, card, 100.0)
    qtbot.waitUntil(part(panel, "undo", QPushButton).isEnabled)
    click(qtbot, panel, "undo")
    question = panel.undoing.question
    assert question is not None
    assert PLANNED.search(question.text())
    assert "force feels 40.0 uN" in question.informativeText()
    qtbot.keyClick(question, Qt.Key.Key_Return)
    assert panel.undoing.question is None
    assert abs(position(card) - 100.0) < 1.0
    click(qtbot, panel, "undo")
    question = panel.undoing.question
    assert question is not None
    question.go.click()
    wait_for_position(qtbot, card, 0.0)


def test_a_gripper_that_was_closed_and_not_opened_again_makes_undo_ask(
    panel: MicoWidget, qtbot: QtBot
) -> None:
    card, gripper = panel.cards["left.x"], panel.cards["left.gripper"]
    opened = position(gripper)
    click(qtbot, gripper, "MiCoOL_4")
    qtbot.waitUntil(lambda: position(gripper) < opened - 20.0 and at_rest(panel, "left.gripper"))
    click(qtbot, card, "MiCoCL_6")
    wait_for_position(qtbot, card, 100.0)
    reasons = panel.mico.application.cautions.reasons()
    assert any("left.gripper was closed by" in each for each in reasons)
    click(qtbot, gripper, "MiCoOL_3")
    qtbot.waitUntil(lambda: not panel.mico.application.cautions.reasons())


def test_initialise_asks_where_a_gripper_may_hold_something(
    panel: MicoWidget, qtbot: QtBot
) -> None:
    before = position(panel.cards["left.x"])
    click(qtbot, panel, "initialise")
    caution = panel.caution
    assert caution is not None
    assert "left.gripper is taken to be 30.0 µm open" in caution.informativeText()
    qtbot.keyClick(caution, Qt.Key.Key_Escape)
    qtbot.waitUntil(lambda: panel.caution is None)
    assert panel.mico.application.running_task is None
    assert position(panel.cards["left.x"]) == before
    initialise(qtbot, panel)
    task = panel.mico.application.running_task
    assert task is not None
    task.cancel()


def test_undo_and_initialise_ask_while_something_else_moves_the_axes(
    panel: MicoWidget, qtbot: QtBot
) -> None:
    card, running = panel.cards["left.x"], ["Push to 50 µN is running"]
    panel.ask_while(lambda: running[0])
    click(qtbot, card, "MiCoCL_6")
    wait_for_position(qtbot, card, 100.0)
    qtbot.waitUntil(part(panel, "undo", QPushButton).isEnabled)
    click(qtbot, panel, "undo")
    question = panel.undoing.question
    assert question is not None
    assert "Push to 50 µN is running" in question.informativeText()
    qtbot.keyClick(question, Qt.Key.Key_Escape)
    click(qtbot, panel, "initialise")
    caution = panel.caution
    assert caution is not None
    assert "Push to 50 µN is running" in caution.informativeText()
    qtbot.keyClick(caution, Qt.Key.Key_Escape)
    running[0] = ""
    click(qtbot, panel, "undo")
    assert panel.undoing.question is None
    wait_for_position(qtbot, card, 0.0)


def at_rest(panel: MicoWidget, name: str) -> bool:
    return not panel.cards[name].axis.details.in_motion
