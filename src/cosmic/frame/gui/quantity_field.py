"""A field for a number with a unit that refuses what it cannot take, and says why."""

from typing import Final

from PySide6.QtCore import QEvent, QRect, QSize, Qt, Signal
from PySide6.QtGui import (
    QColor,
    QEnterEvent,
    QFocusEvent,
    QKeyEvent,
    QMouseEvent,
    QPaintEvent,
)
from PySide6.QtWidgets import QLineEdit, QSizePolicy, QWidget

from cosmic.frame.errors import QuantityError
from cosmic.frame.gui.build import restyle, retip
from cosmic.frame.gui.key_focus import ENTER_KEYS
from cosmic.frame.gui.painting import painting
from cosmic.frame.gui.reason_bubble import ReasonBubble
from cosmic.frame.gui.theme import STEP_PX, State, current_palette, number_font, state_look
from cosmic.frame.overrides import override
from cosmic.frame.units import DISPLAY, format_quantity, parse_quantity, with_micro_signs

_KEEPS_EDITING: Final = (
    Qt.FocusReason.PopupFocusReason,
    Qt.FocusReason.ActiveWindowFocusReason,
    Qt.FocusReason.MenuBarFocusReason,
)
_MOST_DECIMALS: Final = 9


class QuantityField(QLineEdit):
    """Takes "120", "-5" or "0.2 mm"; the unit stands dimmed beside the number.

    A bad entry is refused, never clamped: it keeps its text, the border turns, the reason stands
    below the field, in the tooltip and in the accessible description. Escape goes back to the
    last good value. The click that enters it marks the whole number, so that what is typed
    replaces it; the next click puts the cursor.

    Parameters
    ----------
    unit : str
        "um", "deg", "V", "Hz" or "steps": the unit of `value` and of a bare number.
    low, high : float or None
        The range accepted, both ends included.
    value : float
        What stands in it at first.
    decimals : int or None
        Fewest decimals shown; a finer entry shows all it has. None: as usual for the unit.
    integers : bool
        Accept whole numbers only.
    name : str
        What the number is, for the tooltip and the screen reader.
    """

    value_committed = Signal(float)
    """A valid value other than the last one, on Enter or when the focus leaves."""
    entered = Signal(float)
    """The valid value on every Enter, changed or not; follows `value_committed`."""
    refused = Signal(str)
    """The entry was refused, with the reason."""

    def __init__(
        self,
        unit: str,
        *,
        low: float | None = None,
        high: float | None = None,
        value: float = 0.0,
        decimals: int | None = None,
        integers: bool = False,
        name: str = "",
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self._unit, self._low, self._high = unit, low, high
        self._decimals, self._integers = 0 if integers else decimals, integers
        self._name = name
        self._good = value
        self._before_commit: float | None = None
        self._clicked_into = False
        self._reason = ""
        self._shown = self._text_of(value)
        self.setText(self._shown)
        self.setFont(number_font())
        self.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Fixed)
        self.setTextMargins(0, 0, self._unit_width_px(), 0)
        self.setAccessibleName(name or DISPLAY[unit])
        self._show_tip()
        self.textEdited.connect(self._on_text_edited)

    @property
    def unit(self) -> str:
        """Unit of `value`."""
        return self._unit

    def set_unit(self, unit: str, value: float) -> None:
        """Take another unit, and a value in it; an entry under way is given up."""
        self._unit = unit
        self._set_reason("")
        self._good, self._before_commit = value, None
        self._shown = self._text_of(value)
        self.setText(self._shown)
        self.setTextMargins(0, 0, self._unit_width_px(), 0)
        self._show_tip()
        self.update()

    @property
    def reason(self) -> str:
        """Why the entry is refused; empty when it is not."""
        return self._reason

    @property
    def is_editing(self) -> bool:
        """True while the text is not the last good value: Escape then belongs to the field."""
        return bool(self._reason) or self.text() != self._shown

    def value(self) -> float:
        """Return the last good value."""
        return self._good

    def set_value(self, value: float) -> None:
        """Take over `value` from the model, without a signal; an entry under way stays."""
        editing = self.is_editing
        self._good, self._before_commit = value, None
        self._shown = self._text_of(value)
        if not editing and self.text() != self._shown:
            self.setText(self._shown)

    def set_range(self, low: float | None, high: float | None) -> None:
        """Accept `low` to `high` from now on; None leaves that side open."""
        self._low, self._high = low, high
        self._show_tip()

    def refuse(self, reason: str) -> None:
        """Show that the entry was refused, by the gate for instance; it keeps its text.

        A value committed just before counts as never accepted.
        """
        if self._before_commit is not None:
            self._good, self._before_commit = self._before_commit, None
            self._shown = self._text_of(self._good)
        self._set_reason(reason)
        self.refused.emit(reason)

    def end_refusal(self) -> None:
        """Take the refusal away, as it holds no longer; what was typed stays."""
        self._set_reason("")

    def revert(self) -> None:
        """Go back to the last good value."""
        self._set_reason("")
        self.setText(self._shown)
        self.selectAll()

    def commit(self) -> bool:
        """Check the text as Enter does; False when it was refused."""
        try:
            value = self._parse()
        except QuantityError as exc:
            self._before_commit = None
            self.refuse(str(exc))
            return False
        self._set_reason("")
        before, self._good = self._good, value
        self._shown = self._text_of(value)
        self.setText(self._shown)
        if value != before:
            self._before_commit = before
            self.value_committed.emit(value)
        return not self._reason

    def _parse(self) -> float:
        value = parse_quantity(self.text(), self._unit)
        if self._integers and not value.is_integer():
            raise QuantityError(f"{value:g} is not a whole number")
        low = float("-inf") if self._low is None else self._low
        high = float("inf") if self._high is None else self._high
        if not low <= value <= high:
            side, limit = ("below the lowest", low) if value < low else ("above the highest", high)
            raise QuantityError(
                f"{self._with_unit(value)} is {side} value, {self._with_unit(limit)}"
            )
        return value

    def _text_of(self, value: float) -> str:
        """Return `value` without unit, with as many decimals as it needs to be told exactly."""
        text = self._with_unit(value).split(" ")[0]
        return text if float(text) == value else f"{value:.{_MOST_DECIMALS}f}".rstrip("0")

    def _with_unit(self, value: float) -> str:
        text = format_quantity(value, self._unit, self._decimals)
        if float(text.split(" ")[0]) == value:
            return text
        return f"{value:.{_MOST_DECIMALS}g} {DISPLAY[self._unit]}"

    def _set_reason(self, reason: str) -> None:
        reason = with_micro_signs(reason)
        if reason:
            ReasonBubble.of(self).show_for(self, f"{state_look(State.REFUSED).glyph} {reason}")
        elif self._reason:
            ReasonBubble.of(self).dismiss(self)
        if reason == self._reason:
            return
        self._reason = reason
        self.setProperty("refused", bool(reason))
        restyle(self)
        self._show_tip()
        self.update()

    def _show_tip(self) -> None:
        self.setAccessibleDescription(self._reason)
        if self._reason:
            retip(self, f"REFUSED: {self._reason}\nEsc goes back to the last good value")
            return
        parts = [self._name or "Number", f"in {DISPLAY[self._unit]}"]
        if self._low is not None and self._high is not None:
            parts.append(f"({self._with_unit(self._low)} to {self._with_unit(self._high)})")
        retip(self, f"{' '.join(parts)}; Enter accepts, Esc goes back")

    def _on_text_edited(self) -> None:
        self._before_commit = None
        if self._reason:
            self._set_reason("")

    def _unit_width_px(self) -> int:
        return self.fontMetrics().horizontalAdvance(DISPLAY[self._unit]) + STEP_PX // 2

    @override
    def sizeHint(self) -> QSize:
        digits = self.fontMetrics().horizontalAdvance("-00000.0")
        return QSize(digits + self._unit_width_px() + 3 * STEP_PX, super().sizeHint().height())

    @override
    def minimumSizeHint(self) -> QSize:
        return self.sizeHint()

    @override
    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() == Qt.Key.Key_Escape and self.is_editing:
            self.revert()
            event.accept()
            return
        super().keyPressEvent(event)
        if event.key() in ENTER_KEYS and not event.isAutoRepeat() and self.commit():
            self.selectAll()
            self.entered.emit(self._good)

    @override
    def focusOutEvent(self, event: QFocusEvent) -> None:
        super().focusOutEvent(event)
        if event.reason() not in _KEEPS_EDITING and self.text() != self._shown and not self._reason:
            self.commit()

    @override
    def focusInEvent(self, event: QFocusEvent) -> None:
        super().focusInEvent(event)
        self._clicked_into = event.reason() == Qt.FocusReason.MouseFocusReason
        self._show_reason_again()

    @override
    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        super().mouseReleaseEvent(event)
        if self._clicked_into and not self.hasSelectedText():
            self.selectAll()
        self._clicked_into = False

    @override
    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        self.selectAll()  # Qt takes the digits on one side of the point alone
        event.accept()

    @override
    def enterEvent(self, event: QEnterEvent) -> None:
        super().enterEvent(event)
        self._show_reason_again()

    def _show_reason_again(self) -> None:
        if self._reason:
            self._set_reason(self._reason)

    @override
    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.FontChange:
            self.setTextMargins(0, 0, self._unit_width_px(), 0)

    @override
    def paintEvent(self, event: QPaintEvent) -> None:
        super().paintEvent(event)
        with painting(self) as painter:
            palette = current_palette()
            room: QRect = self.rect().adjusted(STEP_PX, 0, -STEP_PX, 0)
            right = int(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
            left = int(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
            beside = not self._reason or self._has_room_for_mark(room.width())
            if beside:
                painter.setPen(QColor(palette.dim if self.isEnabled() else palette.disabled))
                painter.drawText(room, right, DISPLAY[self._unit])
            if self._reason:  # the shape of REFUSED: colour alone would not do
                painter.setPen(QColor(palette.refused))
                painter.drawText(room, left if beside else right, state_look(State.REFUSED).glyph)

    def _has_room_for_mark(self, room_px: int) -> bool:
        """Tell whether the mark fits beside number and unit; else it has the place of the unit."""
        metrics = self.fontMetrics()
        mark_px = metrics.horizontalAdvance(state_look(State.REFUSED).glyph)
        text_px = metrics.horizontalAdvance(self.text()) + self._unit_width_px()
        return text_px + mark_px + STEP_PX // 2 <= room_px
