from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLabel, QProgressBar, QPushButton, QWidget
from pytestqt.qtbot import QtBot

from cosmic.frame.errors import DeviceError, DeviceFault
from cosmic.frame.gui.state_badge import StateBadge
from cosmic.frame.gui.theme import State
from cosmic.mico.core.motion.positioner import PositionerState
from cosmic.mico.gui import registry
from cosmic.mico.gui.card import ConfidenceMark
from cosmic.mico.gui.closed_loop_gui import ClosedLoopGUI
from cosmic.mico.gui.consent_dialogs import ConsentDialog
from cosmic.mico.gui.mico_widget import MicoWidget
from cosmic.mico.hw.interface import Channel, PositionerKind, PositionRead
from gui.mico.panels import (
    choose,
    click,
    enter,
    field,
    initialise,
    part,
    position,
    show,
    simulated_panel,
    wait_for_position,
)
from unit.mico.rigs import mico
from unit.mico.scripted_controller import ScriptedController


@contextmanager
def scripted_panel(
    qtbot: QtBot, *args: Any, **kwargs: Any
) -> Iterator[tuple[MicoWidget, ScriptedController]]:
    with mico(*args, **kwargs) as (api, controller):
        panel = MicoWidget(api)
        qtbot.addWidget(panel)
        show(qtbot, panel)
        yield panel, controller
        panel.close()


# A move in parts


def test_a_move_is_made_in_parts_when_the_box_is_ticked(qtbot: QtBot) -> None:
    with scripted_panel(qtbot, ("LLN",)) as (panel, controller):
        card = panel.cards["d0.c0"]
        enter(qtbot, field(card, "MiCoCL_8"), "1000")
        click_box(card)
        enter(qtbot, field(card, "MiCoCL_11"), "300")
        click(qtbot, card, "MiCoCL_6")
        wait_for_position(qtbot, card, 1000.0)
        assert len(controller.of("move_to")) == 4
        click(qtbot, card, "MiCoCL_7")
        wait_for_position(qtbot, card, 0.0)
        assert len(controller.of("move_to")) == 8


def click_box(card: QWidget) -> None:
    part(card, "MiCoCL_10", QWidget).setChecked(True)  # type: ignore[attr-defined]


def test_the_card_says_which_part_it_is_at_and_its_stop_ends_the_series(qtbot: QtBot) -> None:
    with scripted_panel(qtbot, ("LLN",), instant=False) as (panel, controller):
        card = panel.cards["d0.c0"]
        enter(qtbot, field(card, "target"), "1000")
        click_box(card)
        click(qtbot, card, "MiCoCL_9")
        line = part(card, "status", QLabel)
        qtbot.waitUntil(lambda: "part 1 of 10" in line.text())
        controller.end(Channel(0, 0), 100.0)
        qtbot.waitUntil(lambda: "part 2 of 10" in line.text())
        click(qtbot, card, "stopAxis")
        qtbot.waitUntil(lambda: not card.axis.details.in_motion)
        assert len(controller.of("move_to")) == 2
        qtbot.waitUntil(lambda: "part" not in line.text())


def test_a_part_must_be_above_zero(panel: MicoWidget, qtbot: QtBot) -> None:
    card = panel.cards["left.x"]
    click_box(card)
    enter(qtbot, field(card, "MiCoCL_11"), "0")
    click(qtbot, card, "MiCoCL_6")
    assert field(card, "MiCoCL_11").reason
    assert position(card) == 0.0


# Consent


@pytest.fixture
def cold(qtbot: QtBot) -> Iterator[MicoWidget]:
    with simulated_panel(qtbot, cold=True) as panel:
        qtbot.waitUntil(
            lambda: part(panel.cards["left.x"], "chip", ConfidenceMark).text() == "? unknown"
        )
        yield panel


def asked(panel: MicoWidget, qtbot: QtBot) -> ConsentDialog:
    qtbot.waitUntil(lambda: panel.dialog is not None)
    dialog = panel.dialog
    assert dialog is not None
    assert not dialog.isModal()
    return dialog


def test_a_move_from_an_unknown_position_asks_and_moves_on_consent(
    cold: MicoWidget, qtbot: QtBot
) -> None:
    card = cold.cards["left.x"]
    before = position(card)
    click(qtbot, card, "MiCoCL_6")
    dialog = asked(cold, qtbot)
    assert position(card) == before
    dialog.move_anyway.click()
    wait_for_position(qtbot, card, before + 100.0)
    qtbot.waitUntil(lambda: cold.dialog is None)


