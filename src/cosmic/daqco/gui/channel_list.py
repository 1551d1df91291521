"""The list of acquired signals (DAQPlot.2): shown or hidden, colour, and the value now."""

import math
from collections.abc import Sequence
from typing import Any, Final

from PySide6.QtCore import (
    QAbstractTableModel,
    QModelIndex,
    QPersistentModelIndex,
    QSize,
    Qt,
    Signal,
)
from PySide6.QtGui import QBrush, QColor, QPainter
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QStyle,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QTableView,
    QWidget,
)

from cosmic.daqco.gui.colours import colour_name, readable, swatch
from cosmic.daqco.gui.plot.chart import Trace
from cosmic.daqco.gui.plot.units import display_unit
from cosmic.frame.gui.theme import STEP_PX, current_palette, number_font
from cosmic.frame.overrides import override

Index = QModelIndex | QPersistentModelIndex

VALUES: Final = ("now", "A", "B", "B − A")
_NOTHING: Final = QModelIndex()
_ROW_PX: Final = 26
_NUMBER: Final = "-00000.000"


def value_text(value: float | None, decimals: int) -> str:
    """Return a value as the list shows it."""
    if value is None or not math.isfinite(value):
        return "–"
    if abs(value) >= 1e6:
        return f"{value:.3e}"
    return f"{round(value, decimals) + 0.0:.{decimals}f}"


