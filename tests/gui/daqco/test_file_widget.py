"""`UDaqFileWidget` as its operator sees it (thesis, Table F.2)."""

from dataclasses import replace
from datetime import datetime

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QMessageBox, QPushButton

from cosmic.daqco.gui.file_widget import UDaqFileWidget
from cosmic.frame.file_names import name_problem
from cosmic.frame.gui.theme import State
from gui.daqco.fake_port import Counted, Recorded

WHEN = datetime(2026, 11, 21, 12, 16, 40)


@pytest.fixture
def widget(qtbot, port):
    made = UDaqFileWidget(port, now=lambda: WHEN)
    qtbot.addWidget(made)
    made.show()
    return made


def choose(qtbot, widget, text):
    button = next(each for each in widget.options.buttons() if each.text() == text)
    qtbot.mouseClick(button, Qt.MouseButton.LeftButton)


def write(qtbot, field, text):
    field.selectAll()
    qtbot.keyClicks(field, text)


def click(qtbot, button):
    qtbot.mouseClick(button, Qt.MouseButton.LeftButton)


def question(widget):
    return widget.findChild(QMessageBox)


def answer(qtbot, widget, text):
    button = next(x for x in question(widget).findChildren(QPushButton) if x.text() == text)
    click(qtbot, button)


def test_the_full_name_shows_the_format_of_the_time_stamp(qtbot, widget):
    write(qtbot, widget.base, "fibre7")
    assert widget.full_name.text() == "fibre7_yyyy-mm-dd_hh-mm-ss.h5"
    choose(qtbot, widget, "Append with number")
    assert widget.full_name.text() == "fibre7_nnn.h5"
    choose(qtbot, widget, "Don't append")
    assert widget.full_name.text() == "fibre7.h5"
    assert widget.full_name.isReadOnly()


def test_pressing_start_disables_it_and_enables_stop(qtbot, widget, port):
    assert widget.start.isEnabled()
    assert not widget.stop.isEnabled()
    click(qtbot, widget.start)
    assert not widget.start.isEnabled()
    assert widget.stop.isEnabled()
    path = port.directory / "recording_2026-11-21_12-16-40.h5"
    assert port.calls == [("record", path, False)]
    assert widget.full_name.text() == path.name
    assert not widget.base.isEnabled()


def test_pressing_stop_disables_it_and_a_closed_file_enables_start(qtbot, widget, port):
    click(qtbot, widget.start)
    click(qtbot, widget.stop)
    assert not widget.stop.isEnabled()
    assert widget.start.isEnabled()
    assert port.calls[-1] == ("stop recording",)


def test_start_stays_disabled_until_the_file_is_closed(qtbot, widget, port):
    click(qtbot, widget.start)
    port.stop_recording = lambda: None  # closing takes its time
    click(qtbot, widget.stop)
    assert not widget.start.isEnabled()
    port.change(recording=replace(port.recording, active=False))
    qtbot.waitUntil(widget.start.isEnabled, timeout=2000)


def test_a_file_that_could_not_be_closed_well_is_reported(qtbot, widget, port):
    click(qtbot, widget.start)
    port.fail_close = "disk full: the last 0.5 s are missing"
    click(qtbot, widget.stop)
    assert "disk full" in widget.message.text()
    assert widget.badge.state is State.ERROR


def test_a_start_that_is_refused_enables_start_again_and_says_why(qtbot, widget, port):
    port.refuse = "the disk is full"
    click(qtbot, widget.start)
    assert widget.start.isEnabled()
    assert not widget.stop.isEnabled()
    assert "the disk is full" in widget.message.text()


