"""The strip chart: its image, live or frozen, and its axes; knows samples, not the application."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QEvent, QPointF, QRectF, Qt, Signal
from PySide6.QtGui import QColor, QFont, QFontMetricsF, QPainter, QPen
from PySide6.QtWidgets import (
    QGraphicsItem,
    QGraphicsSceneWheelEvent,
    QStyleOptionGraphicsItem,
    QWidget,
)

from cosmic.daqco.core.chunk import DataChunk, Values
from cosmic.daqco.core.scale import Scale
from cosmic.daqco.gui.colours import readable
from cosmic.daqco.gui.plot.columns import Columns, LiveColumns, column_of
from cosmic.daqco.gui.plot.history import History, HistoryView
from cosmic.daqco.gui.plot.raster import Look, Raster
from cosmic.daqco.gui.plot.units import AxisRange, display_unit
from cosmic.frame.gui.palette import blend
from cosmic.frame.gui.theme import current_palette, number_font
from cosmic.frame.overrides import override

logger = logging.getLogger(__name__)


class StripChartItem(pg.GraphicsObject):  # type: ignore[misc]
    """Lies over a view box, in its pixels; paints two pieces of an image and thin upright lines.

    The newest column is at the right edge. Measured (32 channels, 15 kHz): a refresh takes
    1-2 ms, where curves of pyqtgraph take 26 ms at best.
    """

    def __init__(self, raster: Raster, view_box: pg.ViewBox) -> None:
        super().__init__()
        self.raster = raster
        self.paints = 0
        """How often it was painted, for benchmarks."""
        self._size = (0.0, 0.0)
        self._uprights: tuple[float, ...] = ()
        self._failed = False
        self.setParentItem(view_box)
        self.setZValue(-50)
        self.setFlag(QGraphicsItem.GraphicsItemFlag.ItemHasNoContents, False)
        self.setAcceptedMouseButtons(Qt.MouseButton.NoButton)

    def set_size(self, width: float, height: float) -> None:
        """Cover that many pixels of the view."""
        self.prepareGeometryChange()
        self._size = (width, height)

    def set_uprights(self, shares: tuple[float, ...]) -> None:
        """Draw upright lines at these parts of the width, 0 to 1."""
        self._uprights = shares
        self.update()

    @override
    def boundingRect(self) -> QRectF:
        return QRectF(0.0, 0.0, *self._size)

    @override
    def paint(
        self,
        painter: QPainter,
        option: QStyleOptionGraphicsItem,
        widget: QWidget | None = None,
    ) -> None:
        # An exception that leaves paint() can end the process, and would come at every frame.
        try:
            self._paint(painter)
        except Exception:
            if not self._failed:
                logger.exception("the strip chart cannot be painted")
            self._failed = True

    def _paint(self, painter: QPainter) -> None:
        self.paints += 1
        raster = self.raster
        width, height = self._size
        per_px = width / raster.width
        oldest = (raster.head + 1) % raster.width
        old_part = raster.width - oldest
        full = float(raster.height)
        painter.drawImage(
            QRectF(0.0, 0.0, old_part * per_px, height),
            raster.image,
            QRectF(oldest, 0.0, old_part, full),
        )
        if oldest:
            painter.drawImage(
                QRectF(old_part * per_px, 0.0, oldest * per_px, height),
                raster.image,
                QRectF(0.0, 0.0, oldest, full),
            )
        colour = QColor(raster.look.line)
        painter.setPen(QPen(colour, 1.0))
        for share in self._uprights:
            x = round(share * (width - 1.0)) + 0.5
            painter.drawLine(pg.Point(x, 0.0), pg.Point(x, height))


ZOOM_A_NOTCH: Final = 0.8
_NOTCH: Final = 120.0


class TimeBox(pg.ViewBox):  # type: ignore[misc]
    """Tells what the mouse asks for, and leaves it to the chart to do it.

    Places are parts of the image, 0 to 1, from the left and from the bottom.
    """

    time_zoom_requested = Signal(float, float)
    """Factor of the new width to the old, and the place that stays."""
    value_zoom_requested = Signal(float, float)
    time_pan_requested = Signal(float)
    """How far the image is pulled to the right."""
    live_requested = Signal()

    def __init__(self) -> None:
        super().__init__(enableMenu=False, enableMouse=False, defaultPadding=0.0)
        self.disableAutoRange()
        self.setYRange(0.0, 1.0, padding=0.0)

    def _place(self, point: QPointF) -> tuple[float, float]:
        width, height = max(1.0, self.width()), max(1.0, self.height())
        return point.x() / width, 1.0 - point.y() / height

    @override
    def wheelEvent(self, ev: QGraphicsSceneWheelEvent, axis: int | None = None) -> None:
        x, y = self._place(ev.pos())
        factor = ZOOM_A_NOTCH ** (ev.delta() / _NOTCH)
        if ev.modifiers() & Qt.KeyboardModifier.ControlModifier:
            self.value_zoom_requested.emit(factor, y)
        else:
            self.time_zoom_requested.emit(factor, x)
        ev.accept()

    @override
    def mouseDragEvent(self, ev: object, axis: int | None = None) -> None:
        event: pg.GraphicsScene.mouseEvents.MouseDragEvent = ev
        if event.button() != Qt.MouseButton.LeftButton:
            event.ignore()
            return
        event.accept()
        before, now = self.mapFromScene(event.lastScenePos()), self.mapFromScene(event.scenePos())
        self.time_pan_requested.emit(self._place(now)[0] - self._place(before)[0])

    @override
    def mouseDoubleClickEvent(self, event: object) -> None:
        self.live_requested.emit()


AXIS_PX: Final = 60
_BELOW_PX: Final = 36
_MOST: Final = 20
_GAP_PX: Final = 4
_COARSER: Final = (1.0, 2.0, 4.0, 5.0, 10.0)
"""So much further apart may numbers stand than asked for, where the chart is low."""


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
        self._shown: dict[str, AxisRange] = {}
        self._names: list[pg.LabelItem] = []
        layout.addItem(box, row=1, col=_MOST)
        layout.addItem(self.time, row=2, col=_MOST)
        # Apart, so that painting the strip does not touch, and so paint, the axes.
        layout.layout.setSpacing(_GAP_PX)
        layout.layout.setContentsMargins(4, 2, 12, 2)
        self._style(self.time)
        box.sigResized.connect(self._space)

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
        self._shown = dict(ranges)
        self._space()

    def _space(self, *_: object) -> None:
        """Set the numbers apart as far as asked for, or further, so that none touches the next."""
        line_px = QFontMetricsF(self._font).height()
        for unit, shown in self._shown.items():
            step_px = self._box.height() * shown.step / (shown.high - shown.low)
            fitting = [each for each in _COARSER if each * step_px >= line_px]
            step = shown.step * (fitting[0] if fitting else _COARSER[-1])
            self._values[unit].setTickSpacing(levels=[(step, 0.0)])

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
        self._shown = {}
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


HISTORY_S: Final = 60.0
FEWEST_SAMPLES: Final = 10.0


@dataclass(frozen=True, slots=True)
class Trace:
    """One channel as it is drawn."""

    name: str
    unit: str
    colour: str
    shown: bool = True


@dataclass(frozen=True, eq=False)
class Frozen:
    """What a chart shows while it does not follow; times in s before the last sample held."""

    view: HistoryView
    begin_s: float
    end_s: float


class Chart(pg.GraphicsView):  # type: ignore[misc]
    """Draws channels over time; new samples cost new columns only. GUI thread.

    Signals
    -------
    frozen_changed(bool)
        It stopped following, or follows again.
    time_changed()
        Another stretch of time is shown.
    value_zoom_requested(float, float)
        The wheel was turned with Ctrl held: factor, and the height that stays (0 to 1).
    """

    frozen_changed = Signal(bool)
    time_changed = Signal()
    value_zoom_requested = Signal(float, float)

    def __init__(self) -> None:
        super().__init__()
        self.rate_hz, self.span_s = 1000.0, 10.0
        self._traces: tuple[Trace, ...] = ()
        self._ranges: dict[str, AxisRange] = {}
        self._history = History(0, self.rate_hz, HISTORY_S)
        self._frozen: Frozen | None = None
        self._live = LiveColumns(1.0)
        self.raster = Raster(self._look())
        layout = pg.GraphicsLayout()
        self.setCentralItem(layout)
        self.box = TimeBox()
        self.axes = Axes(layout, self.box)
        self.strip = StripChartItem(self.raster, self.box)
        self.box.sigResized.connect(self._on_resized)
        self.box.time_zoom_requested.connect(self.zoom_time)
        self.box.time_pan_requested.connect(self.pan_time)
        self.box.value_zoom_requested.connect(self.value_zoom_requested)
        self.box.live_requested.connect(self.follow)
        self._restyle()

    # What is drawn

    @property
    def frozen(self) -> bool:
        """True while it does not follow the newest sample."""
        return self._frozen is not None

    @property
    def traces(self) -> tuple[Trace, ...]:
        """The channels, in the order of the chunks."""
        return self._traces

    def begin(self, traces: Sequence[Trace], rate_hz: float) -> None:
        """Draw these channels from now on, with an empty history."""
        self._traces, self.rate_hz = tuple(traces), rate_hz
        self._history = History(len(traces), rate_hz, HISTORY_S)
        self._apply_look()
        self.follow()
        self.rebuild()

    def set_traces(self, traces: Sequence[Trace]) -> None:
        """Change colours or what is shown of the same channels."""
        self._traces = tuple(traces)
        self._apply_look()

    def set_ranges(self, ranges: dict[str, AxisRange]) -> None:
        """Show one axis for each of these units; the first has the lines across."""
        self._ranges = dict(ranges)
        self.axes.show(ranges)
        self._apply_look()

    def set_span(self, span_s: float) -> None:
        """Follow with that much time in the image."""
        self.span_s = span_s
        self._frozen = None
        self.frozen_changed.emit(False)
        self.rebuild()

    def clear(self) -> None:
        """Forget the history."""
        self._history.clear()
        self.follow()
        self.rebuild()

    # Samples

    def feed(self, chunks: Sequence[DataChunk]) -> None:
        """Add samples; while frozen they only go into the history."""
        for first_sample, values in _joined(chunks):
            if first_sample < self._history.end:  # acquisition began anew
                self._history.clear()
                self.rebuild()
            self._history.append(first_sample, values)
            if self._frozen is not None:
                continue
            found = self._live.feed(first_sample, values)
            if found is not None:
                self.raster.put(*found)
                self.strip.update()

    def now_view(self) -> HistoryView:
        """Return what is held: frozen, as it was then."""
        return self._frozen.view if self._frozen is not None else self._history.view()

    # Time

    def window_s(self) -> tuple[float, float]:
        """Return begin and end of what is shown, s after the last sample held (so below 0)."""
        if self._frozen is not None:
            return self._frozen.begin_s, self._frozen.end_s
        return -self.span_s, 0.0

    def freeze(self) -> None:
        """Stop following; what is shown stays, and samples still come into the history."""
        if self._frozen is None:
            self._frozen = Frozen(self._history.view(), *self.window_s())
            self.time_changed.emit()
            self.frozen_changed.emit(True)

    def follow(self) -> None:
        """Show the newest samples again."""
        if self._frozen is not None:
            self._frozen = None
            self.rebuild()
            self.frozen_changed.emit(False)

    def show_time(self, begin_s: float, end_s: float) -> None:
        """Show a stretch of the history, as far as there is one."""
        self.freeze()
        frozen = self._frozen
        if frozen is None or not self._traces:
            return
        held_s = max((frozen.view.end - frozen.view.first) / self.rate_hz, self.span_s)
        width = min(max(end_s - begin_s, FEWEST_SAMPLES / self.rate_hz), held_s)
        end = min(0.0, max(end_s, -held_s + width))
        self._frozen = Frozen(frozen.view, end - width, end)
        self.rebuild()

    def zoom_time(self, factor: float, share: float) -> None:
        """Show `factor` as much time; the place `share` (0 left, 1 right) stays."""
        begin, end = self.window_s()
        fixed, width = begin + share * (end - begin), (end - begin) * factor
        self.show_time(fixed - share * width, fixed + (1.0 - share) * width)

    def pan_time(self, share: float) -> None:
        """Pull the image to the right by a part of its width."""
        begin, end = self.window_s()
        self.show_time(begin - share * (end - begin), end - share * (end - begin))

    # Painting

    def rebuild(self) -> None:
        """Paint the whole image from the history."""
        begin_s, end_s = self.window_s()
        self.box.setXRange(begin_s, end_s, padding=0.0)
        raster, view = self.raster, self.now_view()
        per_column = (end_s - begin_s) * self.rate_hz / raster.width
        self._live = LiveColumns(per_column)
        last = view.end - 1 + round(end_s * self.rate_hz)
        if view.end > 0:
            newest = column_of(last, per_column) - (1 if per_column < 1.0 else 0)
            first = newest - raster.width + 1
            raster.show(first, view.columns(first, raster.width, per_column))
            if self._frozen is None:
                self._live.prime(*view.samples(view.end - 1, view.end))
        else:
            raster.clear()
        self.strip.set_uprights(self.axes.time_shares())
        self.time_changed.emit()

    def visible_columns(self) -> Columns:
        """Return the extremes of what is in the image, in any order."""
        return self.raster.ring

    def _look(self) -> Look:
        palette = current_palette()
        ranges = [self._ranges.get(each.unit, AxisRange(-10.0, 10.0, 5.0)) for each in self._traces]
        first = next(iter(self._ranges.values()), None)
        return Look(
            colours=tuple(readable(each.colour) for each in self._traces),
            shown=np.array([each.shown for each in self._traces], dtype=np.bool_),
            low=np.array([each.low for each in ranges]),
            high=np.array([each.high for each in ranges]),
            grid=tuple(first.share(value) for value in first.lines()) if first else (),
            ground=palette.field,
            line=blend(palette.border_strong, palette.field, 0.45),
        )

    def _apply_look(self) -> None:
        self.raster.set_look(self._look())
        self.strip.update()

    def _on_resized(self) -> None:
        ratio = self.devicePixelRatioF()
        width, height = self.box.width(), self.box.height()
        self.strip.set_size(width, height)
        self.raster.resize(round(width * ratio), round(height * ratio))
        self.rebuild()

    def _restyle(self) -> None:
        self.setBackground(current_palette().panel)
        self.axes.restyle()
        self._apply_look()

    @override
    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "axes"):
            self._restyle()
            self.raster.set_look(self._look())


def _joined(chunks: Sequence[DataChunk]) -> list[tuple[int, Values]]:
    """Return physical values of chunks, those without a gap between them in one piece."""
    pieces: list[list[DataChunk]] = []
    for chunk in chunks:
        if pieces and chunk.first_sample == pieces[-1][-1].first_sample + pieces[-1][-1].samples:
            pieces[-1].append(chunk)
        else:
            pieces.append([chunk])
    return [
        (
            piece[0].first_sample,
            _scaled(np.concatenate([each.volts for each in piece], axis=1), piece[0].scales),
        )
        for piece in pieces
    ]


def _scaled(volts: Values, scales: Sequence[Scale]) -> Values:
    """Return physical values; rows of one scale in one go, which `DataChunk.values` cannot."""
    rows: dict[Scale, list[int]] = {}
    for row, scale in enumerate(scales):
        rows.setdefault(scale, []).append(row)
    if len(rows) == 1:
        return scales[0].apply(volts)
    for scale, same in rows.items():
        volts[same] = scale.apply(volts[same])
    return volts
