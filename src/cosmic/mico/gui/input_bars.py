"""Live bars of the axes and lamps of the buttons of an input device."""

import math
from typing import Final

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from cosmic.frame.gui.painting import painting
from cosmic.frame.gui.theme import FONT_PX, STEP_PX, current_palette, number_font
from cosmic.frame.overrides import override
from cosmic.mico.hw.input_device import InputState

_NAME_PX: Final = 12 * STEP_PX
_FIGURE_PX: Final = 6 * STEP_PX
_LAMP_PX: Final = 12


class InputBars(QWidget):
    """A bar an axis, from -1 on the left to 1 on the right; below it the buttons."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._axes: tuple[tuple[str, float], ...] = ()
        self._buttons: tuple[tuple[str, bool], ...] = ()
        self.setFont(number_font())
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)
        self.setAccessibleName("inputs")

    @property
    def axes(self) -> dict[str, float]:
        """The deflections shown."""
        return dict(self._axes)

    @property
    def pressed(self) -> tuple[str, ...]:
        """The buttons shown as pressed."""
        return tuple(name for name, down in self._buttons if down)

    def show_inputs(self, inputs: InputState | None) -> None:
        """Show what a device says; nothing where there is none."""
        axes = tuple(inputs.axes.items()) if inputs is not None else ()
        buttons = tuple(inputs.buttons.items()) if inputs is not None else ()
        if (axes, buttons) == (self._axes, self._buttons):
            return
        resized = (len(axes), len(buttons)) != (len(self._axes), len(self._buttons))
        self._axes, self._buttons = axes, buttons
        if resized:
            self.updateGeometry()
        self.update()

    def _row_px(self) -> int:
        return self.fontMetrics().height() + STEP_PX // 2

    def _lamps_a_row(self) -> int:
        return max(1, self.width() // (_NAME_PX + _LAMP_PX))

    @override
    def hasHeightForWidth(self) -> bool:
        return True

    @override
    def heightForWidth(self, width: int) -> int:
        lamps = math.ceil(len(self._buttons) / max(1, width // (_NAME_PX + _LAMP_PX)))
        return max(1, len(self._axes) + lamps) * self._row_px()

    @override
    def sizeHint(self) -> QSize:
        return QSize(40 * STEP_PX, self.heightForWidth(max(self.width(), 40 * STEP_PX)))

    @override
    def paintEvent(self, event: QPaintEvent) -> None:
        with painting(self) as painter:
            colours = current_palette()
            if not self._axes and not self._buttons:
                painter.setPen(QColor(colours.dim))
                text = "axes and buttons are shown here once it has been started"
                painter.drawText(self.rect(), int(Qt.AlignmentFlag.AlignVCenter), text)
                return
            for number, (name, value) in enumerate(self._axes):
                self._paint_axis(painter, number * self._row_px(), name, value)
            self._paint_lamps(painter, len(self._axes) * self._row_px())

    def _paint_axis(self, painter: QPainter, top: int, name: str, value: float) -> None:
        colours, row = current_palette(), self._row_px()
        middle = int(Qt.AlignmentFlag.AlignVCenter)
        painter.setPen(QColor(colours.text))
        painter.drawText(QRectF(0, top, _NAME_PX, row), middle, name)
        bar = QRectF(_NAME_PX, top + 3, self.width() - _NAME_PX - _FIGURE_PX, row - 6)
        painter.fillRect(bar, QColor(colours.field))
        value = round(value, 2) + 0.0  # a zero has no sign
        zero, length = bar.center().x(), value * bar.width() / 2.0
        filled = QRectF(min(zero, zero + length), bar.top(), abs(length), bar.height())
        painter.fillRect(filled, QColor(colours.accent))
        painter.setPen(QColor(colours.border_strong))
        painter.drawRect(bar)
        painter.drawLine(QPointF(zero, bar.top()), QPointF(zero, bar.bottom()))
        painter.setPen(QColor(colours.text))
        right = middle | int(Qt.AlignmentFlag.AlignRight)
        place = QRectF(self.width() - _FIGURE_PX, top, _FIGURE_PX, row)
        painter.drawText(place, right, f"{value:+.2f}")

    def _paint_lamps(self, painter: QPainter, top: int) -> None:
        colours, row, across = current_palette(), self._row_px(), self._lamps_a_row()
        for number, (name, down) in enumerate(self._buttons):
            left = (number % across) * (_NAME_PX + _LAMP_PX)
            y = top + (number // across) * row
            lamp = QRectF(left, y + (row - _LAMP_PX) / 2.0, _LAMP_PX, _LAMP_PX)
            painter.setPen(QColor(colours.border_strong))
            painter.setBrush(QColor(colours.accent if down else colours.field))
            painter.drawRect(lamp)
            painter.setPen(QColor(colours.text if down else colours.dim))
            place = QRectF(left + _LAMP_PX + 4, y, _NAME_PX - 4, row)
            painter.drawText(place, int(Qt.AlignmentFlag.AlignVCenter), name)


class ForceBar(QWidget):
    """What the hand feels, and what the force leaves of its speed."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._force = 0.0
        self._slowed = 1.0
        self.setFont(number_font(FONT_PX))
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)
        self.show_force(0.0, 1.0)

    @property
    def text(self) -> str:
        """What it says."""
        return self.accessibleName()

    def show_force(self, force: float, slowed: float) -> None:
        """Show another force, -1 to 1, and another part of the speed."""
        self._force, self._slowed = force, slowed
        words = f"felt force {100 * abs(force):.0f} %"
        if slowed < 1.0:
            words += f", ▲ speed {100 * slowed:.0f} %"
        if words != self.accessibleName():
            self.setAccessibleName(words)
            self.setToolTip(words)
            self.update()

    @override
    def sizeHint(self) -> QSize:
        return QSize(24 * STEP_PX, self.fontMetrics().height() + STEP_PX)

    @override
    def paintEvent(self, event: QPaintEvent) -> None:
        colours = current_palette()
        with painting(self) as painter:
            box = QRectF(self.rect()).adjusted(0.5, 0.5, -0.5, -0.5)
            painter.fillRect(box, QColor(colours.field))
            bar = QRectF(box.left(), box.bottom() - 4, box.width() * min(1.0, abs(self._force)), 4)
            painter.fillRect(bar, QColor(colours.refused if self._slowed < 1.0 else colours.accent))
            painter.setPen(QColor(colours.border_strong))
            painter.drawRect(box)
            painter.setPen(QColor(colours.text))
            room = box.adjusted(STEP_PX, 0.0, -STEP_PX, -3.0)
            painter.drawText(room, int(Qt.AlignmentFlag.AlignVCenter), self.text)
