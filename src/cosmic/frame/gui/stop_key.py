"""The key that stops everything, from any window of the program and any focus."""

from collections.abc import Sequence
from typing import Final, cast

from PySide6.QtCore import QEvent, QKeyCombination, QObject, Qt, Signal
from PySide6.QtGui import QKeyEvent, QKeySequence
from PySide6.QtWidgets import QApplication

from cosmic.frame.gui.key_focus import is_being_edited
from cosmic.frame.overrides import override

_KEY_EVENTS: Final = (QEvent.Type.ShortcutOverride, QEvent.Type.KeyPress, QEvent.Type.KeyRelease)


class StopKeyFilter(QObject):
    """Turns the stop key, and Escape outside an edited field, into `stop_requested`.

    It sees every key before any widget does; menus, dialogs and floating panels included.
    Modifiers are ignored: a hand that misses by Shift still means it.

    Parameters
    ----------
    key : str
        The key as Qt writes it, such as "F12".

    Raises
    ------
    ValueError
        There is no such key.
    """

    stop_requested = Signal(str)
    """The operator wants everything stopped; which key, for the reason shown."""

    def __init__(self, app: QApplication, key: str = "F12", parent: QObject | None = None) -> None:
        super().__init__(parent or app)
        self._name = key
        self._key = combination_of(key).key()
        self._told = False
        app.installEventFilter(self)

    @property
    def key(self) -> str:
        """The stop key as it is written on the buttons."""
        return self._name

    @override
    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() not in _KEY_EVENTS or not isinstance(event, QKeyEvent):
            return False
        name = self._wanted(event)
        if not name:
            return False
        event.accept()  # a shortcut with the same key must not come first
        self._tell(event, name)
        # Escape goes on to close the menu or dialog it was pressed in; F12 means nothing else.
        return name == self._name or event.type() == QEvent.Type.ShortcutOverride

    def _tell(self, event: QKeyEvent, name: str) -> None:
        """Emit once per press: a key that goes on is seen again in each widget on its way."""
        if event.type() != QEvent.Type.KeyPress:
            self._told = False
        elif not event.isAutoRepeat() and not self._told:
            self._told = True
            self.stop_requested.emit(name)

    def _wanted(self, event: QKeyEvent) -> str:
        """Return the name of the key when it means stop, or nothing."""
        if event.key() == self._key:
            return self._name
        if event.key() == Qt.Key.Key_Escape and not is_being_edited(QApplication.focusWidget()):
            return "Esc"
        return ""


def combination_of(text: str) -> QKeyCombination:
    """Return the key, with its modifiers, that `text` names.

    Raises
    ------
    ValueError
        There is no such key, or it is more than one.
    """
    sequence = QKeySequence(text)
    # The type stubs do not know that a sequence can be indexed.
    keys = cast("Sequence[QKeyCombination]", sequence)
    if sequence.count() != 1 or keys[0].key() == Qt.Key.Key_unknown:
        raise ValueError(f"{text!r} is not the name of a key, such as F12, Left or Shift+J")
    return keys[0]
