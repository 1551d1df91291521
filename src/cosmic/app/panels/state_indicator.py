"""The small indicator of a state: its shape in its colour, to stand beside the word."""

from typing import Final

from PySide6.QtCore import QEvent, QRectF, Qt
from PySide6.QtGui import QColor, QPainter, QPen, QPixmap
from PySide6.QtWidgets import QLabel, QWidget

from cosmic.frame.gui.painting import painting
from cosmic.frame.gui.state_badge import shape_path
from cosmic.frame.gui.theme import State, current_palette, state_look
from cosmic.frame.overrides import override

INDICATOR_PX: Final = 12
_SHARPNESS: Final = 4
"""Pixels drawn for one of the window: sharp on any screen."""


def state_pixmap(state: State | None) -> QPixmap:
    """Return the shape of `state`; a hollow circle, which says nothing, where it is None."""
    pixmap = QPixmap(_SHARPNESS * INDICATOR_PX, _SHARPNESS * INDICATOR_PX)
    pixmap.setDevicePixelRatio(_SHARPNESS)
    pixmap.fill(Qt.GlobalColor.transparent)
    with painting(pixmap) as painter:
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        place = QRectF(1.0, 1.0, INDICATOR_PX - 2.0, INDICATOR_PX - 2.0)
        if state is None:
            painter.setPen(QPen(QColor(current_palette().dim), 1.2))
            painter.drawPath(shape_path(State.UNKNOWN, place.adjusted(1.0, 1.0, -1.0, -1.0)))
        else:
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(QColor(state_look(state).colour))
            painter.drawPath(shape_path(state, place))
    return pixmap


class StateIndicator(QLabel):
    """Shows the shape of a state, or the hollow circle; the word stands beside it."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._state: State | None = None
        self.set_state(None)

    @property
    def state(self) -> State | None:
        """What is shown."""
        return self._state

    def set_state(self, state: State | None) -> None:
        """Show `state`."""
        if state is not self._state or self.pixmap().isNull():
            self._state = state
            self.setPixmap(state_pixmap(state))

    @override
    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "_state"):
            self.setPixmap(state_pixmap(self._state))
