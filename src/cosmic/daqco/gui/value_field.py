"""A field for a number in any unit, such as that of a custom scale; refuses, never clamps."""

import math
from typing import Final

from PySide6.QtCore import QSize, Qt, Signal
from PySide6.QtGui import QColor, QKeyEvent, QPainter, QPaintEvent
from PySide6.QtWidgets import QLineEdit, QWidget

from cosmic.daqco.gui.plot.units import display_unit
from cosmic.frame.gui.reason_bubble import ReasonBubble
from cosmic.frame.gui.theme import STEP_PX, State, current_palette, number_font, state_look
from cosmic.frame.overrides import override

_DIGITS: Final = 9


def show_refusal(field: QLineEdit, reason: str) -> None:
    """Turn the border of a field and say below it why; an empty reason takes both away."""
    if reason:
        ReasonBubble.of(field).show_for(field, f"{state_look(State.REFUSED).glyph} {reason}")
    elif field.property("refused"):
        ReasonBubble.of(field).dismiss(field)
    field.setProperty("refused", bool(reason))
    field.style().unpolish(field)
    field.style().polish(field)
    field.setAccessibleDescription(reason)


def mark_refusal(field: QLineEdit, reason: str) -> None:
    """Show a refusal, or its end, once: a note that was clicked away does not come back."""
    if field.accessibleDescription() != reason:
        show_refusal(field, reason)


class ValueField(QLineEdit):
    """Takes a finite number; the unit stands dimmed behind it.

    Signals
    -------
    committed(float)
        Enter was pressed on a number, or the focus left a new one.
    """

    committed = Signal(float)

    def __init__(
        self, name: str, unit: str = "", *, empty: bool = False, parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        self._name, self._unit, self._empty = name, "", empty
        self._good: float | None = None
        self._reason = ""
        self.setFont(number_font())
        self.setAlignment(Qt.AlignmentFlag.AlignRight)
        self.setAccessibleName(name)
        self.set_unit(unit)
        self.set_value(None if empty else 0.0)
        self.textEdited.connect(lambda: self.refuse(""))
        self.editingFinished.connect(self._on_finished)

    @property
    def reason(self) -> str:
        """Why the entry is refused; empty when it is not."""
        return self._reason

    def set_unit(self, unit: str) -> None:
        """Write another unit behind the number."""
        self._unit = display_unit(unit)
        room = self.fontMetrics().horizontalAdvance(self._unit) + STEP_PX // 2 if unit else 0
        self.setTextMargins(0, 0, room, 0)
        self._tell()
        self.update()

    def set_value(self, value: float | None) -> None:
        """Show `value`; an entry under way is lost."""
        self._good = value
        self.setText("" if value is None else f"{value:.{_DIGITS}g}")
        self.refuse("")

    def take(self) -> bool:
        """Judge the text; False when it was refused, and the reason then stands at the field."""
        text = self.text().strip()
        if not text and self._empty:
            self._good = None
            return True
        try:
            value = float(text.replace("−", "-"))
        except ValueError:
            hint = "; write the decimal sign as a point" if "," in text else ""
            self.refuse(f"{text!r} is not a number{hint}" if text else "type a number")
            return False
        if not math.isfinite(value):
            self.refuse("give a finite number")
            return False
        self._good = value
        return True

    def value(self) -> float:
        """Return the last number taken; 0 where none was."""
        return 0.0 if self._good is None else self._good

    def optional(self) -> float | None:
        """Return the last number taken; None where the field was empty."""
        return self._good

    def refuse(self, reason: str) -> None:
        """Say why the entry is not taken."""
        self._reason = reason
        show_refusal(self, reason)
        self._tell()

    def _tell(self) -> None:
        unit = f" in {self._unit}" if self._unit else ""
        self.setToolTip(
            f"REFUSED: {self._reason}\nEsc goes back" if self._reason else f"{self._name}{unit}"
        )

    def _on_finished(self) -> None:
        before = self._good
        if not self._reason and self.take() and self._good is not None and self._good != before:
            self.committed.emit(self._good)

    @override
    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() == Qt.Key.Key_Escape and (self._reason or self.isModified()):
            self.set_value(self._good)
            event.accept()
            return
        super().keyPressEvent(event)

    @override
    def sizeHint(self) -> QSize:
        width = self.fontMetrics().horizontalAdvance("-0000.000") + self.textMargins().right()
        return QSize(width + 2 * STEP_PX, super().sizeHint().height())

    @override
    def minimumSizeHint(self) -> QSize:
        return self.sizeHint()

    @override
    def paintEvent(self, event: QPaintEvent) -> None:
        super().paintEvent(event)
        if not self._unit:
            return
        palette = current_palette()
        painter = QPainter(self)
        painter.setPen(QColor(palette.dim if self.isEnabled() else palette.disabled))
        align = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
        painter.drawText(self.rect().adjusted(0, 0, -STEP_PX, 0), int(align), self._unit)
