"""Force over push of the spans of one fibre, measured and fitted."""

from collections.abc import Sequence
from typing import Final

import numpy as np
import pyqtgraph as pg
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QWidget

from cosmic.app.curve_frame import CurveFrame
from cosmic.autonomy.campaign.board import CardCurve, Mask
from cosmic.frame.gui.palette import OKABE_ITO, Palette
from cosmic.frame.gui.theme import STEP_PX, current_palette, number_font
from cosmic.frame.overrides import override

_OUT: Final = OKABE_ITO["sky blue"]
_BACK: Final = OKABE_ITO["orange"]
_POINT_PX: Final = 6
_AXIS_PX: Final = 52


class FibreCurves(CurveFrame):
    """Draws `CardCurve`s: full points out, hollow ones back, lines for the model; GUI thread."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(_AXIS_PX, parent)
        self.box, _ = self._add_field("force, µN")
        self._add_axis_below("push beyond the first contact, µm")
        self.setMinimumSize(36 * STEP_PX, 28 * STEP_PX)
        self.setToolTip(
            "Force over push beyond the first contact: full points on the way out, hollow ones on "
            "the way back, lines as the model has it; each by its place along the fibre"
        )
        self._curves: tuple[CardCurve, ...] = ()
        self.labels: list[pg.TextItem] = []
        self._restyle()

    def show_curves(self, curves: Sequence[CardCurve]) -> None:
        """Draw the spans of a fibre."""
        self._curves = tuple(curves)
        self._draw()

    def _draw(self) -> None:
        for item in list(self.box.addedItems):
            self.box.removeItem(item)
        self.labels = []
        palette = current_palette()
        for curve in self._curves:
            back = ~curve.loading
            for branch in (curve.loading, back):
                fitted = branch & np.isfinite(curve.fitted_un)
                order = np.argsort(curve.way_um[fitted])
                line = pg.PlotCurveItem(curve.way_um[fitted][order], curve.fitted_un[fitted][order])
                line.setPen(pg.mkPen(palette.dim, width=1))
                self.box.addItem(line)
            self.box.addItem(_points(curve, back, _BACK, hollow=True))
            self.box.addItem(_points(curve, curve.loading, _OUT, hollow=False))
            self._label(curve, palette.text)
        if self._curves:
            self.box.autoRange(padding=0.12)

    def _label(self, curve: CardCurve, colour: str) -> None:
        last = int(np.argmax(curve.way_um))
        text = f"{curve.place_um:.0f} µm" + ("" if curve.used else ", not used")
        label = pg.TextItem(text, color=colour, anchor=(1.0, 1.0))
        label.setFont(number_font(11))
        label.setPos(float(curve.way_um[last]), float(curve.force_un[last]))
        self.labels.append(label)
        self.box.addItem(label, ignoreBounds=True)

    @override
    def _colour(self, palette: Palette) -> None:
        self._draw()


def _points(curve: CardCurve, which: Mask, colour: str, *, hollow: bool) -> pg.ScatterPlotItem:
    return pg.ScatterPlotItem(
        curve.way_um[which],
        curve.force_un[which],
        size=_POINT_PX,
        pen=pg.mkPen(colour, width=1.2) if hollow else pg.mkPen(None),
        brush=None if hollow else QColor(colour),
    )
