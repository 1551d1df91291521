"""Chooses what to export where no file dialog can look: on the disk of another station."""

from collections.abc import Sequence
from pathlib import Path

from PySide6.QtCore import Signal
from PySide6.QtWidgets import (
    QComboBox,
    QDialogButtonBox,
    QFormLayout,
    QLabel,
    QListWidget,
    QVBoxLayout,
    QWidget,
)

from cosmic.daqco.gui.dialog import FieldDialog, button_box
from cosmic.frame.gui.build import tipped
from cosmic.frame.gui.theme import STEP_PX
from cosmic.frame.plugins import Kind, names

Button = QDialogButtonBox.StandardButton


def export_kinds() -> dict[str, str]:
    """Return the name of each format there is, by what a dialog shows: "CSV (*.csv)"."""
    return {f"{each.upper()} (*.{each})": each for each in names(Kind.EXPORTER)}


class StationExportDialog(FieldDialog):
    """Lists recordings; the export lies beside the recording under the same name.

    Signals
    -------
    chosen(Path, Path)
        Recording and export.
    """

    chosen = Signal(object, object)

    def __init__(
        self, recordings: Sequence[Path], where: str, parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        self.setWindowTitle("Export a recording")
        self._recordings = tuple(recordings)
        self.files = tipped(QListWidget(), f"The newest recordings {where}")
        self.files.addItems([each.name for each in self._recordings])
        self.kind = tipped(QComboBox(), "Kind of the new file")
        self._kinds = export_kinds()
        self.kind.addItems(list(self._kinds))
        self.buttons = button_box(Button.Ok | Button.Cancel)
        self.buttons.button(Button.Ok).setText("Export")
        folder = self._recordings[0].parent if self._recordings else ""
        found = f"{where}, in {folder}" if folder else f"There are no recordings {where}"
        form = QFormLayout()
        form.addRow("Export to", self.kind)
        column = QVBoxLayout(self)
        column.setSpacing(STEP_PX)
        column.addWidget(QLabel(found[:1].upper() + found[1:]))
        column.addWidget(self.files, 1)
        column.addLayout(form)
        column.addWidget(self.buttons)
        self.files.currentRowChanged.connect(self._on_row_changed)
        self.buttons.accepted.connect(self._on_ok)
        self.buttons.rejected.connect(self.reject)
        self.files.setCurrentRow(0)
        self._on_row_changed(self.files.currentRow())
        self.resize(60 * STEP_PX, 48 * STEP_PX)

    def _on_row_changed(self, row: int) -> None:
        self.buttons.button(Button.Ok).setEnabled(row >= 0)

    def _on_ok(self) -> None:
        source = self._recordings[self.files.currentRow()]
        self.chosen.emit(source, source.with_suffix(f".{self._kinds[self.kind.currentText()]}"))
        self.accept()
