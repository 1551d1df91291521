"""The process that `benchmarks.plot` starts on a display: draws, and times it."""

import json
import sys
import time
from typing import Final

import numpy as np
import pyqtgraph as pg
from PySide6.QtWidgets import QApplication

from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.scale import Scale
from cosmic.daqco.gui.plot.chart import Chart, Trace
from cosmic.daqco.gui.plot.inbox import ChunkInbox
from cosmic.daqco.gui.plot.units import AxisRange
from cosmic.frame.gui.theme import apply_theme

CHANNELS: Final = 32
RATE_HZ: Final = 15_000.0
REFRESH_HZ: Final = 60.0
CHUNK_S: Final = 0.01
SIZE_PX: Final = (1280, 800)
COLOURS: Final = ("#E69F00", "#56B4E9", "#009E73", "#F0E442", "#0072B2", "#D55E00", "#CC79A7")
NAMES: Final = tuple(f"channel{number}" for number in range(CHANNELS))
SCALES: Final = tuple(Scale("Cubic", "uN", (0.1, 1.0, 0.01, 0.001)) for _ in NAMES)


class Source:
    """Noise around a level of its own for each channel, with a spike now and then."""

    def __init__(self) -> None:
        rng = np.random.default_rng(5)
        noise = rng.normal(0.0, 0.12, (CHANNELS, round(RATE_HZ * 4)))
        self._volts = noise + np.linspace(-8.0, 8.0, CHANNELS)[:, None]
        self._rng = rng
        self.next = 0
        self.spikes: list[tuple[int, int, float]] = []

    def chunk(self) -> DataChunk:
        """Return the next 10 ms."""
        count = round(RATE_HZ * CHUNK_S)
        at = self.next % (self._volts.shape[1] - count)
        volts = self._volts[:, at : at + count].copy()
        if self._rng.random() < 0.3:
            row, place = int(self._rng.integers(CHANNELS)), int(self._rng.integers(count))
            volts[row, place] += 3.0
            value = float(SCALES[row].apply([volts[row, place]])[0])
            self.spikes.append((row, self.next + place, value))
        chunk = DataChunk(self.next, self.next / RATE_HZ, RATE_HZ, NAMES, volts, SCALES)
        self.next += count
        return chunk


def new_chart(span_s: float) -> Chart:
    """Return the chart of the plotter, in a window."""
    chart = Chart()
    chart.resize(*SIZE_PX)
    chart.begin([Trace(n, "uN", COLOURS[i % 7]) for i, n in enumerate(NAMES)], RATE_HZ)
    chart.set_ranges({"uN": AxisRange(-12.0, 12.0, 2.0)})
    chart.set_span(span_s)
    chart.show()
    QApplication.processEvents()
    return chart


def seen(chart: Chart, spikes: list[tuple[int, int, float]]) -> tuple[int, int]:
    """Return how many spikes should be in the image, and how many are."""
    raster = chart.raster
    per_column = chart.span_s * RATE_HZ / raster.width
    oldest = raster.head - raster.width + 1
    due = [each for each in spikes if each[1] / per_column > oldest + 1]
    found = 0
    for row, sample, value in due:
        _, highs = raster.column(int(sample / per_column + 1e-9))
        found += bool(highs[row] >= np.float32(value) - 1e-4)
    return len(due), found


def ours(span_s: float, refreshes: int) -> dict[str, object]:
    """Return the times of the strip chart."""
    chart, source, inbox = new_chart(span_s), Source(), ChunkInbox()
    for _ in range(round(60.0 / CHUNK_S / 10)):
        chart.feed([source.chunk() for _ in range(10)])
    source.spikes.clear()
    QApplication.processEvents()
    waiting, refresh_s, cpu_s = 0.0, [], []
    before = chart.strip.paints
    for _ in range(refreshes):
        waiting += 1.0 / REFRESH_HZ
        while waiting >= CHUNK_S:
            inbox.put(source.chunk())
            waiting -= CHUNK_S
        began_s, cpu_began_s = time.perf_counter(), time.thread_time()
        chart.feed(inbox.take())
        QApplication.processEvents()
        refresh_s.append(time.perf_counter() - began_s)
        cpu_s.append(time.thread_time() - cpu_began_s)
    paints = chart.strip.paints - before
    due, found = seen(chart, source.spikes)
    result = {
        "refresh_s": refresh_s,
        "cpu_s": cpu_s,
        "paints": paints,
        "spikes": due,
        "spikes_seen": found,
        "zoom_s": zooms(chart),
    }
    chart.close()
    return result


def zooms(chart: Chart) -> list[float]:
    """Return how long the image takes after each step of a zoom, in and out again."""
    found = []
    for factor in (0.5, 0.2, 0.2, 0.2, 5.0, 5.0, 5.0, 2.0):
        began_s = time.perf_counter()
        chart.zoom_time(factor, 0.4)
        QApplication.processEvents()
        found.append(time.perf_counter() - began_s)
    return found


def peaks(span_s: float, refreshes: int) -> list[float]:
    """Return the times of pyqtgraph's own curves with its downsampling that keeps peaks."""
    window = pg.PlotWidget()
    window.resize(*SIZE_PX)
    window.setRange(xRange=(-span_s, 0.0), yRange=(-12.0, 12.0), padding=0.0)
    source, held = Source(), round(span_s * RATE_HZ)
    times = np.arange(-held, 0) / RATE_HZ
    values = np.zeros((CHANNELS, held))
    curves = []
    for number in range(CHANNELS):
        curve = pg.PlotDataItem(pen=COLOURS[number % 7])
        curve.setDownsampling(auto=True, method="peak")
        window.addItem(curve)
        curves.append(curve)
    window.show()
    for begin in range(0, held, 1500):
        part = np.concatenate([source.chunk().values for _ in range(10)], axis=1)
        values[:, begin : begin + 1500] = part[:, : held - begin]
    found = []
    for _ in range(refreshes):
        new = source.chunk().values
        values[:, : -new.shape[1]] = values[:, new.shape[1] :]
        values[:, -new.shape[1] :] = new
        began_s = time.perf_counter()
        for curve, row in zip(curves, values, strict=True):
            curve.setData(times, row)
        QApplication.processEvents()
        found.append(time.perf_counter() - began_s)
    window.close()
    return found


if __name__ == "__main__":
    app = QApplication([])
    apply_theme(app, "dark")
    wanted = int(sys.argv[1])
    answer = {}
    for seconds in (10.0, 60.0):
        answer[f"{seconds:g} s"] = ours(seconds, wanted) | {
            "peak_s": peaks(seconds, max(2, wanted // 150))
        }
    sys.stdout.write(json.dumps(answer) + "\n")
