from dataclasses import replace

import pytest
from PySide6.QtWidgets import QAbstractButton, QLabel, QWidget
from pytestqt.qtbot import QtBot

from cosmic.frame.gui.quantity_field import QuantityField
from cosmic.frame.gui.state_badge import StateBadge
from cosmic.frame.gui.theme import State
from cosmic.mico.core.motion.positioner import Confidence
from cosmic.mico.core.motion.settings import MotionDefaults
from cosmic.mico.gui.axis_table import AxisRow
from cosmic.mico.gui.card import ConfidenceMark
from cosmic.mico.gui.closed_loop_gui import ClosedLoopGUI
from cosmic.mico.gui.mico_widget import MicoWidget
from cosmic.mico.gui.positioner_gui import PositionerBaseGUI
from gui.mico.panels import (
    choose,
    click,
    enter,
    field,
    part,
    position,
    simulated_panel,
    wait_for_position,
)


def test_every_positioner_has_the_card_of_its_kind(still_panel: MicoWidget) -> None:
    kinds = {name: type(card) for name, card in still_panel.cards.items()}
    assert len(kinds) == 11
    assert kinds["left.x"] is ClosedLoopGUI
    assert kinds["table.rotation"] is ClosedLoopGUI
    assert kinds["left.gripper"] is PositionerBaseGUI


def test_cards_have_every_field_of_the_thesis(still_panel: MicoWidget) -> None:
    for number in range(1, 8):
        part(still_panel.cards["left.gripper"], f"MiCoOL_{number}", QWidget)
    for number in range(1, 14):
        part(still_panel.cards["left.x"], f"MiCoCL_{number}", QWidget)


def test_groups_are_those_of_the_configuration(still_panel: MicoWidget) -> None:
    groups = {group.title: list(group.cards) for group in still_panel.groups}
    assert groups["Left assembly"] == ["left.x", "left.y", "left.z", "left.gripper"]
    assert list(groups) == ["Left assembly", "Right assembly", "Probe and table"]


def test_buttons_show_their_text_and_key(still_panel: MicoWidget) -> None:
    gripper, table = still_panel.cards["left.gripper"], still_panel.cards["table.rotation"]
    assert part(gripper, "MiCoOL_3", QAbstractButton).text() == "open [Q]"
    assert part(gripper, "MiCoOL_4", QAbstractButton).text() == "close [E]"
    assert part(table, "MiCoCL_6", QAbstractButton).text() == "turn left [,]"


def test_forward_and_backward_move_by_the_distance(panel: MicoWidget, qtbot: QtBot) -> None:
    card = panel.cards["left.x"]
    click(qtbot, card, "MiCoCL_6")
    wait_for_position(qtbot, card, 100.0)
    enter(qtbot, field(card, "MiCoCL_8"), "0.3 mm")
    click(qtbot, card, "MiCoCL_7")
    wait_for_position(qtbot, card, -200.0)


def test_go_to_moves_to_the_position_in_the_field(panel: MicoWidget, qtbot: QtBot) -> None:
    card = panel.cards["right.y"]
    enter(qtbot, field(card, "target"), "0.2 mm")
    click(qtbot, card, "MiCoCL_9")
    wait_for_position(qtbot, card, 200.0)
    figures = part(card, "MiCoCL_5", QLabel)
    qtbot.waitUntil(lambda: abs(float(figures.text()) - 200.0) < 1.0)


def test_a_button_keeps_its_direction_whatever_was_typed_for_go_to(
    panel: MicoWidget, qtbot: QtBot
) -> None:
    card = panel.cards["left.x"]
    enter(qtbot, field(card, "target"), "-300", accept=True)
    click(qtbot, card, "MiCoCL_9")
    wait_for_position(qtbot, card, -300.0)
    click(qtbot, card, "MiCoCL_6")
    wait_for_position(qtbot, card, -200.0)
    click(qtbot, card, "MiCoCL_7")
    wait_for_position(qtbot, card, -300.0)
    assert field(card, "MiCoCL_8").value() == 100.0