def test_the_dialog_can_initialise_instead(cold: MicoWidget, qtbot: QtBot) -> None:
    choose(cold.cards["left.x"], "Find reference")
    asked(cold, qtbot).initialise_first.click()
    assert cold.caution is not None
    cold.caution.go.click()
    message = part(cold, "message", QLabel)
    qtbot.waitUntil(lambda: "Initialisation finished" in message.text(), timeout=20000)
    assert part(cold.cards["left.x"], "chip", ConfidenceMark).text() == "✓ known"


def test_enter_in_the_question_moves_nothing(cold: MicoWidget, qtbot: QtBot) -> None:
    before = position(cold.cards["left.x"])
    choose(cold.cards["left.x"], "Find reference")
    qtbot.keyClick(asked(cold, qtbot), Qt.Key.Key_Return)
    qtbot.waitUntil(lambda: cold.dialog is None)
    assert cold.caution is None
    assert cold.mico.application.running_task is None
    assert position(cold.cards["left.x"]) == before


def test_declining_moves_nothing(cold: MicoWidget, qtbot: QtBot) -> None:
    card = cold.cards["left.x"]
    before = position(card)
    click(qtbot, card, "MiCoCL_9")
    asked(cold, qtbot).reject()
    qtbot.waitUntil(lambda: cold.dialog is None)
    assert position(card) == before


def test_other_refusals_ask_nothing(panel: MicoWidget, qtbot: QtBot) -> None:
    card = panel.cards["left.x"]
    panel.mico.application.manager.stop("test")
    click(qtbot, card, "MiCoCL_6")
    qtbot.waitUntil(lambda: bool(field(card, "MiCoCL_8").reason))
    assert panel.dialog is None
    assert position(card) == 0.0


# Long operations


def test_initialising_shows_progress_and_can_be_cancelled(qtbot: QtBot) -> None:
    with simulated_panel(qtbot, rate=2.0, cold=True) as panel:
        initialise(qtbot, panel)
        bar, button = part(panel, "progress", QProgressBar), part(panel, "initialise", QPushButton)
        qtbot.waitUntil(bar.isVisible)
        assert not button.isEnabled()
        assert "is running" in button.toolTip()
        qtbot.waitUntil(lambda: "referencing" in part(panel, "progressText", QLabel).text())
        click(qtbot, panel, "cancel")
        message = part(panel, "message", QLabel)
        qtbot.waitUntil(lambda: "Initialisation ended" in message.text())
        qtbot.waitUntil(lambda: not any(axis.details.in_motion for axis in panel.mico))
        assert button.isEnabled()


# What is missing


def test_a_missing_device_is_listed_and_greyed_until_a_rescan_finds_it(qtbot: QtBot) -> None:
    layout = ("LLN", "R")
    with scripted_panel(qtbot, ("LLN",), configured=layout) as (panel, controller):
        missing, card = part(panel, "missing", QLabel), panel.cards["d1.c0"]
        assert "d1.c0" in missing.text()
        forward = part(card, "MiCoCL_6", QPushButton)
        assert not forward.isEnabled()
        assert "Not available" in forward.toolTip()
        assert part(card, "MiCoCL_1", StateBadge).state is State.UNKNOWN
        assert part(card, "status", QLabel).text()

        controller.layout = list(layout)
        click(qtbot, panel, "rescan")
        qtbot.waitUntil(lambda: part(panel.cards["d1.c0"], "MiCoCL_6", QPushButton).isEnabled())
        assert not part(panel, "missing", QLabel).isVisible()
        assert "Not available" not in part(panel.cards["d1.c0"], "MiCoCL_6", QPushButton).toolTip()
        enter(qtbot, field(panel.cards["d1.c0"], "target"), "3")
        click(qtbot, panel.cards["d1.c0"], "MiCoCL_9")
        wait_for_position(qtbot, panel.cards["d1.c0"], 3.0)


def test_a_rescan_while_something_moves_is_refused(qtbot: QtBot) -> None:
    with scripted_panel(qtbot, ("LLN",), instant=False) as (panel, controller):
        card = panel.cards["d0.c0"]
        click(qtbot, card, "MiCoCL_6")
        qtbot.waitUntil(lambda: card.axis.details.in_motion)
        click(qtbot, panel, "rescan")
        message = part(panel, "message", QLabel)
        qtbot.waitUntil(lambda: "d0.c0 is moving" in message.text())
        controller.end(Channel(0, 0), 100.0)


def test_a_device_that_is_lost_greys_its_cards(qtbot: QtBot) -> None:
    with scripted_panel(qtbot, ("LLN", "L")) as (panel, controller):
        controller.broken = DeviceError("cable", fault=DeviceFault.COMMUNICATION)
        forward = part(panel.cards["d0.c0"], "MiCoCL_6", QPushButton)
        qtbot.waitUntil(lambda: not forward.isEnabled())
        qtbot.waitUntil(part(panel, "missing", QLabel).isVisible)


