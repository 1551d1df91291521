"""Keeps the wheel from changing what it only passes over."""

from typing import Final

from PySide6.QtCore import QEvent, QObject, Qt
from PySide6.QtWidgets import (
    QAbstractSlider,
    QAbstractSpinBox,
    QApplication,
    QComboBox,
    QScrollBar,
    QTabBar,
    QWidget,
)

from cosmic.frame.overrides import override

_EVENTS: Final = (QEvent.Type.Wheel, QEvent.Type.Polish)
_NEVER: Final = (QComboBox, QTabBar)
"""A list is chosen from when it is open; a tab is clicked."""
_WITH_FOCUS: Final = (QAbstractSpinBox, QAbstractSlider)


class WheelGuard(QObject):
    """Hands the wheel on to what scrolls, wherever it would change a value unasked.

    A combo box and a tab bar never react to the wheel; a spin box and a slider do once they have
    the focus, which the wheel itself never gives. What lies around them scrolls instead. Scroll
    bars, open lists and pictures keep the wheel. GUI thread.
    """

    def __init__(self, app: QApplication, parent: QObject | None = None) -> None:
        super().__init__(parent or app)
        app.installEventFilter(self)
        for widget in app.allWidgets():
            _refuse_focus_by_wheel(widget)

    @override
    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() not in _EVENTS:
            return False
        if event.type() == QEvent.Type.Polish:
            _refuse_focus_by_wheel(watched)
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


def _refuse_focus_by_wheel(watched: QObject) -> None:
    """Qt gives the focus to these before they see the wheel, which would make them react."""
    if not isinstance(watched, QWidget) or not isinstance(watched, (*_NEVER, *_WITH_FOCUS)):
        return
    if watched.focusPolicy() == Qt.FocusPolicy.WheelFocus:
        watched.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
