"""The panel "Control": choose what to hold and by which axis, start, watch, stop."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import pyqtgraph as pg
from PySide6.QtCore import Qt, QTimer
from PySide6.QtGui import QCloseEvent, QHideEvent, QShowEvent
from PySide6.QtWidgets import (
    QComboBox,
    QFormLayout,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from cosmic.app.panels.curve_frame import CurveFrame
from cosmic.app.rig import Rig
from cosmic.autonomy.control.control import Control
from cosmic.autonomy.control.handle import ControlHandle
from cosmic.autonomy.control.law import ControlState
from cosmic.autonomy.control.pid import PidGains
from cosmic.autonomy.control.trace import ControlTrace
from cosmic.daqco.gui.plot.units import display_unit
from cosmic.daqco.gui.value_field import ValueField
from cosmic.frame.errors import CosmicError, NotAvailable
from cosmic.frame.gui.build import named, push_button, tipped
from cosmic.frame.gui.chip import Chip
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.palette import OKABE_ITO, Palette
from cosmic.frame.gui.state_badge import StateBadge
from cosmic.frame.gui.theme import STEP_PX, State, number_font
from cosmic.frame.overrides import override

SPAN_S: Final = 10.0
_AXIS_PX: Final = 56
_WIDTH: Final = 2
_MOST_POINTS: Final = 1000
_VALUE: Final = OKABE_ITO["orange"]
_OUTPUT: Final = OKABE_ITO["sky blue"]


class ControlPlot(CurveFrame):
    """Draws a `ControlTrace`; GUI thread."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(_AXIS_PX, parent)
        self.value_box, self._value_axis = self._add_field("value", share=3)
        self.output_box, self._output_axis = self._add_field("output", share=2)
        for box in (self.value_box, self.output_box):
            box.setXRange(-SPAN_S, 0.0, padding=0.0)
            box.enableAutoRange(y=True)
        self._add_axis_below("time before now, s")
        self.value, self.set_point = pg.PlotCurveItem(), pg.PlotCurveItem()
        self.output = pg.PlotCurveItem()
        for box, curve in (
            (self.value_box, self.value),
            (self.value_box, self.set_point),
            (self.output_box, self.output),
        ):
            box.addItem(curve)
        self._units = ("", "")
        self.setMinimumSize(30 * STEP_PX, 20 * STEP_PX)
        self._restyle()

    def set_units(self, unit: str, axis_unit: str) -> None:
        """Write the units of value and axis at the axes."""
        if (unit, axis_unit) != self._units:
            self._units = (unit, axis_unit)
            shown, axis_shown = display_unit(unit), display_unit(axis_unit)
            self._names[self._value_axis] = f"value, {shown}" if shown else "value"
            self._names[self._output_axis] = f"output, {axis_shown}/s" if axis_shown else "output"
            self._restyle()

    def show_trace(self, trace: ControlTrace) -> None:
        """Draw a trace; its end is now."""
        if not trace.wall_s.size:
            self.clear()
            return
        every = slice(None, None, 1 + trace.wall_s.size // _MOST_POINTS)
        before_s = (trace.wall_s - trace.wall_s[-1])[every]
        self.value.setData(before_s, trace.measured[every])
        self.set_point.setData(before_s, trace.set_point[every])
        self.output.setData(before_s, trace.output[every])

    def clear(self) -> None:
        """Draw nothing."""
        for curve in (self.value, self.set_point, self.output):
            curve.setData([], [])

    @override
    def _colour(self, palette: Palette) -> None:
        self.value.setPen(pg.mkPen(_VALUE, width=_WIDTH))
        self.output.setPen(pg.mkPen(_OUTPUT, width=_WIDTH))
        # The set point is the text's colour and dashed: told apart without colour, too.
        self.set_point.setPen(pg.mkPen(palette.text, width=1, style=Qt.PenStyle.DashLine))


PERIOD_MS: Final = 50
_FORCE: Final = "uN"
_SET_POINT_UN: Final = 50.0
_USUAL_AXIS: Final = "probe.y"
_PACE: Final = (
    "Median period, 99th percentile, jitter (99th percentile), "
    "periods missed, moves sent to the axis"
)


@dataclass(frozen=True, slots=True)
class ControlRequest:
    """What the fields say."""

    channel: str
    axis: str
    set_point: float
    direction: int
    limit: float | None
    travel: float
    gain: float | None


class ControlForm(QWidget):
    """The fields of a loop that holds a force."""

    def __init__(self, control: Control, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._control = control
        self.channel = tipped(named(QComboBox(), "controlChannel"), "Controlled channel")
        self.axis = tipped(named(QComboBox(), "controlAxis"), "Axis that moves")
        self.direction = named(QComboBox(), "controlDirection")
        tipped(self.direction, "Direction of the axis that increases the force")
        self.direction.addItem("force rises forward (+)", 1)
        self.direction.addItem("force rises backward (-)", -1)
        self.set_point = _field("Force to hold", _FORCE, _SET_POINT_UN, "controlSetPoint")
        self.limit = named(
            ValueField("Force limit that ends the loop", _FORCE, empty=True), "controlLimit"
        )
        self.travel = _field(
            "Largest travel in either direction", "um", control.settings.travel_um, "controlTravel"
        )
        self.gain = named(ValueField("Gain kp", "µm/s/µN", empty=True), "controlGain")
        self.limit.setPlaceholderText("as configured")
        self.gain.setPlaceholderText("by stiffness")
        form = QFormLayout(self)
        form.setContentsMargins(0, 0, 0, 0)
        form.setSpacing(STEP_PX // 2)
        for text, widget in (
            ("Channel", self.channel),
            ("Axis", self.axis),
            ("Direction", self.direction),
            ("Setpoint", self.set_point),
            ("Limit", self.limit),
            ("Travel", self.travel),
            ("Gain", self.gain),
        ):
            form.addRow(text, widget)
        self.reload()
        self.axis.setCurrentText(_USUAL_AXIS)
        self.direction.setCurrentIndex(1)

    def reload(self) -> None:
        """Offer the channels and axes there are now."""
        control = self._control
        for box, units, unit in (
            (self.channel, control.channels, _FORCE),
            (self.axis, control.axes, "um"),
        ):
            names = [name for name, its_unit in units.items() if its_unit == unit]
            if names != [box.itemText(place) for place in range(box.count())]:
                chosen = box.currentText()
                box.clear()
                box.addItems(names)
                box.setCurrentText(chosen)

    def request(self) -> ControlRequest | None:
        """Return what the fields say; None where one of them says nothing that makes sense."""
        fields = (self.set_point, self.limit, self.travel, self.gain)
        taken = [each.take() for each in fields]  # all of them, so that each says what is wrong
        if not all(taken):
            return None
        return ControlRequest(
            channel=self.channel.currentText(),
            axis=self.axis.currentText(),
            set_point=self.set_point.value(),
            direction=int(self.direction.currentData()),
            limit=self.limit.optional(),
            travel=self.travel.value(),
            gain=self.gain.optional(),
        )

    def set_running(self, running: bool) -> None:
        """Leave only the set point to be changed while a loop runs."""
        for each in (self.channel, self.axis, self.direction, self.limit, self.travel, self.gain):
            each.setEnabled(not running)


class ControlPanel(QWidget):
    """Starts a loop that holds a force, shows it, and ends it; GUI thread.

    A loop begun elsewhere is shown as well. Closing the panel ends the one it began.

    Parameters
    ----------
    control : Control
        Whose loops they are.
    busy : callable
        Says why nothing is moved by hand now; empty where nothing speaks against it.
    """

    def __init__(
        self, control: Control, parent: QWidget | None = None, *, busy: Callable[[], str] = str
    ) -> None:
        super().__init__(parent)
        self.setObjectName("ControlPanel")
        self._busy = busy
        self._control = control
        self._mine: ControlHandle | None = None
        self._shown: ControlHandle | None = None
        self.form = ControlForm(control)
        self.start = named(push_button("Hold", "Approach, then hold the force"), "controlStart")
        self.stop = named(push_button("End", "End the loop; the axis stops"), "controlStop")
        self.aim = named(push_button("Change", "Apply the new setpoint"), "controlAim")
        self.badge = StateBadge(State.UNKNOWN)
        self.state = Chip("no loop", tip="State of the loop")
        self.reason = named(ElidedLabel(), "controlReason")
        self.readout = named(QLabel("value -"), "controlReadout")
        self.pace = named(ElidedLabel("period -", hint=_PACE), "controlPace")
        self.plot = ControlPlot()
        self._build()
        self.start.clicked.connect(self._on_start)
        self.stop.clicked.connect(self._on_stop)
        self.aim.clicked.connect(self._on_aim)
        self._timer = QTimer(self, interval=PERIOD_MS)
        self._timer.timeout.connect(self.refresh)
        self.badge.hide()
        self.refresh()

    def _build(self) -> None:
        for label in (self.readout, self.pace):
            label.setFont(number_font())
        self.pace.setProperty("role", "dim")
        buttons = _row(self.start, self.aim, self.stop)
        left = QVBoxLayout()
        left.setSpacing(STEP_PX)
        left.addWidget(self.form)
        left.addLayout(buttons)
        left.addStretch(1)
        status = _row(self.badge, self.state, self.readout)
        status.addStretch(1)
        right = QVBoxLayout()
        right.setSpacing(STEP_PX // 2)
        right.addLayout(status)
        right.addWidget(self.reason)
        right.addWidget(self.plot, 1)
        right.addWidget(self.pace)
        row = QHBoxLayout(self)
        row.setContentsMargins(STEP_PX, STEP_PX, STEP_PX, STEP_PX)
        row.setSpacing(STEP_PX)
        row.addLayout(left)
        row.addLayout(right, 1)

    # What the operator does

    def _on_start(self) -> None:
        asked = self.form.request()
        if asked is None:
            return
        try:
            if why := self._busy():
                raise NotAvailable(why)
            self._mine = self._control.hold_force(
                asked.channel,
                asked.axis,
                asked.set_point,
                direction=asked.direction,
                limit_un=asked.limit,
                travel_um=asked.travel,
                gains=None if asked.gain is None else PidGains(asked.gain),
            )
        except CosmicError as exc:
            self._shown = None
            self._show_refusal(str(exc))
            return
        self.refresh()

    def _on_aim(self) -> None:
        asked, handle = self.form.request(), self._control.newest
        if asked is None or handle is None:
            return
        try:
            handle.aim(asked.set_point)
        except CosmicError as exc:
            self.form.set_point.refuse(str(exc))

    def _on_stop(self) -> None:
        handle = self._control.newest
        if handle is not None:
            handle.stop()
        self.refresh()

    def _show_refusal(self, text: str) -> None:
        self.badge.show()
        self.badge.set_state(State.REFUSED)
        self.state.setText("refused")
        self.reason.set_text(text)

    # Showing

    def refresh(self) -> None:
        """Show the loop begun last as it is now."""
        handle = self._control.newest
        running = handle is not None and handle.running
        self.start.setEnabled(not running)
        self.stop.setEnabled(running)
        self.aim.setEnabled(running)
        self.form.set_running(running)
        if handle is None or (handle is self._shown and not running):
            return
        self._shown = None if running else handle
        self._show(handle)

    def _show(self, handle: ControlHandle) -> None:
        self.badge.show()
        self.badge.set_state(_look(handle))
        self.state.setText(str(handle.state))
        self.reason.set_text(handle.reason or f"{handle.source} by {handle.axis}")
        self.readout.setText(_values(handle))
        self.pace.set_text(_pace(handle))
        self.plot.set_units(handle.unit, handle.axis_unit)
        self.plot.show_trace(handle.trace(SPAN_S))

    @override
    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        self._timer.start()
        self.form.reload()
        self.refresh()

    @override
    def hideEvent(self, event: QHideEvent) -> None:
        super().hideEvent(event)
        self._timer.stop()

    @override
    def closeEvent(self, event: QCloseEvent) -> None:
        self.end_mine()
        super().closeEvent(event)

    def end_mine(self) -> None:
        """End the loop that was begun here; for whoever closes the window."""
        if self._mine is not None:
            self._mine.stop()


def make_control_panel(
    rig: Rig | Control, parent: QWidget | None = None, *, busy: Callable[[], str] = str
) -> ControlPanel:
    """Return the panel for the loops of a rig."""
    return ControlPanel(rig.control if isinstance(rig, Rig) else rig, parent, busy=busy)


def _look(handle: ControlHandle) -> State:
    if handle.running:
        return State.OK if handle.state is ControlState.HOLDING else State.BUSY
    return State.UNKNOWN if handle.error is None else State.ERROR


def _values(handle: ControlHandle) -> str:
    reading, unit = handle.reading, display_unit(handle.unit)
    if not math.isfinite(reading.measured):
        return f"value - {unit}"
    text = f"{reading.measured:.1f} {unit} of {handle.set_point:.1f} {unit}"
    stiffness = handle.stiffness_un_um
    if stiffness is not None and handle.state in (ControlState.HOLDING, ControlState.RAMPING):
        text += f"   {stiffness:.2g} µN/µm"
    return text


def _pace(handle: ControlHandle) -> str:
    statistics = handle.statistics
    pace = statistics.pace
    if not pace.cycles:
        return "period -"
    text = (
        f"{1e3 * pace.period_p50_s:.2f} ms, p99 {1e3 * pace.period_p99_s:.2f}, "
        f"jitter {1e3 * pace.deviation_p99_s:.2f}, missed {pace.missed}/{pace.cycles}, "
        f"{statistics.packets} moves"
    )
    return f"{text}; {statistics.real_time}" if statistics.real_time else text


def _field(title: str, unit: str, value: float, name: str) -> ValueField:
    field = named(ValueField(title, unit), name)
    field.set_value(value)
    return field


def _row(*widgets: QPushButton | QWidget) -> QHBoxLayout:
    row = QHBoxLayout()
    row.setSpacing(STEP_PX)
    for widget in widgets:
        row.addWidget(widget)
    return row
