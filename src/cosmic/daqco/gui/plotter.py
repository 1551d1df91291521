"""`UDaqPlotter`: what is acquired, as it comes (thesis, Table F.1)."""

from dataclasses import replace
from typing import Final

import numpy as np
from PySide6.QtCore import QSize, Qt, QTimer, Signal
from PySide6.QtGui import QHideEvent, QScreen, QShowEvent
from PySide6.QtWidgets import QHBoxLayout, QLabel, QSplitter, QVBoxLayout, QWidget

from cosmic.daqco.api.daqco import Daqco
from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.settings import ChannelSettings
from cosmic.daqco.gui.asking import Asking
from cosmic.daqco.gui.channel_list import ChannelList
from cosmic.daqco.gui.limit_banner import LimitBanner
from cosmic.daqco.gui.plot.chart import Chart, Trace
from cosmic.daqco.gui.plot.inbox import ChunkInbox
from cosmic.daqco.gui.plot.marks import Cursors, LimitLines
from cosmic.daqco.gui.plot.unit_ranges import UnitRanges
from cosmic.daqco.gui.plot.units import AxisRange
from cosmic.daqco.gui.scaling_bar import ScalingBar
from cosmic.frame.clock import WALL
from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.chip import Chip
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.relay import Relay
from cosmic.frame.gui.theme import STEP_PX, number_font
from cosmic.frame.overrides import override

READOUT_MS: Final = 200
UNSEEN_MS: Final = 1000
OLD_S: Final = 1.0
"""A value that is older is not the present one."""
MEAN_S: Final = 0.2
USUAL_HZ: Final = 60.0

_Key = tuple[tuple[str, ...], float, tuple[object, ...]]