@pytest.mark.parametrize("text", ["-50", "0", "-0.1 mm"])
def test_a_step_size_has_no_sign_and_says_so(
    still_panel: MicoWidget, qtbot: QtBot, text: str
) -> None:
    card = still_panel.cards["left.x"]
    entry = field(card, "MiCoCL_8")
    enter(qtbot, entry, text)
    for name in ("MiCoCL_6", "MiCoCL_7"):
        click(qtbot, card, name)
        assert "the button gives the direction" in entry.reason
    assert not card.axis.details.in_motion
    assert position(card) == 0.0


def test_the_target_begins_where_the_axis_stands(panel: MicoWidget, qtbot: QtBot) -> None:
    card = panel.cards["left.z"]
    entry = field(card, "target")
    qtbot.waitUntil(lambda: entry.value() == pytest.approx(position(card), abs=0.5))
    click(qtbot, card, "MiCoCL_9")
    assert not entry.reason


def test_a_rotary_axis_moves_in_degrees(panel: MicoWidget, qtbot: QtBot) -> None:
    card = panel.cards["table.rotation"]
    enter(qtbot, field(card, "target"), "2.5")
    click(qtbot, card, "MiCoCL_9")
    wait_for_position(qtbot, card, 2.5, within=0.01)


def test_a_gripper_makes_the_steps_in_its_fields(panel: MicoWidget, qtbot: QtBot) -> None:
    card = panel.cards["left.gripper"]
    before = position(card)
    enter(qtbot, field(card, "MiCoOL_5"), "50")
    click(qtbot, card, "MiCoOL_3")
    qtbot.waitUntil(lambda: position(card) > before + 25.0)
    click(qtbot, card, "MiCoOL_4")
    wait_for_position(qtbot, card, before, within=5.0)


def test_an_axis_with_sensor_can_make_steps_too(panel: MicoWidget, qtbot: QtBot) -> None:
    card = panel.cards["left.y"]
    more = part(card, "more", QWidget)
    assert not more.isVisible()
    choose(card, "Show steps")
    assert more.isVisible()
    enter(qtbot, field(card, "MiCoOL_5"), "100")
    click(qtbot, card, "MiCoOL_3")
    qtbot.waitUntil(lambda: position(card) > 50.0)


def test_a_target_outside_the_travel_is_refused_at_its_field(
    still_panel: MicoWidget, qtbot: QtBot
) -> None:
    card = still_panel.cards["left.x"]
    entry = field(card, "target")
    enter(qtbot, entry, "9 mm")
    click(qtbot, card, "MiCoCL_9")
    qtbot.waitUntil(lambda: "5500.0 µm" in entry.reason)
    assert entry.text() == "9000.0"
    assert "REFUSED" in part(card, "status", QLabel).text()
    assert position(card) == 0.0
    assert not card.axis.details.in_motion


@pytest.mark.parametrize("text", ["nan", "inf", "-inf", "abc", "", "5 deg", "3 V", "1,5", "1e999"])
def test_what_is_no_length_is_refused_and_moves_nothing(
    still_panel: MicoWidget, qtbot: QtBot, text: str
) -> None:
    card = still_panel.cards["left.x"]
    for entry, name in (
        (field(card, "MiCoCL_8"), "MiCoCL_6"),
        (field(card, "MiCoCL_8"), "MiCoCL_7"),
        (field(card, "target"), "MiCoCL_9"),
    ):
        entry.setFocus()
        entry.selectAll()
        qtbot.keyClick(entry, "\b")
        qtbot.keyClicks(entry, text)
        click(qtbot, card, name)
        assert entry.reason
        assert entry.text() == text
    assert not card.axis.details.in_motion
    assert position(card) == 0.0


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("MiCoOL_5", "30000"),
        ("MiCoOL_5", "1.5"),
        ("MiCoOL_6", "0"),
        ("MiCoOL_6", "18501"),
        ("MiCoOL_7", "14.9"),
        ("MiCoOL_7", "101"),
    ],
)
def test_steps_outside_their_range_are_refused(
    still_panel: MicoWidget, qtbot: QtBot, name: str, text: str
) -> None:
    card = still_panel.cards["right.gripper"]
    before = position(card)
    enter(qtbot, field(card, name), text)
    click(qtbot, card, "MiCoOL_3")
    assert field(card, name).reason
    assert position(card) == before


