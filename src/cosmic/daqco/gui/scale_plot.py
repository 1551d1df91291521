"""A custom scale drawn over the voltages there can be, and tried on one of them."""

import numpy as np
import pyqtgraph as pg
from PySide6.QtWidgets import QHBoxLayout, QLabel, QVBoxLayout, QWidget

from cosmic.daqco.core.settings import EXTREMES_V, ScaleSettings
from cosmic.daqco.gui.plot.units import display_unit
from cosmic.daqco.gui.polynomial import formula, oddity
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.quantity_field import QuantityField
from cosmic.frame.gui.theme import STEP_PX, current_palette, number_font

POINTS = 401


class ScalePlot(QWidget):
    """Formula, curve, and the value of a voltage that the operator types."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._scale: ScaleSettings | None = None
        self.formula = ElidedLabel()
        self.formula.setFont(number_font())
        self._draw_axes()
        self.volts = QuantityField(
            "V", low=EXTREMES_V[0], high=EXTREMES_V[1], value=1.0, decimals=3, name="Try a voltage"
        )
        self.result, self.hint = QLabel("–"), ElidedLabel()
        self.result.setFont(number_font(bold=True))
        self.hint.setProperty("role", "dim")
        row = QHBoxLayout()
        for widget in (QLabel("Try"), self.volts, QLabel("→"), self.result):
            row.addWidget(widget)
        row.addStretch(1)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self.formula)
        column.addWidget(self.plot, 1)
        column.addLayout(row)
        column.addWidget(self.hint)
        self.volts.value_committed.connect(self._try)

    def _draw_axes(self) -> None:
        palette = current_palette()
        self.plot = pg.GraphicsView(background=palette.field)
        self.plot.setMinimumSize(36 * STEP_PX, 22 * STEP_PX)
        self.plot.setAccessibleName("Curve of the scale")
        layout = pg.GraphicsLayout()
        self.plot.setCentralItem(layout)
        # A PlotItem would make menus that outlive it.
        box = pg.ViewBox(enableMenu=False, enableMouse=False)
        self._left = pg.AxisItem("left")
        below = pg.AxisItem("bottom")
        for axis in (self._left, below):
            axis.linkToView(box)
            axis.setPen(palette.border_strong)
            axis.setTextPen(palette.text)
            axis.enableAutoSIPrefix(False)
            axis.setGrid(60)
        below.setLabel("input, V", color=palette.dim)
        layout.addItem(self._left, row=0, col=0)
        layout.addItem(box, row=0, col=1)
        layout.addItem(below, row=1, col=1)
        self.curve = pg.PlotCurveItem(pen=pg.mkPen(palette.accent, width=2))
        self.point = pg.ScatterPlotItem(
            size=9, brush=pg.mkBrush(palette.refused), pen=pg.mkPen(palette.field)
        )
        box.addItem(self.curve)
        box.addItem(self.point)
        box.setXRange(*EXTREMES_V)

    def show_scale(self, scale: ScaleSettings | None) -> None:
        """Draw a scale; None draws nothing."""
        self._scale = scale
        if scale is None:
            self.formula.set_text("")
            self.hint.set_text("")
            self.curve.setData([], [])
        else:
            volts = np.linspace(*EXTREMES_V, POINTS)
            self.curve.setData(volts, scale.scale().apply(volts))
            self.formula.set_text(formula(scale.coefficients, scale.unit))
            odd = oddity(scale)
            self.hint.set_text(f"◆ {odd}" if odd else "")
            label = f"{scale.name}, {display_unit(scale.unit)}"
            self._left.setLabel(label, color=current_palette().dim)
        self._try()

    def _try(self) -> None:
        scale, volts = self._scale, self.volts.value()
        if scale is None:
            self.result.setText("–")
            self.point.setData([], [])
            return
        value = float(scale.scale().apply([volts])[0])
        self.result.setText(f"{value:.6g} {display_unit(scale.unit)}")
        self.point.setData([volts], [value])
