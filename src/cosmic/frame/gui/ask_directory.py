"""The question which directory."""

from collections.abc import Callable

from PySide6.QtWidgets import QFileDialog, QWidget


def ask_directory(parent: QWidget, title: str, start: str, chosen: Callable[[str], object]) -> None:
    """Open a dialog at `start` that calls `chosen` with the directory; returns at once."""
    dialog = QFileDialog(parent, title, start)
    dialog.setFileMode(QFileDialog.FileMode.Directory)
    dialog.setOption(QFileDialog.Option.ShowDirsOnly)
    dialog.fileSelected.connect(chosen)
    dialog.finished.connect(dialog.deleteLater)
    dialog.open()
