"""A field with a slider beside it, for a value that is changed while looking at the image."""

import math
from typing import Final

from PySide6.QtCore import Qt, QTimer, Signal
from PySide6.QtWidgets import QHBoxLayout, QLabel, QSlider, QWidget

from cosmic.frame.gui.build import retip
from cosmic.frame.gui.theme import STEP_PX
from cosmic.vico.gui.amount_field import AmountField

TICKS: Final = 1000
SETTLE_MS: Final = 60
LOGARITHMIC: Final = 50.0


class SliderField(QWidget):
    """A name, a field and a slider over the same range; wide ranges are spread by ratio.

    Signals
    -------
    committed(float)
        The operator chose a value; while the slider is dragged at most every 60 ms.
    """

    committed = Signal(float)

    def __init__(
        self, name: str, unit: str, *, caption: str = "", parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        self.field = AmountField(name, unit)
        self.slider = QSlider(Qt.Orientation.Horizontal)
        self.slider.setRange(0, TICKS)
        self.slider.setMinimumWidth(3 * STEP_PX)
        self.slider.setAccessibleName(name)
        self._low, self._high = 0.0, 1.0
        self._name, self._whole = name, 0.0
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(STEP_PX // 2)
        self._caption = QLabel(caption)
        self._caption.setProperty("role", "dim")
        self._caption.setVisible(bool(caption))
        row.addWidget(self._caption)
        row.addWidget(self.field)
        row.addWidget(self.slider, 1)
        self._settle = QTimer(self, interval=SETTLE_MS, singleShot=True)
        self._settle.timeout.connect(self._on_settled)
        self.field.committed.connect(self._on_field)
        self.slider.valueChanged.connect(self._on_slider)

    def show_field_only(self) -> None:
        """Leave caption and slider away, where there is room for the field alone."""
        self._caption.hide()
        self.slider.hide()

    def set_range(self, low: float, high: float, step: float = 0.0) -> None:
        """Let both go from `low` to `high`."""
        if (low, high, step) == (self._low, self._high, self._whole):
            return
        self._low, self._high, self._whole = low, high, step
        self.field.set_range(low, high, step)
        self._show_slider()

    def set_value(self, value: float | None) -> None:
        """Take over a value from the model; what the operator is at stays."""
        if self.slider.isSliderDown() or self._settle.isActive():
            return
        self.field.set_value(value)
        self._show_slider()

    def value(self) -> float | None:
        """Return the last good value."""
        return self.field.value()

    def refuse(self, reason: str) -> None:
        """Say why the value is not taken."""
        self.field.refuse(reason)
        self._show_slider()

    def set_usable(self, why_not: str) -> None:
        """Disable both, with the reason in the tooltip; an empty reason enables them."""
        self.setEnabled(not why_not)
        retip(self, why_not)
        retip(self.slider, why_not or self._name)
        self.field.set_usable(why_not)

    @property
    def _by_ratio(self) -> bool:
        return self._low > 0.0 and self._high / self._low > LOGARITHMIC

    def _show_slider(self) -> None:
        value = self.field.value()
        if value is None or self._high <= self._low:
            return
        inside = min(max(value, self._low), self._high)
        if self._by_ratio:
            share = math.log(inside / self._low) / math.log(self._high / self._low)
        else:
            share = (inside - self._low) / (self._high - self._low)
        self.slider.blockSignals(True)
        self.slider.setValue(round(TICKS * share))
        self.slider.blockSignals(False)

    def _slider_value(self) -> float:
        share = self.slider.value() / TICKS
        if self._by_ratio:
            value = self._low * (self._high / self._low) ** share
            value = float(f"{value:.3g}")
        else:
            value = self._low + share * (self._high - self._low)
        step = self._whole or (0.0 if self._by_ratio else (self._high - self._low) / TICKS)
        if step:
            value = self._low + round((value - self._low) / step) * step
        return min(max(float(f"{value:.9g}"), self._low), self._high)

    def _on_slider(self) -> None:
        self.field.refuse("")
        self.field.setText(f"{self._slider_value():.6g}")
        if not self._settle.isActive():
            self._settle.start()

    def _on_settled(self) -> None:
        self.field.commit()

    def _on_field(self, value: float) -> None:
        if not self.slider.isSliderDown():
            self._show_slider()
        self.committed.emit(value)
