"""Tare in the force panel: done, or refused with what to do in the room there is."""

from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot

import cosmic
from cosmic.app.panels import force as force_panel
from cosmic.app.panels.force import ForcePanel
from cosmic.app.windows.operator_window import OperatorWindow
from cosmic.app.windows.tasks import MEASURE
from gui.app.windows import Make

LEFT = Qt.MouseButton.LeftButton


def measuring(make: Make, qtbot: QtBot) -> tuple[OperatorWindow, ForcePanel]:
    """A small window, and its panel of the force, once that is measured."""
    window = make(applications=("mico", "daqco", "vico"), rate=1.0, size=(1024, 600))
    assert window.tasks is not None
    assert window.workspaces is not None
    window.workspaces.choose(MEASURE)
    force = window.tasks.force
    assert force is not None
    qtbot.waitUntil(lambda: force.force is not None, timeout=15_000)
    return window, force


def test_tare_says_in_a_small_window_that_the_limit_is_to_be_disarmed_first(
    make: Make, qtbot: QtBot
) -> None:
    _window, force = measuring(make, qtbot)
    qtbot.waitUntil(lambda: "ARMED" in force.limit.text())
    qtbot.mouseClick(force.tare, LEFT)
    qtbot.waitUntil(lambda: "isarm" in force.message.shown_text)
    assert "…" not in force.message.shown_text.removesuffix("Limit…")


def test_a_refusal_gives_way_to_what_is_recorded(
    make: Make, qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(force_panel, "REFUSAL_MS", 300)
    window, force = measuring(make, qtbot)
    assert window.tasks is not None
    monkeypatch.setattr(window.tasks.folder, "_folder", tmp_path)
    qtbot.mouseClick(force.record, LEFT)
    qtbot.waitUntil(lambda: "recording push" in force.message.text())
    qtbot.mouseClick(force.tare, LEFT)
    qtbot.waitUntil(lambda: "isarm" in force.message.text())
    qtbot.waitUntil(lambda: "recording push" in force.message.text())
    qtbot.mouseClick(force.record, LEFT)
    qtbot.waitUntil(lambda: "written" in force.message.text())


def test_tare_calls_the_force_zero_once_the_limit_is_disarmed(make: Make, qtbot: QtBot) -> None:
    window, force = measuring(make, qtbot)
    cosmic.Rig(window.platform).daqco.disarm_limit(force.channel)
    qtbot.waitUntil(lambda: "DISARMED" in force.limit.text())
    qtbot.mouseClick(force.tare, LEFT)
    qtbot.waitUntil(lambda: "zero moved by" in force.message.text())
    qtbot.waitUntil(lambda: abs(force.force or 9.0) < 2.0)
