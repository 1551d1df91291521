"""The number keys of a window as an input device."""

from typing import Final

from PySide6.QtCore import QObject, QTimer
from PySide6.QtWidgets import QApplication

from cosmic.frame.gui.key_hold import HoldKeys
from cosmic.mico.hw.keyboard_input import FINE_KEY, KEYS, KeyboardInput

BEAT_MS: Final = 20


class SteeringKeys(QObject):
    """Tells a `KeyboardInput` which keys are held, and by a timer that the window is alive.

    A window that hangs beats no more, so that the input counts as frozen.
    """

    def __init__(self, app: QApplication, keyboard: KeyboardInput, parent: QObject) -> None:
        super().__init__(parent)
        self._keyboard = keyboard
        keys = [key for pair in KEYS.values() for key in pair]
        self._hold = HoldKeys(app, [*keys, FINE_KEY], self)
        self._hold.set_enabled(False)
        self._hold.hold_started.connect(self._on_changed)
        self._hold.hold_ended.connect(self._on_changed)
        self._timer = QTimer(self, interval=BEAT_MS)
        self._timer.timeout.connect(keyboard.beat)
        self._enabled = False
        keyboard.plug(plugged=True)

    def set_enabled(self, enabled: bool) -> None:
        """Let the keys steer, or leave them to others."""
        if enabled != self._enabled:
            self._enabled = enabled
            self._hold.set_enabled(enabled)
            self._keyboard.hold(())

    def unplug(self) -> None:
        """Listen no more."""
        self.set_enabled(False)
        self._timer.stop()
        self._keyboard.plug(plugged=False)

    def _on_changed(self, _key: str) -> None:
        held = self._hold.held
        self._keyboard.hold(held)
        if held:
            self._timer.start()
        else:
            self._timer.stop()
