import gc
import logging
from collections.abc import Iterator

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QApplication, QLineEdit, QPlainTextEdit, QTableView
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
