"""Turns samples, as they come, into columns of an image."""

import numpy as np

from cosmic.daqco.gui.plot.columns import (
    Columns,
    Samples,
    bounds_of,
    column_of,
    gather,
    interpolate,
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
