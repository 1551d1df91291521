"""Amounts in words, numbers that are typed, widgets in lines, the question before overwriting."""

import math
from functools import partial
from pathlib import Path

import pytest
from PySide6.QtWidgets import QFileDialog, QLineEdit, QPushButton, QWidget

from cosmic.frame.errors import QuantityError
from cosmic.frame.gui.amounts import duration_text, size_text
from cosmic.frame.gui.ask_directory import ask_directory, ask_open_file, ask_save_file
from cosmic.frame.gui.flow_layout import FlowLayout
from cosmic.frame.gui.number_edit import NumberEdit, read_number
from cosmic.frame.gui.overwrite_question import overwrite_question
from cosmic.frame.gui.reason_bubble import ReasonBubble
from cosmic.frame.gui.refusal import mark_refusal, show_refusal


@pytest.mark.parametrize(
    ("duration_s", "text"),
    [
        (-1.0, "0.0 s"),
        (12.34, "12.3 s"),
        (72.0, "1 min 12 s"),
        (7500.0, "2 h 05 min"),
        (200_000.0, "2 days 7 h"),
        (math.inf, "more than 100 days"),
        (math.nan, "?"),
    ],
)
def test_a_duration_is_written_in_words(duration_s, text):
    assert duration_text(duration_s) == text


@pytest.mark.parametrize(
    ("size_bytes", "text"),
    [(0, "0 B"), (999, "999 B"), (12_340_000, "12.3 MB"), (2.5e12, "2.5 TB"), (1e16, "10000.0 TB")],
)
def test_an_amount_of_data_is_written_in_words(size_bytes, text):
    assert size_text(size_bytes) == text


@pytest.mark.parametrize(
    ("typed", "message"),
    [("", "type a number"), ("1,5", "point"), ("a", "not a number"), ("nan", "finite")],
)
def test_a_text_that_is_no_number_is_refused_with_what_to_do(typed, message):
    with pytest.raises(QuantityError, match=message):
        read_number(typed)


def test_a_typed_number_may_have_a_real_minus_sign():
    assert read_number(" −2.5e1 ") == -25.0


def test_a_refusal_stands_at_its_field_until_it_is_taken_back(qtbot):
    window = QWidget()
    qtbot.addWidget(window)
    field = NumberEdit("Force", "µN", window)
    field.refuse("too much")
    assert (field.reason, field.property("refused")) == ("too much", True)
    field.refuse("")
    assert (field.reason, field.property("refused")) == ("", False)


def test_a_note_that_was_clicked_away_comes_back_only_where_it_is_asked_for(qtbot):
    window = QWidget()
    qtbot.addWidget(window)
    field = QLineEdit(window)
    window.show()
    mark_refusal(field, "no")
    note = ReasonBubble.of(field)
    assert note.isVisible()
    note.dismiss()
    mark_refusal(field, "no")
    assert not note.isVisible()
    show_refusal(field, "no")
    assert note.isVisible()


def test_a_note_is_read_as_a_whole_in_a_short_dialog(qtbot):
    window = QWidget()
    qtbot.addWidget(window)
    window.resize(220, 100)
    field = QLineEdit(window)
    field.move(100, 20)
    window.show()
    show_refusal(field, "'0,04 mN' is not a number, and what is said of it takes three lines here")
    note = ReasonBubble.of(field)
    assert note.isVisible()
    assert window.rect().contains(note.geometry())


def test_widgets_go_on_in_a_new_line_where_it_is_narrow(qtbot):
    window = QWidget()
    qtbot.addWidget(window)
    flow = FlowLayout(4, window)
    for _ in range(3):
        box = QWidget()
        box.setFixedSize(100, 20)
        flow.addWidget(box)
    assert [flow.heightForWidth(width) for width in (308, 307, 100)] == [20, 44, 68]
    assert flow.minimumSize().width() == 100


def test_a_file_is_overwritten_on_the_word_only(qtbot, tmp_path):
    parent, done = QWidget(), []
    qtbot.addWidget(parent)
    box = overwrite_question(parent, tmp_path / "a.h5", lambda: done.append("over"), 2000)
    assert "a.h5 exists already (2.0 kB)" in box.text()
    assert box.defaultButton() is box.escapeButton()
    box.open()
    box.reject()
    assert done == []
    box = overwrite_question(parent, tmp_path / "a.h5", lambda: done.append("over"))
    assert box.text() == "a.h5 exists already."
    box.open()
    next(each for each in box.findChildren(QPushButton) if each.text() == "Overwrite").click()
    assert done == ["over"]


def test_a_file_to_write_gets_its_ending_before_the_dialog_asks_about_it(qtbot, tmp_path):
    parent, found = QWidget(), []
    qtbot.addWidget(parent)
    dialog = ask_save_file(
        parent,
        "Save",
        str(tmp_path / "a.toml"),
        files="Procedures (*.toml)",
        suffix=".toml",
        chosen=found.append,
    )
    dialog.selectFile("mine")
    dialog.accept()
    assert found == [str(tmp_path / "mine.toml")]


@pytest.mark.parametrize("ask", [ask_directory, partial(ask_open_file, files="Recipes (*.toml)")])
def test_a_dialog_opens_at_the_nearest_folder_there_is(qtbot, tmp_path, ask):
    parent = QWidget()
    qtbot.addWidget(parent)
    ask(parent, "Where", str(tmp_path / "campaigns" / "new"), chosen=print)
    dialog = parent.findChild(QFileDialog)
    assert Path(dialog.directory().absolutePath()) == tmp_path
    assert dialog.findChild(QLineEdit).text() == ""
    dialog.reject()
