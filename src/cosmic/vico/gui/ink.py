"""Pens and labels that can be seen over any image, bright or dark."""

from collections.abc import Sequence
from functools import cache
from typing import Final

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QFont, QFontMetricsF, QPainter, QPainterPath, QPen

from cosmic.frame.gui.palette import OKABE_ITO, ON_IMAGE
from cosmic.frame.gui.theme import STEP_PX, number_font

HALO: Final = QColor(ON_IMAGE["rim"])
WHITE: Final = QColor(ON_IMAGE["ink"])
SKY: Final = QColor(OKABE_ITO["sky blue"])
GREEN: Final = QColor(ON_IMAGE["found"])
ORANGE: Final = QColor(OKABE_ITO["orange"])
YELLOW: Final = QColor(OKABE_ITO["yellow"])
PINK: Final = QColor(OKABE_ITO["reddish purple"])


@cache
def ink_font(size_px: int = 12, *, bold: bool = True) -> QFont:
    """Return the font over images; kept, as finding it takes longer than drawing a fibre."""
    return number_font(size_px, bold=bold)


def pen(colour: QColor, width: float = 1.5, *, dashed: bool = False) -> QPen:
    """Return a pen whose width does not follow the zoom."""
    made = QPen(colour, width)
    made.setCosmetic(True)
    made.setCapStyle(Qt.PenCapStyle.RoundCap)
    if dashed:
        made.setDashPattern([4.0, 4.0])
    return made


def stroke(painter: QPainter, path: QPainterPath, made: QPen) -> None:
    """Draw a path over a dark rim."""
    painter.setBrush(Qt.BrushStyle.NoBrush)
    painter.setPen(pen(HALO, made.widthF() + 2.0))
    painter.drawPath(path)
    painter.setPen(made)
    painter.drawPath(path)


def line(painter: QPainter, begin: QPointF, end: QPointF, made: QPen) -> None:
    """Draw a line over a faint dark rim."""
    painter.setPen(pen(QColor(ON_IMAGE["faint rim"]), made.widthF() + 2.0))
    painter.drawLine(begin, end)
    painter.setPen(made)
    painter.drawLine(begin, end)


def label(
    painter: QPainter,
    point: QPointF,
    text: str,
    colour: QColor,
    room: QRectF,
    *,
    gap: float = 8.0,
    taken: Sequence[QRectF] = (),
) -> QRectF:
    """Write `text` beside a point on a dark ground, inside `room`; returns where it stands.

    It goes below each of the labels `taken` that it would cover.
    """
    font = ink_font()
    metrics = QFontMetricsF(font)
    width = max(metrics.horizontalAdvance(part) for part in text.splitlines())
    height = metrics.height() * len(text.splitlines())
    box = QRectF(point.x() + gap, point.y() - height - gap, width + STEP_PX, height + 4.0)
    box.moveLeft(min(max(box.left(), room.left() + 2), room.right() - box.width() - 2))
    box.moveTop(min(max(box.top(), room.top() + 2), room.bottom() - box.height() - 2))
    for other in sorted(taken, key=QRectF.top):
        if box.intersects(other):
            box.moveTop(other.bottom() + 2.0)
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(QColor(ON_IMAGE["label"]))
    painter.drawRoundedRect(box, 3.0, 3.0)
    painter.setFont(font)
    painter.setPen(colour)
    painter.drawText(box, int(Qt.AlignmentFlag.AlignCenter), text)
    return box
