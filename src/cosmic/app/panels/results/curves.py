"""Curves of a recording over time or over a position, with two cursors and the moment shown."""

from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Final

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QPointF, Qt, Signal
from PySide6.QtGui import QColor, QMouseEvent
from PySide6.QtWidgets import QGraphicsTextItem

from cosmic.app.panels.curve_frame import CurveFrame
from cosmic.app.results.timeline import Mark, Timeline, Track, Values
from cosmic.daqco.core.curves import Slope, fit_slope
from cosmic.daqco.gui.colours import readable
from cosmic.daqco.gui.plot.units import display_unit
from cosmic.frame.errors import RecordingError
from cosmic.frame.gui.palette import OKABE_ITO, Palette
from cosmic.frame.gui.theme import number_font
from cosmic.frame.overrides import override

AXIS_PX: Final = 56
MOST_POINTS: Final = 4000
MOST_AXES: Final = 6
_BETWEEN: Final = 40
"""Opacity of what fills the field between the cursors, of 255."""
_COLOURS: Final = ("orange", "sky blue", "bluish green", "reddish purple", "yellow", "vermillion")
TIME: Final = "time"
Line = tuple[str, str, Values, Values]
"""Name of the recording, colour, where and what."""


class ResultCurves(CurveFrame):
    """Force above, positions below, or force over one position; GUI thread.

    Over a position only that part is drawn which lay between the cursors when time was left.

    Signals
    -------
    moved()
        A cursor was moved.
    time_chosen(float)
        A click in the field, or the line of the moment shown was dragged: seconds after the start.
    """

    moved = Signal()
    time_chosen = Signal(float)

    def __init__(self) -> None:
        super().__init__(AXIS_PX)
        self._upper, self._left = self._add_field("", share=3)
        self._lower, self._places = self._add_field("moved, µm", share=2)
        self._below = self._add_axis_below("time, s")
        self._lower.setXLink(self._upper)
        self._curves: list[tuple[pg.PlotCurveItem, str]] = []
        self._flags: list[pg.InfiniteLine] = []
        self._lines: list[Line] = []
        self._moved: list[tuple[str, str]] = []
        self._keys = tuple(_key_in(box) for box in (self._upper, self._lower))
        self.cursors = pg.LinearRegionItem(movable=True)
        self.cursors.sigRegionChanged.connect(self.moved)
        self._nows = [pg.InfiniteLine(angle=90, movable=True) for _ in range(2)]
        self._dot = pg.ScatterPlotItem(size=10)
        self._upper.addItem(self.cursors)
        self._upper.addItem(self._dot, ignoreBounds=True)
        for box, line in zip((self._upper, self._lower), self._nows, strict=True):
            line.sigDragged.connect(self._on_dragged)
            box.addItem(line, ignoreBounds=True)
            box.setMouseEnabled(x=False, y=False)
        self._unit, self._across, self._unit_across = "", TIME, "s"
        self._part_s: tuple[float, float] | None = None
        self._path: Path | None = None
        self.cursors.hide()
        self._restyle()
        self._view.viewport().installEventFilter(self)

    # What is drawn

    @property
    def across(self) -> str:
        """What lies along the horizontal axis: "time", or the name of an axis."""
        return self._across

    @property
    def lines(self) -> tuple[Line, ...]:
        """The curves of the force: the first is that of the recording, others are compared."""
        return tuple(self._lines)

    def show_timelines(
        self, timelines: Sequence[Timeline], channel: str, across: str, *, keep: bool = False
    ) -> None:
        """Draw the channel of recordings, each from its own start, and the axes of the first.

        Parameters
        ----------
        across : str
            "time", or the name of an axis.
        keep : bool
            Leave the cursors and the part shown where they are.
        """
        for curve, _ in self._curves:
            (curve.getViewBox() or self._upper).removeItem(curve)
        for flag in self._flags:
            self._upper.removeItem(flag)
        self._curves, self._flags, self._lines = [], [], []
        moved_to_another = across != self._across
        self._choose_part(timelines[0].path if timelines else None, across)
        self._across = across
        for number, each in enumerate(timelines):
            self._add_force(each, channel, _COLOURS[number % len(_COLOURS)])
        self._show_lower(timelines[0] if timelines and across == TIME else None)
        first = timelines[0] if timelines else None
        if first is not None and across == TIME:
            self._add_flags(first.marks, first.start_s)
        self._name_axes(first, channel)
        if not keep or moved_to_another or not self.cursors.isVisible():
            self._place_cursors()
            self.show_all()
        self._restyle()

    @property
    def part_s(self) -> tuple[float, float] | None:
        """Of which time force is drawn over a position, after the start; None: all of it."""
        return self._part_s

    def _choose_part(self, path: Path | None, across: str) -> None:
        """Keep what the cursors chose over time; another recording is drawn as a whole."""
        if path != self._path:
            self._path, self._part_s = path, None
        elif self._across == TIME != across and self.cursors.isVisible():
            self._part_s = self.region

    def _add_force(self, timeline: Timeline, channel: str, colour: str) -> None:
        track = next((each for each in timeline.forces if each.name == channel), None)
        if track is None:
            return
        if self._across == TIME:
            where, what = track.time_s - timeline.start_s, track.values
            drawn = _thinned(where, track)
        else:
            axis = next((e for e in timeline.positions if e.name == self._across), None)
            if axis is None or not axis.time_s.size:
                return
            where = np.interp(track.time_s, axis.time_s, axis.values, left=np.nan, right=np.nan)
            what = track.values
            known = np.isfinite(where)
            if self._part_s is not None:
                after_s = track.time_s - timeline.start_s
                known &= (self._part_s[0] <= after_s) & (after_s <= self._part_s[1])
            where, what = where[known], what[known]
            step = max(1, where.size // MOST_POINTS)
            drawn = where[::step], what[::step]
        self._lines.append((timeline.path.stem, colour, where, what))
        self._draw(self._upper, colour, *drawn)

    def _show_lower(self, timeline: Timeline | None) -> None:
        """Draw how far the axes moved from where they were, each in its colour."""
        moved = timeline.moved[:MOST_AXES] if timeline is not None else ()
        self._moved = []
        for number, each in enumerate(moved):
            if timeline is None:
                break
            first = each.values[np.isfinite(each.values)][0]
            step = max(1, each.values.size // MOST_POINTS)
            colour = _COLOURS[(number + 1) % len(_COLOURS)]
            self._moved.append((each.name, colour))
            times = (each.time_s - timeline.start_s)[::step]
            self._draw(self._lower, colour, times, (each.values - first)[::step])
        shown = bool(moved)
        self._lower.setVisible(shown)
        self._places.setVisible(shown)
        self._layout.layout.setRowStretchFactor(1, 2 if shown else 0)
        self._layout.layout.setRowMaximumHeight(1, 10_000.0 if shown else 0.0)
        words = ", ".join(each.name for each in moved)
        words = words if len(words) < 22 else f"{len(moved)} axes"
        units = dict.fromkeys(display_unit(each.unit) for each in moved)
        self._names[self._places] = ", ".join((words, *units))

    def _draw(self, box: pg.ViewBox, colour: str, where: Values, what: Values) -> None:
        curve = pg.PlotCurveItem(where, what, connect="finite")
        box.addItem(curve)
        self._curves.append((curve, colour))

    def _add_flags(self, marks: Sequence[Mark], start_s: float) -> None:
        for each in marks:
            flag = pg.InfiniteLine(each.time_s - start_s, angle=90, movable=False)
            self._upper.addItem(flag)
            self._flags.append(flag)

    def _name_axes(self, timeline: Timeline | None, channel: str) -> None:
        if timeline is None:
            return
        unit = next((each.unit for each in timeline.forces if each.name == channel), "")
        self._unit = display_unit(unit)
        self._names[self._left] = f"{channel}, {self._unit}" if channel else ""
        axis = next((each for each in timeline.positions if each.name == self._across), None)
        self._unit_across = display_unit(axis.unit) if axis is not None else "s"
        named = f"{axis.name if axis is not None else 'time'}, {self._unit_across}"
        if axis is not None and self._part_s is not None:
            named += f", from {self._part_s[0]:.2f} s to {self._part_s[1]:.2f} s"
        self._names[self._below] = named

    def _place_cursors(self) -> None:
        """Put the cursors where they were over time, around a part, or at the thirds."""
        whole = self._extent()
        self.cursors.setVisible(whole is not None)
        if whole is not None and self._part_s is not None:
            self.cursors.setRegion(self._part_s if self._across == TIME else whole)
        elif whole is not None:
            third = (whole[1] - whole[0]) / 3.0
            self.cursors.setRegion((whole[0] + third, whole[1] - third))

    def _extent(self) -> tuple[float, float] | None:
        known = [where for _, _, where, what in self._lines if where.size > 1]
        if not known:
            return None
        return min(float(w.min()) for w in known), max(float(w.max()) for w in known)

    def show_all(self) -> None:
        """Show everything: the longest of the recordings, where forces are drawn."""
        forces = bool(self._lines)
        # What is linked pulls both ways: the axes of the first would cut off a longer one.
        self._upper.enableAutoRange(x=forces, y=True)
        self._lower.enableAutoRange(x=not forces, y=True)
        for box in (self._upper, self._lower):
            box.updateAutoRange()

    def zoom_to_cursors(self) -> None:
        """Show what lies between the cursors."""
        low, high = self.region
        if high > low:
            self._upper.setXRange(low, high, padding=0.05)

    # Cursors and the moment shown

    @property
    def region(self) -> tuple[float, float]:
        """Where the two cursors are, in seconds after the start or positions."""
        low, high = self.cursors.getRegion()
        return float(low), float(high)

    def between(self, number: int = 0) -> tuple[Values, Values]:
        """Return where and what of a curve lies between the cursors."""
        if number >= len(self._lines):
            return np.empty(0), np.empty(0)
        _, _, where, what = self._lines[number]
        low, high = self.region
        chosen = (low <= where) & (where <= high)
        return where[chosen], what[chosen]

    def slope(self, number: int = 0) -> Slope | None:
        """Return the line through what lies between the cursors; None: too little does."""
        try:
            return fit_slope(*self.between(number), f"{self._unit}/{self._unit_across}")
        except RecordingError:
            return None

    @property
    def unit(self) -> str:
        """Of the force, as the operator reads it."""
        return self._unit

    @property
    def unit_across(self) -> str:
        """Of what lies along the horizontal axis, as the operator reads it."""
        return self._unit_across

    def show_moment(self, after_s: float, point: tuple[float, float] | None) -> None:
        """Show which moment the rest of the viewer shows; `point` lies on the first curve."""
        over_time = self._across == TIME
        for line in self._nows:
            line.setVisible(over_time)
            line.setValue(after_s)
        self._dot.setData(*([[point[0]], [point[1]]] if point is not None else [[], []]))

    def _on_dragged(self, line: pg.InfiniteLine) -> None:
        self.time_chosen.emit(float(line.value()))

    @override
    def eventFilter(self, watched: object, event: object) -> bool:
        """Show the moment of a click beside the cursors; a drag belongs to what is dragged."""
        if (
            isinstance(event, QMouseEvent)
            and event.type() == QMouseEvent.Type.MouseButtonDblClick
            and event.button() == Qt.MouseButton.LeftButton
            and self._across == TIME
        ):
            there = self._upper.mapSceneToView(self._view.mapToScene(event.position().toPoint()))
            if isinstance(there, QPointF):
                self.time_chosen.emit(float(there.x()))
                return True
        return False

    @override
    def _colour(self, palette: Palette) -> None:
        for curve, colour in self._curves:
            curve.setPen(pg.mkPen(readable(OKABE_ITO[colour]), width=1.2))
        for flag in self._flags:
            flag.setPen(pg.mkPen(palette.dim, width=1, style=Qt.PenStyle.DotLine))
        for line in self._nows:
            line.setPen(pg.mkPen(palette.text, width=1.5))
            line.setHoverPen(pg.mkPen(palette.accent, width=2.5))
        self._dot.setBrush(palette.text)
        between = QColor(palette.accent)
        between.setAlpha(_BETWEEN)
        self.cursors.setBrush(between)
        for line in self.cursors.lines:
            line.setPen(pg.mkPen(palette.accent, width=1.5))
            line.setHoverPen(pg.mkPen(palette.text, width=2.5))
        self._name_curves(palette.field)

    def _name_curves(self, ground: str) -> None:
        """Write into each field which curve is which, where that is not said beside it."""
        forces = [(name, colour) for name, colour, _, _ in self._lines]
        named = (forces if len(forces) > 1 else [], self._moved)
        for key, entries in zip(self._keys, named, strict=True):
            words = (
                f'<span style="color:{readable(OKABE_ITO[colour])};background-color:{ground}">'
                f"&nbsp;{escape(name)}&nbsp;</span>"
                for name, colour in entries
            )
            key.setHtml("".join(words))


def _key_in(box: pg.ViewBox) -> QGraphicsTextItem:
    key = QGraphicsTextItem(box)
    key.setFont(number_font(11))
    key.setZValue(1.0)
    return key


def _thinned(where: Values, track: Track) -> tuple[Values, Values]:
    """Return a curve that shows the extremes of every piece, and no more points than are seen."""
    if where.size <= MOST_POINTS:
        return where, track.values
    piece = -(-where.size // (MOST_POINTS // 2))
    starts = np.arange(0, where.size, piece)
    both = np.empty(2 * starts.size)
    both[0::2] = np.minimum.reduceat(track.low, starts)
    both[1::2] = np.maximum.reduceat(track.high, starts)
    return np.repeat(where[starts], 2), both
