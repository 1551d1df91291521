"""Fibres on an image are corrected by the mouse."""

import signal
import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import pytest
from PySide6.QtCore import QEvent, QPoint, QPointF, Qt, QTimer
from PySide6.QtGui import QMouseEvent
from PySide6.QtWidgets import QApplication, QMessageBox
from pytestqt.qtbot import QtBot

from cosmic.app.cli import main
from cosmic.frame.errors import RecordingError
from cosmic.vico.api import find_fibres
from cosmic.vico.core.measuring.corrections import Corrections
from cosmic.vico.gui.fibre_editor import FibreEditor
from unit.vico.vision.drawn_fibres import arc, drawn_image

IMAGE = drawn_image([arc((60.0, 100.0), 0.0, 300.0, 0.0)], [9.0], shape=(300, 400))
LEFT = Qt.MouseButton.LeftButton
Saved = Callable[[], str]


def make(qtbot: QtBot, save: Saved = lambda: "kept") -> FibreEditor:
    editor = FibreEditor(IMAGE, Corrections(IMAGE, find_fibres(IMAGE)), save)
    qtbot.addWidget(editor)
    editor.resize(700, 600)
    editor.show()
    qtbot.waitExposed(editor)
    editor.view.fit()
    return editor


def at(editor: FibreEditor, x: float, y: float) -> QPoint:
    return editor.view.to_screen.map(QPointF(x, y)).toPoint()


def click(qtbot: QtBot, editor: FibreEditor, x: float, y: float) -> None:
    qtbot.mouseClick(editor.view.viewport(), LEFT, pos=at(editor, x, y))


def choose(qtbot: QtBot, editor: FibreEditor, edit: str) -> None:
    qtbot.mouseClick(editor.edits[edit], LEFT)


def lengths(editor: FibreEditor) -> list[int]:
    return sorted(round(each.length_px) for each in editor.corrections.lines)


def test_a_click_cuts_another_deletes_and_undo_brings_all_back(qtbot: QtBot) -> None:
    editor = make(qtbot)
    assert not editor.undo.isEnabled()
    choose(qtbot, editor, "cut")
    click(qtbot, editor, 160.0, 100.0)
    assert lengths(editor) == pytest.approx([100, 200], abs=4)
    choose(qtbot, editor, "delete")
    click(qtbot, editor, 80.0, 100.0)
    assert lengths(editor) == pytest.approx([200], abs=4)
    qtbot.mouseClick(editor.undo, LEFT)
    qtbot.mouseClick(editor.undo, LEFT)
    assert lengths(editor) == pytest.approx([300], abs=2)
    qtbot.mouseClick(editor.redo, LEFT)
    assert len(lengths(editor)) == 2


def test_clicks_add_a_fibre_that_a_second_click_on_its_end_finishes(qtbot: QtBot) -> None:
    editor = make(qtbot)
    choose(qtbot, editor, "add")
    for x in (100.0, 200.0, 300.0, 300.0):
        click(qtbot, editor, x, 220.0)
    assert lengths(editor) == pytest.approx([200, 300], abs=4)


def test_a_double_click_ends_a_fibre_that_is_added(qtbot: QtBot) -> None:
    editor = make(qtbot)
    choose(qtbot, editor, "add")
    click(qtbot, editor, 100.0, 220.0)
    click(qtbot, editor, 300.0, 220.0)
    pane, there = editor.view.viewport(), QPointF(at(editor, 300.0, 220.0))
    again = QMouseEvent(  # the second press alone, which a desktop sends instead of another click
        QEvent.Type.MouseButtonDblClick,
        there,
        pane.mapToGlobal(there),
        LEFT,
        LEFT,
        Qt.KeyboardModifier.NoModifier,
    )
    QApplication.sendEvent(pane, again)
    assert lengths(editor) == pytest.approx([200, 300], abs=4)


@pytest.mark.parametrize("way", ["another edit", "save", "close"])
def test_a_fibre_that_was_clicked_and_not_ended_is_not_lost(qtbot: QtBot, way: str) -> None:
    editor = make(qtbot)
    choose(qtbot, editor, "add")
    click(qtbot, editor, 100.0, 220.0)
    click(qtbot, editor, 300.0, 220.0)
    if way == "another edit":
        choose(qtbot, editor, "cut")
    elif way == "save":
        qtbot.mouseClick(editor.save, LEFT)
    else:
        editor.close()
        assert editor.question is not None, "it is asked before it is lost"
        qtbot.mouseClick(editor.question.button(QMessageBox.StandardButton.Save), LEFT)
    assert lengths(editor) == pytest.approx([200, 300], abs=4)


