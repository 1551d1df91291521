import logging
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QAbstractButton, QLabel, QPushButton
from pytestqt.qtbot import QtBot

from cosmic.app.configuration.platform_file import load_platform
from cosmic.app.platform import build_platform
from cosmic.frame.config import shipped_config_dir
from cosmic.frame.gui.palette import OKABE_ITO
from cosmic.mico.core.collision.collision_manager import CollisionManager
from cosmic.mico.gui.collision_switch import CollisionSwitch, TakeOutQuestion
from cosmic.mico.gui.mico_widget import MicoWidget, make_mico_gui
from cosmic.mico.gui.positioner_gui import PositionerBaseGUI
from gui.mico.panels import click, enter, field, part, position, show, wait_for_position

NAMES = {"left.x": "MiCoCL_13", "left.gripper": "collisionSwitch"}


@pytest.fixture(params=list(NAMES))
def card(request: pytest.FixtureRequest, panel: MicoWidget) -> PositionerBaseGUI:
    """A card with sensor and one without."""
    return panel.cards[str(request.param)]


def switch(card: PositionerBaseGUI) -> CollisionSwitch:
    return part(card, NAMES[card.axis.key], CollisionSwitch)


def question(card: PositionerBaseGUI) -> TakeOutQuestion:
    found = switch(card).question
    assert found is not None
    return found


def model(panel: MicoWidget) -> CollisionManager:
    found = panel.mico.application.collision
    assert found is not None
    return found


def take_out(qtbot: QtBot, card: PositionerBaseGUI) -> None:
    qtbot.mouseClick(switch(card), Qt.MouseButton.LeftButton)
    qtbot.mouseClick(question(card).take_out, Qt.MouseButton.LeftButton)


def test_collision_detection_is_on_at_first(card: PositionerBaseGUI) -> None:
    assert card.axis.collision_detection
    assert switch(card).isEnabled()
    assert switch(card).text() == "CD on"
    assert switch(card).indicator.text() == ""


def test_taking_out_asks_once_more_and_is_loud_afterwards(
    card: PositionerBaseGUI, qtbot: QtBot, caplog: pytest.LogCaptureFixture
) -> None:
    qtbot.mouseClick(switch(card), Qt.MouseButton.LeftButton)
    assert card.axis.collision_detection
    asked = " ".join(label.text() for label in question(card).findChildren(QLabel))
    assert f"Take {card.axis.key} out of collision detection?" in asked
    with caplog.at_level(logging.WARNING):
        qtbot.mouseClick(question(card).take_out, Qt.MouseButton.LeftButton)
    assert not card.axis.collision_detection
    assert f"{card.axis.key} was taken out of collision detection by window" in caplog.text
    qtbot.waitUntil(lambda: switch(card).text() == "CD OFF")
    assert switch(card).indicator.text() == "▲"
    assert "NOT checked" in part(card, "status", QLabel).text()
    border = card.grab().toImage().pixelColor(card.width() // 2, 1)
    assert border == QColor(OKABE_ITO["vermillion"])


def test_cancelling_takes_nothing_out(card: PositionerBaseGUI, qtbot: QtBot) -> None:
    qtbot.mouseClick(switch(card), Qt.MouseButton.LeftButton)
    qtbot.mouseClick(question(card).cancel, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: switch(card).question is None)
    assert card.axis.collision_detection
    assert switch(card).text() == "CD on"


def test_return_on_the_question_is_a_no(card: PositionerBaseGUI, qtbot: QtBot) -> None:
    qtbot.mouseClick(switch(card), Qt.MouseButton.LeftButton)
    qtbot.keyClick(question(card).cancel, Qt.Key.Key_Space)
    qtbot.waitUntil(lambda: switch(card).question is None)
    assert card.axis.collision_detection


def test_turning_to_something_else_is_a_no(panel: MicoWidget, qtbot: QtBot) -> None:
    card = panel.cards["left.x"]
    qtbot.mouseClick(switch(card), Qt.MouseButton.LeftButton)
    field(panel.cards["right.x"], "MiCoCL_8").setFocus()
    qtbot.waitUntil(lambda: switch(card).question is None)
    assert card.axis.collision_detection


def test_taking_in_asks_nothing(card: PositionerBaseGUI, qtbot: QtBot) -> None:
    take_out(qtbot, card)
    qtbot.waitUntil(lambda: switch(card).text() == "CD OFF")
    qtbot.mouseClick(switch(card), Qt.MouseButton.LeftButton)
    assert card.axis.collision_detection
    qtbot.waitUntil(lambda: switch(card).text() == "CD on")
    assert "NOT checked" not in part(card, "status", QLabel).text()


def test_the_switch_follows_what_a_script_changes(
    card: PositionerBaseGUI, panel: MicoWidget, qtbot: QtBot
) -> None:
    model(panel).take_out(card.axis.key)
    qtbot.waitUntil(lambda: switch(card).text() == "CD OFF")
    assert sum(switch_of.text() == "CD OFF" for switch_of in switches(panel)) == 1
    model(panel).take_in(card.axis.key)
    qtbot.waitUntil(lambda: switch(card).text() == "CD on")


def switches(panel: MicoWidget) -> list[CollisionSwitch]:
    return panel.findChildren(CollisionSwitch)


def test_the_switch_keeps_its_width(card: PositionerBaseGUI, panel: MicoWidget) -> None:
    before = switch(card).geometry().getRect()
    switch(card).show_detection(model=True, watched=False)
    card.layout().activate()
    assert switch(card).geometry().getRect() == before


def test_a_refused_move_is_made_after_taking_the_axis_out(panel: MicoWidget, qtbot: QtBot) -> None:
    card = panel.cards["left.z"]
    entry = field(card, "target")
    enter(qtbot, entry, "-2000")
    click(qtbot, card, "MiCoCL_9")
    qtbot.waitUntil(lambda: "left_jaw" in entry.reason)
    assert position(card) == 0.0
    model(panel).take_out("left.z")
    click(qtbot, card, "MiCoCL_9")
    wait_for_position(qtbot, card, -2000.0)


# Without a collision model


@pytest.fixture
def bare(qtbot: QtBot, tmp_path: Path) -> Iterator[MicoWidget]:
    """The shipped platform with no scene named."""
    folder = tmp_path / "config"
    shutil.copytree(shipped_config_dir(), folder)
    text = (folder / "platform.toml").read_text(encoding="utf-8")
    scene = load_platform(None)[0].platform.scene
    (folder / "platform.toml").write_text(text.replace(scene, ""), encoding="utf-8")
    platform = build_platform(folder, applications=("mico",), rate=50.0, mico_gui=make_mico_gui)
    assert platform.mico is not None
    platform.initialize()
    panel = platform.mico.get_gui()
    assert isinstance(panel, MicoWidget)
    qtbot.addWidget(panel)
    show(qtbot, panel)
    yield panel
    platform.shut_down()
    panel.close()


def test_without_a_model_the_switch_says_why_it_cannot_be_used(bare: MicoWidget) -> None:
    for name, object_name in NAMES.items():
        button = part(bare.cards[name], object_name, QAbstractButton)
        assert not button.isEnabled()
        assert "collision model" in button.toolTip()
    indicator = part(bare.cards["left.x"], "MiCoCL_2", QLabel)
    assert indicator.text() == "▲"
    assert indicator.accessibleName() == "no collision model"
    forward = part(bare.cards["left.x"], "MiCoCL_6", QPushButton)
    assert forward.isEnabled()
