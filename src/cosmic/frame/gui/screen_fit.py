"""Nothing opens larger than the screen, or beyond its edge: STOP could be out of sight there."""

from PySide6.QtCore import QEvent, QObject, QRect, QSize, Qt, QTimer
from PySide6.QtGui import QResizeEvent, QShowEvent
from PySide6.QtWidgets import QApplication, QDialog, QScrollArea, QWidget
from shiboken6 import isValid

from cosmic.frame.gui.application_events import ApplicationEvents
from cosmic.frame.gui.build import named
from cosmic.frame.overrides import override

FRAME_PX = 32
"""How high a title bar is taken to be until the desktop has put one round the window."""
_LEAST = QSize(160, 80)


def room_for(window: QWidget) -> QRect | None:
    """Return the part of its screen that windows may cover, in logical pixels; None offscreen.

    Offscreen nobody looks: an image may be as large as it was asked to be.
    """
    if QApplication.platformName() in ("offscreen", "minimal"):
        return None
    return window.screen().availableGeometry()


def fit_to_screen(window: QWidget) -> None:
    """Make a window no larger than the room on its screen, and put it inside; GUI thread."""
    room = _room_within_frame(window)
    if room is None or not window.isWindow() or window.isMaximized() or window.isFullScreen():
        return
    inner = window.geometry()
    wanted = QRect(inner.topLeft(), inner.size().boundedTo(room.size()))
    wanted.moveLeft(max(room.left(), min(wanted.left(), room.right() + 1 - wanted.width())))
    wanted.moveTop(max(room.top(), min(wanted.top(), room.bottom() + 1 - wanted.height())))
    if wanted != inner:
        window.setGeometry(wanted)


def limit_to_least(window: QWidget, least: QSize) -> None:
    """Let a window be made no smaller than that, or than its screen where that is smaller."""
    room = _room_within_frame(window)
    if room is not None:
        window.setMinimumSize(least.boundedTo(room.size()))


def _room_within_frame(window: QWidget) -> QRect | None:
    """Return what a window may cover inside its frame; None offscreen."""
    room = room_for(window)
    if room is None:
        return None
    inner, outer = window.geometry(), window.frameGeometry()
    framed = outer != inner
    left, top = (inner.x() - outer.x(), inner.y() - outer.y()) if framed else (0, FRAME_PX)
    right, bottom = outer.right() - inner.right(), outer.bottom() - inner.bottom()
    return room.adjusted(left, top, -right, -bottom)


class DialogFitter(QObject):
    """Fits each dialog of the program to its screen when it opens."""

    def __init__(self, app: QApplication, parent: QObject | None = None) -> None:
        super().__init__(parent or app)
        ApplicationEvents.of(app).add(self, self._on_shown, QShowEvent)

    def _on_shown(self, watched: QObject, _event: QEvent) -> bool:
        if isinstance(watched, QDialog):
            QTimer.singleShot(0, lambda: fit_to_screen(watched) if isValid(watched) else None)
        return False


class FittedPanel(QScrollArea):
    """Gives a panel all the room there is, and scrolls where that is less than it needs.

    Unlike a plain scroll area it lets a panel that scrolls by itself shrink to its least size
    first, and asks for no more room than a corner of it.
    """

    def __init__(self, panel: QWidget) -> None:
        super().__init__()
        named(self, "dockScroll")
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setMinimumSize(_LEAST)
        self._panel = panel
        self.setWidget(panel)
        self._fit()

    def _fit(self) -> None:
        room = self.maximumViewportSize()
        width, height = self._size_in(room.width())
        if height > room.height():
            width, height = self._size_in(
                room.width() - self.verticalScrollBar().sizeHint().width()
            )
        if width > room.width():
            room.setHeight(room.height() - self.horizontalScrollBar().sizeHint().height())
        self._panel.resize(width, max(height, room.height()))

    def _size_in(self, room_px: int) -> tuple[int, int]:
        """Return the width in so much room, and the least height at that width."""
        panel, layout = self._panel, self._panel.layout()
        least = panel.minimumSizeHint().expandedTo(panel.minimumSize())
        width = max(room_px, least.width())
        if layout is not None and layout.hasHeightForWidth():
            return width, max(layout.minimumHeightForWidth(width), panel.minimumHeight())
        return width, least.height()

    @override
    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    @override
    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if watched is self._panel and event.type() == QEvent.Type.LayoutRequest:
            self._fit()
        return super().eventFilter(watched, event)

    @override
    def sizeHint(self) -> QSize:
        return self._panel.sizeHint()
