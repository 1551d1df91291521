"""The log as the operator sees it: newest last, by level, searchable."""

import logging
import weakref
from collections import deque
from typing import Final

from PySide6.QtCore import QModelIndex, QPersistentModelIndex, QPoint, Qt, QTimer
from PySide6.QtGui import QKeyEvent, QKeySequence, QShowEvent
from PySide6.QtWidgets import (
    QAbstractItemView,
    QApplication,
    QComboBox,
    QHBoxLayout,
    QHeaderView,
    QLineEdit,
    QPlainTextEdit,
    QSplitter,
    QTableView,
    QVBoxLayout,
    QWidget,
)

from cosmic.frame.gui.build import push_button, tipped
from cosmic.frame.gui.log_model import LEVEL, MESSAGE, TIME, WHERE, LogEntry, LogFilter, LogModel
from cosmic.frame.gui.theme import STEP_PX, code_font, number_font
from cosmic.frame.log import RingBufferHandler
from cosmic.frame.overrides import override

REFRESH_MS: Final = 100
LEVELS: Final = {"Everything": logging.NOTSET, "Warnings": logging.WARNING, "Errors": logging.ERROR}


class SearchField(QLineEdit):
    """A line that narrows a list; Escape empties it."""

    @property
    def is_editing(self) -> bool:
        """True while there is something that Escape takes away."""
        return bool(self.text())

    @override
    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() == Qt.Key.Key_Escape and self.text():
            self.clear()
            event.accept()
            return
        super().keyPressEvent(event)


