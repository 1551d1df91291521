"""The STOP button: the one control that must be found without looking for it."""

from typing import Final

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QPushButton, QSizePolicy, QWidget

from cosmic.frame.gui.theme import LARGE_PX, ui_font

STOP_HEIGHT_PX: Final = 50


class StopButton(QPushButton):
    """Red, at least 48 px high, with its key written on it.

    It acts when the mouse button goes down, not up: a stop must not wait for the finger.

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
        self.set_key_text(key_text)
        self.pressed.connect(self.stop_requested)

    def set_key_text(self, key_text: str) -> None:
        """Write `key_text` on the button."""
        self.setText(f"STOP  {key_text}".rstrip())
        self.setToolTip(
            f"Stop every movement now and keep it stopped until Reset ({key_text}, from any "
            "window; Esc too, where it has nothing to cancel)"
        )
        self.setAccessibleName("Stop all movement")
