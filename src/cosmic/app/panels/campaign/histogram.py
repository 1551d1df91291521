"""How the stiffnesses of a campaign are distributed, on a logarithmic axis."""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
import pyqtgraph as pg
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QWidget

from cosmic.app.panels.curve_frame import CurveFrame
from cosmic.autonomy.campaign.formatting import EI_LABEL, EI_UNIT
from cosmic.autonomy.campaign.snapshot import MeasuredEi
from cosmic.autonomy.campaign.statistics import MeanEi
from cosmic.frame.arrays import Floats
from cosmic.frame.gui.palette import OKABE_ITO, Palette
from cosmic.frame.gui.theme import STEP_PX
from cosmic.frame.overrides import override

_AXIS_PX: Final = 44
_BARS: Final = OKABE_ITO["sky blue"]
_MEAN: Final = OKABE_ITO["orange"]
_MOST_INTERVALS: Final = 200
"""Fibres whose intervals are drawn, the newest; more of them would be a solid block."""


class EiHistogram(CurveFrame):
    """Draws the fibres as bars, below them each with its 95 % interval, above them the mean."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(_AXIS_PX, parent)
        self.bars_box, self._count_axis = self._add_field("fibres", share=3)
        self.intervals_box, self._interval_axis = self._add_field("")
        for box in (self.bars_box, self.intervals_box):
            box.disableAutoRange()
        self._ei_axis = self._add_axis_below(f"bending stiffness, {EI_LABEL}")
        self.intervals_box.setXLink(self.bars_box)
        self.bars = pg.BarGraphItem(x0=[], x1=[], height=[])
        self.doubtful = pg.BarGraphItem(x0=[], x1=[], y0=[], height=[])
        self.mean = pg.PlotCurveItem()
        self.middle = pg.ScatterPlotItem()
        self.intervals = pg.PlotCurveItem(connect="pairs")
        self.values = pg.ScatterPlotItem()
        for item in (self.bars, self.doubtful, self.mean, self.middle):
            self.bars_box.addItem(item)
        for item in (self.intervals, self.values):
            self.intervals_box.addItem(item)
        self.setMinimumSize(32 * STEP_PX, 20 * STEP_PX)
        self.setToolTip(
            "Bending stiffness of the fibres: bars above, each with its 95 % interval below, and "
            "the mean of the good ones with its interval"
        )
        self._shown: tuple[Sequence[MeasuredEi], MeanEi] | None = None
        self._clear()
        self._restyle()

    def show_values(self, measured: Sequence[MeasuredEi], mean: MeanEi) -> None:
        """Draw the fibres; values that are no number are left out."""
        if self._shown == (measured, mean):
            return
        self._shown = (measured, mean)
        shown = [each for each in measured if 0.0 < each.ei_n_m2 < math.inf]
        if not shown:
            self._clear()
            return
        logs = np.log10([each.ei_n_m2 / EI_UNIT for each in shown])
        edges = _edges(logs)
        trusted = np.array([each.trusted for each in shown])
        good, _ = np.histogram(logs[trusted], edges)
        doubtful, _ = np.histogram(logs[~trusted], edges)
        gap = 0.04 * (edges[1] - edges[0])
        ends = {"x0": edges[:-1] + gap, "x1": edges[1:] - gap}
        self.bars.setOpts(**ends, y0=np.zeros(len(good)), height=good)
        self.doubtful.setOpts(**ends, y0=good, height=doubtful)
        top = float(max(good + doubtful))
        self._show_mean(mean, 1.12 * top)
        self._show_intervals(shown)
        self._ei_axis.setTicks([_ei_ticks(float(edges[0]), float(edges[-1]))])
        self._count_axis.setTicks([_count_ticks(top)])
        self.bars_box.setXRange(float(edges[0]), float(edges[-1]), padding=0.02)
        self.bars_box.setYRange(0.0, 1.25 * top, padding=0.0)

    def _show_mean(self, mean: MeanEi, height: float) -> None:
        if mean.count < 2:
            self.mean.setData([], [])
            self.middle.setData([], [])
            return
        ends = [math.log10(each / EI_UNIT) for each in (mean.ei_low_n_m2, mean.ei_high_n_m2)]
        self.mean.setData(ends, [height, height])
        self.middle.setData([math.log10(mean.ei_n_m2 / EI_UNIT)], [height])

    def _show_intervals(self, shown: Sequence[MeasuredEi]) -> None:
        newest = sorted(shown[-_MOST_INTERVALS:], key=lambda each: each.ei_n_m2)
        rows = np.arange(len(newest), dtype=np.float64)
        values = np.log10([each.ei_n_m2 / EI_UNIT for each in newest])
        lows = np.log10([max(each.ei_low_n_m2, 1e-3 * each.ei_n_m2) / EI_UNIT for each in newest])
        highs = np.log10([min(each.ei_high_n_m2, 1e3 * each.ei_n_m2) / EI_UNIT for each in newest])
        self.intervals.setData(np.column_stack([lows, highs]).ravel(), np.repeat(rows, 2))
        self.values.setData(values, rows)
        self.intervals_box.setYRange(-1.0, len(newest), padding=0.0)

    def _clear(self) -> None:
        self._ei_axis.setTicks([[]])
        self._count_axis.setTicks([[]])
        self.bars.setOpts(x0=[], x1=[], y0=[], height=[])
        self.doubtful.setOpts(x0=[], x1=[], y0=[], height=[])
        for item in (self.mean, self.middle, self.intervals, self.values):
            item.setData([], [])

    @override
    def _colour(self, palette: Palette) -> None:
        self._interval_axis.setStyle(showValues=False, tickLength=0)
        self.bars.setOpts(brush=QColor(_BARS), pen=pg.mkPen(palette.field))
        # Not trusted: hollow, so that it is told apart without colour, too.
        self.doubtful.setOpts(brush=QColor(palette.field), pen=pg.mkPen(_BARS, width=1.5))
        self.mean.setPen(pg.mkPen(_MEAN, width=3))
        self.middle.setSymbol("d")
        self.middle.setBrush(QColor(_MEAN))
        self.middle.setPen(pg.mkPen(palette.text))
        self.intervals.setPen(pg.mkPen(palette.dim, width=1))
        self.values.setSize(4)
        self.values.setPen(pg.mkPen(None))
        self.values.setBrush(QColor(palette.text))


def _edges(logs: Floats) -> Floats:
    """Return bins of a width that fits the number of fibres, a tenth of a decade at least."""
    low, high = float(logs.min()), float(logs.max())
    width = max(0.1, (high - low) / max(4.0, min(24.0, 2.0 * math.sqrt(len(logs)))))
    first = math.floor(low / width)
    last = math.floor(high / width) + 1
    return width * np.arange(first, last + 1, dtype=np.float64)


def _ei_ticks(low: float, high: float) -> list[tuple[float, str]]:
    """Return the places and names of 1, 2 and 5 of each decade, in logarithms."""
    decades = range(math.floor(low), math.floor(high) + 1)
    values = [digit * 10.0**decade for decade in decades for digit in (1, 2, 5)]
    ticks = [(math.log10(value), f"{value:g}") for value in values]
    return [(tick, name) for tick, name in ticks if low <= tick <= high]


def _count_ticks(top: float) -> list[tuple[float, str]]:
    """Return about four whole numbers up to `top`."""
    size = 10.0 ** math.floor(math.log10(max(top, 1.0)))
    steps = (each * part for each in (size / 10.0, size) for part in (1.0, 2.0, 5.0))
    step = next((each for each in steps if each >= 1.0 and top / each <= 4.0), size)
    return [(float(value), f"{value:g}") for value in np.arange(0.0, top + 0.5 * step, step)]
