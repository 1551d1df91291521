"""What the column FORCE draws by itself: the bar towards the limit, and force over position."""

from collections import deque
from typing import Final

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QColor, QPaintEvent, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

from cosmic.app.panels.curve_frame import CurveFrame
from cosmic.daqco.gui.colours import readable
from cosmic.frame.gui.painting import painting
from cosmic.frame.gui.palette import OKABE_ITO, Palette
from cosmic.frame.gui.theme import STEP_PX, current_palette
from cosmic.frame.overrides import override

AXIS_PX: Final = 48
_POINTS: Final = 4000
_STILL_UM: Final = 0.05


class LimitBar(QWidget):
    """The value between the two sides of its limit, and how much of the way there is gone."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._value: float | None = None
        self._low: float | None = None
        self._high: float | None = None
        self._armed = False
        self.setFixedHeight(2 * STEP_PX)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)

    def show_value(
        self, value: float | None, low: float | None, high: float | None, *, armed: bool
    ) -> None:
        """Show another value; None: it is not measured."""
        now = (value, low, high, armed)
        if now != (self._value, self._low, self._high, self._armed):
            self._value, self._low, self._high, self._armed = now
            self.update()

    @property
    def share(self) -> float:
        """How much of the way to the nearer side is gone, 0 to 1; 0 where nothing is measured."""
        if self._value is None:
            return 0.0
        side = self._high if self._value >= 0.0 else self._low
        return min(1.0, abs(self._value / side)) if side else 0.0

    @override
    def paintEvent(self, event: QPaintEvent) -> None:
        palette = current_palette()
        with painting(self) as painter:
            box = QRectF(self.rect()).adjusted(0.5, 2.5, -0.5, -2.5)
            painter.setPen(QColor(palette.border_strong))
            painter.setBrush(QColor(palette.field))
            painter.drawRect(box)
            middle = box.center().x()
            if self._value is not None:
                reach = self.share * box.width() / 2.0
                colour = "vermillion" if self.share > 0.8 else "orange" if self.share > 0.5 else ""
                fill = OKABE_ITO[colour] if colour else palette.accent
                left = middle if self._value >= 0.0 else middle - reach
                painter.setPen(Qt.PenStyle.NoPen)
                painter.setBrush(QColor(fill))
                painter.drawRect(QRectF(left, box.top() + 1.0, reach, box.height() - 1.0))
            pen = QPen(QColor(palette.text), 1.0)
            if not self._armed:
                pen.setStyle(Qt.PenStyle.DotLine)
            painter.setPen(pen)
            for x in (box.left(), middle, box.right()):
                painter.drawLine(round(x), 0, round(x), self.height())


class PositionCurve(CurveFrame):
    """Force over the position of the axis that moved last."""

    def __init__(self) -> None:
        super().__init__(AXIS_PX)
        self._points: deque[tuple[float, float]] = deque(maxlen=_POINTS)
        self.axis = ""
        box, self._left = self._add_field("force")
        self._below = self._add_axis_below("position")
        self._curve = pg.PlotCurveItem()
        box.addItem(self._curve)
        self._restyle()

    def name_force(self, unit: str) -> None:
        """Say in which unit the force is drawn."""
        self._names[self._left] = f"force, {unit}"
        self._restyle()

    def add(self, axis: str, unit: str, position: float, force: float) -> None:
        """Add a point; another axis begins anew."""
        if axis != self.axis:
            self.axis = axis
            self._points.clear()
            self._names[self._below] = f"{axis}, {unit}"
            self._restyle()
        if self._points and abs(self._points[-1][0] - position) < _STILL_UM:
            return
        self._points.append((position, force))
        places, forces = zip(*self._points, strict=True)
        self._curve.setData(np.array(places), np.array(forces))

    @property
    def points(self) -> tuple[tuple[float, float], ...]:
        """Position and force of what is drawn."""
        return tuple(self._points)

    @override
    def _colour(self, palette: Palette) -> None:
        self._curve.setPen(pg.mkPen(readable(OKABE_ITO["orange"]), width=1.5))
