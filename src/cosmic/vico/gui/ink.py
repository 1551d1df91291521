"""Pens and labels that can be seen over any image, bright or dark."""

from collections.abc import Iterator, Sequence
from functools import cache
from itertools import chain
from typing import Final

from PySide6.QtCore import QPointF, QRectF, QSizeF, Qt
from PySide6.QtGui import QColor, QFont, QFontMetricsF, QPainter, QPainterPath, QPen

from cosmic.frame.gui.palette import OKABE_ITO, ON_IMAGE
from cosmic.frame.gui.theme import STEP_PX, number_font

HALO: Final = QColor(ON_IMAGE["rim"])
WHITE: Final = QColor(ON_IMAGE["ink"])
SKY: Final = QColor(OKABE_ITO["sky blue"])
GREEN: Final = QColor(ON_IMAGE["found"])
ORANGE: Final = QColor(OKABE_ITO["orange"])
YELLOW: Final = QColor(OKABE_ITO["yellow"])
_MOST_STEPS: Final = 6
"""How many times its height a label goes off before it covers another."""
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

    Where a label of `taken` is, it stands at another side of the point, or a little further off:
    far away it would be read for something else.
    """
    font = ink_font()
    metrics = QFontMetricsF(font)
    width = max(metrics.horizontalAdvance(part) for part in text.splitlines())
    height = metrics.height() * len(text.splitlines())
    size = QSizeF(width + STEP_PX, height + 4.0)
    places = _places(point, size, gap, room)
    first = next(places)
    free = (box for box in chain((first,), places) if not any(map(box.intersects, taken)))
    box = next(free, first)
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(QColor(ON_IMAGE["label"]))
    painter.drawRoundedRect(box, 3.0, 3.0)
    painter.setFont(font)
    painter.setPen(colour)
    painter.drawText(box, int(Qt.AlignmentFlag.AlignCenter), text)
    return box


def _places(point: QPointF, size: QSizeF, gap: float, room: QRectF) -> Iterator[QRectF]:
    """Yield where a label of a point may stand inside `room`, the nearest places first."""
    for step in range(_MOST_STEPS):
        off = gap + step * (size.height() + 2.0)
        for top in (point.y() - size.height() + 4.0 - off, point.y() + off):
            for left in (point.x() + gap, point.x() - gap - size.width()):
                box = QRectF(QPointF(left, top), size)
                box.moveLeft(min(max(left, room.left() + 2), room.right() - size.width() - 2))
                box.moveTop(min(max(top, room.top() + 2), room.bottom() - size.height() - 2))
                yield box
