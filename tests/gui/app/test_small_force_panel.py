"""The force panel in a small window: what it says has room, and Tare says what to do."""

from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot

import cosmic
from cosmic.app.panels import force as force_panel
from cosmic.app.panels.force import ForcePanel
from cosmic.app.windows.operator_window import OperatorWindow
from cosmic.app.windows.tasks import MEASURE
from cosmic.frame.gui.amounts import clock_text
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


def test_a_long_recording_makes_the_panel_no_wider(make: Make, qtbot: QtBot) -> None:
    _window, force = measuring(make, qtbot)
    width_px = force.minimumSizeHint().width()
    force.record.setText(f"■ Stop {clock_text(36_000.0)}")
    assert force.minimumSizeHint().width() == width_px
    text_px = force.record.fontMetrics().horizontalAdvance(force.record.text())
    assert text_px < force.record.width()


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(12.34, "12.3 s"), (125.0, "2:05"), (3725.0, "1:02:05"), (float("nan"), "?")],
)
def test_a_time_in_little_room(seconds: float, text: str) -> None:
    assert clock_text(seconds) == text
