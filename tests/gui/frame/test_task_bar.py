"""The line for something that takes a while."""

import pytest
from PySide6.QtCore import QEvent, Qt

from cosmic.frame.errors import ConfigError
from cosmic.frame.gui.task_bar import TaskBar
from cosmic.frame.operation import Task

LEFT = Qt.MouseButton.LeftButton


@pytest.fixture
def bar(qtbot):
    made = TaskBar()
    qtbot.addWidget(made)
    made.show()
    return made


@pytest.fixture
def closable(qtbot):
    made = TaskBar(cancel_tip="End the export", closable=True)
    qtbot.addWidget(made)
    return made


def test_it_says_how_far_a_task_is_and_how_it_ended(qtbot, bar):
    task = Task("Homing")
    bar.follow(task)
    task.report(0.4, "zoom")
    assert bar.text.text().startswith("Homing: zoom, ")
    assert bar.text.text().endswith(" s left")
    assert (bar.bar.value(), bar.bar.isVisible()) == (400, True)
    with qtbot.waitSignal(bar.ended):
        task.finish()
    assert bar.text.text() == "Homing: zoom"
    assert not bar.cancel.isVisible()


def test_a_failure_is_reported_with_its_reason(bar):
    task = Task("Homing")
    bar.follow(task)
    task.fail(ConfigError("no lens"))
    assert bar.text.text().endswith("Homing: no lens")


def test_how_it_ended_has_the_whole_width_at_the_same_height(qtbot, bar):
    bar.resize(260, bar.height())
    task = Task("Autofocus of microscope")
    bar.follow(task)
    task.report(0.4, "searching")
    qtbot.waitUntil(lambda: bar.text.width() < 160)
    before = bar.sizeHint().height()
    task.fail(ConfigError("cancelled"))
    qtbot.waitUntil(lambda: bar.text.width() == bar.width())
    assert bar.sizeHint().height() <= bar.minimumHeight() == before


def test_in_a_narrow_column_it_says_how_a_task_ended(qtbot, bar):
    bar.resize(140, bar.height())
    task = Task("Saving microscope_2026-11-29_14-10-36-326.png")
    bar.follow(task)
    task.finish()
    qtbot.waitUntil(lambda: bar.text.shown_text == "done")
    assert bar.text.text() == f"{task.title}: done"


def test_of_an_older_task_nothing_is_shown_any_more(bar):
    first, second = Task("First"), Task("Second")
    bar.follow(first)
    bar.follow(second)
    first.finish()
    assert bar.text.text().startswith("Second")
    assert bar.cancel.isVisible()


def test_the_button_ends_the_task(qtbot, bar):
    task = Task("Homing")
    bar.follow(task)
    qtbot.mouseClick(bar.cancel, LEFT)
    assert task.cancel_requested
    assert bar.isVisible()


def test_one_that_can_be_closed_stays_away_until_there_is_something_to_say(qtbot, closable):
    assert closable.isHidden()
    closable.say("no such file", refused=True)
    assert closable.isVisible()
    assert (closable.cancel.text(), closable.text.text()[-12:]) == ("Close", "no such file")
    task = Task("Export")
    closable.follow(task)
    assert closable.cancel.text() == "Cancel"
    task.finish()
    assert (closable.text.text(), closable.cancel.text()) == ("Export: done", "Close")
    qtbot.mouseClick(closable.cancel, LEFT)
    assert closable.isHidden()
    assert not task.cancel_requested


def test_a_task_may_outlive_the_bar(qapp):
    bar, task = TaskBar(), Task("Long")
    bar.follow(task)
    bar.deleteLater()
    qapp.sendPostedEvents(bar, QEvent.Type.DeferredDelete.value)
    task.finish()
