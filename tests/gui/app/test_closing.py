"""Closing the window asks first while something would be lost by it."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot

from cosmic.app.windows.closing import CloseDialog, ParkDialog, what_is_lost
from cosmic.app.windows.operator_window import OperatorWindow
from cosmic.vico.api.vico import vico_of
from gui.app.windows import Make, mico

LEFT = Qt.MouseButton.LeftButton


def question(window: OperatorWindow) -> CloseDialog | None:
    found = window.findChild(CloseDialog)
    return found if isinstance(found, CloseDialog) else None


@pytest.fixture
def recording(make: Make, qtbot: QtBot, tmp_path: Path) -> OperatorWindow:
    """A window that writes a recording."""
    window = make(applications=("mico", "daqco", "vico"), rate=1.0)
    assert window.tasks is not None
    assert window.tasks.force is not None
    assert window.workspaces is not None
    window.workspaces.choose("Measure")
    force, daqco = window.tasks.force, window.platform.daqco
    assert daqco is not None
    qtbot.waitUntil(lambda: daqco.running, timeout=15_000)
    daqco.recorder.start(tmp_path / "first.h5")
    qtbot.waitUntil(lambda: daqco.recorder.state.active)
    qtbot.waitUntil(force.mark.isEnabled)
    return window


def test_closing_asks_while_a_recording_is_written(recording: OperatorWindow, qtbot: QtBot) -> None:
    recording.close()
    dialog = question(recording)
    assert dialog is not None
    assert recording.isVisible()
    assert "first.h5" in dialog.informativeText()
    qtbot.mouseClick(dialog.cancel, LEFT)
    qtbot.waitUntil(lambda: question(recording) is None)
    assert recording.isVisible()
    recording.close()
    again = question(recording)
    assert again is not None
    qtbot.mouseClick(again.now, LEFT)
    assert not recording.isVisible()


def test_what_is_lost_is_asked_again_after_a_close_that_was_cancelled_at_the_second_question(
    recording: OperatorWindow, qtbot: QtBot
) -> None:
    qtbot.waitUntil(lambda: mico(recording).mico.ready, timeout=15_000)
    mico(recording).mico.poses.teach("park", ["left.x"])
    recording.close()
    first = question(recording)
    assert first is not None
    qtbot.mouseClick(first.now, LEFT)
    qtbot.waitUntil(lambda: isinstance(question(recording), ParkDialog))
    parking = question(recording)
    assert parking is not None
    qtbot.mouseClick(parking.cancel, LEFT)
    qtbot.waitUntil(lambda: question(recording) is None)
    assert recording.isVisible()
    recording.close()
    again = question(recording)
    assert again is not None
    assert "first.h5" in again.informativeText()
    recording.close_now()
    assert not recording.isVisible()


def test_closing_asks_while_images_are_recorded(make: Make, qtbot: QtBot, tmp_path: Path) -> None:
    window = make(applications=("mico", "daqco", "vico"), rate=1.0)
    vico = window.platform.vico
    assert vico is not None
    camera = vico_of(vico).camera()
    qtbot.waitUntil(lambda: camera.newest_id is not None, timeout=15_000)
    camera.record(tmp_path / "film")
    qtbot.waitUntil(lambda: camera.recording.active)
    window.close()
    dialog = question(window)
    assert dialog is not None
    assert "The images film" in dialog.informativeText()
    qtbot.mouseClick(dialog.cancel, LEFT)
    camera.stop_recording(wait=True)
    qtbot.waitUntil(lambda: question(window) is None)
    window.close()
    assert not window.isVisible()


@pytest.mark.parametrize(("remote", "asked"), [("", 1), ("fibervision", 0)])
def test_images_that_a_station_records_go_on_without_the_window(remote: str, asked: int) -> None:
    recording = SimpleNamespace(active=True, path=Path("film"))
    camera = SimpleNamespace(remote=remote, recording=recording)
    vico = SimpleNamespace(cameras=("microscope",), camera=lambda _name: camera)
    rig: Any = SimpleNamespace(running="", vico=vico)
    assert len(what_is_lost(rig, None, force=False)) == asked


def test_the_end_of_the_program_waits_for_no_answer(recording: OperatorWindow) -> None:
    recording.close_now()
    assert question(recording) is None
    assert not recording.isVisible()


def test_closing_asks_while_a_gripper_holds_a_fibre(
    make: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = make(applications=("mico", "daqco", "vico"), hardware=False)
    assert window.tasks is not None
    operations = window.tasks.operations
    assert operations is not None
    held = SimpleNamespace(held_by="left", may_hold="", running=False)
    monkeypatch.setattr(type(operations), "used", True)
    monkeypatch.setattr(type(operations), "handling", held)
    window.close()
    dialog = question(window)
    assert dialog is not None
    assert "The left gripper holds a fibre" in dialog.informativeText()
    assert window.isVisible()


def test_a_window_that_loses_nothing_closes_at_once(make: Make) -> None:
    window = make(applications=("mico", "daqco", "vico"), hardware=False)
    window.close()
    assert not window.isVisible()
