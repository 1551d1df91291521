"""Closing offers to park the tools first, where that is safe and there is a pose to go to."""

from collections.abc import Callable
from typing import Final

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtWidgets import QMessageBox, QWidget

from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.relay import Relay
from cosmic.frame.operation import Progress
from cosmic.mico.gui.mico_widget import MicoWidget

PARK: Final = "park"
"""Name of the pose that tools are parked in."""


class ParkDialog(QMessageBox):
    """Asks whether to park before the window closes; it never blocks."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.setObjectName("parkDialog")
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setIcon(QMessageBox.Icon.NoIcon)
        self.setWindowTitle("Close")
        self.setText(f"Move the tools to the pose {PARK} before the window closes?")
        role = QMessageBox.ButtonRole
        self.park = self.addButton("Park, then close", role.AcceptRole)
        self.now = self.addButton("Close now", role.DestructiveRole)
        self.cancel = self.addButton("Cancel", role.RejectRole)
        self.setDefaultButton(self.cancel)
        self.setEscapeButton(self.cancel)
        self.setModal(False)


class Parking(QObject):
    """Offers to park, once for each attempt to close; GUI thread.

    Never while an object may be held, something moves, or motion is stopped.

    Parameters
    ----------
    gui : MicoWidget
        Whose tools are parked.
    busy : callable
        Tells whether something moves or runs.
    window : QWidget
        What closes.

    Signals
    -------
    failed(str)
        The tools could not be parked; the window stays.
    """

    failed = Signal(str)

    def __init__(self, gui: MicoWidget, busy: Callable[[], bool], window: QWidget) -> None:
        super().__init__(window)
        self._gui, self._busy, self._window = gui, busy, window
        self._relay = Relay(self._on_progressed)
        self._answered = False
        self.dialog: ParkDialog | None = None

    def asks(self) -> bool:
        """Ask, where there is something to ask; True: the window is not to close now."""
        if self.dialog is not None:
            self.dialog.raise_()
            return True
        if self._answered or not self._may_park():
            return False
        dialog = ParkDialog(self._window)
        dialog.park.clicked.connect(self._on_park)
        dialog.now.clicked.connect(self._close)
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

    def _may_park(self) -> bool:
        mico = self._gui.mico
        try:
            if not mico.ready or mico.stop_state.reason is not None or self._busy():
                return False
            return PARK in mico.poses.names and not mico.application.cautions.reasons()
        except CosmicError:
            return False  # what cannot be asked must not keep the window open

    def _on_gone(self) -> None:
        self.dialog = None

    def _on_park(self) -> None:
        try:
            task = self._gui.mico.poses.go(PARK, wait=False)
        except CosmicError as exc:
            self.failed.emit(str(exc))
            return
        task.subscribe(self._relay)

    def _on_progressed(self, progress: Progress) -> None:
        if not progress.done:
            return
        if progress.error:
            self.failed.emit(progress.error)
        else:
            self._close()

    def _close(self) -> None:
        self._answered = True
        self.dialog = None
        self._window.close()
