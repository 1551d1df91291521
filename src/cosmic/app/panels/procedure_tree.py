"""The tree of a procedure: what each part is at, by shape, word and colour."""

from dataclasses import dataclass
from typing import Final

from PySide6.QtCore import QEvent, QSize, Qt
from PySide6.QtGui import QBrush, QColor, QIcon
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QTreeWidget,
    QTreeWidgetItem,
    QWidget,
)

from cosmic.app.panels.state_indicator import INDICATOR_PX, state_pixmap
from cosmic.autonomy.procedures.tree import RUNNING_STATES, NodeEvent, NodeState, NodeView, Path
from cosmic.frame.gui.amounts import duration_text
from cosmic.frame.gui.theme import State, current_palette, number_font, ui_font
from cosmic.frame.overrides import override

PART, STATE, TRY, TIME, CAUSE = range(5)
_TITLES: Final = ("Part", "State", "Try", "Time", "Cause")
_RIGHT: Final = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
_CENTRE: Final = Qt.AlignmentFlag.AlignHCenter | Qt.AlignmentFlag.AlignVCenter
_SHAPES: Final = {
    NodeState.RUNNING: State.BUSY,
    NodeState.QUEUED: State.BUSY,
    NodeState.HOLDING: State.BUSY,
    NodeState.VERIFYING: State.BUSY,
    NodeState.UNDOING: State.BUSY,
    NodeState.DONE: State.OK,
    NodeState.FAILED: State.ERROR,
    NodeState.NOT_UNDONE: State.ERROR,
    NodeState.ENDED: State.REFUSED,
}
_KINDS: Final = {
    "operation": "One operation",
    "sequence": "One step after the other",
    "retry": "Retried after a failure",
    "fallback": "The next step if one fails",
    "guard": "Runs only while a condition holds",
    "parallel": "In parallel",
    "repeat": "Repeated",
    "holding": "Needs a shared resource",
    "role": "Done by one of several equal arms",
}


@dataclass(frozen=True, slots=True)
class _Shown:
    event: NodeEvent
    time: str


_Outline = tuple[tuple[Path, str, str], ...]
"""Where each part stands, its name and its kind."""


class ProcedureTree(QTreeWidget):
    """Shows a `NodeView`; GUI thread."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("procedureTree")
        self.setColumnCount(len(_TITLES))
        self.setHeaderLabels(list(_TITLES))
        self.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.setSelectionMode(QAbstractItemView.SelectionMode.NoSelection)
        self.setFocusPolicy(Qt.FocusPolicy.ClickFocus)
        self.headerItem().setTextAlignment(TIME, _RIGHT)
        self.headerItem().setTextAlignment(TRY, _CENTRE)
        self.setUniformRowHeights(True)
        self.setAllColumnsShowFocus(True)
        self.setIconSize(QSize(INDICATOR_PX, INDICATOR_PX))
        header = self.header()
        header.setStretchLastSection(True)
        header.setSectionsMovable(False)
        header.setSectionResizeMode(PART, QHeaderView.ResizeMode.Interactive)
        self._items: dict[Path, QTreeWidgetItem] = {}
        self._outline: _Outline = ()
        self._shown: dict[Path, _Shown] = {}
        self._front: Path | None = None
        self._icons: dict[NodeState, QIcon] = {}

    def lay_out(self, view: NodeView) -> None:
        """Show another tree, opened to its last part."""
        self.clear()
        self._items.clear()
        self._shown.clear()
        self._front = None
        self._outline = _outline(view)
        self._add(view, self.invisibleRootItem())
        self.expandAll()
        self._fit()
        self.show_view(view)

    def _add(self, view: NodeView, above: QTreeWidgetItem) -> None:
        item = QTreeWidgetItem(above)
        item.setText(PART, view.name)
        item.setToolTip(PART, _KINDS.get(view.kind, view.kind))
        item.setFont(TIME, number_font())
        item.setTextAlignment(TIME, _RIGHT)
        item.setTextAlignment(TRY, _CENTRE)
        self._items[view.event.path] = item
        for child in view.children:
            self._add(child, item)

    def _fit(self) -> None:
        """Give each column the room of the longest text that can stand in it."""
        metrics = self.fontMetrics()
        words = max(metrics.horizontalAdvance(each.value) for each in NodeState)
        self.resizeColumnToContents(PART)
        self.setColumnWidth(PART, self.columnWidth(PART) + INDICATOR_PX)
        self.setColumnWidth(STATE, words + 3 * INDICATOR_PX)
        self.setColumnWidth(TRY, metrics.horizontalAdvance("round 000") + INDICATOR_PX)
        self.setColumnWidth(TIME, metrics.horizontalAdvance("00 min 00 s") + INDICATOR_PX)

    def show_view(self, view: NodeView) -> None:
        """Show what the parts are at now; only what changed is written anew.

        A tree of other parts takes the place of the one that was laid out: a campaign has one for
        fibres and another one for its standard.
        """
        if _outline(view) != self._outline:
            self.lay_out(view)
            return
        front: Path | None = None
        for each in view.walk():
            path = each.event.path
            time = duration_text(each.duration_s) if each.event.started_s is not None else ""
            shown = _Shown(each.event, time)
            if self._shown.get(path) != shown:
                self._shown[path] = shown
                self._write(self._items[path], each, time)
            if each.state in RUNNING_STATES:
                front = path  # the last one stands lowest: the operation, not what is above it
        if front != self._front:
            self._front = front
            if front is not None:
                self.scrollToItem(self._items[front])

    def _write(self, item: QTreeWidgetItem, view: NodeView, time: str) -> None:
        event, palette = view.event, current_palette()
        item.setIcon(STATE, self._icon(view.state))
        item.setText(STATE, view.state.value)
        item.setText(TRY, _count(view))
        item.setText(TIME, time)
        item.setText(CAUSE, event.cause or event.text)
        item.setToolTip(CAUSE, f"{event.cause}: {event.text}" if event.cause else event.text)
        running = view.state in RUNNING_STATES
        quiet = view.state is NodeState.WAITING
        colour = QBrush(QColor(palette.dim if quiet else palette.text))
        for column in range(len(_TITLES)):
            item.setForeground(column, colour)
        for column in (PART, STATE):
            item.setFont(column, ui_font(bold=running))

    def _icon(self, state: NodeState) -> QIcon:
        if state not in self._icons:
            self._icons[state] = _icon(state)
        return self._icons[state]

    @property
    def front(self) -> str:
        """Name of the operation that is running, empty when none is."""
        return self._items[self._front].text(PART) if self._front is not None else ""

    def row(self, path: Path) -> tuple[str, ...]:
        """Return the texts of a row."""
        return tuple(self._items[path].text(column) for column in range(len(_TITLES)))

    @override
    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "_icons"):
            self._icons.clear()
            self._shown.clear()  # all is written anew, in the new colours, when it is shown next


def _outline(view: NodeView) -> _Outline:
    return tuple((each.event.path, each.name, each.kind) for each in view.walk())


def _count(view: NodeView) -> str:
    """Return which try or round it is, where it is not the only one."""
    event = view.event
    if event.attempt > 1:
        return str(event.attempt)
    return f"round {event.round}" if event.round and len(event.path) == 1 else ""


def _icon(state: NodeState) -> QIcon:
    return QIcon(state_pixmap(_SHAPES.get(state)))
