import gc
import logging
from collections.abc import Iterator

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QApplication, QLineEdit, QPlainTextEdit, QPushButton, QTableView
from pytestqt.qtbot import QtBot

from cosmic.frame.failure import FailurePolicy
from cosmic.frame.gui.log_panel import LogPanel
from cosmic.frame.log import RingBufferHandler
from cosmic.frame.threads import WorkerThread


@pytest.fixture
def ring() -> RingBufferHandler:
    return RingBufferHandler()


@pytest.fixture
def log(ring: RingBufferHandler) -> Iterator[logging.Logger]:
    logger = logging.getLogger("cosmic.test_log_panel")
    logger.addHandler(ring)
    logger.setLevel(logging.DEBUG)
    logger.propagate = False
    yield logger
    logger.removeHandler(ring)


@pytest.fixture
def panel(qtbot: QtBot, ring: RingBufferHandler, log: logging.Logger) -> LogPanel:
    log.info("before the window")
    panel = LogPanel(ring, capacity=200)
    panel.resize(800, 200)
    qtbot.addWidget(panel)
    panel.show()
    return panel


def ends(panel: LogPanel) -> list[str]:
    return [line.split(": ", 1)[1] for line in panel.lines()]


def table(panel: LogPanel) -> QTableView:
    return panel.findChildren(QTableView)[0]


def test_old_and_new_records_are_shown_once_newest_last(
    qtbot: QtBot, panel: LogPanel, log: logging.Logger
) -> None:
    log.info("first")
    log.warning("second")
    qtbot.waitUntil(lambda: ends(panel) == ["before the window", "first", "second"])


def test_units_are_read_with_a_micro_sign_and_found_without(
    qtbot: QtBot, panel: LogPanel, log: logging.Logger
) -> None:
    log.info("left X: jog right, 200 um/s")
    log.info("force: its limit is %g uN", 140.0)
    said = ["left X: jog right, 200 µm/s", "force: its limit is 140 µN"]
    qtbot.waitUntil(lambda: ends(panel)[1:] == said)
    panel.set_search("140 uN")
    assert ends(panel) == said[1:]


def test_the_level_and_the_text_narrow_what_is_shown(
    qtbot: QtBot, panel: LogPanel, log: logging.Logger
) -> None:
    for level in (logging.INFO, logging.WARNING, logging.ERROR):
        log.log(level, "Left.x at level %d", level)
    qtbot.waitUntil(lambda: len(ends(panel)) == 4)
    panel.set_level(logging.WARNING)
    assert ends(panel) == ["Left.x at level 30", "Left.x at level 40"]
    panel.set_search("LEVEL 40")
    assert ends(panel) == ["Left.x at level 40"]
    panel.set_level(logging.NOTSET)
    panel.set_search("before")
    assert ends(panel) == ["before the window"]


def test_escape_empties_the_search(qtbot: QtBot, panel: LogPanel) -> None:
    line = panel.findChildren(QLineEdit)[-1]
    qtbot.keyClicks(line, "nothing has this")
    assert ends(panel) == []
    qtbot.keyClick(line, Qt.Key.Key_Escape)
    assert ends(panel) == ["before the window"]


class Chatter(WorkerThread):
    """Logs a flood from a thread of its own."""

    def __init__(self, log: logging.Logger, policy: FailurePolicy) -> None:
        super().__init__("chatter", policy)
        self._log = log

    def run_body(self) -> None:
        for number in range(3000):
            self._log.info("%s %d", self.name, number)


