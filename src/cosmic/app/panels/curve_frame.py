"""What the curves of the window share: fields with axes, in the colours of the theme."""

from abc import abstractmethod

import pyqtgraph as pg
from PySide6.QtCore import QEvent
from PySide6.QtGui import QFont, QFontMetricsF, QResizeEvent
from PySide6.QtWidgets import QVBoxLayout, QWidget

from cosmic.frame.gui.palette import Palette
from cosmic.frame.gui.theme import current_palette, number_font
from cosmic.frame.overrides import override

_GAP_PX = 2
_AROUND_PX = 8
_ROOMY = 14.0
"""Heights of a figure from which on fields stand apart; lower ones need that room themselves."""


def _tick_font() -> QFont:
    return number_font(11)


class CurveFrame(QWidget):
    """Fields one above another, each with its axis, and one axis below them; GUI thread.

    A subclass adds its fields and what it draws in them, then calls `_restyle`.

    Parameters
    ----------
    axis_px : int
        How wide the axes at the left are, so that the fields stand below one another.
    """

    _complete = False

    def __init__(self, axis_px: int, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._axis_px = axis_px
        self._boxes: list[pg.ViewBox] = []
        self._beside: list[pg.AxisItem] = []
        self._names: dict[pg.AxisItem, str] = {}
        self._view = pg.GraphicsView()
        self._layout = pg.GraphicsLayout()
        self._view.setCentralItem(self._layout)
        self._layout.layout.setSpacing(_GAP_PX)
        self._layout.layout.setContentsMargins(2, 4, 8, 2)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self._view)

    def _add_field(self, name: str, share: int = 1) -> tuple[pg.ViewBox, pg.AxisItem]:
        """Add a field below the others, so high for its share; no menus, which would be windows."""
        row = len(self._boxes)
        box = pg.ViewBox(enableMenu=False, enableMouse=False)
        self._boxes.append(box)
        box.sigResized.connect(self._on_field_resized)
        axis = self._axis("left", name, box)
        axis.setWidth(self._axis_px)
        self._beside.append(axis)
        self._layout.addItem(axis, row=row, col=0)
        self._layout.addItem(box, row=row, col=1)
        self._layout.layout.setRowStretchFactor(row, share)
        return box, axis

    def _add_axis_below(self, name: str) -> pg.AxisItem:
        """Add the axis below the fields; it goes with the last of them."""
        axis = self._axis("bottom", name, self._boxes[-1])
        self._layout.addItem(axis, row=len(self._boxes), col=1)
        return axis

    def _axis(self, side: str, name: str, box: pg.ViewBox) -> pg.AxisItem:
        axis = pg.AxisItem(side)
        axis.enableAutoSIPrefix(False)
        axis.linkToView(box)
        self._names[axis] = name
        return axis

    def _restyle(self) -> None:
        """Take over the theme in force, and the names of the axes."""
        self._complete = True
        palette = current_palette()
        self._view.setBackground(palette.panel)
        for box in self._boxes:
            box.setBackgroundColor(palette.field)
        for axis, name in self._names.items():
            axis.setPen(palette.border_strong)
            axis.setTextPen(palette.text)
            axis.setStyle(tickFont=_tick_font(), tickLength=4)
            axis.setLabel(name, color=palette.dim)
        self._fit_names()
        self._colour(palette)

    def _on_field_resized(self, _box: object) -> None:
        if self._complete:
            self._fit_names()

    def _fit_names(self) -> None:
        """Shorten names that are longer than their field is high: to the unit, or to nothing."""
        for box, axis in zip(self._boxes, self._beside, strict=True):
            name = self._names[axis]
            metrics = QFontMetricsF(axis.label.font())
            fitting = (
                each
                for each in (name, name.rpartition(", ")[2])
                if metrics.horizontalAdvance(each) + _AROUND_PX <= box.height()
            )
            text = next(fitting, "")
            axis.setToolTip(name)
            if text != axis.labelText:
                axis.setLabel(text, color=current_palette().dim)

    def _keep_figures_apart(self) -> None:
        """Leave room for the figures at the ends of two fields, which lie half outside them."""
        figure_px = QFontMetricsF(_tick_font()).height()
        gap_px = figure_px if self.height() >= _ROOMY * figure_px else _GAP_PX
        for row in range(len(self._boxes) - 1):
            self._layout.layout.setRowSpacing(row, gap_px)

    @abstractmethod
    def _colour(self, palette: Palette) -> None:
        """Give what is drawn in the fields its colours."""

    @override
    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._keep_figures_apart()

    @override
    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and self._complete:
            self._restyle()
