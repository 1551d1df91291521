"""The newest log records as a table, and what of them is shown."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from PySide6.QtCore import (
    QAbstractTableModel,
    QDateTime,
    QModelIndex,
    QObject,
    QPersistentModelIndex,
    QSortFilterProxyModel,
    Qt,
)
from PySide6.QtGui import QColor

from cosmic.frame.gui.palette import INK
from cosmic.frame.gui.theme import State, current_palette, state_look
from cosmic.frame.overrides import override
from cosmic.frame.units import with_micro_signs

Index = QModelIndex | QPersistentModelIndex
Role = Qt.ItemDataRole

HEADERS: Final = ("Time", "Level", "Where", "Message")
TIME, LEVEL, WHERE, MESSAGE = range(4)
_NOWHERE: Final = QModelIndex()
_TRACE: Final = logging.Formatter()


@dataclass(frozen=True, slots=True)
class LogEntry:
    """One record as text; keeps no exception alive."""

    time: str
    level: int
    where: str
    message: str
    details: str

    @classmethod
    def of(cls, record: logging.LogRecord) -> "LogEntry":
        """Take what is shown out of `record`."""
        text = with_micro_signs(record.getMessage())
        trace = record.exc_text or ""
        if record.exc_info and not trace:
            trace = _TRACE.formatException(record.exc_info)
        when = QDateTime.fromMSecsSinceEpoch(int(record.created * 1000))
        return cls(
            time=when.toString("HH:mm:ss.zzz"),
            level=record.levelno,
            where=record.name.removeprefix("cosmic."),
            message=text.splitlines()[0] if text else "",
            details="\n".join(part for part in (text, trace) if part),
        )

    @property
    def level_name(self) -> str:
        """The level as a word."""
        return logging.getLevelName(self.level)

    def as_line(self) -> str:
        """Return the whole entry as text, for the clipboard."""
        return f"{self.time} {self.level_name:<8} {self.where}: {self.details}"


class LogModel(QAbstractTableModel):
    """Holds the newest `capacity` entries, oldest first; GUI thread."""

    def __init__(self, capacity: int, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._capacity = capacity
        self._entries: list[LogEntry] = []

    def append(self, entries: Sequence[LogEntry]) -> None:
        """Add `entries`, dropping the oldest beyond the capacity."""
        new = list(entries)[-self._capacity :]
        if not new:
            return
        surplus = len(self._entries) + len(new) - self._capacity
        if surplus > 0:
            self.beginRemoveRows(QModelIndex(), 0, surplus - 1)
            del self._entries[:surplus]
            self.endRemoveRows()
        first = len(self._entries)
        self.beginInsertRows(QModelIndex(), first, first + len(new) - 1)
        self._entries.extend(new)
        self.endInsertRows()

    def clear(self) -> None:
        """Forget all entries."""
        self.beginResetModel()
        self._entries.clear()
        self.endResetModel()

    def entry(self, row: int) -> LogEntry:
        """Return the entry in `row`."""
        return self._entries[row]

    @override
    def rowCount(self, parent: Index = _NOWHERE) -> int:
        return 0 if parent.isValid() else len(self._entries)

    @override
    def columnCount(self, parent: Index = _NOWHERE) -> int:
        return 0 if parent.isValid() else len(HEADERS)

    @override
    def headerData(
        self, section: int, orientation: Qt.Orientation, role: int = Role.DisplayRole
    ) -> object:
        if orientation == Qt.Orientation.Horizontal and role == Role.DisplayRole:
            return HEADERS[section]
        return None

    @override
    def data(self, index: Index, role: int = Role.DisplayRole) -> object:
        entry = self._entries[index.row()]
        if role == Role.DisplayRole:
            return _text(entry, index.column())
        if role == Role.ToolTipRole:
            return entry.details
        if role == Role.BackgroundRole and index.column() == LEVEL:
            state = _state(entry.level)
            return QColor(state_look(state).colour) if state else None
        if role == Role.ForegroundRole:
            return _ink(entry, index.column())
        return None


class LogFilter(QSortFilterProxyModel):
    """Lets through what is at least as grave as the level and contains the text."""

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._level = logging.NOTSET
        self._text = ""

    def set_level(self, level: int) -> None:
        """Show records from `level` up."""
        self._level = level
        self.invalidate()

    def set_text(self, text: str) -> None:
        """Show records that contain `text`, in any case of letters."""
        self._text = with_micro_signs(text).casefold()
        self.invalidate()

    @override
    def filterAcceptsRow(self, source_row: int, source_parent: Index) -> bool:
        model = self.sourceModel()
        if not isinstance(model, LogModel):
            return True
        entry = model.entry(source_row)
        if entry.level < self._level:
            return False
        return not self._text or self._text in entry.as_line().casefold()


def _text(entry: LogEntry, column: int) -> str:
    state = _state(entry.level)
    level = f"{state_look(state).glyph} {entry.level_name}" if state else entry.level_name
    return (entry.time, level, entry.where, entry.message)[column]


def _ink(entry: LogEntry, column: int) -> QColor | None:
    if column == LEVEL and _state(entry.level):
        return QColor(INK)
    return QColor(current_palette().dim) if column != MESSAGE else None


def _state(level: int) -> State | None:
    if level >= logging.ERROR:
        return State.ERROR
    return State.REFUSED if level >= logging.WARNING else None
