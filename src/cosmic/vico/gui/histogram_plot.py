"""The histogram of the image shown, with the levels in it."""

import numpy as np
from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QSizePolicy, QWidget

from cosmic.frame.gui.painting import painting
from cosmic.frame.gui.theme import STEP_PX, current_palette, number_font
from cosmic.frame.overrides import override
from cosmic.vico.gui.levels import BINS, Histogram, Levels

HEIGHT_PX = 10 * STEP_PX
FOOT_PX = 16


class HistogramPlot(QWidget):
    """Draws the shares by their root, so that a thin fibre is seen beside its ground."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.histogram: Histogram | None = None
        self._levels = Levels(0.0, 255.0)
        self.setFixedHeight(HEIGHT_PX + FOOT_PX)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setAccessibleName("Histogram")
        self.setToolTip("How often each brightness occurs; the lines are what is black and white")

    def show_histogram(self, histogram: Histogram, levels: Levels) -> None:
        """Draw another histogram."""
        self.histogram, self._levels = histogram, levels
        self.update()

    @override
    def sizeHint(self) -> QSize:
        return QSize(24 * STEP_PX, HEIGHT_PX + FOOT_PX)

    @override
    def paintEvent(self, event: QPaintEvent) -> None:
        colours = current_palette()
        with painting(self) as painter:
            box = QRectF(0.5, 0.5, self.width() - 1.0, HEIGHT_PX - 1.0)
            painter.setPen(QColor(colours.border))
            painter.setBrush(QColor(colours.field))
            painter.drawRect(box)
            found = self.histogram
            if found is None:
                return
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(QColor(colours.dim))
            painter.drawPolygon(_outline(found, box))
            painter.setPen(QPen(QColor(colours.accent), 1.5))
            for value in (self._levels.low, self._levels.high):
                x = box.left() + box.width() * min(max(value / found.full, 0.0), 1.0)
                painter.drawLine(QPointF(x, box.top()), QPointF(x, box.bottom()))
            self._paint_numbers(painter, found.full)

    def _paint_numbers(self, painter: QPainter, full: int) -> None:
        painter.setPen(QColor(current_palette().dim))
        painter.setFont(number_font(11))
        foot = QRectF(0.0, HEIGHT_PX + 1.0, self.width(), FOOT_PX)
        for flag, text in (
            (Qt.AlignmentFlag.AlignLeft, "0"),
            (Qt.AlignmentFlag.AlignHCenter, f"{(full + 1) // 2}"),
            (Qt.AlignmentFlag.AlignRight, f"{full}"),
        ):
            painter.drawText(foot, int(flag), text)


def _outline(found: Histogram, box: QRectF) -> QPolygonF:
    heights = np.sqrt(found.shares)
    heights = heights / max(float(heights.max()), 1e-9)
    step = box.width() / BINS
    points = [QPointF(box.left(), box.bottom())]
    for number, height in enumerate(heights.tolist()):
        y = box.bottom() - height * (box.height() - 3.0)
        points += [
            QPointF(box.left() + number * step, y),
            QPointF(box.left() + (number + 1) * step, y),
        ]
    points.append(QPointF(box.right(), box.bottom()))
    return QPolygonF(points)