def test_a_flood_from_other_threads_is_taken_in_few_steps_and_bounded(
    qtbot: QtBot, panel: LogPanel, log: logging.Logger
) -> None:
    steps: list[int] = []
    table(panel).model().rowsInserted.connect(lambda *_: steps.append(1))
    threads = [Chatter(log, FailurePolicy()) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        assert thread.join()
    qtbot.waitUntil(lambda: ends(panel)[-1] == "chatter 2999")
    assert len(ends(panel)) == 200
    assert len(steps) < 30


def test_it_follows_the_newest_unless_scrolled_up(
    qtbot: QtBot, panel: LogPanel, log: logging.Logger
) -> None:
    def write(count: int) -> None:
        before = len(ends(panel))
        for number in range(count):
            log.info("line %d", number)
        qtbot.waitUntil(lambda: len(ends(panel)) == before + count)

    write(50)
    assert panel.follows()
    bar = table(panel).verticalScrollBar()
    bar.setValue(3)
    write(50)
    assert bar.value() == 3
    assert not panel.follows()


def test_the_whole_story_of_a_failure_is_shown_and_copied(
    qtbot: QtBot, panel: LogPanel, log: logging.Logger
) -> None:
    try:
        raise OSError("cable pulled")
    except OSError:
        log.exception("device 1 is gone")
    qtbot.waitUntil(lambda: len(ends(panel)) == 2)
    details = panel.findChildren(QPlainTextEdit)[0]
    assert not details.isVisible()
    table(panel).selectRow(1)
    assert "OSError: cable pulled" in details.toPlainText()
    assert details.isVisible()
    panel.copy()
    copied = QApplication.clipboard().text()
    assert "device 1 is gone" in copied
    assert "Traceback" in copied
    assert "before the window" not in copied


def test_records_that_come_after_the_panel_is_gone_meet_nobody(
    qtbot: QtBot, ring: RingBufferHandler, log: logging.Logger
) -> None:
    panel = LogPanel(ring)
    with qtbot.waitSignal(panel.destroyed):
        panel.deleteLater()
    del panel
    gc.collect()
    log.info("late")
    assert ring._listeners == ()


def at_end(panel: LogPanel) -> bool:
    """Tell whether the newest record is really in view."""
    view = table(panel)
    last = view.model().index(view.model().rowCount() - 1, 0)
    return view.viewport().rect().contains(view.visualRect(last).center())


def newest(panel: LogPanel) -> QPushButton:
    return panel.findChildren(QPushButton)[0]


def fill(qtbot: QtBot, panel: LogPanel, log: logging.Logger, count: int, name: str = "x") -> None:
    for number in range(count):
        log.info("%s %d", name, number)
    qtbot.waitUntil(lambda: ends(panel)[-1:] == [f"{name} {count - 1}"])


def test_it_goes_on_following_when_the_panel_becomes_lower_or_was_hidden(
    qtbot: QtBot, panel: LogPanel, log: logging.Logger
) -> None:
    fill(qtbot, panel, log, 60)
    panel.resize(800, 130)
    QApplication.processEvents()
    assert panel.follows()
    assert at_end(panel)
    fill(qtbot, panel, log, 30, "y")
    assert at_end(panel)
    panel.hide()
    fill(qtbot, panel, log, 50, "z")
    panel.show()
    panel.resize(800, 300)
    fill(qtbot, panel, log, 5, "after")
    assert panel.follows()
    assert at_end(panel)


def test_it_follows_after_thousands_of_lines_with_a_filter(
    qtbot: QtBot, panel: LogPanel, log: logging.Logger
) -> None:
    panel.set_search("kept")
    for block in range(5):
        for number in range(600):
            log.info("%s %d", "kept" if number % 3 else "other", number)
        fill(qtbot, panel, log, 1, f"kept {block}")
        assert panel.follows()
        assert at_end(panel)


def test_scrolled_up_it_keeps_the_line_and_says_how_many_are_new(
    qtbot: QtBot, panel: LogPanel, log: logging.Logger
) -> None:
    fill(qtbot, panel, log, 180)
    view = table(panel)
    view.verticalScrollBar().setValue(100)
    seen = view.indexAt(view.viewport().rect().topLeft()).siblingAtColumn(3).data()
    assert not panel.follows()
    fill(qtbot, panel, log, 40, "more")  # beyond the capacity: the oldest go
    qtbot.waitUntil(lambda: newest(panel).text() == "40 new")
    assert view.indexAt(view.viewport().rect().topLeft()).siblingAtColumn(3).data() == seen
    qtbot.mouseClick(newest(panel), Qt.MouseButton.LeftButton)
    assert at_end(panel)
    assert newest(panel).text() == "Newest"
    assert not newest(panel).isEnabled()


def test_only_those_that_pass_the_filter_count_as_new(
    qtbot: QtBot, panel: LogPanel, log: logging.Logger
) -> None:
    fill(qtbot, panel, log, 100, "kept")
    panel.set_search("kept")
    table(panel).verticalScrollBar().setValue(20)
    for number in range(10):
        log.info("%s %d", "kept" if number % 2 else "other", number)
    qtbot.waitUntil(lambda: newest(panel).text() == "5 new")
