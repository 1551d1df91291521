"""The list of alarms: when, why, what to do, and whether somebody has seen it."""

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import datetime
from enum import StrEnum
from typing import Final

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtWidgets import QHBoxLayout, QTreeWidget, QTreeWidgetItem, QVBoxLayout, QWidget

from cosmic.frame.gui.build import named, push_button
from cosmic.frame.gui.theme import STEP_PX, State, state_look
from cosmic.frame.units import with_micro_signs

logger = logging.getLogger(__name__)

MOST: Final = 200
HEADS: Final = ("Time", "Level", "Cause", "What to do", "Seen")


class Level(StrEnum):
    """How grave it is; the value is the word."""

    WARNING = "warning"
    CRITICAL = "critical"


@dataclass(frozen=True, slots=True)
class Alarm:
    """One alarm.

    Attributes
    ----------
    source : str
        What it is about; a source has one alarm at a time that was not seen.
    cause : str
        The true cause, first.
    advice : str
        What to do.
    lasts : bool
        It is so still.
    """

    source: str
    level: Level
    cause: str
    advice: str
    when: datetime
    lasts: bool = True
    seen: bool = False


class AlarmBook(QObject):
    """Keeps the alarms of one window; GUI thread.

    Parameters
    ----------
    now : callable
        Returns the local time.

    Signals
    -------
    changed()
        There is another one, or one was seen or is over.
    """

    changed = Signal()

    def __init__(
        self, parent: QObject | None = None, *, now: Callable[[], datetime] = datetime.now
    ) -> None:
        super().__init__(parent)
        self._now = now
        self._alarms: list[Alarm] = []

    @property
    def alarms(self) -> tuple[Alarm, ...]:
        """All of them, newest first."""
        return tuple(reversed(self._alarms))

    @property
    def unseen(self) -> tuple[Alarm, ...]:
        """Those that nobody has acknowledged, newest first."""
        return tuple(each for each in self.alarms if not each.seen)

    def raise_alarm(self, source: str, level: Level, cause: str, advice: str = "") -> None:
        """Add an alarm; the same cause of the same source that still lasts is one alarm."""
        last = next((each for each in self.alarms if each.source == source), None)
        if last is not None and last.lasts and last.cause == cause:
            return
        self.end(source)
        self._alarms.append(Alarm(source, level, cause, advice, self._now()))
        grave = logging.ERROR if level is Level.CRITICAL else logging.WARNING
        logger.log(grave, "Alarm, %s: %s. %s.", level, cause.rstrip("."), advice.rstrip("."))
        del self._alarms[:-MOST]
        self.changed.emit()

    def end(self, source: str) -> None:
        """Note that what a source raised is over; it stays in the list until it was seen."""
        self._change(lambda each: replace(each, lasts=False) if each.source == source else each)

    def acknowledge(self, index: int | None = None) -> None:
        """Note that somebody has seen one alarm, by its place in `alarms`, or all of them."""
        chosen = self.alarms if index is None else self.alarms[index : index + 1]
        for each in chosen:
            if not each.seen:
                logger.info("Alarm acknowledged: %s.", each.cause.rstrip("."))
        self._change(
            lambda each: replace(each, seen=True) if any(each is one for one in chosen) else each
        )

    def _change(self, change: Callable[[Alarm], Alarm]) -> None:
        changed = [change(each) for each in self._alarms]
        if changed != self._alarms:
            self._alarms = changed
            self.changed.emit()


class AlarmPanel(QWidget):
    """Shows the book, newest first, and lets alarms be acknowledged."""

    def __init__(self, book: AlarmBook, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._book, self._shown = book, tuple[Alarm, ...]()
        self.list = named(QTreeWidget(), "alarmList")
        self.list.setHeaderLabels(list(HEADS))
        self.list.setRootIsDecorated(False)
        self.list.setWordWrap(True)
        self.one = named(push_button("Acknowledge", "Note that the chosen one was seen"), "ackOne")
        self.all = named(push_button("Acknowledge all", "Note that all were seen"), "ackAll")
        self.one.clicked.connect(self._on_one)
        self.all.clicked.connect(lambda: book.acknowledge())
        row = QHBoxLayout()
        row.addWidget(self.one)
        row.addWidget(self.all)
        row.addStretch(1)
        column = QVBoxLayout(self)
        column.setContentsMargins(STEP_PX, STEP_PX // 2, STEP_PX, STEP_PX // 2)
        column.setSpacing(STEP_PX // 2)
        column.addWidget(self.list, 1)
        column.addLayout(row)
        book.changed.connect(self.refresh)
        self.refresh()

    def refresh(self) -> None:
        """Show the alarms there are now; the chosen one stays chosen."""
        chosen = self._chosen
        self.list.clear()
        self._shown = self._book.alarms
        for each in self._book.alarms:
            state = State.ERROR if each.level is Level.CRITICAL else State.REFUSED
            word = f"{state_look(state).glyph} {each.level}" + ("" if each.lasts else ", over")
            seen = "yes" if each.seen else "no"
            cause, advice = with_micro_signs(each.cause), with_micro_signs(each.advice)
            item = QTreeWidgetItem([f"{each.when:%H:%M:%S}", word, cause, advice, seen])
            for column in range(len(HEADS)):
                item.setToolTip(column, item.text(column))
            if each.seen:
                item.setFlags(item.flags() & ~Qt.ItemFlag.ItemIsEnabled)
            self.list.addTopLevelItem(item)
            if chosen is not None and (each.source, each.when) == (chosen.source, chosen.when):
                self.list.setCurrentItem(item)
        for column, width in enumerate((9, 14, 46, 46, 6)):
            self.list.setColumnWidth(column, width * STEP_PX)
        self.one.setEnabled(bool(self._book.unseen))
        self.all.setEnabled(bool(self._book.unseen))

    @property
    def _chosen(self) -> Alarm | None:
        """The alarm whose line is chosen."""
        item: QTreeWidgetItem | None = self.list.currentItem()
        row = self.list.indexOfTopLevelItem(item) if item is not None else -1
        return self._shown[row] if 0 <= row < len(self._shown) else None

    def _on_one(self) -> None:
        """Acknowledge the chosen one; the newest where none is chosen that nobody has seen."""
        chosen, unseen = self._chosen, self._book.unseen
        if unseen:
            one = chosen if chosen in unseen else unseen[0]
            self._book.acknowledge(self._book.alarms.index(one))
