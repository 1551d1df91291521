"""A small sign that shows a state by colour, by shape and by word."""

from dataclasses import replace

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import (
    QColor,
    QFontMetricsF,
    QPainter,
    QPainterPath,
    QPaintEvent,
    QPen,
    QPolygonF,
)
from PySide6.QtWidgets import QSizePolicy, QWidget

from cosmic.frame.gui.painting import painting
from cosmic.frame.gui.theme import (
    STEP_PX,
    State,
    StateLook,
    current_palette,
    number_font,
    state_look,
)
from cosmic.frame.overrides import override

_SHAPE_PX = 10.0
_FONT_PX = 11


def shape_path(state: State, place: QRectF) -> QPainterPath:
    """Return the outline that stands for `state`, drawn into `place`."""
    path = QPainterPath()
    left, right, top, bottom = place.left(), place.right(), place.top(), place.bottom()
    middle = place.center()
    if state is State.BUSY:
        path.addPolygon(
            QPolygonF([place.topLeft(), QPointF(right, middle.y()), place.bottomLeft()])
        )
    elif state is State.ERROR:
        path.addRect(place.adjusted(0.5, 0.5, -0.5, -0.5))
    elif state is State.REFUSED:
        corners = [(middle.x(), top), (right, middle.y()), (middle.x(), bottom), (left, middle.y())]
        path.addPolygon(QPolygonF([QPointF(x, y) for x, y in corners]))
    else:
        path.addEllipse(place)
    path.closeSubpath()
    return path


class StateBadge(QWidget):
    """Shows a `State`; its width is that of the longest word, so nothing beside it moves."""

    def __init__(self, state: State = State.UNKNOWN, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._state, self._word = state, ""
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self.setFont(number_font(_FONT_PX, bold=True))
        self.set_state(state)

    @property
    def state(self) -> State:
        """What is shown."""
        return self._state

    @property
    def word(self) -> str:
        """What is written."""
        return self._word or self._state.value

    def set_state(self, state: State, detail: str = "", *, word: str = "") -> None:
        """Show `state`, by another word where that says it better; `detail` is in the tooltip."""
        self._state, self._word = state, word
        text = f"{self.word}: {detail}" if detail else self.word
        if text != self.toolTip():
            self.setToolTip(text)
            self.setAccessibleName(text)
        self.update()

    @override
    def sizeHint(self) -> QSize:
        metrics = QFontMetricsF(number_font(_FONT_PX, bold=True))
        width = max(metrics.horizontalAdvance(each.value) for each in State)
        return QSize(int(width + _SHAPE_PX + 2.5 * STEP_PX) + 1, int(metrics.height()) + STEP_PX)

    def _look(self) -> StateLook:
        """Return the look; grey where the panel is: what a failed part said last may be wrong."""
        look = state_look(self._state)
        if self.isEnabled():
            return look
        grey = current_palette()
        return replace(look, colour=grey.disabled, fill=grey.panel, text=grey.disabled)

    @override
    def paintEvent(self, event: QPaintEvent) -> None:
        look = self._look()
        with painting(self) as painter:
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            box = QRectF(self.rect()).adjusted(0.5, 0.5, -0.5, -0.5)
            painter.setPen(QColor(look.colour))
            painter.setBrush(QColor(look.fill))
            painter.drawRoundedRect(box, 4.0, 4.0)
            place = QRectF(STEP_PX, (self.height() - _SHAPE_PX) / 2.0, _SHAPE_PX, _SHAPE_PX)
            loud = look.fill == look.colour
            self._paint_shape(painter, place, QColor(look.text if loud else look.colour))
            painter.setPen(QColor(look.text))
            room = box.adjusted(1.5 * STEP_PX + _SHAPE_PX, 0.0, 0.0, 0.0)
            painter.drawText(room, int(Qt.AlignmentFlag.AlignVCenter), self._word or look.word)

    def _paint_shape(self, painter: QPainter, place: QRectF, colour: QColor) -> None:
        hollow = self._state is State.UNKNOWN
        painter.setPen(QPen(colour, 2.0) if hollow else Qt.PenStyle.NoPen)
        painter.setBrush(Qt.BrushStyle.NoBrush if hollow else colour)
        inset = 1.0 if hollow else 0.0
        painter.drawPath(shape_path(self._state, place.adjusted(inset, inset, -inset, -inset)))
