"""The last seconds of a control loop as curves: set point and value above, output below."""

from typing import Final

import pyqtgraph as pg
from PySide6.QtCore import QEvent, Qt
from PySide6.QtWidgets import QVBoxLayout, QWidget

from cosmic.autonomy.control.trace import ControlTrace
from cosmic.daqco.gui.plot.units import display_unit
from cosmic.frame.gui.palette import OKABE_ITO
from cosmic.frame.gui.theme import STEP_PX, current_palette, number_font
from cosmic.frame.overrides import override

SPAN_S: Final = 10.0
_AXIS_PX: Final = 56
_GAP_PX: Final = 3
_WIDTH: Final = 2
_MOST_POINTS: Final = 1000
_VALUE: Final = OKABE_ITO["orange"]
_OUTPUT: Final = OKABE_ITO["sky blue"]


class ControlPlot(QWidget):
    """Draws a `ControlTrace`; GUI thread."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._view = pg.GraphicsView()
        layout = pg.GraphicsLayout()
        self._view.setCentralItem(layout)
        layout.layout.setSpacing(_GAP_PX)
        layout.layout.setContentsMargins(2, 4, 8, 2)
        self.value_box, self._value_axis = _strip(layout, 0)
        self.output_box, self._output_axis = _strip(layout, 1)
        layout.layout.setRowStretchFactor(0, 3)
        layout.layout.setRowStretchFactor(1, 2)
        self._time_axis = pg.AxisItem("bottom")
        self._time_axis.enableAutoSIPrefix(False)
        self._time_axis.linkToView(self.output_box)
        layout.addItem(self._time_axis, row=2, col=1)
        self.value, self.set_point = pg.PlotCurveItem(), pg.PlotCurveItem()
        self.output = pg.PlotCurveItem()
        for box, curve in (
            (self.value_box, self.value),
            (self.value_box, self.set_point),
            (self.output_box, self.output),
        ):
            box.addItem(curve)
        self._units = ("", "")
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self._view)
        self.setMinimumSize(30 * STEP_PX, 20 * STEP_PX)
        self._restyle()

    def set_units(self, unit: str, axis_unit: str) -> None:
        """Write the units of value and axis at the axes."""
        if (unit, axis_unit) != self._units:
            self._units = (unit, axis_unit)
            self._restyle()

    def show_trace(self, trace: ControlTrace) -> None:
        """Draw a trace; its end is now."""
        if not trace.wall_s.size:
            self.clear()
            return
        every = slice(None, None, 1 + trace.wall_s.size // _MOST_POINTS)
        before_s = (trace.wall_s - trace.wall_s[-1])[every]
        self.value.setData(before_s, trace.measured[every])
        self.set_point.setData(before_s, trace.set_point[every])
        self.output.setData(before_s, trace.output[every])

    def clear(self) -> None:
        """Draw nothing."""
        for curve in (self.value, self.set_point, self.output):
            curve.setData([], [])

    def _restyle(self) -> None:
        palette = current_palette()
        self._view.setBackground(palette.panel)
        unit, axis_unit = (display_unit(each) for each in self._units)
        for box in (self.value_box, self.output_box):
            box.setBackgroundColor(palette.field)
        for axis, name in (
            (self._value_axis, f"value, {unit}" if unit else "value"),
            (self._output_axis, f"output, {axis_unit}/s" if axis_unit else "output"),
            (self._time_axis, "time before now, s"),
        ):
            axis.setPen(palette.border_strong)
            axis.setTextPen(palette.text)
            axis.setStyle(tickFont=number_font(11), tickLength=4)
            axis.setLabel(name, color=palette.dim)
        self.value.setPen(pg.mkPen(_VALUE, width=_WIDTH))
        self.output.setPen(pg.mkPen(_OUTPUT, width=_WIDTH))
        # The set point is the text's colour and dashed: told apart without colour, too.
        self.set_point.setPen(pg.mkPen(palette.text, width=1, style=Qt.PenStyle.DashLine))

    @override
    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "_units"):
            self._restyle()


def _strip(layout: pg.GraphicsLayout, row: int) -> tuple[pg.ViewBox, pg.AxisItem]:
    """Add one field for curves with its axis; it has no menus, which would be windows."""
    box = pg.ViewBox(enableMenu=False, enableMouse=False)
    box.setXRange(-SPAN_S, 0.0, padding=0.0)
    box.enableAutoRange(y=True)
    axis = pg.AxisItem("left")
    axis.enableAutoSIPrefix(False)
    axis.setWidth(_AXIS_PX)
    axis.linkToView(box)
    layout.addItem(axis, row=row, col=0)
    layout.addItem(box, row=row, col=1)
    return box, axis
