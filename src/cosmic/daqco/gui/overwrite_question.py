"""The question before a file is overwritten (DAQFile.5, note 3)."""

from collections.abc import Callable
from pathlib import Path

from PySide6.QtWidgets import QMessageBox, QWidget

from cosmic.daqco.gui.amounts import size_text


def overwrite_question(
    parent: QWidget, path: Path, size_bytes: int, overwrite: Callable[[], object]
) -> QMessageBox:
    """Return a dialog that calls `overwrite` when the operator says so; Escape is no."""
    box = QMessageBox(parent)
    box.setIcon(QMessageBox.Icon.Warning)
    box.setWindowTitle("Overwrite the file?")
    box.setText(f"{path.name} exists already ({size_text(size_bytes)}).")
    box.setInformativeText("What is in it will be lost.")
    agree = box.addButton("Overwrite", QMessageBox.ButtonRole.DestructiveRole)
    cancel = box.addButton(QMessageBox.StandardButton.Cancel)
    box.setDefaultButton(cancel)
    box.setEscapeButton(cancel)
    agree.clicked.connect(overwrite)
    return box
