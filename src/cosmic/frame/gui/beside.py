"""How dialogs and files open: beside the window, whose STOP can be clicked meanwhile."""

from pathlib import Path

from PySide6.QtCore import QUrl
from PySide6.QtGui import QDesktopServices
from PySide6.QtWidgets import QDialog, QMessageBox, QWidget


def open_with_desktop(path: Path) -> None:
    """Open a file with the program that the desktop has for it."""
    QDesktopServices.openUrl(QUrl.fromLocalFile(str(path)))


def open_beside(dialog: QDialog) -> None:
    """Show a dialog that takes no click from the window it belongs to; returns at once.

    A modal one would: STOP in the window would look as ever and stop nothing. The dialog is asked
    for only once: the same one that is open already comes to the front instead, and a question
    takes the place of the one before. A dialog that another one opens has that wait for it.
    """
    parent = dialog.parentWidget()
    earlier = _open_already(dialog, parent)
    if isinstance(earlier, QMessageBox):
        earlier.reject()
    elif earlier is not None:
        earlier.raise_()
        earlier.activateWindow()
        dialog.deleteLater()
        return
    asking = parent.window() if parent is not None else None
    if isinstance(asking, QDialog):
        asking.setEnabled(False)
        dialog.setEnabled(True)
        dialog.finished.connect(lambda: asking.setEnabled(True))
    dialog.setModal(False)
    dialog.show()


def _open_already(dialog: QDialog, parent: QWidget | None) -> QDialog | None:
    """Return the dialog of this kind and title that its owner has open."""
    open_now = [each for each in parent.children() if isinstance(each, QDialog)] if parent else []
    for each in open_now:
        same = type(each) is type(dialog) and each.windowTitle() == dialog.windowTitle()
        if same and each is not dialog and each.isVisible():
            return each
    return None
