"""Closing asks first while something would be lost: a run, a recording, a fibre that is held."""

from collections.abc import Callable, Sequence

from PySide6.QtCore import QObject, Qt
from PySide6.QtWidgets import QMessageBox, QWidget

from cosmic.app.rig import A_CAMPAIGN, Rig
from cosmic.app.windows.fibre_menu import FibreOperations
from cosmic.frame.errors import CosmicError


def what_is_lost(rig: Rig, operations: FibreOperations | None, *, force: bool) -> tuple[str, ...]:
    """Return what ends with the window, a sentence each; empty for nothing.

    Parameters
    ----------
    operations : FibreOperations or None
        What knows of a fibre that is held.
    force : bool
        Recordings are made by this program.
    """
    found: list[str] = []
    if running := rig.running:
        later = " Resume goes on with it another time." if running == A_CAMPAIGN else ""
        found.append(f"{running[:1].upper()}{running[1:]} is running: it is aborted.{later}")
    handling = operations.handling if operations is not None and operations.used else None
    if handling is not None and handling.may_hold:
        found.append(
            f"The {handling.may_hold} gripper was opened since it took a fibre and may still hold "
            "it: nothing knows of it at the next start. Put it away first."
        )
    if handling is not None and handling.held_by:
        found.append(
            f"The {handling.held_by} gripper holds a fibre: it stays in the jaws, and nothing "
            "knows of it at the next start. Put it away first."
        )
    if force:
        try:
            recording = rig.daqco.recording
        except CosmicError:
            recording = None  # what cannot be asked must not keep the window open
        if recording is not None and recording.active:
            name = recording.path.name if recording.path is not None else ""
            found.append(f"The recording {name} ends; what it has is kept.")
    return tuple(found)


class CloseDialog(QMessageBox):
    """Says what is lost, and asks whether to close all the same; it never blocks."""

    def __init__(self, lost: Sequence[str], parent: QWidget) -> None:
        super().__init__(parent)
        self.setObjectName("closeDialog")
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setIcon(QMessageBox.Icon.NoIcon)
        self.setWindowTitle("Close")
        self.setText("Close the window now?")
        self.setInformativeText("\n".join(lost))
        role = QMessageBox.ButtonRole
        self.now = self.addButton("Close now", role.DestructiveRole)
        self.cancel = self.addButton("Cancel", role.RejectRole)
        self.setDefaultButton(self.cancel)
        self.setEscapeButton(self.cancel)
        self.setModal(False)


class Closing(QObject):
    """Asks once for each attempt to close, while something would be lost; GUI thread.

    Parameters
    ----------
    lost : callable
        Returns what ends with the window, a sentence each.
    window : QWidget
        What closes.
    """

    def __init__(self, lost: Callable[[], Sequence[str]], window: QWidget) -> None:
        super().__init__(window)
        self._lost, self._window = lost, window
        self._answered = False
        self.dialog: CloseDialog | None = None

    def asks(self) -> bool:
        """Ask, where there is something to ask; True: the window is not to close now."""
        if self.dialog is not None:
            self.dialog.raise_()
            return True
        if self._answered:
            return False
        lost = self._lost()
        if not lost:
            return False
        dialog = CloseDialog(lost, self._window)
        dialog.now.clicked.connect(self._on_now)
        dialog.destroyed.connect(self._on_gone)
        self.dialog = dialog
        dialog.show()
        return True

    def skip(self) -> None:
        """Ask nothing from now on: whoever closes the window cannot answer."""
        self._answered = True
        if self.dialog is not None:
            self.dialog.close()
            self.dialog = None

    def _on_gone(self) -> None:
        self.dialog = None

    def _on_now(self) -> None:
        self._answered = True
        self.dialog = None
        self._window.close()
