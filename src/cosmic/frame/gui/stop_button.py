"""The STOP button: the one control that must be found without looking for it."""

from typing import Final

from PySide6.QtCore import QEvent, QObject, Qt, Signal
from PySide6.QtGui import QMouseEvent
from PySide6.QtWidgets import QApplication, QPushButton, QSizePolicy, QWidget

from cosmic.frame.gui.application_events import ApplicationEvents
from cosmic.frame.gui.theme import LARGE_PX, ui_font
from cosmic.frame.overrides import override

STOP_HEIGHT_PX: Final = 50
_PRESSES: Final = (QEvent.Type.MouseButtonPress, QEvent.Type.MouseButtonDblClick)


class StopButton(QPushButton):
    """Red, at least 48 px high, with its key written on it.

    It acts when the mouse button goes down, not up: a stop must not wait for the finger. Nor for a
    menu: one that is open gets the press that is meant for the button, and would only close.

    Parameters
    ----------
    key_text : str
        The key as it is written on the keyboard, such as "F12".
    """

    stop_requested = Signal()

    def __init__(self, key_text: str = "F12", parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("stopButton")
        self.setFont(ui_font(LARGE_PX, bold=True))
        self.setMinimumHeight(STOP_HEIGHT_PX)
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setText(f"STOP  {key_text}".rstrip())
        self.setToolTip(
            f"Stop every movement now and keep it stopped until Reset ({key_text}, from any "
            "window; Esc too, where it has nothing to cancel)"
        )
        self.setAccessibleName("Stop all movement")
        self._pressed_ms = 0
        self.pressed.connect(self.stop_requested)
        app = QApplication.instance()
        if isinstance(app, QApplication):
            ApplicationEvents.of(app).add(self, self._on_any_press, QMouseEvent)

    def _on_any_press(self, watched: QObject, event: QEvent) -> bool:
        """Stop where a menu or the list of a box has a press that is on the button."""
        if event.type() not in _PRESSES or not isinstance(event, QMouseEvent):
            return False
        popup = QApplication.activePopupWidget()
        if popup is None or watched is not popup or event.button() is not Qt.MouseButton.LeftButton:
            return False
        at = event.globalPosition().toPoint()
        over_popup = popup.rect().contains(popup.mapFromGlobal(at))
        if self.isVisible() and self.rect().contains(self.mapFromGlobal(at)) and not over_popup:
            self._pressed_ms = event.timestamp()
            self.stop_requested.emit()
        return False

    @override
    def mousePressEvent(self, event: QMouseEvent) -> None:
        # Qt hands some presses on once the list of a box has closed.
        if event.timestamp() and event.timestamp() == self._pressed_ms:
            event.accept()
            return
        super().mousePressEvent(event)
