"""The key that stops everything, from any window of the program and any focus."""

from collections.abc import Callable, Sequence
from typing import Final, cast

from PySide6.QtCore import QEvent, QKeyCombination, QObject, Qt, Signal
from PySide6.QtGui import QKeyEvent, QKeySequence
from PySide6.QtWidgets import QApplication

from cosmic.frame.gui.application_events import ApplicationEvents
from cosmic.frame.gui.key_focus import escape_is_for

_KEY_EVENTS: Final = (QEvent.Type.ShortcutOverride, QEvent.Type.KeyPress, QEvent.Type.KeyRelease)


def _yes() -> bool:
    return True


class StopKeyFilter(QObject):
    """Turns the stop key into `stop_requested`, and Escape where there is nothing to cancel.

    It sees every key before any widget does; menus, dialogs and floating panels included.
    Modifiers are ignored: a hand that misses by Shift still means it.

    Escape cancels the innermost thing: popup, dialog, entry, tool. Only with nothing to cancel
    and something moving does it stop. What it means is decided once, when it goes down: an
    Escape that is held cancels one thing and does not go on to stop.

    Parameters
    ----------
    key : str
        The key as Qt writes it, such as "F12".
    moving : callable
        Tells whether anything moves that Escape should stop.

    Raises
    ------
    ValueError
        There is no such key.
    """

    stop_requested = Signal(str)
    """The operator wants everything stopped; which key, for the reason shown."""

    def __init__(
        self,
        app: QApplication,
        key: str = "F12",
        parent: QObject | None = None,
        *,
        moving: Callable[[], bool] = _yes,
    ) -> None:
        super().__init__(parent or app)
        self._name = key
        self._key = combination_of(key).key()
        self._moving = moving
        self._cancels: list[Callable[[], bool]] = []
        self._emitted = False
        self._escape_down = self._escape_taken = False
        self._down_stamp = self._up_stamp = 0
        ApplicationEvents.of(app).add(self, self._on_key_event, QKeyEvent)

    @property
    def key(self) -> str:
        """The stop key as it is written on the buttons."""
        return self._name

    def add_cancel(self, cancel: Callable[[], bool]) -> None:
        """Have Escape call `cancel` before it stops; it returns whether it cancelled anything.

        The one added last is called first.
        """
        self._cancels.insert(0, cancel)

    def _on_key_event(self, _watched: QObject, event: QEvent) -> bool:
        if not isinstance(event, QKeyEvent) or event.type() not in _KEY_EVENTS:
            return False
        if event.key() == self._key:
            return self._on_stop_key(event)
        return event.key() == Qt.Key.Key_Escape and self._on_escape(event)

    def _on_stop_key(self, event: QKeyEvent) -> bool:
        """Emit once per press, and let nobody else have the key."""
        event.accept()  # a shortcut with the same key must not come first
        if event.type() != QEvent.Type.KeyPress:
            self._emitted = False
        elif not event.isAutoRepeat() and not self._emitted:
            self._emitted = True
            self.stop_requested.emit(self._name)
        return True

    def _on_escape(self, event: QKeyEvent) -> bool:
        """Act at the first event of a press; return True to keep it from the widgets."""
        if self._is_new_press(event):
            self._escape_down, self._down_stamp = True, event.timestamp()
            self._escape_taken = self._act_on_escape()
        if event.type() == QEvent.Type.KeyRelease and not event.isAutoRepeat():
            self._escape_down, self._up_stamp = False, event.timestamp()
        if self._escape_taken:
            event.accept()
        return self._escape_taken

    def _is_new_press(self, event: QKeyEvent) -> bool:
        """Tell the first event of a press from the same one on its way, and from a repeat."""
        if event.type() == QEvent.Type.KeyRelease or event.isAutoRepeat():
            return False
        stamp = event.timestamp()
        if not self._escape_down:
            # X11 repeats a key as a release and a press of one moment.
            return QApplication.platformName() != "xcb" or stamp != self._up_stamp
        # The release may have gone to another program.
        return event.type() == QEvent.Type.ShortcutOverride and stamp != self._down_stamp

    def _act_on_escape(self) -> bool:
        """Cancel or stop; False where a widget cancels by itself, or nothing is to be done."""
        if escape_is_for(QApplication.focusWidget()):
            return False
        if any(cancel() for cancel in self._cancels):  # as far as the first that does
            return True
        if not self._moving():
            return False
        self.stop_requested.emit("Esc")
        return True


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
