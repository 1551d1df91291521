"""The last minute of all channels: samples, and their extremes at coarser and coarser steps."""

from collections import deque
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from cosmic.daqco.gui.plot.columns import Block, Bounds, Columns, bounds_of, gather, interpolate

FACTOR: Final = 16
LEVELS: Final = 3
SEGMENT: Final = 4 * FACTOR**LEVELS
BUDGET_BYTES: Final = 192 * 2**20

Samples = npt.NDArray[np.float64]


class Segment:
    """Some samples in a row, only ever appended to, so that a frozen view can share them."""

    def __init__(self, channels: int, first_sample: int) -> None:
        self.first = first_sample
        self.used = 0
        self.raw: Block = np.empty((channels, SEGMENT), dtype=np.float32)
        sizes = [SEGMENT // FACTOR**level for level in range(1, LEVELS + 1)]
        self.lows: list[Block] = [np.empty((channels, size), dtype=np.float32) for size in sizes]
        self.highs: list[Block] = [np.empty((channels, size), dtype=np.float32) for size in sizes]

    @property
    def end(self) -> int:
        """Number of the sample after the last."""
        return self.first + self.used

    @property
    def room(self) -> int:
        """How many samples still fit."""
        return SEGMENT - self.used

    def append(self, values: Samples) -> None:
        """Add samples that fit."""
        before, self.used = self.used, self.used + values.shape[1]
        self.raw[:, before : self.used] = values
        low = high = self.raw
        step = 1
        for level in range(LEVELS):
            step *= FACTOR
            done, now = before // step, self.used // step
            if now == done:
                return
            shape = (len(low), now - done, FACTOR)
            reach = slice(done * FACTOR, now * FACTOR)
            self.lows[level][:, done:now] = low[:, reach].reshape(shape).min(axis=2)
            self.highs[level][:, done:now] = high[:, reach].reshape(shape).max(axis=2)
            low, high = self.lows[level], self.highs[level]


@dataclass(frozen=True, eq=False)
class HistoryView:
    """The history as it was at one time; shares memory with it, but does not move on.

    Attributes
    ----------
    first, end : int
        Number of the first sample, and of the one after the last.
    """

    segments: tuple[Segment, ...]
    channels: int
    first: int
    end: int

    def columns(self, first_column: int, count: int, samples_per_column: float) -> Columns:
        """Return the extremes of columns; column 0 begins with sample 0."""
        if samples_per_column < 1.0:
            return self._line(first_column, count, samples_per_column)
        bounds = bounds_of(first_column, count, samples_per_column)
        found = Columns.empty(self.channels, count)
        level = _level_for(samples_per_column)
        for segment in self.segments:
            if segment.first < min(bounds[-1], self.end) and segment.end > bounds[0]:
                self._gather(found, bounds, segment, level)
        return found

    def samples(self, first: int, end: int) -> tuple[int, Block]:
        """Return samples `first` to `end`, as far as they are there, and the number of the first.

        What was lost in between is left out: the last piece without a gap is returned.
        """
        pieces: list[Block] = []
        begin = last = max(first, self.first)
        for segment in self.segments:
            low, high = max(segment.first, begin), min(segment.end, end, self.end)
            if high <= low:
                continue
            if low != last:
                pieces, begin = [], low
            pieces.append(segment.raw[:, low - segment.first : high - segment.first])
            last = high
        if not pieces:
            return begin, np.empty((self.channels, 0), dtype=np.float32)
        return begin, np.concatenate(pieces, axis=1)

    def _gather(self, found: Columns, bounds: Bounds, segment: Segment, level: int) -> None:
        used = min(segment.used, self.end - segment.first)
        done = 0
        if level:
            step = FACTOR**level
            blocks = used // step
            low = segment.lows[level - 1][:, :blocks]
            high = segment.highs[level - 1][:, :blocks]
            gather(found, bounds, low, high, segment.first, step)
            done = blocks * step
        rest = segment.raw[:, done:used]
        gather(found, bounds, rest, rest, segment.first + done)

    def _line(self, first_column: int, count: int, samples_per_column: float) -> Columns:
        found = Columns.empty(self.channels, count)
        edges = np.arange(first_column, first_column + count + 1) * samples_per_column
        begin, values = self.samples(int(edges[0]) - 1, int(edges[-1]) + 2)
        if not values.shape[1]:
            return found
        inside = (edges >= begin) & (edges <= begin + values.shape[1] - 1)
        whole = np.flatnonzero(inside[:-1] & inside[1:])
        if whole.size:
            reach = edges[whole[0] : whole[-1] + 2]
            line = interpolate(values, begin, reach)
            found.low[:, whole], found.high[:, whole] = line.low, line.high
        return found


def _level_for(samples_per_column: float) -> int:
    """Return the coarsest level whose blocks are well below a column."""
    level = 0
    while level < LEVELS and 2 * FACTOR ** (level + 1) <= samples_per_column:
        level += 1
    return level


class History:
    """Keeps samples for `span_s`, as float32, in physical units; GUI thread.

    Memory is bounded: beyond `BUDGET_BYTES` of samples the oldest go, even if they are younger.
    """

    def __init__(self, channels: int, rate_hz: float, span_s: float = 60.0) -> None:
        self.channels, self.rate_hz = channels, rate_hz
        self._segments: deque[Segment] = deque()
        by_memory = BUDGET_BYTES // (4 * max(1, channels))
        self._most = int(min(np.ceil(span_s * rate_hz), by_memory))

    @property
    def end(self) -> int:
        """Number of the sample after the last."""
        return self._segments[-1].end if self._segments else 0

    def append(self, first_sample: int, values: Samples) -> None:
        """Add samples, shape (channels, n); a gap before them stays one."""
        done, count = 0, values.shape[1]
        while done < count:
            segment = self._segments[-1] if self._segments else None
            if segment is None or not segment.room or segment.end != first_sample + done:
                segment = Segment(self.channels, first_sample + done)
                self._segments.append(segment)
            part = min(segment.room, count - done)
            segment.append(values[:, done : done + part])
            done += part
        while self._segments[0].end <= self.end - self._most:
            self._segments.popleft()

    def clear(self) -> None:
        """Forget everything; views made before keep theirs."""
        self._segments.clear()

    def view(self) -> HistoryView:
        """Return what there is now, without copying."""
        segments = tuple(self._segments)
        first = segments[0].first if segments else 0
        return HistoryView(segments, self.channels, max(first, self.end - self._most), self.end)
