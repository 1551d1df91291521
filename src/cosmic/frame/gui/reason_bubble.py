"""The note that says, right below a field, why its entry was refused."""

from PySide6.QtCore import QEvent, QObject, QPoint, Qt
from PySide6.QtGui import QMouseEvent
from PySide6.QtWidgets import QLabel, QWidget
from shiboken6 import isValid

from cosmic.frame.gui.theme import STEP_PX
from cosmic.frame.overrides import override

_WIDTH_PX = 45 * STEP_PX
_FOLLOWED = {QEvent.Type.Move, QEvent.Type.Resize, QEvent.Type.Show, QEvent.Type.Hide}


class ReasonBubble(QLabel):
    """Lies over its window instead of in a layout, so nothing jumps when it appears.

    One window has one bubble: of several refusals the newest, or the one whose field the
    operator points at, is spelt out. A click takes it away.
    """

    def __init__(self, window: QWidget) -> None:
        super().__init__(window)
        self.setObjectName("reasonBubble")
        self.setTextFormat(Qt.TextFormat.PlainText)
        self.setWordWrap(True)
        self.setToolTip("Click to close this note")
        self.hide()
        self._field: QWidget | None = None
        self._followed: list[QWidget] = []

    @classmethod
    def of(cls, field: QWidget) -> "ReasonBubble":
        """Return the bubble of the window that `field` is in."""
        window = field.window()
        found = window.findChild(cls, options=Qt.FindChildOption.FindDirectChildrenOnly)
        return found if isinstance(found, cls) else cls(window)

    def show_for(self, field: QWidget, reason: str) -> None:
        """Say `reason` below `field` until another refusal, a click or `dismiss`."""
        self.dismiss()
        self.setText(reason)
        self.ensurePolished()  # the style sheet adds to the height
        text_width = self.fontMetrics().horizontalAdvance(reason) + 4 * STEP_PX
        width = min(_WIDTH_PX, text_width, field.window().width())
        self.setFixedSize(width, self.heightForWidth(width))
        self._field = field
        field.destroyed.connect(self._on_field_destroyed)
        self._follow(field)
        self._arrange()

    def dismiss(self, field: QWidget | None = None) -> None:
        """Take the note away, if it belongs to `field`; None takes away any."""
        if field is not None and self._field is not None and field is not self._field:
            return
        if self._field is not None and isValid(self._field):
            self._field.destroyed.disconnect(self._on_field_destroyed)
        for widget in self._followed:
            if isValid(widget):
                widget.removeEventFilter(self)
        self._followed = []
        self._field = None
        self.hide()

    def _on_field_destroyed(self) -> None:
        self._field = None  # what is left of it can only be forgotten
        self.dismiss()

    def _follow(self, field: QWidget) -> None:
        """Watch the field and what it lies in: scrolling moves an ancestor, not the field."""
        widget: QWidget | None = field
        while widget is not None and widget is not self.parentWidget():
            widget.installEventFilter(self)
            self._followed.append(widget)
            widget = widget.parentWidget()

    def _arrange(self) -> None:
        field, window = self._field, self.parentWidget()
        if field is None:
            return
        if field.window() is not window:
            self.dismiss()  # its panel was taken out into a window of its own
            return
        top_left = field.mapTo(window, QPoint(0, 0))
        x = max(0, min(top_left.x(), window.width() - self.width() - STEP_PX // 2))
        y = top_left.y() + field.height() + STEP_PX // 2
        if y + self.height() > window.height():
            y = top_left.y() - self.height() - STEP_PX // 2
        if y < 0:  # a short dialog: over what is below the field, rather than cut off
            y = max(0, window.height() - self.height())
        self.move(x, y)
        self.setVisible(not field.visibleRegion().isEmpty())
        self.raise_()

    @override
    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() in _FOLLOWED:
            self._arrange()
        return super().eventFilter(watched, event)

    @override
    def mousePressEvent(self, event: QMouseEvent) -> None:
        self.dismiss()
        event.accept()
