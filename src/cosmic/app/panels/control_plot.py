"""The last seconds of a control loop as curves: set point and value above, output below."""

from typing import Final

import pyqtgraph as pg
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QWidget

from cosmic.app.panels.curve_frame import CurveFrame
from cosmic.autonomy.control.trace import ControlTrace
from cosmic.daqco.gui.plot.units import display_unit
from cosmic.frame.gui.palette import OKABE_ITO, Palette
from cosmic.frame.gui.theme import STEP_PX
from cosmic.frame.overrides import override

SPAN_S: Final = 10.0
_AXIS_PX: Final = 56
_WIDTH: Final = 2
_MOST_POINTS: Final = 1000
_VALUE: Final = OKABE_ITO["orange"]
_OUTPUT: Final = OKABE_ITO["sky blue"]


class ControlPlot(CurveFrame):
    """Draws a `ControlTrace`; GUI thread."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(_AXIS_PX, parent)
        self.value_box, self._value_axis = self._add_field("value", share=3)
        self.output_box, self._output_axis = self._add_field("output", share=2)
        for box in (self.value_box, self.output_box):
            box.setXRange(-SPAN_S, 0.0, padding=0.0)
            box.enableAutoRange(y=True)
        self._add_axis_below("time before now, s")
        self.value, self.set_point = pg.PlotCurveItem(), pg.PlotCurveItem()
        self.output = pg.PlotCurveItem()
        for box, curve in (
            (self.value_box, self.value),
            (self.value_box, self.set_point),
            (self.output_box, self.output),
        ):
            box.addItem(curve)
        self._units = ("", "")
        self.setMinimumSize(30 * STEP_PX, 20 * STEP_PX)
        self._restyle()

    def set_units(self, unit: str, axis_unit: str) -> None:
        """Write the units of value and axis at the axes."""
        if (unit, axis_unit) != self._units:
            self._units = (unit, axis_unit)
            shown, axis_shown = display_unit(unit), display_unit(axis_unit)
            self._names[self._value_axis] = f"value, {shown}" if shown else "value"
            self._names[self._output_axis] = f"output, {axis_shown}/s" if axis_shown else "output"
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

    @override
    def _colour(self, palette: Palette) -> None:
        self.value.setPen(pg.mkPen(_VALUE, width=_WIDTH))
        self.output.setPen(pg.mkPen(_OUTPUT, width=_WIDTH))
        # The set point is the text's colour and dashed: told apart without colour, too.
        self.set_point.setPen(pg.mkPen(palette.text, width=1, style=Qt.PenStyle.DashLine))