def test_an_existing_file_is_overwritten_only_after_a_question(qtbot, widget, port):
    choose(qtbot, widget, "Don't append")
    (port.directory / "recording.h5").write_bytes(b"precious")
    click(qtbot, widget.start)
    assert "recording.h5 exists already" in question(widget).text()
    assert not widget.start.isEnabled()
    answer(qtbot, widget, "Cancel")
    assert port.calls == []
    assert widget.start.isEnabled()
    qtbot.waitUntil(lambda: question(widget) is None)
    click(qtbot, widget.start)
    answer(qtbot, widget, "Overwrite")
    assert port.calls == [("record", port.directory / "recording.h5", True)]
    assert widget.stop.isEnabled()


def test_escape_does_not_overwrite(qtbot, widget, port):
    choose(qtbot, widget, "Don't append")
    (port.directory / "recording.h5").write_bytes(b"precious")
    click(qtbot, widget.start)
    qtbot.keyClick(question(widget), Qt.Key.Key_Escape)
    assert port.calls == []
    assert (port.directory / "recording.h5").read_bytes() == b"precious"


def test_numbers_go_on_after_the_highest_there_is(qtbot, widget, port):
    choose(qtbot, widget, "Append with number")
    for name in ("recording_002.h5", "recording_041.h5", "other_099.h5", "recording_x.h5"):
        (port.directory / name).touch()
    click(qtbot, widget.start)
    assert port.calls[0][1].name == "recording_042.h5"


@pytest.mark.parametrize(
    "name", ["", " ", ".h5", "a/b", "a\\b", "..", ".hidden", "what?", "con", "x" * 250, "a\x00b"]
)
def test_a_name_that_is_none_is_refused_at_its_field(qtbot, widget, port, name):
    widget.base.setText(name)
    widget.base.textEdited.emit(name)
    assert not widget.start.isEnabled()
    assert widget.start.toolTip() == name_problem(name) != ""
    assert widget.base.property("refused")
    assert widget.base.text() == name.replace("\x00", widget.base.text()[1:2])


def test_a_directory_that_is_not_there_is_refused_at_its_field(qtbot, widget, port):
    write(qtbot, widget.directory, str(port.directory / "missing"))
    assert not widget.start.isEnabled()
    assert "does not exist" in widget.start.toolTip()
    assert widget.directory.property("refused")
    (port.directory / "missing").mkdir()
    qtbot.waitUntil(widget.start.isEnabled, timeout=2000)


def test_nothing_can_be_recorded_while_nothing_is_acquired(qtbot, widget, port):
    port.change(running=False)
    qtbot.waitUntil(lambda: not widget.start.isEnabled())
    assert "start the acquisition" in widget.start.toolTip()


def test_time_left_on_the_disk_is_reported_for_the_channels_and_rate_in_force(qtbot, widget, port):
    port.free = 2 * 1000 * 8 * 7200  # two channels, 1 kHz, 8 bytes
    widget.refresh()
    assert "2 h 00 min" in widget.room.text()
    port.free = 1000
    widget.refresh()
    assert "little room" in widget.room.text()


def test_a_writer_that_falls_behind_is_reported(qtbot, widget, port):
    port.counters = Counted(backlog=2500)
    port.change(recording=Recorded(active=True, path=port.directory / "x.h5"))
    qtbot.waitUntil(lambda: "2.5 s behind" in widget.message.text())


def test_length_and_size_of_the_recording_are_reported(qtbot, widget, port):
    path = port.directory / "x.h5"
    recording = Recorded(active=True, path=path, duration_s=72.0, size_bytes=12_300_000)
    port.change(recording=recording)
    qtbot.waitUntil(lambda: "1 min 12 s, 12.3 MB" in widget.message.text())


def test_a_recording_that_broke_off_by_itself_is_reported(qtbot, widget, port):
    port.change(recording=Recorded(path=port.directory / "x.h5", failure="the disk is full"))
    qtbot.waitUntil(lambda: "the disk is full" in widget.message.text())
    assert widget.start.isEnabled()


def test_a_widget_that_goes_stops_listening(qtbot, port):
    made = UDaqFileWidget(port)
    assert port.listened == 1
    made.deleteLater()
    qtbot.waitUntil(lambda: port.listened == 0)