class LogPanel(QWidget):
    """Shows what `ring` keeps and receives; follows the newest line unless scrolled up.

    Scrolled up, it keeps what is looked at in its place and says how many came below.

    Records arrive in any thread and wait; a timer takes them over at most ten times a second,
    so that no flood of records can block the window.

    Parameters
    ----------
    ring : RingBufferHandler
        Where the records come from.
    capacity : int
        How many records are kept in the table.
    """

    def __init__(
        self, ring: RingBufferHandler, *, capacity: int = 5000, parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        self._pending: deque[logging.LogRecord] = deque(maxlen=capacity)
        # The deque outlives the widget: a record that comes late meets no deleted object.
        weakref.finalize(self, ring.subscribe(self._pending.append)).atexit = False
        self._model = LogModel(capacity, self)
        self._filter = LogFilter(self)
        self._filter.setSourceModel(self._model)
        self._make_widgets()
        self._arrange()
        # A record may come both ways: kept by the ring and told to us, until the first refresh.
        self._shown_at_start = ring.records()
        self._model.append([LogEntry.of(record) for record in self._shown_at_start])
        self.follow()
        self._timer = QTimer(self, interval=REFRESH_MS)
        self._timer.timeout.connect(self._on_timer)
        self._timer.start()

    def _make_widgets(self) -> None:
        self._levels = tipped(QComboBox(), "Show records from this level up")
        self._levels.addItems(list(LEVELS))
        self._levels.currentTextChanged.connect(self._on_level_chosen)
        self._search = tipped(SearchField(), "Show records with this text; Esc empties it")
        self._search.setPlaceholderText("Search")
        self._search.setClearButtonEnabled(True)
        self._search.textChanged.connect(self._on_search_changed)
        self._following, self._new, self._adding = True, 0, False
        self._newest = push_button("Newest", "Go to the newest record and follow it")
        self._newest.setMinimumWidth(
            self._newest.fontMetrics().horizontalAdvance("00000 new") + 3 * STEP_PX
        )
        self._newest.clicked.connect(self.follow)
        self._copy = push_button("Copy", "Copy the selected records, or all shown (Ctrl+C)")
        self._copy.clicked.connect(self.copy)
        self._view = _view(self._filter)
        bar = self._view.verticalScrollBar()
        bar.valueChanged.connect(self._on_scrolled)
        bar.rangeChanged.connect(self._on_range_changed)
        self._filter.rowsInserted.connect(self._on_rows_inserted)
        self._view.selectionModel().currentRowChanged.connect(self._on_row_changed)
        self._details = tipped(QPlainTextEdit(), "Details of the selected record")
        self._details.setReadOnly(True)
        self._details.setFont(code_font(12))
        self._details.hide()

    def _arrange(self) -> None:
        tools = QHBoxLayout()
        tools.setSpacing(STEP_PX)
        tools.addWidget(self._levels)
        tools.addWidget(self._search, 1)
        tools.addWidget(self._newest)
        tools.addWidget(self._copy)
        split = QSplitter(Qt.Orientation.Horizontal)
        split.addWidget(self._view)
        split.addWidget(self._details)
        split.setChildrenCollapsible(False)
        split.setStretchFactor(0, 3)
        split.setStretchFactor(1, 2)
        column = QVBoxLayout(self)
        column.setContentsMargins(STEP_PX, STEP_PX, STEP_PX, STEP_PX)
        column.setSpacing(STEP_PX)
        column.addLayout(tools)
        column.addWidget(split, 1)
        self.setMinimumSize(40 * STEP_PX, 15 * STEP_PX)

    def lines(self) -> list[str]:
        """Return the records shown, oldest first, as text."""
        return [self._entry(row).as_line() for row in range(self._filter.rowCount())]

    def set_level(self, level: int) -> None:
        """Show records from `level` up."""
        names = [name for name, each in LEVELS.items() if each <= level]
        self._levels.setCurrentText(names[-1])

    def set_search(self, text: str) -> None:
        """Show only records with `text` in them."""
        self._search.setText(text)

    def copy(self) -> None:
        """Put the selected records, or all that are shown, on the clipboard."""
        rows = sorted(index.row() for index in self._view.selectionModel().selectedRows())
        chosen = [self._entry(row).as_line() for row in rows] or self.lines()
        QApplication.clipboard().setText("\n".join(chosen))

    @property
    def new(self) -> int:
        """How many records came below what is looked at."""
        return self._new

    def follows(self) -> bool:
        """Tell whether the newest record is in view, and stays so when others come."""
        return self._following

    def follow(self) -> None:
        """Go to the newest record and stay with those that come."""
        self._following, self._new = True, 0
        self._view.scrollToBottom()
        self._show_new()

    def _entry(self, row: int) -> LogEntry:
        source = self._filter.mapToSource(self._filter.index(row, 0))
        return self._model.entry(source.row())

    def _on_timer(self) -> None:
        waiting = [self._pending.popleft() for _ in range(len(self._pending))]
        known = {id(record) for record in self._shown_at_start}
        self._shown_at_start = []
        records = [record for record in waiting if id(record) not in known]
        if records:
            self._add([LogEntry.of(record) for record in records])
        self._show_new()

    def _add(self, entries: list[LogEntry]) -> None:
        """Take records over; what is looked at keeps its place, unless it was the newest."""
        looked_at = QPersistentModelIndex(self._view.indexAt(QPoint(0, 0)))
        self._adding = True  # what moves the bar meanwhile is not the operator
        self._model.append(entries)
        if self._following:
            self._view.scrollToBottom()
        elif looked_at.isValid():
            index = self._filter.index(looked_at.row(), 0)
            self._view.scrollTo(index, QAbstractItemView.ScrollHint.PositionAtTop)
        self._adding = False

    def _show_new(self) -> None:
        text = f"{self._new} new" if self._new else "Newest"
        if text != self._newest.text():
            self._newest.setText(text)
        self._newest.setEnabled(not self._following)

    def _on_rows_inserted(self, _parent: QModelIndex, first: int, last: int) -> None:
        if not self._following and self._adding:
            self._new += last - first + 1

    def _on_scrolled(self, value: int) -> None:
        if self._adding:
            return
        self._following = value >= self._view.verticalScrollBar().maximum()
        if self._following:
            self._new = 0
        self._show_new()

    def _on_range_changed(self, _low: int, high: int) -> None:
        """Stay with the newest record in a table that has become lower, too."""
        if self._following:
            self._view.verticalScrollBar().setValue(high)

    def _on_level_chosen(self, name: str) -> None:
        self._filter.set_level(LEVELS[name])
        self.follow()

    def _on_search_changed(self, text: str) -> None:
        self._filter.set_text(text)
        self.follow()

    def _on_row_changed(self) -> None:
        index = self._view.currentIndex()
        text = self._entry(index.row()).details if index.isValid() else ""
        self._details.setPlainText(text)
        self._details.setVisible("\n" in text)

    @override
    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        if self._following:
            self._view.scrollToBottom()

    @override
    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.matches(QKeySequence.StandardKey.Copy):
            self.copy()
            event.accept()
            return
        super().keyPressEvent(event)


def _view(model: LogFilter) -> QTableView:
    view = QTableView()
    view.setModel(model)
    view.setFont(number_font(12))
    view.setToolTip("Log records, newest last; select one for its details")
    view.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
    view.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
    view.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
    view.setFocusPolicy(Qt.FocusPolicy.ClickFocus)
    view.setShowGrid(False)
    view.setWordWrap(False)
    view.setTabKeyNavigation(False)
    rows = view.verticalHeader()
    rows.hide()
    rows.setDefaultSectionSize(view.fontMetrics().height() + STEP_PX // 2)
    rows.setSectionResizeMode(QHeaderView.ResizeMode.Fixed)
    columns = view.horizontalHeader()
    columns.setDefaultAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
    columns.setHighlightSections(False)
    metrics = view.fontMetrics()
    for column, sample in {
        TIME: "00:00:00.000",
        LEVEL: "■ WARNING",
        WHERE: "mico.core.device",
    }.items():
        view.setColumnWidth(column, metrics.horizontalAdvance(sample) + 3 * STEP_PX)
    columns.setSectionResizeMode(MESSAGE, QHeaderView.ResizeMode.Stretch)
    return view