class ChannelModel(QAbstractTableModel):
    """Names, colours and values of the acquired channels."""

    shown_changed = Signal(int, bool)

    def __init__(self) -> None:
        super().__init__()
        self._traces: tuple[Trace, ...] = ()
        self._values: list[Sequence[float] | None] = [None] * len(VALUES)
        self._decimals: tuple[int, ...] = ()
        self._age_s: float | None = None

    def set_age(self, age_s: float | None) -> None:
        """Say how old the values are; None while they are the present ones."""
        shown = None if age_s is None else float(round(age_s))
        if shown == self._age_s:
            return
        self._age_s = shown
        self.headerDataChanged.emit(Qt.Orientation.Horizontal, 1, 1)
        last = len(self._traces) - 1
        if last >= 0:
            self.dataChanged.emit(self.index(0, 1), self.index(last, 1))

    def set_traces(self, traces: Sequence[Trace]) -> None:
        """List these channels."""
        self.beginResetModel()
        self._traces = tuple(traces)
        self._values = [None] * len(VALUES)
        self._decimals = (2,) * len(traces)
        self.endResetModel()

    def set_decimals(self, decimals: Sequence[int]) -> None:
        """Show so many decimals, one number a channel."""
        self._decimals = tuple(decimals)

    def set_values(self, column: int, values: Sequence[float] | None) -> None:
        """Show values in one of `VALUES`; None where there are none."""
        if values is None and self._values[column] is None:
            return
        self._values[column] = values
        last = len(self._traces) - 1
        if last >= 0:
            self.dataChanged.emit(self.index(0, column + 1), self.index(last, column + 1))

    def unit(self, row: int) -> str:
        """Return the unit of a channel, as the operator reads it."""
        return display_unit(self._traces[row].unit)

    @override
    def rowCount(self, parent: Index = _NOTHING) -> int:
        return 0 if parent.isValid() else len(self._traces)

    @override
    def columnCount(self, parent: Index = _NOTHING) -> int:
        return 0 if parent.isValid() else 1 + len(VALUES)

    @override
    def headerData(
        self, section: int, orientation: Qt.Orientation, role: int = Qt.ItemDataRole.DisplayRole
    ) -> Any:
        if orientation is Qt.Orientation.Horizontal and role == Qt.ItemDataRole.DisplayRole:
            if section == 1 and self._age_s is not None:
                return f"{self._age_s:.0f} s ago"
            return ("channel", *VALUES)[section]
        return None

    @override
    def flags(self, index: Index) -> Qt.ItemFlag:
        flags = Qt.ItemFlag.ItemIsEnabled | Qt.ItemFlag.ItemIsSelectable
        return flags | Qt.ItemFlag.ItemIsUserCheckable if index.column() == 0 else flags

    @override
    def data(self, index: Index, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        trace = self._traces[index.row()]
        if index.column():
            return self._value(index.row(), index.column() - 1, role)
        if role == Qt.ItemDataRole.DisplayRole:
            return trace.name
        if role == Qt.ItemDataRole.DecorationRole:
            return swatch(readable(trace.colour))
        if role == Qt.ItemDataRole.CheckStateRole:
            return Qt.CheckState.Checked if trace.shown else Qt.CheckState.Unchecked
        if role == Qt.ItemDataRole.ToolTipRole:
            return f"{trace.name}, in {self.unit(index.row())}, {colour_name(trace.colour)}"
        return None

    def _value(self, row: int, column: int, role: int) -> Any:
        values = self._values[column]
        if role == Qt.ItemDataRole.DisplayRole:
            value = values[row] if values is not None and row < len(values) else None
            return value_text(value, self._decimals[row])
        if column == 0 and self._age_s is not None:
            if role == Qt.ItemDataRole.ForegroundRole:
                return QBrush(Qt.GlobalColor.gray)
            if role == Qt.ItemDataRole.ToolTipRole:
                return f"Measured {self._age_s:.0f} s ago; nothing is measured now"
        if role == Qt.ItemDataRole.ToolTipRole and column == 0:
            return "Mean of the last 0.2 s"
        return None

    @override
    def setData(self, index: Index, value: Any, role: int = Qt.ItemDataRole.EditRole) -> bool:
        if role != Qt.ItemDataRole.CheckStateRole:
            return False
        self.shown_changed.emit(index.row(), Qt.CheckState(value) is Qt.CheckState.Checked)
        return True

    def replace(self, row: int, trace: Trace) -> None:
        """Show a channel in another way."""
        self._traces = (*self._traces[:row], trace, *self._traces[row + 1 :])
        self.dataChanged.emit(self.index(row, 0), self.index(row, 0))


class _ValueDelegate(QStyledItemDelegate):
    """Draws a number with figures of one width, and its unit dimmed beside it."""

    @override
    def paint(self, painter: QPainter, option: QStyleOptionViewItem, index: Index) -> None:
        model = index.model()
        if not isinstance(model, ChannelModel):
            return
        palette = current_palette()
        room = option.rect.adjusted(STEP_PX // 2, 0, -STEP_PX // 2, 0)
        if option.state & QStyle.StateFlag.State_Selected:
            painter.fillRect(option.rect, QColor(palette.hover))
        painter.setFont(number_font())
        unit = model.unit(index.row())
        width = painter.fontMetrics().horizontalAdvance(unit) + STEP_PX // 2
        align = int(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        painter.setPen(QColor(palette.dim))
        painter.drawText(room, align, unit)
        painter.setPen(QColor(palette.text))
        painter.drawText(room.adjusted(0, 0, -width, 0), align, str(index.data()))

    @override
    def sizeHint(self, option: QStyleOptionViewItem, index: Index) -> QSize:
        model = index.model()
        unit = model.unit(index.row()) if isinstance(model, ChannelModel) else ""
        metrics = option.fontMetrics
        width = metrics.horizontalAdvance(f"{_NUMBER} {unit}")
        return QSize(width + STEP_PX, _ROW_PX)


class ChannelList(QTableView):
    """Shows the channels; ticks show and hide them."""

    limit_requested = Signal(str)
    """A channel was double-clicked: its limit is to be set."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.channels = ChannelModel()
        self.setModel(self.channels)
        self.setItemDelegate(_ValueDelegate(self))
        self.setItemDelegateForColumn(0, QStyledItemDelegate(self))
        self.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.setShowGrid(False)
        self.setTabKeyNavigation(False)
        self.verticalHeader().hide()
        self.verticalHeader().setDefaultSectionSize(_ROW_PX)
        self.verticalHeader().setMinimumSectionSize(_ROW_PX)
        header = self.horizontalHeader()
        header.setHighlightSections(False)
        header.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        header.setSectionResizeMode(0, QHeaderView.ResizeMode.Stretch)
        self.set_cursors_shown(False)
        self.doubleClicked.connect(self._on_double_clicked)
        self.setAccessibleName("Channels")

    def set_cursors_shown(self, shown: bool) -> None:
        """Show the columns with the values at the cursors."""
        for column in range(2, 1 + len(VALUES)):
            self.setColumnHidden(column, not shown)
        self.updateGeometry()

    @override
    def sizeHint(self) -> QSize:
        wide = not self.isColumnHidden(2)
        return QSize((58 if wide else 30) * STEP_PX, 20 * STEP_PX)

    @override
    def minimumSizeHint(self) -> QSize:
        return QSize(24 * STEP_PX, 7 * STEP_PX)

    def _on_double_clicked(self, index: QModelIndex) -> None:
        if index.column():
            name = self.channels.index(index.row(), 0).data()
            self.limit_requested.emit(str(name))
