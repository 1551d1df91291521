"""What is made of a force while it comes: a filter, statistics and a spectrum."""

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import pyqtgraph as pg

from cosmic.app.panels.curve_frame import CurveFrame
from cosmic.daqco.core.chunk import DataChunk, Values
from cosmic.daqco.gui.colours import readable
from cosmic.frame.gui.palette import OKABE_ITO, Palette
from cosmic.frame.overrides import override

SPAN_S: Final = 10.0
"""Statistics and spectrum are of so much."""
MOST_SAMPLES: Final = 200_000
SPECTRUM_SAMPLES: Final = 4096
FEWEST: Final = 64


class LowPass:
    """A filter of first order; what is drawn and read is filtered, never what is recorded."""

    def __init__(self, cut_hz: float) -> None:
        self.cut_hz = cut_hz
        self._last: float | None = None

    def apply(self, chunk: DataChunk) -> DataChunk:
        """Return the chunk of one channel with filtered volts."""
        share = 1.0 - math.exp(-2.0 * math.pi * self.cut_hz / chunk.rate_hz)
        level = float(chunk.volts[0, 0]) if self._last is None else self._last
        filtered = np.empty_like(chunk.volts)
        for number, volts in enumerate(chunk.volts[0].tolist()):
            level += share * (volts - level)
            filtered[0, number] = level
        self._last = level
        return replace(chunk, volts=filtered)


@dataclass(frozen=True, slots=True)
class Statistics:
    """Of the last seconds."""

    mean: float
    deviation: float
    low: float
    high: float
    seconds: float


class RecentValues:
    """The values of one channel in the last seconds; forgets those before a pause."""

    def __init__(self, span_s: float = SPAN_S) -> None:
        self._span_s = span_s
        self._rate_hz = 0.0
        self._values: list[Values] = []
        self._count = 0
        self._next = -1

    @property
    def rate_hz(self) -> float:
        """Of the samples; 0 before the first."""
        return self._rate_hz

    def add(self, chunk: DataChunk) -> None:
        """Take a chunk of one channel in."""
        if chunk.rate_hz != self._rate_hz or chunk.first_sample != self._next:
            self._values, self._count, self._rate_hz = [], 0, chunk.rate_hz
        self._next = chunk.first_sample + chunk.samples
        self._values.append(chunk.values[0])
        self._count += chunk.samples
        while self._count - self._values[0].size >= self._most:
            self._count -= self._values.pop(0).size

    @property
    def _most(self) -> int:
        return min(MOST_SAMPLES, round(self._span_s * self._rate_hz))

    def all(self) -> Values:
        """Return them, oldest first, shape (n,)."""
        if not self._values:
            return np.empty(0)
        # One array from here on: without the cut it would only ever grow.
        whole = np.concatenate(self._values)[-self._most :].copy()
        self._values, self._count = [whole], whole.size
        return whole

    def statistics(self) -> Statistics | None:
        """Return mean, standard deviation and extremes; None where there is too little."""
        values = self.all()
        if values.size < FEWEST:
            return None
        return Statistics(
            mean=float(values.mean()),
            deviation=float(values.std(ddof=1)),
            low=float(values.min()),
            high=float(values.max()),
            seconds=values.size / self._rate_hz,
        )

    def spectrum(self) -> tuple[Values, Values] | None:
        """Return frequencies in Hz and amplitude densities in unit/√Hz; None: too little."""
        values = self.all()[-SPECTRUM_SAMPLES:]
        if values.size < FEWEST:
            return None
        window = np.hanning(values.size)
        parts = np.abs(np.fft.rfft((values - values.mean()) * window))
        density = parts * math.sqrt(2.0 / (self._rate_hz * float(window @ window)))
        frequencies = np.asarray(np.fft.rfftfreq(values.size, 1.0 / self._rate_hz), dtype=float)
        return frequencies[1:], density[1:]


class SpectrumCurve(CurveFrame):
    """Amplitude density over frequency, both in decades."""

    def __init__(self, axis_px: int) -> None:
        super().__init__(axis_px)
        box, self._left = self._add_field("")
        below = self._add_axis_below("frequency, Hz")
        for axis in (self._left, below):
            axis.setLogMode(x=True, y=True)
        self._curve = pg.PlotCurveItem()
        box.addItem(self._curve)
        self._restyle()

    def name_force(self, unit: str) -> None:
        """Say in which unit the density is drawn."""
        self._names[self._left] = f"{unit}/√Hz"
        self._restyle()

    def show_spectrum(self, frequencies_hz: Values, density: Values) -> None:
        """Draw another spectrum."""
        least = float(density.max()) * 1e-6 or 1e-12
        self._curve.setData(np.log10(frequencies_hz), np.log10(np.maximum(density, least)))

    @property
    def points(self) -> tuple[Values, Values]:
        """Logarithms of frequency and density that are drawn."""
        where, what = self._curve.getData()
        return np.asarray(where), np.asarray(what)

    @override
    def _colour(self, palette: Palette) -> None:
        self._curve.setPen(pg.mkPen(readable(OKABE_ITO["orange"]), width=1.2))
