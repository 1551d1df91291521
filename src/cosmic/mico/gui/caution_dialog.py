"""Asks before something is done that could cost a sample or a probe."""

from collections.abc import Callable, Sequence

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QMessageBox, QWidget


class CautionDialog(QMessageBox):
    """Says what is about to happen and what speaks against it; GUI thread.

    It never blocks: STOP can be reached meanwhile. Enter and Escape are no.

    Parameters
    ----------
    title : str
        What it is about.
    what : str
        What would be done, with its numbers.
    doubts : sequence of str
        What speaks against it.
    go_text : str
        The verb that the button does it by.
    go : callable
        Does it.
    """

    def __init__(
        self,
        title: str,
        what: str,
        doubts: Sequence[str],
        go_text: str,
        go: Callable[[], None],
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self.setObjectName("cautionDialog")
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setIcon(QMessageBox.Icon.NoIcon)
        self.setTextFormat(Qt.TextFormat.PlainText)
        self.setWindowTitle(title)
        self.setText(what)
        self.setInformativeText("\n".join(f"▲ {each}" for each in doubts))
        role = QMessageBox.ButtonRole
        self.go = self.addButton(go_text, role.DestructiveRole)
        self.go.setToolTip("Continue. Make sure first that no gripper holds anything")
        self.cancel = self.addButton("Cancel", role.RejectRole)
        self.cancel.setToolTip("Cancel; nothing moves")
        self.setDefaultButton(self.cancel)
        self.setEscapeButton(self.cancel)
        self.setModal(False)
        self.go.clicked.connect(go)
