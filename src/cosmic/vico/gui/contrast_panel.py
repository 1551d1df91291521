"""What is shown black and what white: by hand, once by the image, or always by the image."""

from typing import Final

import numpy as np
from PySide6.QtCore import QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QCheckBox, QGridLayout, QLabel, QSizePolicy, QWidget

from cosmic.frame.gui.build import named, push_button, tight_row, tipped
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.painting import painting
from cosmic.frame.gui.theme import STEP_PX, current_palette, number_font
from cosmic.frame.overrides import override
from cosmic.vico.gui.amount_field import AmountField
from cosmic.vico.gui.levels import BINS, Histogram, Levels

HEIGHT_PX = 10 * STEP_PX
FOOT_PX = 16
FIVE_DIGITS_PX: Final = 6 * STEP_PX


class HistogramPlot(QWidget):
    """Draws the shares by their root, so that a thin fibre is seen beside its ground."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.histogram: Histogram | None = None
        self._levels = Levels(0.0, 255.0)
        self.setFixedHeight(HEIGHT_PX + FOOT_PX)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setAccessibleName("Histogram")
        self.setToolTip("Histogram of brightness; the lines mark the black and white levels")

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


CUT_PERCENT: Final = 0.3
SETTLED: Final = 0.01
"""With Auto, levels follow changes above this share of the range only: else it flickers."""


class ContrastPanel(QWidget):
    """Histogram, levels and marks.

    Signals
    -------
    levels_changed(Levels)
        The image is to be shown with these levels.
    marks_changed(bool)
        Pixels that are over-exposed or quite black are to be coloured, or not.
    """

    levels_changed = Signal(object)
    marks_changed = Signal(bool)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._levels, self._full = Levels(0.0, 255.0), 255
        self._histogram: Histogram | None = None
        self.plot = HistogramPlot()
        self.low = AmountField("Shown black", "", low=0.0, high=255.0, value=0.0)
        self.high = AmountField("Shown white", "", low=0.0, high=255.0, value=255.0)
        self.once = push_button(
            "Once", f"Stretch the contrast now: {CUT_PERCENT:g} % black, as many white"
        )
        self.auto = push_button("Auto", "Keep stretching the contrast as the image changes")
        self.auto.setCheckable(True)
        self.reset = push_button("Full", "Show the whole range of the camera")
        self.marks = tipped(
            named(QCheckBox("mark lost pixels"), "marks"),
            "Colour over-exposed pixels orange and quite black ones blue",
        )
        self.share = ElidedLabel()
        self.share.setFont(number_font())
        self._build()
        for field in (self.low, self.high):
            field.setMinimumWidth(FIVE_DIGITS_PX)
            field.committed.connect(self._on_typed)
        self.once.clicked.connect(self.stretch)
        self.auto.toggled.connect(self._on_auto)
        self.reset.clicked.connect(self._on_reset)
        self.marks.toggled.connect(self.marks_changed)

    def _build(self) -> None:
        buttons, row = tight_row(STEP_PX // 2)
        for button in (self.once, self.auto, self.reset):
            row.addWidget(button, 1)
        grid = QGridLayout(self)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setSpacing(STEP_PX // 2)
        grid.addWidget(self.plot, 0, 0, 1, 4)
        grid.addWidget(_dim("black"), 1, 0)
        grid.addWidget(self.low, 1, 1)
        grid.addWidget(_dim("white"), 1, 2)
        grid.addWidget(self.high, 1, 3)
        grid.addWidget(buttons, 2, 0, 1, 4)
        grid.addWidget(self.marks, 3, 0, 1, 4)
        grid.addWidget(self.share, 4, 0, 1, 4)

    @property
    def levels(self) -> Levels:
        """What is wanted."""
        return self._levels

    def show_histogram(self, histogram: Histogram) -> None:
        """Take over how bright the newest image is."""
        self._histogram = histogram
        if histogram.full != self._full:
            self._rescale(histogram.full)
        if self.auto.isChecked():
            self._follow()
        self.plot.show_histogram(histogram, self._levels)
        self.share.set_text(
            f"over-exposed {100 * histogram.over:.2f} %, black {100 * histogram.under:.2f} %"
        )

    def stretch(self) -> None:
        """Fit the levels to the newest image, once."""
        if self._histogram is not None:
            self._take(self._histogram.levels(CUT_PERCENT))

    def _follow(self) -> None:
        if self._histogram is None:
            return
        wanted, least = self._histogram.levels(CUT_PERCENT), SETTLED * self._full
        moved = max(abs(wanted.low - self._levels.low), abs(wanted.high - self._levels.high))
        if moved > least:
            self._take(wanted)

    def _take(self, levels: Levels) -> None:
        if levels == self._levels:
            return
        self._levels = levels
        self.low.set_value(round(levels.low, 1))
        self.high.set_value(round(levels.high, 1))
        if self._histogram is not None:
            self.plot.show_histogram(self._histogram, levels)
        self.levels_changed.emit(levels)

    def _rescale(self, full: int) -> None:
        share = full / self._full
        self._full = full
        for field in (self.low, self.high):
            field.set_range(0.0, float(full))
        self._take(Levels(self._levels.low * share, self._levels.high * share))

    def _on_typed(self) -> None:
        low, high = self.low.value(), self.high.value()
        if low is None or high is None:
            return
        if not low < high:
            field = self.low if self.low.hasFocus() else self.high
            field.refuse(f"Black must be below white: {low:g} is not below {high:g}")
            return
        self.auto.setChecked(False)
        self._take(Levels(low, high))

    def _on_auto(self, auto: bool) -> None:
        if auto:
            self.stretch()

    def _on_reset(self) -> None:
        self.auto.setChecked(False)
        self._take(Levels(0.0, float(self._full)))


def _dim(text: str) -> QLabel:
    label = QLabel(text)
    label.setProperty("role", "dim")
    return label
