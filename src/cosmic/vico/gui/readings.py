"""Numbers that change, in fixed widths, so that nothing moves when they do."""

from collections import deque
from typing import Final

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPaintEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from cosmic.frame.gui.painting import painting
from cosmic.frame.gui.palette import INK, OKABE_ITO
from cosmic.frame.gui.theme import STEP_PX, current_palette, number_font
from cosmic.frame.overrides import override

BARS: Final = 24
_MIDDLE: Final = int(Qt.AlignmentFlag.AlignVCenter | Qt.AlignmentFlag.AlignLeft)


class Reading(QWidget):
    """A number between its name and its unit, both dimmed; as wide as `widest` needs.

    Parameters
    ----------
    before, after : str
        Name and unit.
    widest : str
        The longest number.
    """

    def __init__(
        self, before: str, widest: str, after: str, tip: str, parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        self._before, self._after, self._number = before, after, "–"
        self._alarm = False
        self.setFont(number_font())
        self.setToolTip(tip)
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        metrics = self.fontMetrics()
        parts = [text for text in (before, widest, after) if text]
        width = sum(metrics.horizontalAdvance(text) + STEP_PX // 2 for text in parts)
        self.setFixedSize(width + STEP_PX, metrics.height() + 2)

    def text(self) -> str:
        """Return the whole of it."""
        return " ".join(part for part in (self._before, self._number, self._after) if part)

    def show_number(self, number: str, *, alarm: bool = False) -> None:
        """Show another number; `alarm` colours the ground, for one that should be 0."""
        if (number, alarm) == (self._number, self._alarm):
            return
        self._number, self._alarm = number, alarm
        self.setAccessibleName(self.text())
        self.update()

    @override
    def paintEvent(self, event: QPaintEvent) -> None:
        colours = current_palette()
        with painting(self) as painter:
            if self._alarm:
                painter.fillRect(self.rect(), QColor(OKABE_ITO["orange"]))
            dim, ink = (INK, INK) if self._alarm else (colours.dim, colours.text)
            x = STEP_PX // 2
            for text, colour in ((self._before, dim), (self._number, ink), (self._after, dim)):
                if text:
                    painter.setPen(QColor(colour))
                    width = self.fontMetrics().horizontalAdvance(text)
                    painter.drawText(x, 0, width + 1, self.height(), _MIDDLE, text)
                    x += width + STEP_PX // 2


class FocusBars(QWidget):
    """The last values of a measure, the newest on the right; a full bar is the best seen."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.values: deque[float] = deque(maxlen=BARS)
        self.best = 0.0
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self.setToolTip(
            "Sharpness over the last seconds; a full bar is the best seen\nClick to start again"
        )
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
        with painting(self) as painter:
            painter.fillRect(self.rect(), QColor(colours.field))
            painter.setPen(Qt.PenStyle.NoPen)
            room = self.height() - 2.0
            first = BARS - len(self.values)
            for number, value in enumerate(self.values):
                height = room * value / self.best if self.best > 0.0 else 0.0
                newest = number == len(self.values) - 1
                painter.setBrush(QColor(colours.accent if newest else colours.dim))
                painter.drawRect(QRectF(1 + 3 * (first + number), 1 + room - height, 2, height))
