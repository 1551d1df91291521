"""The first day: the window says what is missing and what to press, down to the first click."""

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from cosmic.app.panels.first_day import DayStep, FirstDayPanel, Standing
from cosmic.frame.errors import NotAvailable
from cosmic.frame.gui.theme import State
from gui.app.windows import Make

LEFT = Qt.MouseButton.LeftButton


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
