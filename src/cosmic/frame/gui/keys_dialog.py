"""The list of keys that F1 shows."""

from collections.abc import Sequence

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QAbstractItemView,
    QDialog,
    QHBoxLayout,
    QHeaderView,
    QLabel,
    QTableWidget,
    QTableWidgetItem,
    QVBoxLayout,
    QWidget,
)

from cosmic.frame.gui.build import push_button
from cosmic.frame.gui.stop_button import StopButton
from cosmic.frame.gui.theme import STEP_PX

KeyList = Sequence[tuple[str, str]]


class KeysDialog(QDialog):
    """Shows every key and what it does; leaves the other windows usable.

    Parameters
    ----------
    keys : sequence of (str, str)
        The key as it is written on the keyboard, and what it does.
    """

    stop_requested = Signal()

    def __init__(
        self, keys: KeyList, *, stop_key: str = "F12", parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        self.setWindowTitle("Keys")
        self.setModal(False)
        stop = StopButton(stop_key)
        stop.stop_requested.connect(self.stop_requested)
        hint = QLabel("Keys that move are ignored while a text field or the console has the focus.")
        hint.setWordWrap(True)
        hint.setProperty("role", "dim")
        top = QHBoxLayout()
        top.addWidget(hint, 1)
        top.addWidget(stop)
        self._table = _table()
        self.set_keys(keys)
        close = push_button("Close", "Close this list")
        close.clicked.connect(self.close)
        bottom = QHBoxLayout()
        bottom.addStretch(1)
        bottom.addWidget(close)
        column = QVBoxLayout(self)
        column.setContentsMargins(2 * STEP_PX, 2 * STEP_PX, 2 * STEP_PX, 2 * STEP_PX)
        column.setSpacing(2 * STEP_PX)
        column.addLayout(top)
        column.addWidget(self._table, 1)
        column.addLayout(bottom)
        self.resize(70 * STEP_PX, 60 * STEP_PX)

    def set_keys(self, keys: KeyList) -> None:
        """Show `keys` instead of what was shown."""
        self._table.setRowCount(len(keys))
        for row, texts in enumerate(keys):
            for column, text in enumerate(texts):
                item = QTableWidgetItem(text)
                item.setToolTip(text)
                self._table.setItem(row, column, item)

    def rows(self) -> list[tuple[str, str]]:
        """Return what is shown."""
        table = self._table
        return [(_text(table, row, 0), _text(table, row, 1)) for row in range(table.rowCount())]


def _table() -> QTableWidget:
    table = QTableWidget(0, 2)
    table.setHorizontalHeaderLabels(["Key", "What it does"])
    table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
    table.setSelectionMode(QAbstractItemView.SelectionMode.NoSelection)
    table.setFocusPolicy(Qt.FocusPolicy.NoFocus)
    table.setShowGrid(False)
    table.setWordWrap(False)
    table.setToolTip("Every key of this window, from the configuration")
    table.verticalHeader().hide()
    header = table.horizontalHeader()
    header.setSectionResizeMode(0, QHeaderView.ResizeMode.ResizeToContents)
    header.setSectionResizeMode(1, QHeaderView.ResizeMode.Stretch)
    header.setDefaultAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
    return table


def _text(table: QTableWidget, row: int, column: int) -> str:
    item = table.item(row, column)
    return item.text() if item is not None else ""
