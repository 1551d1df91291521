"""The questions before something moves: its position is unknown, or something may be held."""

from collections.abc import Callable, Sequence

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QMessageBox, QWidget

from cosmic.mico.gui.axis_commands import ConsentRequest


class ConsentDialog(QMessageBox):
    """Offers to move anyway or to initialise first; never blocks, STOP can be reached meanwhile.

    Signals
    -------
    initialise_requested()
        The operator prefers to find the references.
    """

    initialise_requested = Signal()

    def __init__(self, request: ConsentRequest, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._request = request
        self.setObjectName("consentDialog")
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setIcon(QMessageBox.Icon.NoIcon)
        self.setWindowTitle(f"{request.axis}: position unknown")
        self.setText(
            f"The position of {request.axis} is unknown, so its limits cannot be checked.\n"
            f"You asked it to {request.what}."
        )
        self.setInformativeText("Make sure that its path is clear.")
        role = QMessageBox.ButtonRole
        self.move_anyway = self.addButton("Move anyway", role.DestructiveRole)
        self.move_anyway.setToolTip("Move anyway. You are responsible for a clear path.")
        self.initialise_first = self.addButton("Initialise first", role.AcceptRole)
        self.initialise_first.setToolTip("Find the reference of every axis in the safe order")
        cancel = self.addButton("Cancel", role.RejectRole)
        cancel.setToolTip("Do nothing")
        self.setDefaultButton(cancel)  # an Enter too many must not set axes going
        self.setEscapeButton(cancel)
        self.setModal(False)
        self.move_anyway.clicked.connect(self._on_move_anyway)
        self.initialise_first.clicked.connect(self.initialise_requested)

    def _on_move_anyway(self) -> None:
        self._request.go()


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
