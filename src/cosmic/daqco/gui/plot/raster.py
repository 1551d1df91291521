"""Columns of extremes, painted once each into a ring of pixels."""

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from pyqtgraph.Qt.internals import PrimitiveArray
from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QColor, QImage, QPainter

from cosmic.daqco.gui.plot.columns import Block, Columns
from cosmic.frame.gui.painting import painting
from cosmic.frame.gui.palette import DARK

Flags = npt.NDArray[np.bool_]
Reals = npt.NDArray[np.float64]
ColumnIndices = npt.NDArray[np.int64]

OFF_PX: Final = 4.0


@dataclass(frozen=True, eq=False)
class Look:
    """How channels are painted.

    Attributes
    ----------
    colours : tuple of str
        One a channel, "#RRGGBB".
    shown : ndarray, shape (channels,), bool
    low, high : ndarray, shape (channels,), float64
        Value at the bottom and at the top of the image.
    grid : tuple of float
        Heights of the horizontal lines, 0 (bottom) to 1.
    ground, line : str
        Colours of background and grid.
    """

    colours: tuple[str, ...]
    shown: Flags
    low: Reals
    high: Reals
    grid: tuple[float, ...] = ()
    ground: str = DARK.field
    line: str = DARK.border


class Raster:
    """An image of the newest `width` columns; only new columns are painted.

    Column numbers count on without end; column `n` lies at pixel ``n % width``.
    """

    def __init__(self, look: Look, width: int = 1, height: int = 1) -> None:
        self.look = look
        self.head = -1
        self.painted = 0
        """Columns painted so far, for tests and benchmarks."""
        self._rects = PrimitiveArray(QRectF, 4)
        self.resize(width, height)

    def resize(self, width: int, height: int) -> None:
        """Make the image anew, without columns."""
        self.width, self.height = max(1, width), max(1, height)
        self.image = QImage(self.width, self.height, QImage.Format.Format_RGB32)
        self.clear()

    def clear(self) -> None:
        """Forget all columns."""
        self.ring = Columns.empty(len(self.look.colours), self.width)
        self.head = -1
        self.image.fill(QColor(self.look.ground))
        self._paint_grid()

    def set_look(self, look: Look) -> None:
        """Paint all that is there anew, in another way."""
        if len(look.colours) != len(self.look.colours):
            self.look = look
            self.clear()
            return
        self.look = look
        self._paint_grid()  # what has no columns yet has the other look, too
        self._paint(max(0, self.head - self.width + 1), self.head)

    def show(self, first: int, columns: Columns) -> None:
        """Show these columns instead of all there were."""
        self.clear()
        self.put(first, columns)

    def put(self, first: int, columns: Columns) -> None:
        """Add columns; those that are there already are widened, as one under way is."""
        count = columns.low.shape[1]
        skip = max(0, count - self.width, self.head - self.width + 1 - first)
        if skip >= count:
            return
        begin, last = first + skip, first + count - 1
        dirty = min(begin, self._make_room(last))
        at = np.arange(begin, last + 1) % self.width
        ring = self.ring
        ring.low[:, at] = np.fmin(ring.low[:, at], columns.low[:, skip:])
        ring.high[:, at] = np.fmax(ring.high[:, at], columns.high[:, skip:])
        self._paint(dirty, last)

    def column(self, number: int) -> tuple[Block, Block]:
        """Return the extremes of a column, one a channel."""
        at = number % self.width
        return self.ring.low[:, at], self.ring.high[:, at]

    def _make_room(self, last: int) -> int:
        """Empty the columns after the newest, up to `last`; returns the first of them."""
        begin = max(self.head + 1, last - self.width + 1)
        if begin <= last:
            at = np.arange(begin, last + 1) % self.width
            self.ring.low[:, at] = np.nan
            self.ring.high[:, at] = np.nan
            self.head = last
        return begin

    def _paint(self, begin: int, last: int) -> None:
        if last < begin:
            return
        with painting(self.image) as painter:
            self._paint_ground(painter, begin, last)
            self._paint_channels(painter, begin, last)
        self.painted += last - begin + 1

    def _paint_grid(self) -> None:
        with painting(self.image) as painter:
            self._paint_ground(painter, 0, self.width - 1)

    def _paint_ground(self, painter: QPainter, begin: int, last: int) -> None:
        ground, line = QColor(self.look.ground), QColor(self.look.line)
        heights = [round((self.height - 1) * (1.0 - y)) for y in self.look.grid]
        left, right = begin % self.width, last % self.width
        if left <= right:
            parts = [(left, right - left + 1)]
        else:
            parts = [(left, self.width - left), (0, right + 1)]
        for x, width in parts:
            painter.fillRect(x, 0, width, self.height, ground)
            for y in heights:
                painter.fillRect(x, y, width, 1, line)

    def _paint_channels(self, painter: QPainter, begin: int, last: int) -> None:
        look = self.look
        rows = np.flatnonzero(look.shown)
        if not rows.size:
            return
        at = np.arange(begin, last + 1) % self.width
        tops, heights = self._extents(rows, at, begin)
        painter.setPen(Qt.PenStyle.NoPen)
        colours = [look.colours[row] for row in rows]
        for colour in dict.fromkeys(colours):
            same = [place for place, each in enumerate(colours) if each == colour]
            painter.setBrush(QColor(colour))
            self._paint_rects(painter, at, tops[same], heights[same])

    def _paint_rects(
        self, painter: QPainter, at: ColumnIndices, tops: Reals, heights: Reals
    ) -> None:
        there = np.isfinite(tops)
        count = int(np.count_nonzero(there))
        if not count:
            return
        self._rects.resize(count)
        rects = self._rects.ndarray()
        rects[:, 0] = np.broadcast_to(at, tops.shape)[there]
        rects[:, 1] = tops[there]
        rects[:, 2] = 1.0
        rects[:, 3] = heights[there]
        painter.drawRects(*self._rects.drawargs())

    def _extents(self, rows: ColumnIndices, at: ColumnIndices, begin: int) -> tuple[Reals, Reals]:
        """Return top and height in pixels, each joined to the column before."""
        low, high = self.ring.low[np.ix_(rows, at)], self.ring.high[np.ix_(rows, at)]
        before = (at - 1) % self.width
        low_before = self.ring.low[np.ix_(rows, before)]
        high_before = self.ring.high[np.ix_(rows, before)]
        if begin <= self.head - self.width + 1:  # the oldest has none before it
            low_before[:, 0] = high_before[:, 0] = np.nan
        nothing = np.isnan(low)
        low, high = np.fmin(low, high_before), np.fmax(high, low_before)
        bottom, top = self.look.low[rows, None], self.look.high[rows, None]
        scale = (self.height - 1) / (top - bottom)
        upper = np.rint(np.clip((top - high) * scale, -OFF_PX, self.height + OFF_PX))
        lower = np.rint(np.clip((top - low) * scale, -OFF_PX, self.height + OFF_PX))
        upper[nothing] = np.nan
        return upper, lower - upper + 1.0
