"""The questions which directory, and which file to read or to write."""

from collections.abc import Callable
from pathlib import Path

from PySide6.QtWidgets import QFileDialog, QWidget

from cosmic.frame.gui.beside import open_beside


def ask_directory(parent: QWidget, title: str, start: str, chosen: Callable[[str], object]) -> None:
    """Open a dialog at `start` that calls `chosen` with the directory; returns at once."""
    dialog = QFileDialog(parent, title, _there(start))
    dialog.setFileMode(QFileDialog.FileMode.Directory)
    dialog.setOption(QFileDialog.Option.ShowDirsOnly)
    dialog.fileSelected.connect(chosen)
    dialog.finished.connect(dialog.deleteLater)
    open_beside(dialog)


def ask_open_file(
    parent: QWidget, title: str, start: str, *, files: str, chosen: Callable[[str], object]
) -> None:
    """Open a dialog that calls `chosen` with a file there is; returns at once."""
    dialog = QFileDialog(parent, title, _there(start), files)
    dialog.setFileMode(QFileDialog.FileMode.ExistingFile)
    dialog.fileSelected.connect(chosen)
    dialog.finished.connect(dialog.deleteLater)
    open_beside(dialog)


def ask_save_file(
    parent: QWidget,
    title: str,
    start: str,
    *,
    files: str,
    suffix: str,
    chosen: Callable[[str], object],
) -> QFileDialog:
    """Open a dialog that calls `chosen` with the file to write; returns at once.

    A name without an ending gets `suffix` before the dialog asks about a file that is there.
    """
    dialog = QFileDialog(parent, title, start, files)
    dialog.setAcceptMode(QFileDialog.AcceptMode.AcceptSave)
    dialog.setDefaultSuffix(suffix)
    dialog.fileSelected.connect(chosen)
    dialog.finished.connect(dialog.deleteLater)
    open_beside(dialog)
    return dialog


def _there(folder: str) -> str:
    """Return the folder, or the nearest one above it that there is; Qt would take the working one.

    Many folders are made only once something is written.
    """
    path = Path(folder)
    return next((str(each) for each in (path, *path.parents) if folder and each.is_dir()), "")
