"""Lines over the strip: two cursors to read values at, and the limits."""

from collections.abc import Sequence
from typing import Final

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QObject, Qt, Signal

from cosmic.daqco.api.daqco import DaqLimit
from cosmic.daqco.gui.colours import readable
from cosmic.daqco.gui.plot.chart import Chart
from cosmic.daqco.gui.plot.units import AxisRange, display_unit
from cosmic.frame.gui.palette import INK, OKABE_ITO
from cosmic.frame.gui.theme import current_palette

_CURSORS: Final = ("A", "B")
_FIRST_SHARES: Final = (0.35, 0.65)


class Cursors(QObject):
    """Two upright lines that the operator moves."""

    moved = Signal()

    def __init__(self, chart: Chart) -> None:
        super().__init__(chart)
        self._chart = chart
        self.lines: list[pg.InfiniteLine] = []

    @property
    def shown(self) -> bool:
        """True while they are in the image."""
        return bool(self.lines)

    def show(self, shown: bool) -> None:
        """Put them into the image, or take them out."""
        if shown == self.shown:
            return
        for line in self.lines:
            self._chart.box.removeItem(line)
        self.lines = []
        if shown:
            begin, end = self._chart.window_s()
            self.lines = [
                self._line(name, begin + share * (end - begin))
                for name, share in zip(_CURSORS, _FIRST_SHARES, strict=True)
            ]

    def times_s(self) -> tuple[float, ...]:
        """Return where they are, s after the last sample held."""
        return tuple(float(line.value()) for line in self.lines)

    def values(self) -> list[list[float] | None]:
        """Return the values of all channels at each cursor; None where there are none."""
        view = self._chart.now_view()
        found: list[list[float] | None] = []
        for time_s in self.times_s():
            number = view.end - 1 + round(time_s * self._chart.rate_hz)
            _, samples = view.samples(number, number + 1)
            found.append(samples[:, 0].tolist() if samples.shape[1] else None)
        return found

    def readings(self) -> list[list[float] | None]:
        """Return the values at A, at B, and B less A; None each where there are none."""
        if not self.shown:
            return [None, None, None]
        at_a, at_b = self.values()
        between = None if at_a is None or at_b is None else np.subtract(at_b, at_a).tolist()
        return [at_a, at_b, between]

    def text(self) -> str:
        """Return where both cursors are and what lies between them."""
        first_s, second_s = self.times_s()
        return f"A {first_s:.3f} s   B {second_s:.3f} s   B − A {second_s - first_s:.3f} s"

    def _line(self, name: str, time_s: float) -> pg.InfiniteLine:
        palette = current_palette()
        line = pg.InfiniteLine(
            time_s,
            angle=90,
            movable=True,
            pen=pg.mkPen(palette.accent, width=1),
            hoverPen=pg.mkPen(palette.accent, width=3),
            label=name,
            labelOpts={"position": 0.94, "color": palette.on_accent, "fill": palette.accent},
        )
        line.sigPositionChanged.connect(self.moved)
        self._chart.box.addItem(line, ignoreBounds=True)
        return line


class LimitLines:
    """A dashed line for each limit, at its height on the axis of its channel."""

    def __init__(self, chart: Chart) -> None:
        self._chart = chart
        self.lines: list[pg.InfiniteLine] = []
        self._shown: object = None

    def show(self, limits: Sequence[DaqLimit], ranges: dict[str, AxisRange]) -> None:
        """Draw the limits of the channels that are in the image."""
        wanted = (tuple(limits), dict(ranges), self._chart.traces, current_palette().name)
        if wanted == self._shown:
            return  # a line is dear, and this is asked for whenever anything in DAQCo changes
        self._shown = wanted
        for line in self.lines:
            self._chart.box.removeItem(line)
        self.lines = []
        traces = {trace.name: trace for trace in self._chart.traces if trace.shown}
        for limit in limits:
            trace = traces.get(limit.settings.channel)
            if trace is None or trace.unit not in ranges:
                continue
            for side in ("low", "high"):
                value = getattr(limit.settings, side)
                share = np.nan if value is None else ranges[trace.unit].share(value)
                if 0.0 <= share <= 1.0:
                    text = f"{trace.name} {side} {value:g} {display_unit(trace.unit)}"
                    self._add(limit, text, float(share), trace.colour)

    def _add(self, limit: DaqLimit, text: str, share: float, colour: str) -> None:
        armed = limit.settings.armed
        shown = OKABE_ITO["vermillion"] if limit.crossed else readable(colour)
        line = pg.InfiniteLine(
            share,
            angle=0,
            pen=pg.mkPen(
                shown,
                width=2 if armed else 1,
                style=Qt.PenStyle.DashLine if armed else Qt.PenStyle.DotLine,
            ),
            label=text if armed else f"{text} (not armed)",
            labelOpts={
                "position": 0.02,
                "anchors": [(0.0, 0.0), (0.0, 1.0)],
                "color": INK if limit.crossed else current_palette().text,
                "fill": shown if limit.crossed else current_palette().panel,
            },
        )
        self._chart.box.addItem(line, ignoreBounds=True)
        self.lines.append(line)
