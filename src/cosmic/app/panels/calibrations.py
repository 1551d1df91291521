"""The panel "Calibrations": all there are, how good and how old, and how to renew them."""

from collections.abc import Callable, Sequence
from typing import Final, Protocol

from PySide6.QtCore import QSize, Qt, QTimer
from PySide6.QtGui import QHideEvent, QIcon, QShowEvent
from PySide6.QtWidgets import (
    QCheckBox,
    QHBoxLayout,
    QTreeWidget,
    QTreeWidgetItem,
    QVBoxLayout,
    QWidget,
)

from cosmic.app.panels.procedure import ProcedurePort, ProcedureTreePanel
from cosmic.app.panels.state_indicator import INDICATOR_PX, state_pixmap
from cosmic.app.rig import Rig
from cosmic.autonomy.calibrating.registry import (
    CalibrationEntry,
    CalibrationRegistry,
    CalibrationStanding,
)
from cosmic.frame.gui.amounts import duration_text
from cosmic.frame.gui.build import named, push_button, tipped
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.late_panel import LatePanel, is_seen
from cosmic.frame.gui.server_gui import CosmicServerGui
from cosmic.frame.gui.theme import STEP_PX, State
from cosmic.frame.overrides import override

CALIBRATIONS: Final = "Calibrations"
HEADERS: Final = ("Calibration", "Tool", "Standing", "Residual", "At most", "Age", "How")
NAME, TOOL, STANDING, RESIDUAL, LARGEST, AGE, HOW = range(len(HEADERS))
PERIOD_MS: Final = 1000
STANDING_STATES: Final = {
    CalibrationStanding.FRESH: State.OK,
    CalibrationStanding.STALE: State.REFUSED,
    CalibrationStanding.UNCHECKED: State.REFUSED,
    CalibrationStanding.POOR: State.ERROR,
}
_KEY: Final = Qt.ItemDataRole.UserRole


class Calibrating(Protocol):
    """Begins a run that calibrates what is due; `zooms` adds every step of the lens."""

    def __call__(self, *, zooms: bool) -> ProcedurePort:
        """Return the run, ready to begin."""
        ...


class CalibrationPanel(QWidget):
    """Lists the registry, and carries out the procedure that calibrates; GUI thread.

    Parameters
    ----------
    registry : callable
        Returns the registry.
    calibrate : callable
        Returns a run that is ready to begin.
    """

    def __init__(
        self,
        registry: Callable[[], CalibrationRegistry],
        calibrate: Calibrating,
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self.setObjectName("CalibrationPanel")
        self._registry = registry
        self.list = named(QTreeWidget(), "calibrationList")
        self.list.setHeaderLabels(list(HEADERS))
        self.list.setRootIsDecorated(False)
        self.list.setSelectionMode(QTreeWidget.SelectionMode.ExtendedSelection)
        self.list.setIconSize(QSize(INDICATOR_PX, INDICATOR_PX))
        self.list.itemSelectionChanged.connect(self._on_selection)
        self.anew = named(
            push_button(
                "Measure again",
                "Measure the selected calibrations in the next run even if they are fresh",
            ),
            "calibrationAnew",
        )
        self.anew.clicked.connect(self._on_anew)
        self.zooms = named(QCheckBox("every zoom"), "calibrationZooms")
        tipped(self.zooms, "Map every zoom step of the lens as well (about one minute)")
        self.run = ProcedureTreePanel(lambda: calibrate(zooms=self.zooms.isChecked()))
        row = QHBoxLayout()
        row.addWidget(self.anew)
        row.addWidget(self.zooms)
        self.none = named(ElidedLabel("None yet. Start measures all"), "calibrationNone")
        row.addWidget(self.none, 9)
        row.addStretch(1)
        column = QVBoxLayout(self)
        column.setContentsMargins(STEP_PX, STEP_PX, STEP_PX, STEP_PX)
        column.addWidget(self.list, 1)
        column.addLayout(row)
        column.addWidget(self.run, 1)
        self._timer = QTimer(self)
        self._timer.setInterval(PERIOD_MS)
        self._timer.timeout.connect(self._on_timer)
        self._icons: dict[CalibrationStanding, QIcon] = {}
        self._shown: tuple[tuple[str, str], ...] = ()
        self._on_selection()

    def refresh(self) -> None:
        """Show the registry as it is now."""
        registry = self._registry()
        entries = registry.entries
        keys = tuple(each.key for each in entries)
        self.none.setVisible(not keys)
        if keys != self._shown:
            self.list.clear()
            self.list.addTopLevelItems([QTreeWidgetItem() for _ in keys])
            self._shown = keys
        for row, entry in enumerate(entries):
            self._fill(self.list.topLevelItem(row), registry, entry)
        for column in range(HOW):
            self.list.resizeColumnToContents(column)

    def _on_timer(self) -> None:
        if is_seen(self):
            self.refresh()

    def _fill(
        self, item: QTreeWidgetItem | None, registry: CalibrationRegistry, entry: CalibrationEntry
    ) -> None:
        if item is None:
            return
        standing = registry.standing(entry)
        for column, text in enumerate(texts(registry, entry)):
            if item.text(column) != text:
                item.setText(column, text)
        if standing not in self._icons:
            self._icons[standing] = QIcon(state_pixmap(STANDING_STATES[standing]))
        item.setIcon(STANDING, self._icons[standing])
        item.setData(NAME, _KEY, entry.key)
        tip = "\n".join(
            [*(f"{key}: {each:.4g}" for key, each in entry.values.items()), _made_text(entry)]
        )
        for column in range(len(HEADERS)):
            item.setToolTip(column, entry.problem or tip)

    def _on_selection(self) -> None:
        self.anew.setEnabled(bool(self.list.selectedItems()))

    def _on_anew(self) -> None:
        registry = self._registry()
        for item in self.list.selectedItems():
            name, tool = item.data(NAME, _KEY)
            registry.forget(name, tool)
        self.refresh()

    @override
    def showEvent(self, event: QShowEvent) -> None:
        self.refresh()
        self._timer.start()
        super().showEvent(event)

    @override
    def hideEvent(self, event: QHideEvent) -> None:
        self._timer.stop()
        super().hideEvent(event)

    def shut_down(self) -> None:
        """End the run that was begun here."""
        self._timer.stop()
        self.run.shut_down()


def texts(registry: CalibrationRegistry, entry: CalibrationEntry) -> Sequence[str]:
    """Return what stands in the columns of the list."""
    refused = bool(entry.problem)
    return (
        entry.name,
        entry.tool,
        str(registry.standing(entry)),
        "" if refused else f"{entry.residual:.2g} {entry.unit.replace('um', 'µm')}",
        "" if refused else f"{entry.largest:g}",
        duration_text(registry.age_s(entry)),
        entry.problem or entry.how,
    )


def _made_text(entry: CalibrationEntry) -> str:
    made = entry.made.astimezone().strftime("%Y-%m-%d %H:%M")
    seen = entry.checked.astimezone().strftime("; last confirmed %H:%M") if entry.checked else ""
    return f"made {made}{seen}; with {entry.made_with}; CoSMic {entry.version}"


def add_calibrations(window: CosmicServerGui, rig: Rig, beside: str) -> LatePanel[CalibrationPanel]:
    """Put the panel in a window, in a tab with another one; it is made when it is first seen."""
    panel = LatePanel(
        lambda: CalibrationPanel(
            lambda: rig.calibrations, lambda *, zooms: rig.calibrate(zooms=zooms)
        )
    )
    window.add_panel(CALIBRATIONS, panel, scroll=False, beside=beside, tabbed=True)
    return panel
