"""The table of what each input moves; its numbers can be edited."""

from typing import Final

from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QTableWidget,
    QTableWidgetItem,
    QWidget,
)

from cosmic.frame.gui.theme import STEP_PX
from cosmic.frame.units import format_quantity
from cosmic.mico.core.teleoperation.settings import (
    SPEED_KEYS,
    TeleoperationAxisSettings,
    TeleoperationProfileSettings,
)
from cosmic.mico.core.teleoperation.state import TeleoperationState

INPUT, MOVES, NOW, DIRECTION, SCALE, DEAD_ZONE, SPEED = range(7)
HEADS: Final = ("input", "moves", "now", "direction", "scale", "dead zone", "speed limit")
EDITABLE: Final = {DIRECTION: "direction", SCALE: "scale", DEAD_ZONE: "dead_zone"}
_UNITS: Final = {"linear": "µm/s", "rotary": "°/s", "open-loop": "Hz"}
_TIPS: Final = {
    DIRECTION: "1, or -1 to reverse it",
    SCALE: "Multiplies the deflection",
    DEAD_ZONE: "Part of the deflection around the middle that moves nothing",
    SPEED: "Speed at full deflection; empty for that of jogging",
}


class MappingTable(QTableWidget):
    """A row an input of the profile; GUI thread.

    Signals
    -------
    changed(int, str, object)
        The operator wants another value: row, key of the configuration, value.
    refused(str)
        What was typed is no number.
    """

    changed = Signal(int, str, object)
    refused = Signal(str)

    def __init__(self, kinds: dict[str, str], parent: QWidget | None = None) -> None:
        super().__init__(0, len(HEADS), parent)
        self._kinds = kinds
        self._profile: TeleoperationProfileSettings | None = None
        self.setHorizontalHeaderLabels(list(HEADS))
        self.setAccessibleName("mapping")
        self.verticalHeader().hide()
        self.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        self.setTabKeyNavigation(False)
        header = self.horizontalHeader()
        header.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        header.setSectionResizeMode(NOW, QHeaderView.ResizeMode.Interactive)
        self.setColumnWidth(NOW, 14 * STEP_PX)
        header.setStretchLastSection(True)
        rows = self.verticalHeader()
        rows.setMinimumSectionSize(self.fontMetrics().height() + STEP_PX)
        rows.setDefaultSectionSize(self.fontMetrics().height() + STEP_PX)
        self.cellChanged.connect(self._on_cell_changed)

    def show_profile(self, profile: TeleoperationProfileSettings | None) -> None:
        """Show the rows of `profile`."""
        self._profile = profile
        rows = profile.axis if profile is not None else ()
        with QSignalBlocker(self):
            self.setRowCount(len(rows))
            for number, row in enumerate(rows):
                self._show_row(number, row)

    def _show_row(self, number: int, row: TeleoperationAxisSettings) -> None:
        unit = _UNITS[self._kinds[row.positioner]]
        speed = "as jogging" if row.speed is None else f"{row.speed:g} {unit}"
        moves = row.positioner if row.mode == "speed" else f"{row.positioner} (position)"
        texts = {
            INPUT: row.input,
            MOVES: moves,
            DIRECTION: f"{row.direction:+d}",
            SCALE: f"{row.scale:g}",
            DEAD_ZONE: f"{row.dead_zone:g}",
            SPEED: speed,
            NOW: "",
        }
        for column, text in texts.items():
            item = self.item(number, column)
            if item is None:
                item = QTableWidgetItem()
                if column not in EDITABLE and column != SPEED:
                    item.setFlags(item.flags() & ~Qt.ItemFlag.ItemIsEditable)
                self.setItem(number, column, item)
            item.setText(text)
            item.setToolTip(_TIPS.get(column, text))

    def show_state(self, state: TeleoperationState) -> None:
        """Show what each positioner is asked for, or why it does not move."""
        rows = self._profile.axis if self._profile is not None else ()
        with QSignalBlocker(self):
            for number, row in enumerate(rows):
                text = self._now(row.positioner, state)
                item = self.item(number, NOW)
                if item is not None and item.text() != text:
                    item.setText(text)
                    item.setToolTip(text)

    def _now(self, name: str, state: TeleoperationState) -> str:
        refused = state.refused.get(name)
        if refused:
            return f"◆ {refused}"
        velocity = state.velocities.get(name)
        if velocity is None:
            return ""
        kind = self._kinds[name]
        if kind == "open-loop":
            return f"{velocity:+.0f} Hz"
        return f"{format_quantity(velocity, 'deg' if kind == 'rotary' else 'um')}/s"

    def _on_cell_changed(self, row: int, column: int) -> None:
        item, profile = self.item(row, column), self._profile
        if item is None or profile is None:
            return
        typed = text = item.text().strip()
        if column == SPEED:
            key = SPEED_KEYS[self._kinds[profile.axis[row].positioner]]
            text = text.split(" ")[0].replace("as", "")
        else:
            key = EDITABLE[column]
        try:
            value = _value(key, text)
        except ValueError:
            self.show_profile(profile)
            self.refused.emit(f"{HEADS[column]}: {typed!r} is not a number")
            return
        self.changed.emit(row, key, value)


def _value(key: str, text: str) -> float | int | None:
    if key == "direction":
        return int(text)
    if not text and key in SPEED_KEYS.values():
        return None
    return float(text)
