"""The fibres of a campaign as a table."""

from collections.abc import Sequence
from typing import Final

from PySide6.QtCore import (
    QAbstractTableModel,
    QModelIndex,
    QObject,
    QPersistentModelIndex,
    QSize,
    Qt,
    Signal,
)
from PySide6.QtGui import QIcon, QKeyEvent
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QTableView, QWidget

from cosmic.app.panels.state_indicator import INDICATOR_PX, state_pixmap
from cosmic.autonomy.campaign.formatting import (
    EI_LABEL,
    NONE,
    interval,
    length_words,
    number,
    stiffness,
    width_words,
)
from cosmic.autonomy.campaign.records import Outcome
from cosmic.autonomy.campaign.snapshot import FibreRow
from cosmic.frame.gui.amounts import duration_text
from cosmic.frame.gui.key_focus import ENTER_KEYS
from cosmic.frame.gui.theme import STEP_PX, State, number_font
from cosmic.frame.overrides import override

Index = QModelIndex | QPersistentModelIndex
Role = Qt.ItemDataRole

HEADERS: Final = ("Fibre", "Outcome", "EI", "95 %", "Length", "Width", "Curl", "Time", "Cause")
NUMBER, OUTCOME, EI, INTERVAL, LENGTH, WIDTH, CURL, TIME, CAUSE = range(9)
_TIPS: Final = {
    EI: f"Bending stiffness, {EI_LABEL}",
    INTERVAL: f"95 % interval of the bending stiffness, {EI_LABEL}",
    LENGTH: "Length, µm",
    WIDTH: "Width, µm",
    CURL: "Length divided by the distance between the ends, minus one",
    TIME: "Time on the platform's clock",
    CAUSE: "Cause of the failure, or why the result is not trusted",
}
_SAMPLES: Final = {
    NUMBER: "00000",
    OUTCOME: f"■■ {Outcome.DOUBTFUL}",
    EI: "00.0",
    INTERVAL: "00.0 to 00.0",
    LENGTH: "0000",
    WIDTH: "00.0",
    CURL: "0.00",
    TIME: "00 min 00 s",
}
OUTCOME_STATES: Final = {
    Outcome.RUNNING: State.BUSY,
    Outcome.GOOD: State.OK,
    Outcome.DOUBTFUL: State.REFUSED,
    Outcome.FAILED: State.ERROR,
    Outcome.INTERRUPTED: State.REFUSED,
}
_NOWHERE: Final = QModelIndex()
_LEFT: Final = int(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
_RIGHT: Final = int(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)


class FibreTableModel(QAbstractTableModel):
    """The rows of a board, the newest first."""

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._rows: tuple[FibreRow, ...] = ()
        self._icons: dict[Outcome, QIcon] = {}

    def set_rows(self, rows: Sequence[FibreRow]) -> None:
        """Show other rows; what is new comes on top, and a selection stays where it is."""
        old, new = self._rows, tuple(reversed(rows))
        if new == old:
            return
        more = len(new) - len(old)
        if more < 0 or [each.number for each in new[more:]] != [each.number for each in old]:
            self.beginResetModel()
            self._rows = new
            self.endResetModel()
            return
        if more:
            self.beginInsertRows(_NOWHERE, 0, more - 1)
            self._rows = (*new[:more], *old)
            self.endInsertRows()
        self._rows = new
        for place in range(more, len(new)):
            if new[place] != old[place - more]:
                self.dataChanged.emit(self.index(place, 0), self.index(place, CAUSE))

    def number(self, row: int) -> int:
        """Return the number of the fibre in a row."""
        return self._rows[row].number

    @override
    def rowCount(self, parent: Index = _NOWHERE) -> int:
        return 0 if parent.isValid() else len(self._rows)

    @override
    def columnCount(self, parent: Index = _NOWHERE) -> int:
        return 0 if parent.isValid() else len(HEADERS)

    @override
    def headerData(
        self, section: int, orientation: Qt.Orientation, role: int = Role.DisplayRole
    ) -> object:
        if orientation is not Qt.Orientation.Horizontal:
            return None
        if role == Role.DisplayRole:
            return HEADERS[section]
        if role == Role.ToolTipRole:
            return _TIPS.get(section)
        return _alignment(section) if role == Role.TextAlignmentRole else None

    @override
    def data(self, index: Index, role: int = Role.DisplayRole) -> object:
        row, column = self._rows[index.row()], index.column()
        if role == Role.DisplayRole:
            return _text(row, column)
        if role == Role.DecorationRole and column == OUTCOME:
            return self._icon(row.outcome)
        if role == Role.ToolTipRole:
            return _tip(row, column)
        return _alignment(column) if role == Role.TextAlignmentRole else None

    def _icon(self, outcome: Outcome) -> QIcon:
        if outcome not in self._icons:
            self._icons[outcome] = QIcon(state_pixmap(OUTCOME_STATES[outcome]))
        return self._icons[outcome]


def _alignment(column: int) -> int:
    return _LEFT if column in (OUTCOME, CAUSE) else _RIGHT


def _tip(row: FibreRow, column: int) -> str | None:
    if column == WIDTH:
        return f"{width_words(row.shape)} µm (95 %)"
    if column == LENGTH:
        return f"{length_words(row.shape)} (95 %)"
    return row.cause if column == CAUSE and row.cause else None


def _text(row: FibreRow, column: int) -> str:
    ei, shape = row.ei, row.shape
    texts = {
        NUMBER: str(row.number),
        OUTCOME: str(row.outcome),
        EI: NONE if ei is None else stiffness(ei.ei_n_m2),
        INTERVAL: NONE if ei is None else interval(ei.ei_low_n_m2, ei.ei_high_n_m2),
        LENGTH: number(shape.length_um),
        WIDTH: number(shape.width_um, 1),
        CURL: number(shape.curl, 2),
        TIME: duration_text(row.duration_s) if row.duration_s >= 0.0 else NONE,
        CAUSE: row.cause,
    }
    return texts[column]


class FibreTable(QTableView):
    """Shows the rows; double click or Enter chooses a fibre.

    Signals
    -------
    fibre_chosen(int)
        The number of the fibre.
    """

    fibre_chosen = Signal(int)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.rows = FibreTableModel(self)
        self.setModel(self.rows)
        self.setFont(number_font(12))
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        self.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.setShowGrid(False)
        self.setIconSize(QSize(INDICATOR_PX, INDICATOR_PX))
        self.setWordWrap(False)
        self.setTabKeyNavigation(False)
        rows = self.verticalHeader()
        rows.hide()
        rows.setDefaultSectionSize(self.fontMetrics().height() + STEP_PX // 2)
        rows.setSectionResizeMode(QHeaderView.ResizeMode.Fixed)
        columns = self.horizontalHeader()
        columns.setHighlightSections(False)
        for column, sample in _SAMPLES.items():
            room = max(sample, HEADERS[column], key=len)
            width = self.fontMetrics().horizontalAdvance(room)
            self.setColumnWidth(column, width + 2 * STEP_PX)
        columns.setSectionResizeMode(CAUSE, QHeaderView.ResizeMode.Stretch)
        columns.setMinimumSectionSize(4 * STEP_PX)
        self.doubleClicked.connect(self._on_double_clicked)

    def _on_double_clicked(self, index: QModelIndex) -> None:
        self.fibre_chosen.emit(self.rows.number(index.row()))

    @override
    def keyPressEvent(self, event: QKeyEvent) -> None:
        index = self.currentIndex()
        if event.key() in ENTER_KEYS and index.isValid():
            self.fibre_chosen.emit(self.rows.number(index.row()))
            event.accept()
            return
        super().keyPressEvent(event)
