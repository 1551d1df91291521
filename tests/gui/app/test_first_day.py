"""The first day: the window says what is missing and what to press, down to the first click."""

import shutil
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from cosmic.app.panels.first_day import DayStep, FirstDayPanel, FirstDaySteps, Standing
from cosmic.app.rig import Rig
from cosmic.frame.config import shipped_config_dir
from cosmic.frame.errors import NotAvailable
from cosmic.frame.gui.theme import State
from gui.app.windows import Make, drive, mico, wait_until_ready

LEFT = Qt.MouseButton.LeftButton
ONE_AXIS = """\
[platform]
name = "New"
applications = ["mico"]
scene = ""

[mico]
backend = "simulated"

[[mico.positioner]]
name = "left.x"
device = 0
channel = 0
kind = "linear"
limits_um = [-5500.0, 5500.0]
"""


def test_a_step_says_how_far_it_is_and_its_button_carries_it_out(qtbot: QtBot) -> None:
    done: list[str] = []

    def look() -> Standing:
        return Standing(State.OK, "done") if done else Standing(State.REFUSED, "missing", "Do it")

    def fail() -> None:
        raise NotAvailable("the lens is away")

    panel = FirstDayPanel(
        (
            DayStep("First", look, lambda: done.append("it")),
            DayStep("Second", lambda: Standing(State.REFUSED, "no lens", "Home"), fail),
            DayStep("Third", lambda: Standing(State.BUSY, "looking", "Wait"), fail),
        )
    )
    qtbot.addWidget(panel)
    panel.show()
    first, second, third = panel.rows.values()
    assert (first.badge.state, first.text.text()) == (State.REFUSED, "missing")
    assert not third.button.isEnabled()
    qtbot.mouseClick(first.button, LEFT)
    assert (first.badge.state, first.text.text()) == (State.OK, "done")
    assert not first.button.isVisible()
    qtbot.mouseClick(second.button, LEFT)
    assert "the lens is away" in panel.message.text()


def test_no_line_moves_when_a_button_goes(qtbot: QtBot) -> None:
    done: list[str] = []

    def look() -> Standing:
        return Standing(State.OK, "done") if done else Standing(State.UNKNOWN, "not", "A long word")

    panel = FirstDayPanel(
        (
            DayStep("First", look, lambda: done.append("it")),
            DayStep("Second", lambda: Standing(State.OK, "done", "Again"), lambda: None),
        )
    )
    qtbot.addWidget(panel)
    panel.show()
    QApplication.processEvents()
    second = panel.rows["Second"].button
    before = second.geometry()
    qtbot.mouseClick(panel.rows["First"].button, LEFT)
    QApplication.processEvents()
    assert not panel.rows["First"].button.isVisible()
    assert second.geometry() == before


def test_what_runs_is_cancelled_by_the_button_of_its_line(qtbot: QtBot) -> None:
    running = ["it"]

    def look() -> Standing:
        if running:
            return Standing(State.BUSY, "position 3 of 9")
        return Standing(State.UNKNOWN, "not yet", "Begin")

    step = DayStep("First", look, lambda: "begun", cancel=running.clear)
    panel = FirstDayPanel((step,))
    qtbot.addWidget(panel)
    panel.show()
    (row,) = panel.rows.values()
    assert (row.button.text(), row.button.isEnabled()) == ("Cancel", True)
    qtbot.mouseClick(row.button, LEFT)
    assert not running
    assert (row.badge.state, row.button.text()) == (State.UNKNOWN, "Begin")
    qtbot.mouseClick(row.button, LEFT)
    assert panel.message.text() == "begun"


def test_the_focus_goes_to_no_other_button_when_one_is_done(qtbot: QtBot) -> None:
    done: list[str] = []

    def look() -> Standing:
        return Standing(State.OK, "known") if done else Standing(State.UNKNOWN, "not", "Initialise")

    panel = FirstDayPanel(
        (
            DayStep("First", look, lambda: done.append("initialised")),
            DayStep("Second", lambda: Standing(State.OK, "known", "Calibrate"), pytest.fail),
        )
    )
    qtbot.addWidget(panel)
    panel.show()
    panel.activateWindow()
    first = panel.rows["First"].button
    first.setFocus()
    qtbot.waitUntil(first.hasFocus)
    qtbot.keyClick(first, Qt.Key.Key_Space)
    assert done == ["initialised"]
    assert not panel.rows["Second"].button.hasFocus()
    qtbot.keyClick(panel.focusWidget() or panel, Qt.Key.Key_Space)


def test_the_line_of_positions_says_that_they_are_being_found_and_cancels_that(
    make: Make, qtbot: QtBot
) -> None:
    window = make(applications=("mico", "daqco", "vico"), cold=True, rate=1.0)
    window.raise_panel("First day")
    tasks = window.tasks
    assert tasks is not None
    row = tasks.first_day.rows["Positions"]
    qtbot.waitUntil(lambda: row.button.text() == "Initialise")
    qtbot.mouseClick(row.button, LEFT)
    question = mico(window).caution
    assert question is not None
    qtbot.mouseClick(question.go, LEFT)
    qtbot.waitUntil(lambda: row.badge.state is State.BUSY)
    qtbot.waitUntil(lambda: "referencing" in row.text.text())
    qtbot.mouseClick(tasks.first_day.rows["Devices"].button, LEFT)
    assert "Initialisation is running" in tasks.first_day.message.text()
    assert row.button.text() == "Cancel"
    qtbot.mouseClick(row.button, LEFT)
    qtbot.waitUntil(lambda: row.button.text() == "Initialise", timeout=10_000)
    assert row.badge.state is State.UNKNOWN