def test_the_next_good_command_takes_the_refusal_away(panel: MicoWidget, qtbot: QtBot) -> None:
    card = panel.cards["left.x"]
    entry = field(card, "target")
    enter(qtbot, entry, "9 mm")
    click(qtbot, card, "MiCoCL_9")
    qtbot.waitUntil(lambda: bool(entry.reason))
    enter(qtbot, entry, "10")
    click(qtbot, card, "MiCoCL_9")
    assert not entry.reason
    wait_for_position(qtbot, card, 10.0)
    qtbot.waitUntil(lambda: part(card, "status", QLabel).text() == "±5500 µm travel")


def test_a_refusal_is_shown_until_the_axis_moves_by_anything(
    panel: MicoWidget, qtbot: QtBot
) -> None:
    card = panel.cards["left.x"]
    entry = field(card, "target")
    enter(qtbot, entry, "9 mm")
    click(qtbot, card, "MiCoCL_9")
    qtbot.waitUntil(lambda: bool(entry.reason))
    panel.mico["left.x"].move_to(500.0, wait=False)
    qtbot.waitUntil(lambda: part(card, "status", QLabel).text() == "±5500 µm travel")
    assert not entry.reason
    assert entry.text() == "9000.0"


def test_a_state_from_before_a_refusal_does_not_end_it(panel: MicoWidget, qtbot: QtBot) -> None:
    """On a busy computer the card is shown late that the axis moved."""
    card = panel.cards["left.x"]
    entry = field(card, "target")
    before = card.axis.details
    panel.mico["left.x"].move_to(50.0)
    enter(qtbot, entry, "9 mm")
    click(qtbot, card, "MiCoCL_9")
    qtbot.waitUntil(lambda: bool(entry.reason))
    card.show_state(replace(before, in_motion=True))
    card.show_state(before)
    card.show_state(card.axis.details)
    assert entry.reason
    panel.mico["left.x"].move_to(500.0, wait=False)
    qtbot.waitUntil(lambda: not entry.reason)


def test_a_refusal_by_the_stop_ends_with_the_reset(panel: MicoWidget, qtbot: QtBot) -> None:
    card = panel.cards["left.x"]
    entry = field(card, "target")
    panel.mico.stop("the test")
    panel.show_stopped("the test")
    enter(qtbot, entry, "10")
    click(qtbot, card, "MiCoCL_9")
    qtbot.waitUntil(lambda: "reset the stop" in entry.reason)
    panel.show_stopped(None)
    assert not entry.reason


def test_figures_that_say_no_position_are_grey(panel: MicoWidget, qtbot: QtBot) -> None:
    card = panel.cards["left.x"]
    row = AxisRow(card, MotionDefaults(), panel)
    for cell in row.cells:
        qtbot.addWidget(cell)
    figures = part(row.position, "rowPosition", QLabel), part(card, card.position_name, QLabel)
    state = card.axis.details
    for confidence, usable in ((Confidence.UNKNOWN, False), (Confidence.ESTIMATED, True)):
        row.show_state(replace(state, confidence=confidence))
        card.show_state(replace(state, confidence=confidence))
        assert [each.isEnabled() for each in figures] == [usable, usable]
    card.show_state(state)


