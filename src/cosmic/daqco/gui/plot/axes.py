"""The axes around the strip: time below, and one axis a unit at the left."""

from typing import Final

import pyqtgraph as pg
from PySide6.QtGui import QFont

from cosmic.daqco.gui.plot.units import AxisRange, display_unit
from cosmic.frame.gui.theme import current_palette, number_font

AXIS_PX: Final = 60
_BELOW_PX: Final = 36
_MOST: Final = 20
_GAP_PX: Final = 4


class Axes:
    """Keeps the axes of a layout; their widths are fixed, so that the image does not jump."""

    def __init__(self, layout: pg.GraphicsLayout, box: pg.ViewBox) -> None:
        self._layout, self._box = layout, box
        self._font: QFont = number_font(11)
        self.time = pg.AxisItem("bottom")
        self.time.enableAutoSIPrefix(False)
        self.time.linkToView(box)
        self.time.setHeight(_BELOW_PX)
        self._values: dict[str, pg.AxisItem] = {}
        self._names: list[pg.LabelItem] = []
        layout.addItem(box, row=1, col=_MOST)
        layout.addItem(self.time, row=2, col=_MOST)
        # Apart, so that painting the strip does not touch, and so paint, the axes.
        layout.layout.setSpacing(_GAP_PX)
        layout.layout.setContentsMargins(4, 2, 12, 2)
        self._style(self.time)

    @property
    def units(self) -> tuple[str, ...]:
        """Units that have an axis, from the outermost."""
        return tuple(self._values)

    def axis(self, unit: str) -> pg.AxisItem:
        """Return the axis of a unit that has one."""
        return self._values[unit]

    def show(self, ranges: dict[str, AxisRange]) -> None:
        """Have one axis for each unit, with its range."""
        if tuple(ranges) != self.units:
            self._rebuild(tuple(ranges))
        for unit, shown in ranges.items():
            axis = self._values[unit]
            axis.setRange(shown.low, shown.high)
            axis.setTickSpacing(levels=[(shown.step, 0.0)])

    def restyle(self) -> None:
        """Take over the colours of the theme in force."""
        for axis in (self.time, *self._values.values()):
            self._style(axis)
        for unit, name in zip(self._values, self._names, strict=True):
            name.setText(display_unit(unit), color=current_palette().dim, size="9pt")

    def time_shares(self) -> tuple[float, ...]:
        """Return where the labelled times are, 0 (left) to 1."""
        low, high = self.time.range
        size = max(1.0, self._box.width())
        levels = self.time.tickValues(low, high, size)
        major = levels[0][1] if levels else ()
        return tuple((value - low) / (high - low) for value in major)

    def _rebuild(self, units: tuple[str, ...]) -> None:
        for item in (*self._values.values(), *self._names):
            self._layout.removeItem(item)
            item.deleteLater()
        self._values, self._names = {}, []
        for column, unit in enumerate(units[:_MOST]):
            axis = pg.AxisItem("left")
            axis.enableAutoSIPrefix(False)
            axis.setWidth(AXIS_PX)
            self._layout.addItem(axis, row=1, col=column)
            self._values[unit] = axis
            name = pg.LabelItem("", justify="right")
            name.setMaximumWidth(AXIS_PX)
            self._layout.addItem(name, row=0, col=column)
            self._names.append(name)
        self.restyle()

    def _style(self, axis: pg.AxisItem) -> None:
        palette = current_palette()
        axis.setPen(palette.border_strong)
        axis.setTextPen(palette.text)
        axis.setStyle(tickFont=self._font, tickLength=4, autoExpandTextSpace=False)
        if axis is self.time:
            axis.setLabel("time before now, s", color=palette.dim)
