"""The lines of a trajectory: the one under way is marked, those at fault say why."""

from collections.abc import Iterable, Sequence
from typing import Final

from PySide6.QtCore import QAbstractListModel, QModelIndex, QPersistentModelIndex, QSize, Qt
from PySide6.QtGui import QColor, QFont
from PySide6.QtWidgets import QListView, QWidget

from cosmic.frame.gui.theme import STEP_PX, State, code_font, current_palette, state_look
from cosmic.frame.overrides import override
from cosmic.mico.core.trajectory.model import Problem

LEAST_PX: Final = 10 * STEP_PX

_Index = QModelIndex | QPersistentModelIndex
_DISPLAY = Qt.ItemDataRole.DisplayRole


class TrajectoryLinesModel(QAbstractListModel):
    """Text, problems and the current line; also of ten thousand lines."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._lines: tuple[str, ...] = ()
        self._problems: dict[int, str] = {}
        self._current = 0
        self._bold = QFont(code_font())
        self._bold.setBold(True)

    @property
    def current(self) -> int:
        """Number of the line under way; 0 without one."""
        return self._current

    @property
    def problems(self) -> dict[int, str]:
        """What is wrong, by line."""
        return dict(self._problems)

    def set_lines(self, lines: Sequence[str]) -> None:
        """Show another text."""
        self.beginResetModel()
        self._lines, self._problems, self._current = tuple(lines), {}, 0
        self.endResetModel()

    def set_problems(self, problems: Iterable[Problem]) -> None:
        """Mark lines that are wrong; line 0 is shown at the first."""
        self._problems = {}
        for each in problems:
            line = max(1, each.line)
            before = self._problems.get(line)
            self._problems[line] = f"{before}; {each.text}" if before else each.text
        self._emit_changed(1, len(self._lines))

    def set_current(self, line: int) -> None:
        """Mark the line under way."""
        if line != self._current:
            before, self._current = self._current, line
            self._emit_changed(before, before)
            self._emit_changed(line, line)

    def _emit_changed(self, first: int, last: int) -> None:
        if 1 <= first <= last <= len(self._lines):
            self.dataChanged.emit(self.index(first - 1), self.index(last - 1))

    @override
    def rowCount(self, parent: _Index | None = None) -> int:
        return 0 if parent is not None and parent.isValid() else len(self._lines)

    @override
    def data(self, index: _Index, role: int = _DISPLAY) -> object:
        line = index.row() + 1
        if not 1 <= line <= len(self._lines):
            return None
        problem = self._problems.get(line)
        match role:
            case Qt.ItemDataRole.DisplayRole:
                return self._text(line, problem)
            case Qt.ItemDataRole.ToolTipRole:
                return problem
            case Qt.ItemDataRole.FontRole:
                return self._bold if line == self._current else None
            case Qt.ItemDataRole.ForegroundRole:
                return self._ink(line, problem)
            case Qt.ItemDataRole.BackgroundRole:
                fill = state_look(State.BUSY).fill
                return QColor(fill) if line == self._current else None
        return None

    def _text(self, line: int, problem: str | None) -> str:
        width = len(str(len(self._lines)))
        # Plain signs: others come from fonts of another width, and the text would jump.
        mark = "!" if problem is not None else ">" if line == self._current else " "
        said = f"{mark} {line:>{width}}  {self._lines[line - 1].rstrip()}"
        return said if problem is None else f"{said}    {problem}"

    def _ink(self, line: int, problem: str | None) -> QColor | None:
        palette = current_palette()
        if problem is not None:
            return QColor(palette.refused)
        said = self._lines[line - 1].lstrip()
        return QColor(palette.dim) if not said or said.startswith("#") else None


class TrajectoryLines(QListView):
    """Shows a `TrajectoryLinesModel` and keeps the current line in sight."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("trajectoryLines")
        self.setAccessibleName("Lines of the trajectory")
        self.setFont(code_font())
        self.setUniformItemSizes(True)
        self.setSelectionMode(QListView.SelectionMode.NoSelection)
        self.setEditTriggers(QListView.EditTrigger.NoEditTriggers)
        self.lines = TrajectoryLinesModel(self)
        self.setModel(self.lines)

    @override
    def sizeHint(self) -> QSize:
        # As low as it may be: it gives way to what is said below it, so that no button moves.
        return QSize(super().sizeHint().width(), LEAST_PX)

    def show_line(self, line: int) -> None:
        """Mark the line under way, and bring it in sight."""
        if line == self.lines.current:
            return
        self.lines.set_current(line)
        self.look_at(line)

    def look_at(self, line: int) -> None:
        """Bring a line in sight."""
        if line > 0:
            self.scrollTo(self.lines.index(line - 1), QListView.ScrollHint.EnsureVisible)
