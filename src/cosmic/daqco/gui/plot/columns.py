"""Lowest and highest value in each column of an image: what keeps every spike visible."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Block = npt.NDArray[np.float32]
Bounds = npt.NDArray[np.int64]
Edges = npt.NDArray[np.floating[Any]]
Samples = npt.NDArray[np.float32] | npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Columns:
    """Extremes a column.

    Attributes
    ----------
    low, high : ndarray, shape (channels, columns), float32
        Extremes of the samples of each column; NaN where there are none.
    """

    low: Block
    high: Block

    @classmethod
    def empty(cls, channels: int, columns: int) -> "Columns":
        """Return columns without a sample."""
        return cls(
            np.full((channels, columns), np.nan, dtype=np.float32),
            np.full((channels, columns), np.nan, dtype=np.float32),
        )


def bounds_of(first_column: int, count: int, samples_per_column: float) -> Bounds:
    """Return the first sample of each of `count` columns, and the one after the last."""
    edges = np.arange(first_column, first_column + count + 1) * samples_per_column
    bounds: Bounds = np.ceil(edges - 1e-9).astype(np.int64)
    return bounds


def column_of(sample: int, samples_per_column: float) -> int:
    """Return the column that `sample` is in; agrees with `bounds_of`."""
    return int(np.floor((sample + 1e-9) / samples_per_column))


def gather(
    into: Columns,
    bounds: Bounds,
    low: Samples,
    high: Samples,
    first_sample: int,
    step: int = 1,
) -> None:
    """Merge data into columns; a block belongs to the column that its first sample is in.

    Parameters
    ----------
    low, high : ndarray, shape (channels, n)
        Extremes of `n` blocks of `step` samples; the same array twice for samples themselves.
    first_sample : int
        Number of the first sample of the first block.
    """
    count = low.shape[1]
    starts = np.clip(-((first_sample - bounds) // step), 0, count)
    if first_sample < bounds[0] and starts[0] > 0 and step > 1:
        starts[0] -= 1  # the block that reaches into the first column
    used = np.flatnonzero(np.diff(starts))
    if not used.size:
        return
    offsets, end = starts[used], starts[used[-1] + 1]
    lows = np.minimum.reduceat(low[:, :end], offsets, axis=1)
    highs = np.maximum.reduceat(high[:, :end], offsets, axis=1)
    into.low[:, used] = np.fmin(into.low[:, used], lows)
    into.high[:, used] = np.fmax(into.high[:, used], highs)


def interpolate(values: Samples, first_sample: int, edges: Edges) -> Columns:
    """Return columns of a line through `values` where a column has less than one sample.

    Parameters
    ----------
    edges : ndarray, shape (columns + 1,)
        Positions of the columns' edges, in samples; all between the first and the last sample.
    """
    indices = np.clip(edges - first_sample, 0.0, values.shape[1] - 1.0)
    before = np.minimum(indices.astype(np.int64), max(0, values.shape[1] - 2))
    after = np.minimum(before + 1, values.shape[1] - 1)
    share = indices - before
    line = values[:, before] * (1.0 - share) + values[:, after] * share
    return Columns(
        np.minimum(line[:, :-1], line[:, 1:]).astype(np.float32),
        np.maximum(line[:, :-1], line[:, 1:]).astype(np.float32),
    )


class LiveColumns:
    """Remembers where the last samples were, and the last of them where a line is drawn on.

    Parameters
    ----------
    samples_per_column : float
        Below 1 a column is a piece of the line between two samples.
    """

    def __init__(self, samples_per_column: float) -> None:
        self.samples_per_column = samples_per_column
        self._last: Samples | None = None
        self._next = -1

    def prime(self, first_sample: int, values: Samples) -> None:
        """Say what came before, so that a line goes on from there."""
        if values.shape[1]:
            self._last, self._next = values[:, -1:], first_sample + values.shape[1]

    def feed(self, first_sample: int, values: Samples) -> tuple[int, Columns] | None:
        """Return the number of the first column that changes, and the columns."""
        found = (
            self._extremes(first_sample, values)
            if self.samples_per_column >= 1.0
            else self._line(first_sample, values)
        )
        self._last, self._next = values[:, -1:], first_sample + values.shape[1]
        return found

    def _extremes(self, first_sample: int, values: Samples) -> tuple[int, Columns]:
        per_column = self.samples_per_column
        begin = column_of(first_sample, per_column)
        count = column_of(first_sample + values.shape[1] - 1, per_column) - begin + 1
        found = Columns.empty(len(values), count)
        gather(found, bounds_of(begin, count, per_column), values, values, first_sample)
        return begin, found

    def _line(self, first_sample: int, values: Samples) -> tuple[int, Columns] | None:
        if self._last is not None and first_sample == self._next:
            values = np.concatenate([self._last, values], axis=1)
            first_sample -= 1
        last = first_sample + values.shape[1] - 1
        begin = int(np.ceil(first_sample / self.samples_per_column))
        end = int(np.floor(last / self.samples_per_column))
        if end <= begin:
            return None
        edges = np.arange(begin, end + 1) * self.samples_per_column
        return begin, interpolate(values, first_sample, edges)