def test_an_end_is_dragged_and_two_fibres_are_joined(qtbot: QtBot) -> None:
    editor = make(qtbot)
    choose(qtbot, editor, "move end")
    pane = editor.view.viewport()
    qtbot.mousePress(pane, LEFT, pos=at(editor, 360.0, 100.0))
    qtbot.mouseMove(pane, at(editor, 250.0, 100.0))
    qtbot.mouseRelease(pane, LEFT, pos=at(editor, 250.0, 100.0))
    assert lengths(editor) == pytest.approx([190], abs=4)
    editor.corrections.add([(270.0, 100.0), (380.0, 100.0)])
    choose(qtbot, editor, "join")
    click(qtbot, editor, 150.0, 100.0)
    click(qtbot, editor, 330.0, 100.0)
    assert lengths(editor) == pytest.approx([320], abs=5)


def test_what_is_refused_or_cannot_be_saved_is_said(qtbot: QtBot) -> None:
    def fails() -> str:
        raise RecordingError("the disk is full")

    editor = make(qtbot, fails)
    choose(qtbot, editor, "delete")
    click(qtbot, editor, 200.0, 250.0)
    assert "No fibre" in editor.note.text()
    qtbot.mouseClick(editor.save, LEFT)
    assert "disk is full" in editor.note.text()


def test_what_lies_outside_the_image_is_refused_and_costs_no_click(qtbot: QtBot) -> None:
    editor = make(qtbot)
    choose(qtbot, editor, "add")
    click(qtbot, editor, 100.0, 220.0)
    click(qtbot, editor, 100.0, -3.0)
    assert "outside the image" in editor.note.text()
    click(qtbot, editor, 300.0, 220.0)
    click(qtbot, editor, 300.0, 220.0)
    assert lengths(editor) == pytest.approx([200, 300], abs=4)
    choose(qtbot, editor, "move end")
    pane = editor.view.viewport()
    qtbot.mousePress(pane, LEFT, pos=at(editor, 300.0, 220.0))
    qtbot.mouseRelease(pane, LEFT, pos=at(editor, 300.0, -3.0))
    assert "outside the image" in editor.note.text()
    assert lengths(editor) == pytest.approx([200, 300], abs=4)


def cut(qtbot: QtBot, editor: FibreEditor) -> None:
    choose(qtbot, editor, "cut")
    click(qtbot, editor, 160.0, 100.0)
    assert len(lengths(editor)) == 2


def answer(qtbot: QtBot, editor: FibreEditor, button: QMessageBox.StandardButton) -> None:
    assert editor.question is not None
    qtbot.mouseClick(editor.question.button(button), LEFT)
    qtbot.waitUntil(lambda: editor.question is None)


def test_corrections_that_are_not_saved_are_not_lost_by_closing(qtbot: QtBot) -> None:
    saved: list[str] = []
    editor = make(qtbot, lambda: saved.append("kept") or "kept")
    cut(qtbot, editor)
    editor.close()
    assert editor.isVisible()
    answer(qtbot, editor, QMessageBox.StandardButton.Cancel)
    assert editor.isVisible()
    assert not saved
    editor.close()
    answer(qtbot, editor, QMessageBox.StandardButton.Save)
    assert saved == ["kept"]
    assert not editor.isVisible()


def test_an_editor_that_cannot_save_stays_until_the_corrections_are_discarded(
    qtbot: QtBot,
) -> None:
    def full() -> str:
        raise RecordingError("the disk is full")

    editor = make(qtbot, full)
    cut(qtbot, editor)
    editor.close()
    answer(qtbot, editor, QMessageBox.StandardButton.Save)
    assert editor.isVisible()
    assert "the disk is full" in editor.note.text()
    editor.close()
    answer(qtbot, editor, QMessageBox.StandardButton.Discard)
    assert not editor.isVisible()


def test_an_editor_without_edits_closes_at_once(qtbot: QtBot) -> None:
    editor = make(qtbot)
    editor.close()
    assert not editor.isVisible()


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_a_signal_ends_the_command_and_its_window(qtbot: QtBot, tmp_path: Path) -> None:
    file = tmp_path / "plate.png"
    assert cv2.imwrite(str(file), IMAGE)
    QTimer.singleShot(500, lambda: signal.raise_signal(signal.SIGTERM))
    assert main(["correct", str(file)]) == 143
    QApplication.processEvents()
    came: list[bool] = []
    QTimer.singleShot(20, lambda: came.append(True))
    qtbot.waitUntil(lambda: bool(came), timeout=2000)  # no quit is left for whoever began it
