"""A field for a number in any unit, such as that of a custom scale; refuses, never clamps."""

from typing import Final

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QWidget

from cosmic.daqco.gui.plot.units import display_unit
from cosmic.frame.errors import QuantityError
from cosmic.frame.gui.number_edit import NumberEdit, read_number
from cosmic.frame.overrides import override

_DIGITS: Final = 9


class ValueField(NumberEdit):
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
        super().__init__(name, display_unit(unit), parent)
        self._empty = empty
        self._good: float | None = None
        self.set_value(None if empty else 0.0)
        self.textEdited.connect(lambda: self.refuse(""))
        self.editingFinished.connect(self._on_finished)

    def set_unit(self, unit: str) -> None:
        """Write another unit behind the number."""
        self._write_unit(display_unit(unit))
        self._show_tip()

    def set_value(self, value: float | None) -> None:
        """Show `value`; an entry under way is lost."""
        self._good = value
        self.setText("" if value is None else f"{value:.{_DIGITS}g}")
        self.refuse("")

    def take(self) -> bool:
        """Check the text; False when it was refused, and the reason then stands at the field."""
        if self._empty and not self.text().strip():
            self._good = None
            return True
        try:
            self._good = read_number(self.text())
        except QuantityError as exc:
            self.refuse(str(exc))
            return False
        return True

    def value(self) -> float:
        """Return the last number taken; 0 where none was."""
        return 0.0 if self._good is None else self._good

    def optional(self) -> float | None:
        """Return the last number taken; None where the field was empty."""
        return self._good

    @override
    def refuse(self, reason: str) -> None:
        super().refuse(reason)
        self._show_tip()

    def _show_tip(self) -> None:
        unit = f" in {self._unit}" if self._unit else ""
        self.setToolTip(
            f"REFUSED: {self.reason}\nEsc goes back" if self.reason else f"{self._name}{unit}"
        )

    def _on_finished(self) -> None:
        before = self._good
        if not self.reason and self.take() and self._good is not None and self._good != before:
            self.committed.emit(self._good)

    @override
    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() == Qt.Key.Key_Escape and (self.reason or self.isModified()):
            self.set_value(self._good)
            event.accept()
            return
        super().keyPressEvent(event)
