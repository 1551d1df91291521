"""A field for a number in any unit, with a range; refuses, never clamps, and says why."""

import math
from typing import Final

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QFocusEvent, QKeyEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from cosmic.frame.errors import QuantityError
from cosmic.frame.gui.build import retip
from cosmic.frame.gui.key_focus import ENTER_KEYS
from cosmic.frame.gui.number_edit import NumberEdit, read_number
from cosmic.frame.overrides import override
from cosmic.vico.gui.texts import number_text, plain_steps

_STEPS: Final = {Qt.Key.Key_Up: 1, Qt.Key.Key_Down: -1}


class AmountField(NumberEdit):
    """Takes a number within a range; its unit stands dimmed behind it.

    Enter accepts, Escape goes back, the arrow keys go up and down a step.

    Signals
    -------
    committed(float)
        A good value other than the last was entered.
    """

    committed = Signal(float)

    def __init__(
        self,
        name: str,
        unit: str = "",
        *,
        low: float = -math.inf,
        high: float = math.inf,
        value: float | None = None,
        integers: bool = False,
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(name, unit, parent)
        self._integers = integers
        self._low, self._high, self._step = low, high, 1.0
        self._good: float | None = None
        self._before: float | None = None
        self._shown = self._why_not = ""
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Fixed)
        self.set_range(low, high)
        self.set_value(value)
        self.textEdited.connect(self._on_edited)

    @property
    def is_editing(self) -> bool:
        """True while the text is not the last good value."""
        return bool(self.reason) or self.text() != self._shown

    def value(self) -> float | None:
        """Return the last good value; None where there never was one."""
        return self._good

    def set_value(self, value: float | None) -> None:
        """Take over a value from the model; an entry under way stays."""
        editing = self.is_editing
        self._good, self._before = value, None
        self._shown = "" if value is None else number_text(value)
        if not editing and self.text() != self._shown:
            self.setText(self._shown)

    def set_range(self, low: float, high: float, step: float = 0.0) -> None:
        """Accept `low` to `high` from now on; the arrow keys go by `step` (0: as fits)."""
        self._low, self._high = low, high
        finite = math.isfinite(high - low)
        self._step = step or (plain_steps(low, high) if finite else 1.0)
        self._show_tip()

    def set_usable(self, why_not: str) -> None:
        """Disable it, with the reason in the tooltip; an empty reason enables it."""
        self._why_not = why_not
        self.setEnabled(not why_not)
        self._show_tip()

    @override
    def refuse(self, reason: str) -> None:
        """Say why the entry is not taken; a value committed just before was never good."""
        if self._before is not None:
            self._good, self._before = self._before, None
            self._shown = number_text(self._good)
        super().refuse(reason)
        self._show_tip()

    def revert(self) -> None:
        """Go back to the last good value."""
        self.setText(self._shown)
        self.refuse("")
        self.selectAll()

    def commit(self) -> bool:
        """Check the text as Enter does; False when it was refused."""
        value = self._checked()
        if value is None:
            return False
        self.refuse("")
        changed, before = value != self._good, self._good
        self._good, self._shown = value, number_text(value)
        self.setText(self._shown)
        if changed:
            self._before = before
            self.committed.emit(value)
        return not self.reason

    def _checked(self) -> float | None:
        try:
            value = read_number(self.text().strip().removesuffix(self._unit))
        except QuantityError as exc:
            self.refuse(str(exc))
            return None
        problem = self._problem(value)
        if problem:
            self.refuse(problem)
            return None
        return value

    def _problem(self, value: float) -> str:
        if self._integers and not value.is_integer():
            return f"{value:g} is not a whole number"
        if not self._low <= value <= self._high:
            side, limit = (
                ("below the lowest", self._low)
                if value < self._low
                else ("above the highest", self._high)
            )
            return f"{self._with_unit(value)} is {side} value, {self._with_unit(limit)}"
        return ""

    def _with_unit(self, value: float) -> str:
        return f"{number_text(value)} {self._unit}".strip()

    def _on_edited(self) -> None:
        self._before = None
        if self.reason:
            self.refuse("")

    def _show_tip(self) -> None:
        if self._why_not:
            retip(self, self._why_not)
            return
        if self.reason:
            retip(self, f"REFUSED: {self.reason}\nEsc goes back to the last good value")
            return
        span = ""
        if math.isfinite(self._low) and math.isfinite(self._high):
            span = f", {number_text(self._low)} to {self._with_unit(self._high)}"
        retip(self, f"{self._name}{span}; Enter accepts, Esc goes back")

    def _go(self, steps: int) -> None:
        if self._good is None:
            return
        target = min(max(self._good + steps * self._step, self._low), self._high)
        self.setText(number_text(target))
        self.commit()

    @override
    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() == Qt.Key.Key_Escape and self.is_editing:
            self.revert()
            event.accept()
        elif event.key() in _STEPS:
            self._go(_STEPS[Qt.Key(event.key())])
            event.accept()
        else:
            super().keyPressEvent(event)
            if event.key() in ENTER_KEYS and self.commit():
                self.selectAll()

    @override
    def focusOutEvent(self, event: QFocusEvent) -> None:
        super().focusOutEvent(event)
        leaving = event.reason() not in (
            Qt.FocusReason.PopupFocusReason,
            Qt.FocusReason.ActiveWindowFocusReason,
        )
        if leaving and self.text() != self._shown and not self.reason:
            self.commit()