class UDaqPlotter(QWidget):
    """Draws the channels, lists them with their values, and lets the operator look back.

    Parameters
    ----------
    daqco : Daqco
        The application; chunks come from it in its own thread and are only kept there.
    """

    limit_requested = Signal(str)
    """The limit of a channel is to be set."""

    def __init__(self, daqco: Daqco, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._daqco = daqco
        self._key: _Key | None = None
        self._hidden: set[str] = set()
        self._ranges = UnitRanges()
        self.inbox = ChunkInbox()
        self.chart = Chart()
        self.channels = ChannelList()
        self.bar = ScalingBar()
        self.banner = LimitBanner()
        self.cursors = Cursors(self.chart)
        self.limit_lines = LimitLines(self.chart)
        self.state = Chip("LIVE", tip="Whether the plot follows the newest samples")
        self.lost = Chip("lost 0", tip="Samples lost per channel")
        self.window_text, self.problem = QLabel(), ElidedLabel()
        self._heard_s = WALL.now_s()
        self._timer = QTimer(self, timerType=Qt.TimerType.PreciseTimer)
        self._readout = QTimer(self, interval=READOUT_MS)
        self._build()
        self._connect()
        self._asking = Asking(daqco, self)
        self._relay = Relay(self._on_changed).follow(daqco.on_change)
        self._relay.keep(daqco.follow(self.inbox.put))
        self._on_changed()

    def _build(self) -> None:
        self.window_text.setFont(number_font())
        self.window_text.setProperty("role", "dim")
        status = QHBoxLayout()
        status.setSpacing(STEP_PX)
        for widget in (self.state, self.window_text, self.lost):
            status.addWidget(widget)
        status.addWidget(self.problem, 1)
        split = QSplitter(Qt.Orientation.Horizontal)
        split.addWidget(self.chart)
        split.addWidget(self.channels)
        split.setStretchFactor(0, 1)
        split.setCollapsible(0, False)
        self.split = split
        self.chart.setMinimumSize(30 * STEP_PX, 14 * STEP_PX)
        column = QVBoxLayout(self)
        column.setContentsMargins(STEP_PX, STEP_PX, STEP_PX, STEP_PX)
        column.setSpacing(STEP_PX // 2)
        column.addWidget(self.bar)
        column.addWidget(self.banner)
        column.addWidget(split, 1)
        column.addLayout(status)

    def _connect(self) -> None:
        self._timer.timeout.connect(self.refresh)
        self._readout.timeout.connect(self.read_out)
        bar, chart = self.bar, self.chart
        bar.rescale_requested.connect(self._on_rescale)
        bar.auto_changed.connect(self._on_auto_changed)
        bar.clear_requested.connect(self.clear)
        bar.pause_requested.connect(self.set_paused)
        bar.span_changed.connect(chart.set_span)
        bar.cursors_changed.connect(self._on_cursors_changed)
        chart.frozen_changed.connect(self._on_frozen_changed)
        chart.time_changed.connect(self._on_time_changed)
        chart.value_zoom_requested.connect(self._on_value_zoom)
        self.cursors.moved.connect(self._show_cursors)
        self.channels.channels.shown_changed.connect(self._on_shown_changed)
        self.channels.limit_requested.connect(self.limit_requested)
        self.banner.reset_requested.connect(self._on_reset_requested)

    def set_compact(self, compact: bool, *, narrow: bool) -> None:
        """Leave the room to the image; where it is narrow, the channels stand below it."""
        self.bar.set_compact(compact)
        upright = Qt.Orientation.Vertical if narrow else Qt.Orientation.Horizontal
        if self.split.orientation() is not upright:
            self.split.setOrientation(upright)
            self._share_room()

    def _set_pace(self) -> None:
        """Look as often as the screen shows it; unseen, only keep the history."""
        seen = self.isVisible()
        self._timer.start(max(1, round(1000.0 / self.refresh_hz)) if seen else UNSEEN_MS)
        if seen and not self._readout.isActive():
            self._readout.start()
        elif not seen:
            self._readout.stop()

    @override
    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        self._set_pace()
        self.refresh()
        self.read_out()

    @override
    def hideEvent(self, event: QHideEvent) -> None:
        super().hideEvent(event)
        self._set_pace()

    # What the operator does

    @property
    def refresh_hz(self) -> float:
        """How often the image is looked at: the setting, or what the screen can show."""
        return _shown_rate_hz(self._daqco.settings.refresh_hz, self.screen())

    @property
    def ranges(self) -> dict[str, AxisRange]:
        """The range of each axis that is shown, by unit."""
        return self._ranges.shown(self.chart.traces)

    def set_paused(self, paused: bool) -> None:
        """Freeze the image, or follow again."""
        if paused:
            self.refresh()
            self.chart.freeze()
        else:
            self.chart.follow()

    def clear(self) -> None:
        """Forget the history (DAQPlot.4)."""
        self.inbox.take()
        self.chart.clear()

    # Refreshing

    def refresh(self) -> None:
        """Draw what has come since the last time."""
        pending: list[DataChunk] = []
        for chunk in self.inbox.take():
            self._heard_s = WALL.now_s()
            key = (chunk.channels, chunk.rate_hz, chunk.scales)
            if key != self._key:
                self.chart.feed(pending)
                pending = []
                if not self._knows(chunk):
                    continue
                self._begin(key)
            pending.append(chunk)
        self.chart.feed(pending)

    def _knows(self, chunk: DataChunk) -> bool:
        """Return whether the settings have its channels: another station may tell of them later."""
        return {each.name for each in self._daqco.settings.channel}.issuperset(chunk.channels)

    def read_out(self) -> None:
        """Show values, counters and, with Auto, fitting axes."""
        if self.bar.auto.isChecked() and not self.chart.frozen:
            self._fit()
        view = self.chart.now_view()
        first = view.end - max(1, round(MEAN_S * self.chart.rate_hz))
        samples = view.samples(first, view.end)[1] if view.end else np.empty((0, 0))
        values = samples.mean(axis=1).tolist() if samples.shape[1] else None
        self.channels.channels.set_values(0, values)
        self._show_age()
        self._show_cursors()
        lost, skipped = self._daqco.counters.lost, self.inbox.skipped
        self.lost.setText(f"lost {lost}" + (f", not shown {skipped}" if skipped else ""))
        self.lost.set_tone("alarm" if lost else "quiet")

    def _show_age(self) -> None:
        """Show values that are not measured any more as old ones."""
        age_s = WALL.now_s() - self._heard_s
        measured = self._daqco.running and age_s <= OLD_S
        self.channels.channels.set_age(None if measured else age_s)
        if self.chart.frozen:
            self.state.setText("HISTORY")
        else:
            self.state.setText("LIVE" if measured else f"NOT MEASURED for {age_s:.0f} s")
        self.state.set_tone("quiet" if measured and not self.chart.frozen else "warning")

    # Following the application

    def _on_changed(self) -> None:
        settings, scales = self._daqco.settings, self._daqco.settings.scales()
        active = [each for each in settings.channel if each.active]
        key = (
            tuple(each.name for each in active),
            self._daqco.rate_hz,
            tuple(scales[each.scale] for each in active),
        )
        if key != self._key:
            self._begin(key)
        else:
            self._set_traces(self._traces_of(active))
        self._set_pace()
        units = {trace.name: trace.unit for trace in self.chart.traces}
        self.banner.show_limits(self._daqco.limits, units)
        self.problem.set_text(self._daqco.problem)
        self._show_limits()

    def _begin(self, key: _Key) -> None:
        self._key = key
        named_channels = {each.name: each for each in self._daqco.settings.channel}
        active = [named_channels[name] for name in key[0] if name in named_channels]
        traces = self._traces_of(active)
        self._ranges.add(active, self._daqco.settings.scales())
        self.chart.begin(traces, key[1])
        self.channels.channels.set_traces(traces)
        self._show_ranges()

    def _traces_of(self, active: list[ChannelSettings]) -> tuple[Trace, ...]:
        scales = self._daqco.settings.scales()
        return tuple(
            Trace(each.name, scales[each.scale].unit, each.colour, each.name not in self._hidden)
            for each in active
        )

    def _set_traces(self, traces: tuple[Trace, ...]) -> None:
        if traces != self.chart.traces:
            for row, trace in enumerate(traces):
                self.channels.channels.replace(row, trace)
            self.chart.set_traces(traces)
            self._show_ranges()

    # Axes

    def _show_ranges(self) -> None:
        shown = self.ranges
        self.chart.set_ranges(shown)
        self.bar.show_ranges(shown)
        decimals = {unit: each.decimals() for unit, each in shown.items()}
        self.channels.channels.set_decimals(
            [decimals.get(trace.unit, 2) for trace in self.chart.traces]
        )
        self._show_limits()

    def _show_limits(self) -> None:
        self.limit_lines.show(self._daqco.limits, self.ranges)

    def _on_rescale(self, unit: str, wanted: AxisRange) -> None:
        self._ranges.put(unit, wanted)
        self._show_ranges()

    def _on_auto_changed(self, auto: bool) -> None:
        if auto:
            self._fit(at_once=True)

    def _on_value_zoom(self, factor: float, share: float) -> None:
        if self._ranges.zoom(self.chart.traces, factor, share):
            self.bar.auto.setChecked(False)
            self._show_ranges()

    def _fit(self, *, at_once: bool = False) -> None:
        if self._ranges.fit(self.chart.traces, self.chart.visible_columns(), at_once=at_once):
            self._show_ranges()

    # Reactions

    def _on_shown_changed(self, row: int, shown: bool) -> None:
        name = self.chart.traces[row].name
        (self._hidden.discard if shown else self._hidden.add)(name)
        traces = list(self.chart.traces)
        traces[row] = replace(traces[row], shown=shown)
        self._set_traces(tuple(traces))

    def _on_frozen_changed(self, frozen: bool) -> None:
        self.bar.show_frozen(frozen)
        self._show_age()

    def _on_time_changed(self) -> None:
        begin_s, end_s = self.chart.window_s()
        self.window_text.setText(f"{begin_s:9.3f} to {end_s:.3f} s" if self.chart.frozen else "")
        self._show_cursors()

    def _on_cursors_changed(self, shown: bool) -> None:
        self.cursors.show(shown)
        self.channels.set_cursors_shown(shown)
        self._share_room()
        self._show_cursors()

    def _share_room(self) -> None:
        """Give the channels what they need and the image the rest."""
        beside = self.split.orientation() is Qt.Orientation.Horizontal
        needed = self.channels.sizeHint().width() if beside else 1
        self.split.setSizes([max(1, self.split.width() - needed), needed])

    def _show_cursors(self) -> None:
        model = self.channels.channels
        for column, values in enumerate(self.cursors.readings(), start=1):
            model.set_values(column, values)
        if self.cursors.shown:
            self.window_text.setText(self.cursors.text())

    def _on_reset_requested(self, channel: str) -> None:
        self._asking.ask(lambda: self._daqco.reset_limit(channel), self._on_reset)

    def _on_reset(self, _result: object, error: CosmicError | None) -> None:
        if error is not None:
            self.problem.set_text(str(error))

    @override
    def sizeHint(self) -> QSize:
        return QSize(110 * STEP_PX, 50 * STEP_PX)


def _shown_rate_hz(wanted_hz: float, screen: QScreen | None) -> float:
    """Return `wanted_hz`, or what the screen can show; some screens do not know and say 0."""
    most = screen.refreshRate() if screen is not None else USUAL_HZ
    return min(wanted_hz, most if most > 1.0 else USUAL_HZ)
