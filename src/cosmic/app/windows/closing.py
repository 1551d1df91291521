"""Closing asks first: while something would be lost, and whether to park the tools."""

from abc import abstractmethod
from collections.abc import Callable, Sequence
from typing import Final

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtWidgets import QMessageBox, QPushButton, QWidget

from cosmic.app.rig import A_CAMPAIGN, Rig
from cosmic.app.windows.fibre_menu import FibreOperations
from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.relay import Relay
from cosmic.frame.operation import Progress
from cosmic.frame.overrides import override
from cosmic.mico.gui.mico_widget import MicoWidget

PARK: Final = "park"
"""Name of the pose that tools are parked in."""


def what_is_lost(rig: Rig, operations: FibreOperations | None, *, force: bool) -> tuple[str, ...]:
    """Return what ends with the window, a sentence each; empty for nothing.

    Parameters
    ----------
    operations : FibreOperations or None
        What knows of a fibre that is held.
    force : bool
        Recordings of it are made by this program.
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
    recorded = _force(rig) if force else []
    found += [f"The recording {name} ends; what it has is kept." for name in recorded]
    found += [f"The images {name} end; what they have is kept." for name in _images(rig)]
    return tuple(found)


def _force(rig: Rig) -> list[str]:
    """Return the name of the recording of the force that is written."""
    try:
        recording = rig.daqco.recording
    except CosmicError:
        return []  # what cannot be asked must not keep the window open
    if not recording.active:
        return []
    return [recording.path.name if recording.path is not None else ""]


def _images(rig: Rig) -> list[str]:
    """Return the names of the recordings of images that this program writes."""
    try:
        cameras = [rig.vico.camera(name) for name in rig.vico.cameras]
        recordings = [each.recording for each in cameras if not each.remote]
    except CosmicError:
        return []
    return [each.path.name if each.path is not None else "" for each in recordings if each.active]


class CloseDialog(QMessageBox):
    """Asks whether to close, with `now` and `cancel`; it never blocks."""

    def __init__(self, text: str, parent: QWidget) -> None:
        super().__init__(parent)
        self.setObjectName("closeDialog")
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setIcon(QMessageBox.Icon.NoIcon)
        self.setWindowTitle("Close")
        self.setText(text)
        self.now = self.addButton("Close now", QMessageBox.ButtonRole.DestructiveRole)
        self.cancel = self.addButton("Cancel", QMessageBox.ButtonRole.RejectRole)
        self.setDefaultButton(self.cancel)
        self.setEscapeButton(self.cancel)
        self.setModal(False)


class ParkDialog(CloseDialog):
    """Asks whether to park before the window closes."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(f"Move the tools to the pose {PARK} before the window closes?", parent)
        self.setObjectName("parkDialog")
        self.park: QPushButton = self.addButton(
            "Park, then close", QMessageBox.ButtonRole.AcceptRole
        )


class _Asking(QObject):
    """Asks once for each attempt to close, where there is something to ask; GUI thread.

    Signals
    -------
    given_up()
        The window is not to close after all: what was answered before counts no more.
    """

    given_up = Signal()

    def __init__(self, window: QWidget) -> None:
        super().__init__(window)
        self._window = window
        self._answered = self._skipped = False
        self.dialog: CloseDialog | None = None

    @abstractmethod
    def _question(self) -> CloseDialog | None:
        """Return what to ask; None: nothing."""

    def asks(self) -> bool:
        """Ask, where there is something to ask; True: the window is not to close now."""
        if self.dialog is not None:
            self.dialog.raise_()
            return True
        dialog = None if self._answered else self._question()
        if dialog is None:
            return False
        dialog.now.clicked.connect(self._close)
        dialog.rejected.connect(self.given_up)
        dialog.destroyed.connect(self._on_gone)
        self.dialog = dialog
        dialog.show()
        return True

    def skip(self) -> None:
        """Ask nothing from now on: whoever closes the window cannot answer."""
        self._answered = self._skipped = True
        if self.dialog is not None:
            self.dialog.close()
            self.dialog = None

    def forget(self) -> None:
        """Ask again at the next attempt to close."""
        self._answered = self._skipped

    def _on_gone(self) -> None:
        self.dialog = None

    def _close(self) -> None:
        self._answered = True
        self.dialog = None
        self._window.close()


class Closing(_Asking):
    """Asks while something would be lost; GUI thread.

    Parameters
    ----------
    lost : callable
        Returns what ends with the window, a sentence each.
    window : QWidget
        What closes.
    """

    def __init__(self, lost: Callable[[], Sequence[str]], window: QWidget) -> None:
        super().__init__(window)
        self._lost = lost

    @override
    def _question(self) -> CloseDialog | None:
        lost = self._lost()
        if not lost:
            return None
        dialog = CloseDialog("Close the window now?", self._window)
        dialog.setInformativeText("\n".join(lost))
        return dialog


class Parking(_Asking):
    """Offers to park the tools, where that is safe and there is a pose to go to; GUI thread.

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
        self._gui, self._busy = gui, busy
        self._relay = Relay(self._on_progressed)

    @override
    def _question(self) -> CloseDialog | None:
        if not self._may_park():
            return None
        dialog = ParkDialog(self._window)
        dialog.park.clicked.connect(self._on_park)
        return dialog

    def _may_park(self) -> bool:
        mico = self._gui.mico
        try:
            if not mico.ready or mico.stop_state.reason is not None or self._busy():
                return False
            return PARK in mico.poses.names and not mico.application.cautions.reasons()
        except CosmicError:
            return False  # what cannot be asked must not keep the window open

    def _on_park(self) -> None:
        try:
            task = self._gui.mico.poses.go(PARK, wait=False)
        except CosmicError as exc:
            self._fail(str(exc))
            return
        task.subscribe(self._relay)

    def _on_progressed(self, progress: Progress) -> None:
        if not progress.done:
            return
        if progress.error:
            self._fail(progress.error)
        else:
            self._close()

    def _fail(self, why: str) -> None:
        self.failed.emit(why)
        self.given_up.emit()
