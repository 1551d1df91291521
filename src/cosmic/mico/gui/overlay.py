"""A small frame that lies over its window below a button; nothing jumps, and it is no dialog."""

from PySide6.QtCore import QEvent, QObject, QPoint, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QApplication, QFrame, QWidget

from cosmic.frame.gui.theme import STEP_PX
from cosmic.frame.overrides import override


class Overlay(QFrame):
    """Closes by itself when the focus goes elsewhere, on Escape, and when the window changes.

    STOP, keys and everything else act as before. Fill it, then call `open_below`.

    Parameters
    ----------
    anchor : QWidget
        The button that it belongs to.
    """

    def __init__(self, anchor: QWidget) -> None:
        self._window = anchor.window()
        super().__init__(self._window)
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setFrameShape(QFrame.Shape.StyledPanel)
        self.setAutoFillBackground(True)
        self.anchor = anchor

    @property
    def is_editing(self) -> bool:
        """True while it is open: Escape closes it."""
        return self.isVisible()

    def open_below(self, first: QWidget) -> None:
        """Show it below its button, with the focus on `first`."""
        self._place()
        self.raise_()
        self._window.installEventFilter(self)
        app = QApplication.instance()
        if isinstance(app, QApplication):
            app.focusChanged.connect(self._on_focus_changed)
        self.show()
        first.setFocus()

    def _place(self) -> None:
        self.ensurePolished()
        self.adjustSize()
        window = self._window
        below = self.anchor.mapTo(window, QPoint(0, self.anchor.height() + STEP_PX // 2))
        x = max(0, min(below.x(), window.width() - self.width()))
        y = below.y()
        if y + self.height() > window.height():
            y -= self.height() + self.anchor.height() + STEP_PX
        self.move(x, max(0, y))

    def _holds(self, widget: QWidget) -> bool:
        """Return True for what is part of it, the list of a combo box too."""
        at: QWidget | None = widget
        while at is not None and at is not self:
            at = at.parentWidget()
        return at is self

    def _on_focus_changed(self, _before: QWidget | None, now: QWidget | None) -> None:
        if now is not None and now is not self.anchor and not self._holds(now):
            self.close()

    @override
    def keyPressEvent(self, event: QKeyEvent) -> None:
        super().keyPressEvent(event)
        if event.key() == Qt.Key.Key_Escape:
            self.close()

    @override
    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.Resize:
            self.close()
        return super().eventFilter(watched, event)
