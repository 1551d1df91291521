"""Numbers that change, in fixed widths, so that nothing moves when they do."""

from collections import deque
from typing import Final

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent
from PySide6.QtWidgets import QLabel, QSizePolicy, QWidget

from cosmic.frame.gui.palette import INK
from cosmic.frame.gui.theme import STEP_PX, current_palette, number_font
from cosmic.frame.overrides import override

BARS: Final = 24


class Reading(QLabel):
    """A number with its name; as wide as `widest`, whatever it shows."""

    def __init__(self, widest: str, tip: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setFont(number_font())
        self.setToolTip(tip)
        self.setTextFormat(Qt.TextFormat.PlainText)
        self.setContentsMargins(STEP_PX // 2, 0, 0, 0)
        self.setFixedWidth(self.fontMetrics().horizontalAdvance(widest) + STEP_PX)

    def show_alarm(self, alarm: bool) -> None:
        """Turn the number's ground while it is one that should be 0."""
        wanted = f"background: {current_palette().refused}; color: {INK};" if alarm else ""
        if self.styleSheet() != wanted:
            self.setStyleSheet(wanted)


class FocusBars(QWidget):
    """The last values of a measure, the newest on the right; a full bar is the best seen."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.values: deque[float] = deque(maxlen=BARS)
        self.best = 0.0
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self.setToolTip("Sharpness over the last seconds; a full bar is the best seen\nClick: anew")
        self.setAccessibleName("Sharpness over the last seconds")

    def add(self, value: float) -> None:
        """Take over the newest value."""
        self.values.append(value)
        self.best = max(self.best, value)
        self.update()

    def clear(self) -> None:
        """Forget what was best."""
        self.values.clear()
        self.best = 0.0
        self.update()

    @override
    def sizeHint(self) -> QSize:
        return QSize(BARS * 3 + 2, 2 * STEP_PX + 2)

    @override
    def mousePressEvent(self, event: object) -> None:
        self.clear()

    @override
    def paintEvent(self, event: QPaintEvent) -> None:
        colours = current_palette()
        painter = QPainter(self)
        painter.fillRect(self.rect(), QColor(colours.field))
        painter.setPen(Qt.PenStyle.NoPen)
        room = self.height() - 2.0
        first = BARS - len(self.values)
        for number, value in enumerate(self.values):
            height = room * value / self.best if self.best > 0.0 else 0.0
            newest = number == len(self.values) - 1
            painter.setBrush(QColor(colours.accent if newest else colours.dim))
            painter.drawRect(QRectF(1 + 3 * (first + number), 1 + room - height, 2, height))
