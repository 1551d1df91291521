"""Keeps the wheel from changing what it only passes over."""

from typing import Final

from PySide6.QtCore import QEvent, QObject, Qt
from PySide6.QtGui import QWheelEvent
from PySide6.QtWidgets import (
    QAbstractSlider,
    QAbstractSpinBox,
    QApplication,
    QComboBox,
    QScrollBar,
    QTabBar,
    QWidget,
)

from cosmic.frame.gui.application_events import ApplicationEvents

_NEVER: Final = (QComboBox, QTabBar)
"""A list is chosen from when it is open; a tab is clicked."""
_WITH_FOCUS: Final = (QAbstractSpinBox, QAbstractSlider)


class WheelGuard(QObject):
    """Hands the wheel on to what scrolls, wherever it would change a value unasked.

    A combo box and a tab bar never react to the wheel; a spin box and a slider do once they have
    the focus, which the wheel itself never gives. What lies around them scrolls instead. Scroll
    bars, open lists and images keep the wheel. GUI thread.
    """

    def __init__(self, app: QApplication, parent: QObject | None = None) -> None:
        super().__init__(parent or app)
        ApplicationEvents.of(app).add(self, self._on_wheel, QWheelEvent)

    def _on_wheel(self, watched: QObject, event: QEvent) -> bool:
        if not isinstance(event, QWheelEvent):
            return False
        if not isinstance(watched, QWidget):
            _refuse_focus_by_wheel(QApplication.widgetAt(event.globalPosition().toPoint()))
            return False
        if not _is_guarded(watched):
            return False
        event.ignore()  # Qt then offers it to the parent, which scrolls
        return True


def _is_guarded(watched: QObject) -> bool:
    if isinstance(watched, _NEVER):
        return True
    if not isinstance(watched, _WITH_FOCUS) or isinstance(watched, QScrollBar):
        return False
    return not watched.hasFocus()


def _refuse_focus_by_wheel(widget: QWidget | None) -> None:
    """Keep Qt from giving the focus to what the wheel is turned over, before it does.

    A combo box, a spin box and what lies in them would react then.
    """
    while widget is not None and not widget.isWindow():
        if widget.focusPolicy() == Qt.FocusPolicy.WheelFocus:
            widget.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        widget = widget.parentWidget()
