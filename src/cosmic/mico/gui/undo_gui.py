"""The button and the key that take the last movement back."""

from collections.abc import Callable
from typing import Final

from PySide6.QtCore import QObject, Signal
from PySide6.QtGui import QKeySequence, QShortcut
from PySide6.QtWidgets import QWidget

from cosmic.frame.errors import CosmicError, NotAvailable
from cosmic.frame.gui.relay import Relay
from cosmic.frame.gui.theme import State
from cosmic.mico.api.group_movement import GroupMovement
from cosmic.mico.api.mico import Mico
from cosmic.mico.core.motion.undo import UndoEntry, undo_text
from cosmic.mico.gui.consent_dialogs import CautionDialog

UNDO_KEY: Final = "Ctrl+Z"


class UndoGui(QObject):
    """Takes back what moved last, and says what that is; GUI thread.

    A field that is being edited keeps Ctrl+Z for itself, as it does everywhere.

    Signals
    -------
    said(str, State)
        How it went.
    available(str)
        What would be taken back, and where to; empty when there is nothing.
    planned(object)
        The poses it leads through, while it is asked about or under way; None afterwards.

    Attributes
    ----------
    doubt : callable
        Returns what speaks against it beside what the axes know; empty where nothing does.
    """

    said = Signal(str, object)
    available = Signal(str)
    planned = Signal(object)

    def __init__(self, mico: Mico, parent: QWidget) -> None:
        super().__init__(parent)
        self.doubt: Callable[[], str] = str
        self._mico = mico
        self._window = parent
        self._question: CautionDialog | None = None
        self._relay = Relay(self._on_ended, queued=True)
        shortcut = QShortcut(QKeySequence(UNDO_KEY), parent)
        shortcut.activated.connect(self.undo)
        self._entries: tuple[UndoEntry, ...] = ()
        self._changes = Relay(self._on_change).follow(mico.on_change)

    def _on_change(self) -> None:
        entries = self._mico.undo_entries
        if entries != self._entries:
            self._entries = entries
            self.show_available()

    def show_available(self) -> None:
        """Say what would be taken back now."""
        entries = self._mico.undo_entries
        self.available.emit(self._what(entries[0]) if entries else "")

    @property
    def question(self) -> CautionDialog | None:
        """What is asked before it goes back; None where nothing is."""
        return self._question

    def undo(self) -> None:
        """Show where it leads and begin to move back; asks first where something is felt or held.

        Returns at once.
        """
        if self._question is not None:
            self._question.raise_()
            return
        try:
            entry = self._mico.undo_entry()
        except CosmicError as exc:
            self.said.emit(f"Undo: {exc}", State.REFUSED)
            return
        doubts = tuple(text for text in (self.doubt(), *self._mico.undo_doubts(entry)) if text)
        self.planned.emit(self._poses(entry))
        if doubts:
            self._ask(entry, doubts)
        else:
            self._go(entry, confirm=False)

    def _ask(self, entry: UndoEntry, doubts: tuple[str, ...]) -> None:
        where = undo_text(entry, self._mico.states())
        question = CautionDialog(
            "Undo",
            f"Undo moves {where}.",
            doubts,
            "Move back",
            lambda: self._go(entry, confirm=True),
            self._window,
        )
        question.finished.connect(self._on_answered)
        self._question = question
        question.show()

    def _on_answered(self) -> None:
        question, self._question = self._question, None
        if question is not None and question.clickedButton() is not question.go:
            self.planned.emit(None)

    def _go(self, entry: UndoEntry, *, confirm: bool) -> None:
        states = self._mico.states()
        where = undo_text(entry, states)
        try:
            if self._mico.undo_entry() != entry:
                raise NotAvailable("an axis moved meanwhile; check again where the undo leads")
            movement = self._mico.undo(entry.group, wait=False, confirm=confirm)
        except CosmicError as exc:
            self.planned.emit(None)
            self.said.emit(f"Undo: {exc}", State.REFUSED)
            return
        self.said.emit(f"Undo: {where}, slowly", State.BUSY)
        movement.add_callback(self._relay)

    def _poses(self, entry: UndoEntry) -> list[dict[str, float]]:
        states = self._mico.states().values()
        now = {each.name: each.position for each in states if each.position is not None}
        return [now, {**now, **entry.before}]

    def _what(self, entry: UndoEntry) -> str:
        where = undo_text(entry, self._mico.states())
        return f"move {where} ({entry.group})"

    def _on_ended(self, movement: GroupMovement) -> None:
        self.planned.emit(None)
        error = movement.exception()
        if error is not None:
            self.said.emit(f"Undo ended: {error}", State.ERROR)
        else:
            self.said.emit(f"Undo: {', '.join(movement.movements)} back", State.OK)
        self.show_available()
