"""Which range each unit has, and how it follows what is in the image."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Final

import numpy as np

from cosmic.daqco.core.scale import Scale
from cosmic.daqco.core.settings import ChannelSettings
from cosmic.daqco.gui.plot.chart import Trace
from cosmic.daqco.gui.plot.columns import Columns
from cosmic.daqco.gui.plot.units import AxisRange, range_around

FITS_SHARE: Final = 0.25
"""An axis is left alone while the signals need at least this much of it."""


class UnitRanges:
    """Remembers a range for each unit, shown or not."""

    def __init__(self) -> None:
        self._ranges: dict[str, AxisRange] = {}

    def add(self, channels: Iterable[ChannelSettings], scales: Mapping[str, Scale]) -> None:
        """Give units that have no range what their inputs can measure."""
        ends: dict[str, list[float]] = {}
        for each in channels:
            scale = scales[each.scale]
            values = scale.apply(np.linspace(each.low_v, each.high_v, 21))
            ends.setdefault(scale.unit, []).extend([float(values.min()), float(values.max())])
        for unit, values_there in ends.items():
            if unit not in self._ranges:
                self._ranges[unit] = range_around(min(values_there), max(values_there), 0.0)

    def put(self, unit: str, wanted: AxisRange) -> None:
        """Give a unit its range."""
        self._ranges[unit] = wanted

    def shown(self, traces: Sequence[Trace]) -> dict[str, AxisRange]:
        """Return the ranges of the traces shown; that of the first where none is."""
        chosen = [trace for trace in traces if trace.shown] or list(traces[:1])
        return {unit: self._ranges[unit] for unit in dict.fromkeys(each.unit for each in chosen)}

    def zoom(self, traces: Sequence[Trace], factor: float, share: float) -> bool:
        """Make all ranges shown `factor` as wide; False when that would leave the sensible."""
        zoomed = {unit: each.zoomed(factor, share) for unit, each in self.shown(traces).items()}
        if any(each.problem()[0] for each in zoomed.values()):
            return False
        self._ranges.update(zoomed)
        return True

    def fit(self, traces: Sequence[Trace], columns: Columns, *, at_once: bool = False) -> bool:
        """Fit the ranges to what is in the image; True when one changed."""
        if columns.low.shape[0] != len(traces):
            return False
        changed = False
        for unit, now in self.shown(traces).items():
            rows = [i for i, each in enumerate(traces) if each.shown and each.unit == unit]
            wanted = _fitting(now, columns, rows, at_once=at_once) if rows else now
            changed |= wanted != now
            self._ranges[unit] = wanted
        return changed


def _fitting(now: AxisRange, columns: Columns, rows: list[int], *, at_once: bool) -> AxisRange:
    low = float(np.fmin.reduce(columns.low[rows], axis=None))
    high = float(np.fmax.reduce(columns.high[rows], axis=None))
    if not (math.isfinite(low) and math.isfinite(high)):
        return now
    wanted = range_around(low, high)
    inside = now.low <= low and high <= now.high
    roomy = (wanted.high - wanted.low) / (now.high - now.low) < FITS_SHARE
    return wanted if at_once or not inside or roomy else now