def test_no_badge_says_ok_while_everything_is_stopped(panel: MicoWidget, qtbot: QtBot) -> None:
    card = panel.cards["left.x"]
    row = AxisRow(card, MotionDefaults(), panel)
    for cell in row.cells:
        qtbot.addWidget(cell)
    row.show_state(card.axis.details)
    badges = (part(card, "MiCoCL_1", StateBadge), row.badge)
    assert [each.word for each in badges] == ["OK", "OK"]
    panel.show_stopped("the test")
    assert [each.word for each in badges] == ["STOPPED", "STOPPED"]
    panel.show_stopped(None)
    assert [each.word for each in badges] == ["OK", "OK"]


def test_the_badge_says_busy_while_it_moves_and_stop_ends_only_that_axis(qtbot: QtBot) -> None:
    with simulated_panel(qtbot, rate=2.0) as panel:
        moving, other = panel.cards["left.x"], panel.cards["right.x"]
        for card in (moving, other):
            enter(qtbot, field(card, "target"), "5 mm")
            click(qtbot, card, "MiCoCL_9")
        badge = part(moving, "MiCoCL_1", StateBadge)
        qtbot.waitUntil(lambda: badge.state is State.BUSY)
        click(qtbot, moving, "stopAxis")
        qtbot.waitUntil(lambda: badge.state is State.OK)
        assert position(moving) < 4900.0
        assert part(other, "MiCoCL_1", StateBadge).state is State.BUSY


def test_zero_is_set_shown_and_cleared(panel: MicoWidget, qtbot: QtBot) -> None:
    card = panel.cards["left.x"]
    click(qtbot, card, "MiCoCL_6")
    wait_for_position(qtbot, card, 100.0)
    choose(card, "Set zero")
    figures, line = part(card, "MiCoCL_5", QLabel), part(card, "status", QLabel)
    qtbot.waitUntil(lambda: abs(float(figures.text())) < 0.5)
    qtbot.waitUntil(lambda: "-5600" in line.text() or "-5599" in line.text())
    choose(card, "Clear zero")
    qtbot.waitUntil(lambda: float(figures.text()) > 99.0)


def test_the_menu_references_calibrates_and_finds_end_stops(
    panel: MicoWidget, qtbot: QtBot
) -> None:
    card = panel.cards["left.x"]
    for entry in ("Calibrate", "To the end stop: right", "Find reference"):
        with qtbot.waitSignal(card.axis.commander.movement_ended, timeout=8000):
            choose(card, entry)
        assert not card.axis.error
        if entry.startswith("To"):
            assert position(card) > 5900.0
    assert card.axis.confidence == "known"


def test_the_speed_of_moves_is_set_from_the_card(
    panel: MicoWidget, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    set_hz: list[int] = []
    device = panel.mico.application.manager.device("left.x")
    monkeypatch.setattr(device, "set_frequency", lambda _channel, hertz: set_hz.append(hertz))
    card = panel.cards["left.x"]
    choose(card, "Show steps")
    entry = field(card, "speed")
    enter(qtbot, entry, "20000", accept=True)
    assert "18500" in entry.reason
    assert not set_hz
    enter(qtbot, entry, "900", accept=True)
    assert set_hz == [900]


def test_confidence_is_said_by_word_and_shape(still_panel: MicoWidget) -> None:
    assert part(still_panel.cards["left.x"], "chip", ConfidenceMark).text() == "✓ known"
    assert part(still_panel.cards["left.gripper"], "chip", ConfidenceMark).text() == "≈ estimated"


def test_everything_that_can_be_used_has_a_tooltip(still_panel: MicoWidget) -> None:
    kinds = (QAbstractButton, QuantityField, StateBadge)
    silent = [
        f"{widget.parent().objectName()}/{widget.objectName()}"
        for kind in kinds
        for widget in still_panel.findChildren(kind)
        if not widget.toolTip() and not widget.objectName().startswith("qt_")
    ]
    assert not silent
