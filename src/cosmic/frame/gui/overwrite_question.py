"""The question before a file is overwritten."""

from collections.abc import Callable
from pathlib import Path

from PySide6.QtWidgets import QMessageBox, QWidget

from cosmic.frame.gui.amounts import size_text


def overwrite_question(
    parent: QWidget,
    path: Path,
    overwrite: Callable[[], object],
    size_bytes: int | None = None,
) -> QMessageBox:
    """Return a dialog that calls `overwrite` when the operator says so; Escape is no."""
    box = QMessageBox(parent)
    box.setIcon(QMessageBox.Icon.Warning)
    box.setWindowTitle("Overwrite it?")
    size = "" if size_bytes is None else f" ({size_text(size_bytes)})"
    box.setText(f"{path.name} exists already{size}.")
    box.setInformativeText("Its contents will be lost.")
    agree = box.addButton("Overwrite", QMessageBox.ButtonRole.DestructiveRole)
    cancel = box.addButton(QMessageBox.StandardButton.Cancel)
    box.setDefaultButton(cancel)
    box.setEscapeButton(cancel)
    agree.clicked.connect(overwrite)
    box.finished.connect(box.deleteLater)
    return box
