"""Groups side by side in as many columns as the window has room for."""

from collections.abc import Sequence

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QFrame, QHBoxLayout, QScrollArea, QVBoxLayout, QWidget

from cosmic.frame.gui.build import named
from cosmic.frame.gui.theme import STEP_PX
from cosmic.frame.overrides import override
from cosmic.mico.api.mico import Mico
from cosmic.mico.core.settings import GroupSettings
from cosmic.mico.gui.device_gui import DeviceGUI


def arranged_groups(mico: Mico) -> list[GroupSettings]:
    """Return the groups of the configuration, and one a device for what they leave out."""
    groups = list(mico.settings.group)
    named = {name for group in groups for name in group.positioners}
    rest: dict[int, list[str]] = {}
    for name in mico.names:
        if name not in named:
            rest.setdefault(mico[name].details.address.device, []).append(name)
    groups += [
        GroupSettings(title=f"Device {index}", positioners=tuple(names))
        for index, names in sorted(rest.items())
    ]
    return groups


class GroupColumns(QScrollArea):
    """Scrolls downwards only; a group is never cut in width while one column fits."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("dockScroll")
        self.setWidgetResizable(True)
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self._groups: list[DeviceGUI] = []
        self._columns: list[QVBoxLayout] = []
        self._content = named(QWidget(), "groups")
        self._row = QHBoxLayout(self._content)
        self._row.setContentsMargins(STEP_PX, 0, STEP_PX, STEP_PX)
        self._row.setSpacing(STEP_PX)
        self.setWidget(self._content)

    @property
    def groups(self) -> list[DeviceGUI]:
        """The groups in their order."""
        return list(self._groups)

    def set_groups(self, groups: Sequence[DeviceGUI]) -> None:
        """Show `groups`; those shown before are deleted."""
        for old in self._groups:
            old.hide()
            old.deleteLater()
        self._groups = list(groups)
        for group in self._groups:
            group.setParent(self._content)
        self._spread(self._fitting())

    def _group_width_px(self) -> int:
        return max((group.minimumSizeHint().width() for group in self._groups), default=1)

    def _fitting(self) -> int:
        room = self.viewport().width() - STEP_PX
        return max(1, min(room // (self._group_width_px() + STEP_PX), len(self._groups)))

    def _spread(self, count: int) -> None:
        """Put each group into the column that is the shortest so far."""
        for column in self._columns:
            self._row.removeItem(column)
            while column.count():
                column.takeAt(0)
            column.deleteLater()
        self._columns = [QVBoxLayout() for _ in range(count)]
        heights = [0] * count
        for group in self._groups:
            shortest = heights.index(min(heights))
            self._columns[shortest].addWidget(group)
            heights[shortest] += group.sizeHint().height()
        for column in self._columns:
            column.setSpacing(STEP_PX)
            column.addStretch(1)
            self._row.addLayout(column, 1)
        for group in self._groups:
            group.show()
        bar = self.verticalScrollBar().sizeHint().width()
        self.setMinimumWidth(self._group_width_px() + bar + 2 * STEP_PX)

    @override
    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        count = self._fitting()
        if self._groups and count != len(self._columns):
            self._spread(count)

    @override
    def sizeHint(self) -> QSize:
        return self._content.sizeHint().expandedTo(QSize(self.minimumWidth(), 30 * STEP_PX))
