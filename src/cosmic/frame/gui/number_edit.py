"""The common part of fields for a number: how they look, read text and show a refusal."""

import math

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QColor, QPaintEvent
from PySide6.QtWidgets import QLineEdit, QWidget

from cosmic.frame.errors import QuantityError
from cosmic.frame.gui.painting import painting
from cosmic.frame.gui.refusal import show_refusal
from cosmic.frame.gui.theme import STEP_PX, current_palette, number_font
from cosmic.frame.overrides import override


def read_number(text: str) -> float:
    """Return the number that was typed; a minus sign of the typesetter counts.

    Raises
    ------
    QuantityError
        It is none, or not finite; the text says what to do.
    """
    typed = text.strip()
    try:
        value = float(typed.replace("−", "-"))
    except ValueError:
        hint = "; write the decimal sign as a point" if "," in typed else ""
        problem = f"{typed!r} is not a number{hint}" if typed else "type a number"
        raise QuantityError(problem) from None
    if not math.isfinite(value):
        raise QuantityError("give a finite number")
    return value


class NumberEdit(QLineEdit):
    """A line for a number; its unit stands dimmed behind it."""

    def __init__(self, name: str, unit: str = "", parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._name, self._unit = name, ""
        self.setFont(number_font())
        self.setAlignment(Qt.AlignmentFlag.AlignRight)
        self.setAccessibleName(name)
        self._write_unit(unit)

    @property
    def reason(self) -> str:
        """Why the entry is refused; empty when it is not."""
        return self.accessibleDescription()

    def refuse(self, reason: str) -> None:
        """Say why the entry is not taken; an empty reason takes that back."""
        show_refusal(self, reason)

    def _write_unit(self, unit: str) -> None:
        self._unit = unit
        room = self.fontMetrics().horizontalAdvance(unit) + STEP_PX // 2 if unit else 0
        self.setTextMargins(0, 0, room, 0)
        self.update()

    @override
    def sizeHint(self) -> QSize:
        digits = self.fontMetrics().horizontalAdvance("-0000.000")
        return QSize(digits + self.textMargins().right() + 2 * STEP_PX, super().sizeHint().height())

    @override
    def minimumSizeHint(self) -> QSize:
        return self.sizeHint()

    @override
    def paintEvent(self, event: QPaintEvent) -> None:
        super().paintEvent(event)
        if not self._unit:
            return
        colours = current_palette()
        with painting(self) as painter:
            painter.setPen(QColor(colours.dim if self.isEnabled() else colours.disabled))
            align = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
            painter.drawText(self.rect().adjusted(0, 0, -STEP_PX, 0), int(align), self._unit)
