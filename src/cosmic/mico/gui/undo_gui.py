"""The button and the key that take the last movement back."""

from typing import Final

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtGui import QKeySequence, QShortcut
from PySide6.QtWidgets import QWidget

from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.theme import State
from cosmic.mico.api.group import GroupMovement
from cosmic.mico.api.mico import Mico
from cosmic.mico.core.undo import UndoEntry

UNDO_KEY: Final = "Ctrl+Z"


class _Relay(QObject):
    """Brings the end of a movement to the window's thread; outlives it."""

    ended = Signal(object)


class UndoGui(QObject):
    """Takes back what moved last, and says what that is; GUI thread.

    A field that is being edited keeps Ctrl+Z for itself, as it does everywhere.

    Signals
    -------
    said(str, State)
        How it went.
    available(str)
        What would be taken back; empty when there is nothing.
    """

    said = Signal(str, object)
    available = Signal(str)

    def __init__(self, mico: Mico, parent: QWidget) -> None:
        super().__init__(parent)
        self._mico = mico
        self._relay = _Relay()
        self._relay.ended.connect(self._on_ended, Qt.ConnectionType.QueuedConnection)
        shortcut = QShortcut(QKeySequence(UNDO_KEY), parent)
        shortcut.activated.connect(self.undo)
        mico.application.undo.changed.connect(self.show_available)

    def show_available(self) -> None:
        """Say what would be taken back now."""
        entries = self._mico.undo_entries
        self.available.emit(_what(entries[0]) if entries else "")

    def undo(self) -> None:
        """Begin to move back; returns at once."""
        try:
            movement = self._mico.undo(wait=False)
        except CosmicError as exc:
            self.said.emit(f"Undo: {exc}", State.REFUSED)
            return
        self.said.emit(f"Undo: moving {', '.join(movement.movements)} back", State.BUSY)
        movement.add_callback(self._relay.ended.emit)

    def _on_ended(self, movement: GroupMovement) -> None:
        error = movement.exception()
        if error is not None:
            self.said.emit(f"Undo ended: {error}", State.ERROR)
        else:
            self.said.emit(f"Undo: {', '.join(movement.movements)} back", State.OK)
        self.show_available()


def _what(entry: UndoEntry) -> str:
    return f"move {', '.join(entry.before)} back to where it was ({entry.group})"
