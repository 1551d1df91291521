"""Snap, record, time-lapse: names, refusals, counters."""

from dataclasses import replace

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QMessageBox, QPushButton

from cosmic.frame.file_names import directory_problem, name_problem
from cosmic.vico.gui.record_bar import TimeLapseDialog
from gui.vico.fake_vico import Recorded

STAMP = "2026-11-21_12-16-40"


def click(qtbot, button):
    qtbot.mouseClick(button, Qt.MouseButton.LeftButton)


def write(qtbot, field, text):
    field.selectAll()
    qtbot.keyClicks(field, text)


@pytest.fixture
def bar(qtbot, shown):
    click(qtbot, shown.recorder.more)
    return shown.recorder


def test_a_snap_goes_to_a_file_with_the_time_in_its_name(qtbot, bar, camera):
    click(qtbot, bar.snap)
    path = camera.directory / f"top_{STAMP}-000.png"
    assert camera.calls == [("snap", path, False)]
    camera.task.finish()
    qtbot.waitUntil(lambda: bar.tasks.text.text() == f"Snap {path.name}: done")


def test_a_snap_that_fails_is_reported(qtbot, bar, camera):
    click(qtbot, bar.snap)
    camera.task.fail(OSError("disk full"))
    qtbot.waitUntil(lambda: "disk full" in bar.tasks.text.text())
    camera.refuse = "no such directory"
    click(qtbot, bar.snap)
    assert "no such directory" in bar.message.text()


def test_a_recording_is_started_counted_and_stopped(qtbot, bar, camera):
    click(qtbot, bar.record)
    path = camera.directory / f"top_{STAMP}.mkv"
    assert camera.calls == [("record", path, "FFV1 (lossless)", False)]
    qtbot.waitUntil(lambda: bar.record.text() == "■ Stop")
    assert not bar.files.isEnabled()
    assert not bar.lapse.isEnabled()
    places = [each.geometry() for each in (bar.snap, bar.record, bar.lapse, bar.more)]
    camera.recording = Recorded(
        active=True,
        path=path,
        written=4711,
        dropped=2,
        waiting=5,
        size_bytes=123_400_000,
        left_s=3700.0,
    )
    qtbot.waitUntil(lambda: bar.message.text().startswith("4711 written, 2 dropped, 5 waiting"))
    assert "123.4 MB, disk lasts 1 h 01 min" in bar.message.text()
    assert [each.geometry() for each in (bar.snap, bar.record, bar.lapse, bar.more)] == places
    click(qtbot, bar.record)
    assert camera.calls[-1] == ("stop recording",)
    qtbot.waitUntil(lambda: bar.record.text() == "● Record")


def test_a_recording_that_ended_by_itself_says_why(qtbot, bar, camera):
    click(qtbot, bar.record)
    camera.change(recording=replace(camera.recording, active=False, failure="disk full"))
    qtbot.waitUntil(lambda: bar.message.text() == "■ disk full")
    assert not bar.record.isChecked()


def test_before_a_recording_the_disk_is_said_to_last(bar):
    assert bar.message.text() == "disk lasts 2 h 00 min"


def test_a_format_that_cannot_be_used_disables_recording_and_says_why(qtbot, bar, camera):
    bar.format.setCurrentIndex(2)
    bar.format.activated.emit(2)
    assert not bar.record.isEnabled()
    assert bar.record.toolTip() == "the codec is missing"
    assert bar.snap.isEnabled()
    bar.format.setCurrentIndex(3)
    bar.format.activated.emit(3)
    click(qtbot, bar.record)
    assert camera.calls[0][1] == camera.directory / f"top_{STAMP}"


def test_an_existing_file_is_overwritten_only_after_a_question(qtbot, bar, camera):
    click(qtbot, bar.files.stamp)
    write(qtbot, bar.files.base, "run")
    path = camera.directory / "run.mkv"
    path.write_bytes(b"precious")
    click(qtbot, bar.record)
    box = bar.findChild(QMessageBox)
    assert "run.mkv exists" in box.text()
    assert camera.calls == []
    qtbot.keyClick(box, Qt.Key.Key_Escape)
    assert camera.calls == []
    click(qtbot, bar.record)
    box = next(each for each in bar.findChildren(QMessageBox) if each.isVisible())
    click(qtbot, next(x for x in box.findChildren(QPushButton) if x.text() == "Overwrite"))
    assert camera.calls == [("record", path, "FFV1 (lossless)", True)]


@pytest.mark.parametrize("name", ["", "  ", "a/b", "..", "x\ny", "what?"])
def test_a_name_that_is_none_is_refused(name):
    assert name_problem(name)


def test_a_wrong_directory_is_refused_with_its_text_kept(qtbot, bar, camera):
    write(qtbot, bar.files.directory, "/nowhere/at/all")
    assert bar.files.directory.text() == "/nowhere/at/all"
    assert "does not exist" in bar.files.directory.accessibleDescription()
    assert not bar.record.isEnabled()
    assert "does not exist" in bar.record.toolTip()
    assert directory_problem("") and directory_problem("\0")
    write(qtbot, bar.files.directory, str(camera.directory))
    assert bar.record.isEnabled()


def test_nothing_is_recorded_from_a_camera_that_stands(qtbot, bar, camera):
    camera.change(running=False)
    qtbot.waitUntil(lambda: not bar.record.isEnabled())
    assert "start the camera" in bar.record.toolTip()


def test_a_time_lapse_asks_how_often_and_shows_how_far_it_is(qtbot, bar, camera):
    click(qtbot, bar.lapse)
    dialog = bar.findChild(TimeLapseDialog)
    write(qtbot, dialog.interval, "60")
    qtbot.keyClick(dialog.interval, Qt.Key.Key_Return)
    assert dialog.isVisible()
    assert dialog.total.text() == "59 min 00 s"
    write(qtbot, dialog.count, "2.5")
    click(qtbot, dialog.begin)
    assert "whole number" in dialog.count.reason
    write(qtbot, dialog.count, "10")
    click(qtbot, dialog.begin)
    path = camera.directory / f"top_{STAMP}.mkv"
    assert camera.calls == [("lapse", path, "FFV1 (lossless)", 60.0, 10, False)]
    camera.task.report(0.5, "5 of 10")
    qtbot.waitUntil(lambda: bar.tasks.bar.value() == 500)
    assert "5 of 10" in bar.tasks.text.text()
    click(qtbot, bar.tasks.cancel)
    assert camera.task.cancel_requested
    camera.task.finish()
    qtbot.waitUntil(lambda: not bar.tasks.cancel.isVisible())