def test_axes_that_nobody_has_named_do_not_count_as_missing(
    make: Make, qtbot: QtBot, tmp_path: Path
) -> None:
    shutil.copytree(shipped_config_dir(), tmp_path, dirs_exist_ok=True)
    (tmp_path / "platform.toml").write_text(ONE_AXIS, encoding="utf-8")
    window = make(config=tmp_path, applications=("mico",))
    steps = FirstDaySteps(
        Rig(window.platform),
        mico(window),
        configured=("left.x",),
        force=False,
        tool=str,
        camera=pytest.fail,
        folder=lambda: tmp_path,
        click=lambda: None,
    )
    qtbot.waitUntil(lambda: steps.devices().state is not State.BUSY)
    assert steps.devices() == Standing(State.OK, "1 axes answer", "Rescan")
    assert "device0.channel1" in steps.names().text
    assert "paste" in steps.copy_entries()
    copied = QApplication.clipboard().text()
    assert 'name = "device0.channel1"' in copied
    assert "was not read" in copied, "nobody has read where it stands"


def test_a_failure_of_before_is_not_shown_as_what_is_missing_now(make: Make, qtbot: QtBot) -> None:
    window = make(applications=("mico", "daqco", "vico"), cold=True)
    window.raise_panel("First day")
    tasks = window.tasks
    assert tasks is not None
    rows = tasks.first_day.rows
    qtbot.waitUntil(lambda: "the zoom is not known" in rows["Scale and rotation"].text.text())
    qtbot.mouseClick(rows["Scale and rotation"].button, LEFT)
    qtbot.waitUntil(lambda: "The last calibration failed" in rows["Scale and rotation"].text.text())
    qtbot.mouseClick(rows["Know your stage"].button, LEFT)
    qtbot.waitUntil(lambda: "The last check failed" in rows["Know your stage"].text.text())
    qtbot.mouseClick(rows["Lens"].button, LEFT)
    qtbot.waitUntil(lambda: rows["Lens"].badge.state is State.OK, timeout=30_000)

    def missing() -> str:
        return rows["Scale and rotation"].text.text().partition("The last")[0]

    qtbot.waitUntil(lambda: "zoom is not known" not in missing())
    assert "close to the plate" in missing()


def test_a_cold_platform_says_what_is_missing_and_what_to_press(make: Make, qtbot: QtBot) -> None:
    window = make(applications=("mico", "daqco", "vico"), cold=True)
    window.raise_panel("First day")
    tasks = window.tasks
    assert tasks is not None
    rows = tasks.first_day.rows
    qtbot.waitUntil(lambda: rows["Devices"].text.text() == "11 axes answer")
    assert rows["Names"].badge.state is State.OK
    qtbot.waitUntil(lambda: rows["Positions"].button.text() == "Initialise")
    assert "left.x" in rows["Positions"].text.text()
    qtbot.waitUntil(lambda: rows["Force"].badge.state is State.OK)
    assert rows["Scale and rotation"].button.text() == "Calibrate"
    assert rows["First click-to-move"].text.text() == "After scale and rotation"
    QApplication.processEvents()


def test_what_was_found_of_the_axes_is_there_at_the_next_start(
    make: Make, qtbot: QtBot, tmp_path: Path
) -> None:
    shutil.copytree(shipped_config_dir(), tmp_path, dirs_exist_ok=True)
    window = make(config=tmp_path, applications=("mico", "daqco", "vico"), rate=8.0)
    wait_until_ready(window, qtbot)
    drive(window, qtbot, "left.z", -1450.0)
    window.raise_panel("First day")
    tasks = window.tasks
    assert tasks is not None
    row = tasks.first_day.rows["Know your stage"]
    qtbot.waitUntil(lambda: row.text.text().startswith("Moves the left "))
    qtbot.mouseClick(row.button, LEFT)
    qtbot.waitUntil(lambda: row.badge.state is State.BUSY)
    qtbot.waitUntil(lambda: row.badge.state is not State.BUSY, timeout=120_000)
    assert row.badge.state is State.OK, row.text.text()
    qtbot.waitUntil(lambda: f"noted: {tmp_path / 'platform.toml'}" in row.text.text())
    window.close_now()
    again = make(config=tmp_path, applications=("mico", "daqco", "vico"), hardware=False)
    again.raise_panel("First day")
    assert again.tasks is not None
    row = again.tasks.first_day.rows["Know your stage"]
    qtbot.waitUntil(lambda: "left.x repeats within" in row.text.text())
    assert row.badge.state is State.OK


def test_the_axes_of_a_tool_with_a_tip_are_checked_whatever_is_chosen(
    make: Make, qtbot: QtBot
) -> None:
    window = make(applications=("mico", "daqco", "vico"))
    tasks = window.tasks
    assert tasks is not None
    words = tasks.first_day.rows["Know your stage"].text
    for chosen, checked in (("right", "right"), ("table", "left")):
        tasks.tool.choose(chosen)
        window.raise_panel("First day")
        qtbot.waitUntil(lambda checked=checked: f"Moves the {checked} " in words.text())