def test_an_error_of_the_device_stands_in_the_card(qtbot: QtBot) -> None:
    with scripted_panel(qtbot, ("LLN",), instant=False) as (panel, controller):
        card = panel.cards["d0.c0"]
        click(qtbot, card, "MiCoCL_6")
        qtbot.waitUntil(lambda: bool(controller.of("move_to")))
        controller.fail(Channel(0, 0), DeviceFault.END_STOP)
        line = part(card, "status", QLabel)
        qtbot.waitUntil(lambda: "end stop" in line.text())
        assert "end stop" in line.toolTip()
        badge = part(card, "MiCoCL_1", StateBadge)
        qtbot.waitUntil(lambda: badge.state is State.ERROR)
        assert panel.groups[0].state is State.ERROR


def test_a_stop_that_ends_a_move_refuses_no_entry(qtbot: QtBot) -> None:
    with scripted_panel(qtbot, ("LLN",), instant=False) as (panel, _controller):
        card = panel.cards["d0.c0"]
        click(qtbot, card, "MiCoCL_6")
        badge, line = part(card, "MiCoCL_1", StateBadge), part(card, "status", QLabel)
        qtbot.waitUntil(lambda: badge.state is State.BUSY)
        panel.mico.application.manager.stop("test")
        qtbot.waitUntil(lambda: "stopped: test" in line.text())
        assert not field(card, "MiCoCL_8").reason
        click(qtbot, card, "MiCoCL_6")
        qtbot.waitUntil(lambda: "stopped" in field(card, "MiCoCL_8").reason)


# Arrangement and cost


def test_positioners_that_no_group_names_stand_with_their_device(qtbot: QtBot) -> None:
    group = ({"title": "Arm", "positioners": ("d0.c1",)},)
    with scripted_panel(qtbot, ("LLN", "L"), group=group) as (panel, _controller):
        arranged = {each.title: list(each.cards) for each in panel.groups}
        assert arranged == {
            "Arm": ["d0.c1"],
            "Device 0": ["d0.c0", "d0.c2"],
            "Device 1": ["d1.c0"],
        }


def test_a_group_folds_and_keeps_its_gravest_state_in_sight(
    panel: MicoWidget, qtbot: QtBot
) -> None:
    group = panel.groups[0]
    card = panel.cards["left.x"]
    group.set_folded(True)
    assert not card.isVisible()
    assert group.state is State.OK
    group.set_folded(False)
    assert card.isVisible()


def test_a_new_kind_is_one_class_and_one_entry(
    qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Turntable(ClosedLoopGUI):
        """Another card for rotary axes."""

    monkeypatch.setitem(registry.POSITIONER_GUIS, PositionerKind.ROTARY, Turntable)
    with scripted_panel(qtbot, ("LR",)) as (panel, _controller):
        assert type(panel.cards["d0.c1"]) is Turntable
        assert type(panel.cards["d0.c0"]) is ClosedLoopGUI


def test_a_storm_of_states_reaches_a_card_a_few_times_only(
    qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown: list[float | None] = []
    original = ClosedLoopGUI.show_state

    def count(self: ClosedLoopGUI, state: PositionerState) -> None:
        if self.settings.name == "d0.c0":
            shown.append(state.position)
        original(self, state)

    monkeypatch.setattr(ClosedLoopGUI, "show_state", count)
    with scripted_panel(qtbot, ("LLN",)) as (panel, controller):
        shown.clear()
        controller.position[Channel(0, 0)] = 499.0
        for number in range(500):
            controller.emit(PositionRead(Channel(0, 0), float(number), "um"))
        figures = part(panel.cards["d0.c0"], "MiCoCL_5", QLabel)
        qtbot.waitUntil(lambda: figures.text() == "499.0")
        assert 0 < len(shown) < 60


def test_the_panel_takes_as_many_columns_as_fit(panel: MicoWidget, qtbot: QtBot) -> None:
    def columns() -> int:
        return len({group.mapToGlobal(group.rect().topLeft()).x() for group in panel.groups})

    panel.resize(2000, 900)
    qtbot.waitUntil(lambda: columns() == 3)
    panel.resize(1340, 700)
    qtbot.waitUntil(lambda: columns() == 2)
    panel.resize(700, 700)
    qtbot.waitUntil(lambda: columns() == 1)


def test_the_keys_are_listed(panel: MicoWidget) -> None:
    keys = dict(panel.keys())
    assert keys["D"] == "left.x: right while held"
    assert keys[","] == "table.rotation: turn left while held"
