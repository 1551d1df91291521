"""Keys that act as long as they are held, for jogging."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from PySide6.QtCore import QEvent, QObject, Qt, QTimer, QTimerEvent, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QApplication, QWidget

from cosmic.frame.clock import WALL
from cosmic.frame.gui.application_events import ApplicationEvents
from cosmic.frame.gui.key_focus import takes_text
from cosmic.frame.gui.stop_key import combination_of
from cosmic.frame.overrides import override

GUARD_MS: Final = 50
GRACE_MS: Final = 25
WINDOW_LOST: Final = "another window has the keyboard"
_TEXT: Final = "a text field has the keyboard"
_MODIFIERS: Final = (
    Qt.KeyboardModifier.ShiftModifier
    | Qt.KeyboardModifier.ControlModifier
    | Qt.KeyboardModifier.AltModifier
    | Qt.KeyboardModifier.MetaModifier
)
_KEY_EVENTS: Final = (QEvent.Type.ShortcutOverride, QEvent.Type.KeyPress, QEvent.Type.KeyRelease)


@dataclass(frozen=True, slots=True)
class _Combination:
    key: Qt.Key
    modifiers: Qt.KeyboardModifier


class HoldKeys(QObject):
    """Says when a key goes down and when it comes up, whatever happens in between.

    Auto-repeat starts nothing again and ends nothing. X11 repeats a key as releases and presses
    that Qt does not always mark as such (seen with Qt 6.11 under Xvfb, the pair within one
    millisecond); so a release counts once no press has followed it for `GRACE_MS`.

    Everything held ends as well when its window or the program is no longer the active one,
    when the focus goes to where text is typed, and when a menu, a dialog or a drag takes the
    input: no key may stay held unseen.

    Parameters
    ----------
    keys : iterable of str
        The keys as Qt writes them, such as "Left", "PgUp", "Shift+A".

    Raises
    ------
    ValueError
        One of them is no key.
    """

    hold_started = Signal(str)
    hold_lost = Signal(str, str)
    """The key is about to end though it did not come up; with what took it away."""
    hold_ended = Signal(str)

    def __init__(
        self, app: QApplication, keys: Iterable[str] = (), parent: QObject | None = None
    ) -> None:
        super().__init__(parent or app)
        self._names: dict[_Combination, str] = {}
        self._held: dict[int, str] = {}
        self._coming_up: dict[int, int] = {}  # timer of each key that may have come up
        self._up_since_s: dict[int, float] = {}
        self._enabled = True
        self._guard = QTimer(self, interval=GUARD_MS)
        self._guard.timeout.connect(self._on_guard)
        self.set_keys(keys)
        ApplicationEvents.of(app).add(self, self._on_key_event, QKeyEvent)
        app.focusWindowChanged.connect(self._on_window_changed)
        app.focusChanged.connect(self._on_focus_changed)
        app.applicationStateChanged.connect(self._on_guard)

    @property
    def held(self) -> tuple[str, ...]:
        """The keys held now."""
        return tuple(self._held.values())

    def set_keys(self, keys: Iterable[str]) -> None:
        """Act on `keys` from now on; ends what is held."""
        self.release_all()
        self._names = {_combination(name): name for name in keys}

    def set_enabled(self, enabled: bool) -> None:
        """Let keys act or not; ends what is held."""
        self._enabled = enabled
        self.release_all()

    def release_all(self, why: str = "") -> None:
        """End everything held; the keys must come up before they act again.

        With `why`, `hold_lost` tells it of each.
        """
        self._guard.stop()
        for key in list(self._held):
            if why:
                self.hold_lost.emit(self._held[key], why)
            self._end(key)

    def _on_window_changed(self) -> None:
        self.release_all(WINDOW_LOST)

    def _on_key_event(self, _watched: QObject, event: QEvent) -> bool:
        kind = event.type()
        if not isinstance(event, QKeyEvent) or kind not in _KEY_EVENTS:
            return False
        if event.key() in self._held:
            return self._on_held_key(event)
        if kind == QEvent.Type.KeyRelease:
            self._up_since_s[event.key()] = WALL.now_s()
            return False
        name = self._names.get(_Combination(Qt.Key(event.key()), event.modifiers() & _MODIFIERS))
        if name is None or not self._enabled or _input_is_outside():
            return False
        event.accept()
        if kind == QEvent.Type.KeyPress and not self._is_repeat(event):
            self._held[event.key()] = name
            self._guard.start()
            self.hold_started.emit(name)
        return True

    def _on_held_key(self, event: QKeyEvent) -> bool:
        """Handle a key that is held, whatever modifier has been pressed since."""
        event.accept()
        key = event.key()
        if event.type() == QEvent.Type.KeyPress and key in self._coming_up:
            self.killTimer(self._coming_up.pop(key))
        came_up = event.type() == QEvent.Type.KeyRelease and not event.isAutoRepeat()
        if came_up and key not in self._coming_up:
            self._coming_up[key] = self.startTimer(GRACE_MS, Qt.TimerType.PreciseTimer)
        return True

    def _is_repeat(self, event: QKeyEvent) -> bool:
        """Tell a press that only repeats a key which is down, but no longer held for us."""
        up_s = WALL.now_s() - self._up_since_s.get(event.key(), float("-inf"))
        return event.isAutoRepeat() or up_s * 1000.0 < GRACE_MS

    def _end(self, key: int) -> None:
        name = self._held.pop(key)
        if key in self._coming_up:
            self.killTimer(self._coming_up.pop(key))
        if not self._held:
            self._guard.stop()
        self.hold_ended.emit(name)

    @override
    def timerEvent(self, event: QTimerEvent) -> None:
        for key, timer in list(self._coming_up.items()):
            if timer == event.timerId():
                self._end(key)

    def _on_focus_changed(self, _old: QWidget | None, new: QWidget | None) -> None:
        if takes_text(new):
            self.release_all(_TEXT)

    def _on_guard(self) -> None:
        """End what is held where no event tells that the keyboard was taken away."""
        active = QApplication.applicationState() == Qt.ApplicationState.ApplicationActive
        why = _input_is_outside() if active else WINDOW_LOST
        if self._held and why:
            self.release_all(why)


def _input_is_outside() -> str:
    """Return what has the keyboard instead of the program's keys; empty when nothing has."""
    if takes_text(QApplication.focusWidget()):
        return _TEXT
    if QApplication.activePopupWidget() is not None:
        return "a menu is open"
    if QApplication.activeModalWidget() is not None:
        return "a dialog is open"
    grabbed = QWidget.mouseGrabber() is not None or QWidget.keyboardGrabber() is not None
    return "something is being dragged" if grabbed else ""


def _combination(name: str) -> _Combination:
    combination = combination_of(name)
    return _Combination(combination.key(), combination.keyboardModifiers() & _MODIFIERS)
