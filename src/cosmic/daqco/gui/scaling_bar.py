"""The fields for the vertical axes (DAQPlot.3) and the buttons beside them (DAQPlot.4)."""

from typing import Final

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QComboBox, QHBoxLayout, QLabel, QPushButton, QWidget

from cosmic.daqco.gui.plot.units import AxisRange, display_unit
from cosmic.daqco.gui.value_field import ValueField
from cosmic.frame.gui.build import named, push_button, tight_row, tipped
from cosmic.frame.gui.flow_layout import FlowLayout
from cosmic.frame.gui.theme import STEP_PX

SPANS_S: Final = (1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0)
_LIVE: Final = ("Pause", "Freeze the plot; acquisition and recording continue")
_FROZEN: Final = ("Back to live", "Follow the newest samples again")


class ScalingBar(QWidget):
    """Asks for what the plotter does; goes on in a second line where there is little room."""

    rescale_requested = Signal(str, object)
    """Unit and `AxisRange` of the axis to change."""
    auto_changed = Signal(bool)
    clear_requested = Signal()
    pause_requested = Signal(bool)
    span_changed = Signal(float)
    cursors_changed = Signal(bool)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._ranges: dict[str, AxisRange] = {}
        self._frozen = False
        self.pause = push_button(*_LIVE)
        width = max(push_button(text, "").sizeHint().width() for text, _ in (_LIVE, _FROZEN))
        self.pause.setFixedWidth(width + STEP_PX)
        self.span = tipped(QComboBox(), "Time span of the plot")
        for span_s in SPANS_S:
            self.span.addItem(f"{span_s:g} s", span_s)
        self.span.setCurrentIndex(SPANS_S.index(10.0))
        self.unit = tipped(QComboBox(), "The axis that the fields beside are for")
        self.low, self.high = ValueField("y-axis minimum"), ValueField("y-axis maximum")
        self.step = ValueField("Interval between the labelled lines")
        self.rescale = named(push_button("Rescale", "Apply y-min, y-max and y-interval"), "rescale")
        self.auto = _toggle("Auto", "Keep fitting the axes to the visible data")
        self.auto.setChecked(True)
        self.cursors = _toggle("Cursors", "Show two lines to read values at")
        self.clear = push_button("Clear", "Clear the plotted history; no file is changed")
        self.scales = _toggle("y-axis", "Show the fields for the vertical axes")
        self.scales.setChecked(True)
        self._fields: list[QWidget] = []
        self._chosen = False
        self._build()
        self._connect()

    def _build(self) -> None:
        flow = FlowLayout(STEP_PX, self)
        labelled = (("y-min", self.low), ("y-max", self.high), ("y-interval", self.step))
        self._fields = [*(_labelled(text, field) for text, field in labelled), self.rescale]
        before = (self.pause, self.span, self.cursors, self.clear, self.auto, self.scales)
        for widget in (*before, self.unit, *self._fields):
            flow.addWidget(widget)

    def _connect(self) -> None:
        self.pause.clicked.connect(self._on_pause)
        self.span.activated.connect(lambda: self.span_changed.emit(self.span.currentData()))
        self.unit.activated.connect(self._show_range)
        self.rescale.clicked.connect(self._on_rescale)
        self.auto.toggled.connect(self.auto_changed)
        self.scales.clicked.connect(self._on_scales_clicked)
        self.scales.toggled.connect(self._show_fields)
        self.cursors.toggled.connect(self.cursors_changed)
        self.clear.clicked.connect(self.clear_requested)
        for field in (self.low, self.high, self.step):
            field.returnPressed.connect(self._on_rescale)

    def show_ranges(self, ranges: dict[str, AxisRange]) -> None:
        """Show the ranges in force; fields that are being edited keep their text."""
        if tuple(ranges) != tuple(self._ranges):
            chosen = self.unit.currentData()
            self.unit.clear()
            for unit in ranges:
                self.unit.addItem(display_unit(unit), unit)
            self.unit.setCurrentIndex(max(0, self.unit.findData(chosen)))
        self._ranges = dict(ranges)
        self._show_fields()
        if not any(f.isModified() or f.reason for f in (self.low, self.high, self.step)):
            self._show_range()

    def set_compact(self, compact: bool) -> None:
        """Leave the room to the image, unless the operator chose otherwise."""
        if not self._chosen:
            self.scales.setChecked(not compact)

    def show_frozen(self, frozen: bool) -> None:
        """Let the first button say what it does now."""
        self._frozen = frozen
        text, tip = _FROZEN if frozen else _LIVE
        self.pause.setText(text)
        self.pause.setToolTip(tip)

    def _show_fields(self) -> None:
        shown = self.scales.isChecked()
        for widget in self._fields:
            widget.setVisible(shown)
        self.unit.setVisible(shown and len(self._ranges) > 1)

    def _on_scales_clicked(self) -> None:
        self._chosen = True

    def _show_range(self) -> None:
        unit = self.unit.currentData()
        for field in (self.low, self.high, self.step):
            field.setEnabled(unit is not None)
        shown = self._ranges.get(unit)
        if shown is None:
            return
        for field, value in ((self.low, shown.low), (self.high, shown.high)):
            field.set_unit(unit)
            field.set_value(value)
        self.step.set_unit(unit)
        self.step.set_value(shown.step)

    def _on_pause(self) -> None:
        self.pause_requested.emit(not self._frozen)

    def _on_rescale(self) -> None:
        fields = {"low": self.low, "high": self.high, "step": self.step}
        taken = [field.take() for field in fields.values()]
        if not all(taken):
            return
        wanted = AxisRange(self.low.value(), self.high.value(), self.step.value())
        wrong, why = wanted.problem()
        if wrong:
            fields[wrong].refuse(why)
            return
        for field in fields.values():
            field.setModified(False)
            field.refuse("")
        self.auto.setChecked(False)
        self.rescale_requested.emit(self.unit.currentData(), wanted)


def _toggle(text: str, tip: str) -> QPushButton:
    button = push_button(text, tip)
    button.setCheckable(True)
    return button


def _labelled(text: str, field: ValueField) -> QWidget:
    row, layout = tight_row(STEP_PX // 2)
    label = QLabel(text)
    label.setProperty("role", "dim")
    label.setBuddy(field)
    assert isinstance(layout, QHBoxLayout)
    layout.addWidget(label)
    layout.addWidget(field)
    return row
