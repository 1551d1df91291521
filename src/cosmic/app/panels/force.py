"""The column FORCE: the value, how far it is from its limit, its curve, and the recording."""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Final, TypeVar

from PySide6.QtCore import QSize, Qt, QTimer, Signal
from PySide6.QtGui import QAction, QActionGroup
from PySide6.QtWidgets import (
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QMenu,
    QPushButton,
    QSizePolicy,
    QStackedWidget,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from cosmic.app.panels.calculated import CalculatedCurve, Calculation
from cosmic.app.panels.force_analysis import LowPass, RecentValues, SpectrumCurve
from cosmic.app.panels.force_calibration import ForceCalibrationDialog
from cosmic.app.panels.force_curves import AXIS_PX, LimitBar, PositionCurve
from cosmic.autonomy.calibrating.force_scale import reach_of
from cosmic.daqco.api.daqco import Daqco, DaqLimit
from cosmic.daqco.api.files import NamedFile
from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.gui.asking import Asking
from cosmic.daqco.gui.limit_dialog import LimitDialog
from cosmic.daqco.gui.limit_indicator import distance, sides_text
from cosmic.daqco.gui.plot.chart import Chart, Trace
from cosmic.daqco.gui.plot.inbox import ChunkInbox
from cosmic.daqco.gui.plot.unit_ranges import UnitRanges
from cosmic.daqco.gui.plot.units import display_unit
from cosmic.frame.clock import WALL
from cosmic.frame.errors import ConfigError, CosmicError
from cosmic.frame.file_names import NameOption
from cosmic.frame.gui.amounts import clock_text
from cosmic.frame.gui.beside import open_beside
from cosmic.frame.gui.build import click_once, named, push_button, styled, tight_row, tipped
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.relay import Relay
from cosmic.frame.gui.theme import STEP_PX, State, number_font, state_look
from cosmic.frame.overrides import override
from cosmic.mico.gui.mico_widget import MicoWidget

T = TypeVar("T")

READOUT_MS: Final = 100
CHART_MS: Final = 33
OLD_S: Final = 1.0
REFUSAL_MS: Final = 12_000
"""So long a refusal is shown."""
MEAN_S: Final = 0.1
VALUE_PX: Final = 26
SPAN_S: Final = 10.0
TARE_SHARE: Final = 0.25
"""Of the limit: a load beyond it is no zero, and Tare refuses it."""
LOW_PX: Final = 20 * STEP_PX
"""Below this height an axis has three numbers only."""
BEFORE_S: Final = 3.0
FILTERS_HZ: Final = (100.0, 30.0, 10.0, 3.0, 1.0)
_ANALYSIS_LOOKS: Final = 5
"""Statistics and spectrum are made anew at each so many read-outs."""
FORMULA_TIP: Final = (
    "A formula of channels, numbers, + - * /, abs() and sqrt(); Enter draws it, an empty line ends "
    "it. It is shown and not recorded: the channels are"
)


class ForcePanel(QWidget):
    """Everything about the force that a hand on the tool needs; GUI thread.

    Parameters
    ----------
    daqco : Daqco
        The application.
    gui : MicoWidget
        Whose axes the curve is drawn over.
    folder : callable
        Returns the folder of this session's files.
    running : callable, optional
        Names the campaign or procedure that runs; "" where none does.

    Signals
    -------
    written(Path)
        A recording was closed.
    """

    written = Signal(object)

    def __init__(
        self,
        daqco: Daqco,
        gui: MicoWidget,
        folder: Callable[[], Path],
        parent: QWidget | None = None,
        *,
        running: Callable[[], str] = str,
    ) -> None:
        super().__init__(parent)
        self.setObjectName("forcePanel")
        self._daqco, self._gui, self._folder = daqco, gui, folder
        self._running = running
        self._inbox = ChunkInbox()
        self._ranges = UnitRanges()
        self._key: object = None
        self._channel = ""
        self._heard_s: float | None = None
        self._recent: deque[float] = deque(maxlen=max(1, round(MEAN_S * 1000.0)))
        self._recording = False
        self._said = ""
        self._refused = QTimer(self, interval=REFUSAL_MS, singleShot=True)
        self._refused.timeout.connect(self._on_refusal_read)
        self._filter: LowPass | None = None
        self._window = RecentValues()
        self._looks = 0
        self._make_widgets()
        self._arrange()
        self._asking = Asking(daqco, self)
        self._relay = Relay(self._on_changed).follow(daqco.on_change)
        self._relay.keep(daqco.follow(self._inbox.put))
        self._look = QTimer(self, interval=READOUT_MS)
        self._look.timeout.connect(self.read_out)
        self._look.start()
        self._draw = QTimer(self, timerType=Qt.TimerType.PreciseTimer, interval=CHART_MS)
        self._draw.timeout.connect(self.refresh)
        self._draw.start()
        self._on_changed()

    # Putting it together

    def _make_widgets(self) -> None:
        self.title = named(ElidedLabel("FORCE"), "forceTitle")
        self.value = named(QLabel("–"), "forceValue")
        self.value.setFont(number_font(VALUE_PX, bold=True))
        self.value.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        self.value.setMinimumWidth(self.value.fontMetrics().horizontalAdvance("-180.0") + 2)
        self.unit = QLabel("")
        self.unit.setProperty("role", "dim")
        self.bar = LimitBar()
        self.limit = named(ElidedLabel(), "forceLimit")
        self.limit.setFont(number_font(11))
        self.arm = styled(
            named(push_button("Limit…", "Set, arm or disarm the limit"), "arm"), "narrow"
        )
        self.arm.clicked.connect(self._on_limit)
        self._make_curves()
        self.statistics = named(ElidedLabel(), "forceStatistics")
        self.statistics.setFont(number_font(11))
        self.statistics.hide()
        self.formula = named(tipped(QLineEdit(), FORMULA_TIP), "forceFormula")
        self.formula.setPlaceholderText("force - 2 * spare")
        self.formula.returnPressed.connect(lambda: self.calculate(self.formula.text()))
        self.formula.hide()
        self._make_menu()
        self.by_time = self._curve_button("over time", 0)
        self.by_position = self._curve_button("over position", 1)
        self.by_time.setChecked(True)
        self.name = named(tipped(QLineEdit("push"), "Name of the recording"), "recordName")
        self.note = named(tipped(QLineEdit(), "Note kept in the recording"), "recordNote")
        self.note.setPlaceholderText("note")
        self.record = named(push_button("● Record", ""), "recordForce")
        self.record.setCheckable(True)
        click_once(self.record)
        self.record.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)
        self.record.clicked.connect(self._on_record)
        self.tare = styled(
            named(push_button("Tare", "Set the present force to zero"), "tare"), "narrow"
        )
        self.tare.clicked.connect(self.take_zero)
        self.mark = styled(named(push_button("Mark", "Write a mark (Ctrl+M)"), "mark"), "narrow")
        self.mark.setShortcut("Ctrl+M")
        self.mark.clicked.connect(self._on_mark)
        self.message = named(ElidedLabel(), "forceMessage")

    def _make_curves(self) -> None:
        self.chart = Chart()
        self.chart.setMinimumSize(18 * STEP_PX, 9 * STEP_PX)
        self.over = PositionCurve()
        self.over.setMinimumSize(18 * STEP_PX, 9 * STEP_PX)
        self.curves = QStackedWidget()
        self.curves.addWidget(self.chart)
        self.curves.addWidget(self.over)
        self.spectrum = SpectrumCurve(AXIS_PX)
        self.curves.addWidget(self.spectrum)
        self.calculated = CalculatedCurve()
        self.calculated.setMinimumSize(18 * STEP_PX, 9 * STEP_PX)
        self.curves.addWidget(self.calculated)

    def _make_menu(self) -> None:
        self.more = styled(
            named(
                tipped(QToolButton(), "Filter, statistics, spectrum, calculated channel"), "more"
            ),
            "tool menu",
        )
        self.more.setFixedWidth(3 * STEP_PX)
        self.more.setText("⋯")
        self.more.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        menu = QMenu(self.more)
        self.before = QAction(f"Record also the {BEFORE_S:g} s before", menu)
        self.numbers = QAction("Statistics of the last 10 s", menu)
        for action in (self.before, self.numbers):
            action.setCheckable(True)
            menu.addAction(action)
        self.numbers.toggled.connect(self.statistics.setVisible)
        menu.addSeparator()
        spectrum = menu.addAction("Spectrum")
        spectrum.triggered.connect(self._on_spectrum)
        weights = menu.addAction("Calibrate with weights…")
        weights.triggered.connect(self._on_calibrate)
        calculated = menu.addAction("Calculated channel…")
        calculated.triggered.connect(self._on_calculated)
        filters = menu.addMenu("Filter what is shown")
        self.filters = QActionGroup(filters)
        for cut_hz in (0.0, *FILTERS_HZ):
            action = filters.addAction(f"below {cut_hz:g} Hz" if cut_hz else "none")
            action.setCheckable(True)
            action.setChecked(not cut_hz)
            action.setData(cut_hz)
            self.filters.addAction(action)
        self.filters.triggered.connect(self._on_filter)
        self.more.setMenu(menu)

    def _on_filter(self, action: QAction) -> None:
        cut_hz = float(action.data())
        self._filter = LowPass(cut_hz) if cut_hz else None

    def _on_spectrum(self) -> None:
        self._show_curve(self.spectrum)

    def _show_curve(self, curve: QWidget) -> None:
        """Show a curve that has no button of its own."""
        for button in (self.by_time, self.by_position):
            button.setAutoExclusive(False)
            button.setChecked(False)
            button.setAutoExclusive(True)
        self.curves.setCurrentWidget(curve)

    def _on_calculated(self) -> None:
        self.formula.show()
        self.formula.setFocus()
        self.formula.selectAll()

    def calculate(self, formula: str) -> None:
        """Draw what a formula gives of the channels; an empty one: the force again."""
        if not formula.strip():
            self.calculated.calculation = None
            self.formula.hide()
            self.statistics.setVisible(self.numbers.isChecked())
            self.by_time.click()
            return
        try:
            found = Calculation(formula)
        except ConfigError as exc:
            self._say(str(exc), refused=True)
            return
        missing = found.missing(tuple(self._daqco.channels))
        if missing:
            self._say(missing, refused=True)
            return
        self._say("")
        self.formula.setText(found.formula)
        self.formula.show()
        self.calculated.calculate(found, self._daqco.rate_hz, SPAN_S)
        self.statistics.show()
        self._show_curve(self.calculated)

    def _show_analysis(self) -> None:
        """Show statistics and spectrum, where they are seen."""
        self._looks = (self._looks + 1) % _ANALYSIS_LOOKS
        if self._looks or not self.isVisible():
            return
        if self.curves.currentWidget() is self.calculated:
            value = self.calculated.newest
            shown = "–" if value is None else f"{value:.4g}"
            self.statistics.set_text(f"{self.formula.text()} = {shown}")
            return
        self.statistics.setVisible(self.numbers.isChecked())
        if self.numbers.isChecked():
            found = self._window.statistics()
            if found is None:
                self.statistics.set_text("too little was measured")
            else:
                self.statistics.set_text(
                    f"{found.seconds:.0f} s: mean {found.mean:.2f}  sd {found.deviation:.3f}  "
                    f"{found.low:.1f} to {found.high:.1f}"
                )
        if self.curves.currentWidget() is self.spectrum:
            spectrum = self._window.spectrum()
            if spectrum is not None:
                self.spectrum.show_spectrum(*spectrum)

    def _curve_button(self, text: str, page: int) -> QPushButton:
        button = styled(push_button(text, f"Force {text}"), "narrow")
        button.setCheckable(True)
        button.setAutoExclusive(True)
        button.clicked.connect(lambda: self.curves.setCurrentIndex(page))
        return button

    def _arrange(self) -> None:
        head, row = tight_row(STEP_PX // 2)
        row.addWidget(self.title, 1)
        row.addWidget(self.value)
        row.addWidget(self.unit)
        limit, row = tight_row(STEP_PX // 2)
        row.addWidget(self.limit, 1)
        row.addWidget(self.arm)
        which = QWidget()
        row = QHBoxLayout(which)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(0)
        row.addWidget(self.by_time, 1)
        row.addWidget(self.by_position, 1)
        row.addWidget(self.more)
        buttons, row = tight_row(STEP_PX // 2)
        row.addWidget(self.record, 1)
        row.addWidget(self.mark)
        row.addWidget(self.tare)
        names, row = tight_row(STEP_PX // 2)
        row.addWidget(self.name, 1)
        row.addWidget(self.note, 1)
        for field in (self.name, self.note):
            field.setMinimumWidth(6 * STEP_PX)
        column = QVBoxLayout(self)
        column.setContentsMargins(STEP_PX, STEP_PX // 2, STEP_PX, STEP_PX // 2)
        column.setSpacing(STEP_PX // 2)
        for widget in (head, self.bar, limit, which, self.formula):
            column.addWidget(widget)
        column.addWidget(self.curves, 1)
        column.addWidget(self.statistics)
        for widget in (names, buttons, self.message):
            column.addWidget(widget)

    # What is shown

    @property
    def channel(self) -> str:
        """The channel that is shown: the first with a limit, else the first."""
        return self._channel

    @property
    def force(self) -> float | None:
        """The newest value; None where it is not measured now."""
        return self._recent[-1] if self._recent and not self._age_s() else None

    def _age_s(self) -> float:
        """Return how old the newest sample is, 0 while samples come."""
        if self._heard_s is None:
            return math.inf
        age_s = WALL.now_s() - self._heard_s
        return 0.0 if self._daqco.running and age_s <= OLD_S else age_s

    def _limit_in_force(self) -> DaqLimit | None:
        limits = self._daqco.limits
        return next((each for each in limits if each.settings.channel == self._channel), None)

    def _on_changed(self) -> None:
        daqco = self._daqco
        channels, limits = daqco.channels, daqco.limits
        limited = [each.settings.channel for each in limits if each.settings.channel in channels]
        self._channel = next(iter([*limited, *channels]), "")
        calculation = self.calculated.calculation
        if calculation is not None and self.calculated.rate_hz != daqco.rate_hz:
            self.calculated.calculate(calculation, daqco.rate_hz, SPAN_S)
        key = (self._channel, daqco.rate_hz, daqco.scales.get(self._channel))
        if key != self._key and self._channel:
            self._key = key
            settings = next(e for e in daqco.settings.channel if e.name == self._channel)
            unit = daqco.units.get(self._channel, "")
            self._ranges = UnitRanges()
            self._ranges.add([settings], daqco.settings.scales())
            self.chart.begin([Trace(self._channel, unit, settings.colour)], daqco.rate_hz)
            self.chart.set_span(SPAN_S)
            self._show_ranges()
            self.over.name_force(display_unit(unit))
            self.spectrum.name_force(display_unit(unit))
            self._window = RecentValues()
            self.title.set_text(self._channel.upper())
            self.unit.setText(display_unit(unit))
        self._show_recording()
        self.read_out()

    def refresh(self) -> None:
        """Draw what has come since the last time."""
        taken = self._inbox.take()
        self.calculated.feed_from(taken)
        mine = [self._own(chunk) for chunk in taken if self._channel in chunk.channels]
        if not mine:
            return
        self._heard_s = WALL.now_s()
        for chunk in mine:
            self._window.add(chunk)
        if self._filter is not None:
            mine = [self._filter.apply(chunk) for chunk in mine]
        for chunk in mine:
            self._recent.extend(chunk.values[0].tolist())
        self.chart.feed(mine)
        seen = self.isVisible() and self.curves.currentIndex() == 0
        if seen and self._ranges.fit(self.chart.traces, self.chart.visible_columns()):
            self._show_ranges()
        self._add_point()

    def _show_ranges(self) -> None:
        """Have as many lines as can be told apart in the height there is."""
        shown = self._ranges.shown(self.chart.traces)
        if self.chart.height() < LOW_PX:
            shown = {
                unit: replace(each, step=(each.high - each.low) / 2.0)
                for unit, each in shown.items()
            }
        self.chart.set_ranges(shown)

    def _own(self, chunk: DataChunk) -> DataChunk:
        """Return what a chunk has of the channel shown."""
        row = chunk.channels.index(self._channel)
        return replace(
            chunk,
            channels=(self._channel,),
            volts=chunk.volts[row : row + 1],
            scales=(chunk.scales[row],),
        )

    def _add_point(self) -> None:
        force = self._mean()
        moving = next((each for each in self._gui.mico if each.details.in_motion), None)
        if force is None or moving is None:
            return
        state = moving.details
        if state.shown_position is not None:
            self.over.add(state.name, display_unit(state.unit), state.shown_position, force)

    def _mean(self) -> float | None:
        return sum(self._recent) / len(self._recent) if self._recent else None

    def read_out(self) -> None:
        """Show the value, its limit and how far it is from it."""
        age_s, value = self._age_s(), self._mean()
        fresh = age_s == 0.0 and value is not None
        self.value.setText("–" if value is None else f"{value:.1f}")
        self.value.setEnabled(fresh)
        if not fresh:
            old = f", {age_s:.0f} s old" if math.isfinite(age_s) else ""
            self.value.setToolTip(f"Not measured now{old}")
            self.title.set_text(f"{self._channel.upper()} not measured{old}")
        elif "not measured" in self.title.text():
            self.value.setToolTip("")
            self.title.set_text(self._channel.upper())
        limit = self._limit_in_force()
        low = limit.settings.low if limit is not None else None
        high = limit.settings.high if limit is not None else None
        armed = limit is not None and limit.settings.armed
        self.bar.show_value(value if fresh else None, low, high, armed=armed)
        self.limit.set_text(*self._limit_words(limit, value if fresh else None))
        if self._recording:
            self._show_recording()
        self._show_analysis()

    def _limit_words(self, limit: DaqLimit | None, value: float | None) -> tuple[str, ...]:
        """Return what is said of the limit, and shorter, for a narrow window."""
        unit = display_unit(self._daqco.units.get(self._channel, ""))
        if limit is None:
            return ("▲ no limit",)
        sides = sides_text(limit.settings.low, limit.settings.high)
        if limit.crossed:
            beyond = sides.removeprefix("up to ").removeprefix("down to ")
            return f"■ crossed {beyond} {unit}", "■ crossed"
        if not limit.settings.armed:
            return f"▲ DISARMED {sides} {unit}", "▲ DISARMED"
        if value is None:
            return f"ARMED {sides} {unit}", f"ARMED {sides}", sides
        left = f"{distance(limit, value):.0f} to go"
        return f"ARMED {sides}, {left}", f"{sides}, {left}", left

    # Commands

    def _on_limit(self) -> None:
        dialog = LimitDialog(self._daqco, self._channel, self)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        open_beside(dialog)

    def _on_calibrate(self) -> None:
        if self._daqco.remote:
            self._say("calibrate where the boards are", refused=True)
            return
        try:
            reach = reach_of(self._daqco, self._channel)
        except CosmicError as exc:
            self._say(str(exc), refused=True)
            return
        if self._is_measuring():
            return
        dialog = ForceCalibrationDialog(
            self._daqco,
            self._channel,
            self,
            running=self._running,
            reach=reach,
            name=self._daqco.own_scale_name(self._channel),
        )
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        open_beside(dialog)

    def _is_measuring(self) -> bool:
        """Tell whether something runs whose forces are read by this scale, and say so."""
        what = self._running()
        if what:
            text = f"{what} measures with this scale: end it first"
            self._say(text, f"{what} measures: end it first", "end what runs first", refused=True)
        return bool(what)

    def take_zero(self) -> None:
        """Call the present force zero, by another scale; refused while the sensor is loaded."""
        value, limit = self._mean(), self._limit_in_force()
        if not self._daqco.running:
            self._say("start the acquisition first", refused=True)
            return
        if self._is_measuring():
            return
        if limit is not None and limit.settings.armed:
            text = "the armed limit watches this zero: disarm it first, by Limit…"
            self._say(
                text, "disarm the limit first: Limit…", "disarm it first: Limit…", refused=True
            )
            return
        if value is None or self._age_s():
            text = "the last force value is too old: wait for the next one"
            self._say(text, "the force value is too old: wait", refused=True)
            return
        sides = (limit.settings.low, limit.settings.high) if limit is not None else ()
        least = min((abs(each) for each in sides if each is not None), default=math.inf)
        if abs(value) > TARE_SHARE * least:
            text = f"{value:.0f} is a load, not zero: take the tool off the fibre first"
            self._say(text, f"{value:.0f} is a load: take the tool off", refused=True)
            return
        channel = self._channel
        self._ask(lambda: self._daqco.tare(channel), f"zero moved by {value:.1f}")

    def _ask(self, action: Callable[[], T], said: str, *, slow: bool = False) -> None:
        def done(_result: T | None, error: CosmicError | None) -> None:
            self._say(str(error) if error is not None else said, refused=error is not None)
            self._on_changed()

        self._asking.ask(action, done, slow=slow)

    def _say(self, text: str, *shorter: str, refused: bool = False) -> None:
        """Show a line, or what of `shorter` has room; after a refusal again what was before."""
        if refused:
            glyph = state_look(State.REFUSED).glyph
            self.message.set_text(*(f"{glyph} {each}" for each in (text, *shorter)))
            self._refused.start()
            return
        self._refused.stop()
        self._said = text
        self.message.set_text(text)

    def _on_refusal_read(self) -> None:
        self._say(self._said)

    # Recording

    def _on_record(self) -> None:
        self.record.setChecked(self._recording)  # the recorder decides
        if self._daqco.recording.active:
            path = self._daqco.recording.path

            def closed(_result: object, error: CosmicError | None) -> None:
                self._say(str(error) if error else f"written: {path.name if path else ''}")
                if error is None and path is not None:
                    self.written.emit(path)

            self._asking.ask(self._daqco.stop_recording, closed, slow=True)
            return
        when = datetime.now().astimezone()
        try:
            folder = self._daqco.directory if self._daqco.remote else self._folder()
        except OSError as exc:
            self._say(str(exc), refused=True)
            return
        base = self.name.text()
        self._asking.ask(
            lambda: self._daqco.name_recording(base, NameOption.TIME, folder, when), self._on_named
        )

    def _on_named(self, found: NamedFile | None, error: CosmicError | None) -> None:
        if found is None:
            self._say(str(error), refused=True)
            return
        note = self.note.text().strip()
        before_s = BEFORE_S if self.before.isChecked() else 0.0

        def begin() -> None:
            self._daqco.start_recording(found.path, before_s=before_s)
            if note:
                self._daqco.mark(f"note: {note}")

        self._ask(begin, f"recording {found.path.name}")

    def _on_mark(self) -> None:
        text = self.note.text().strip() or "mark"
        self._ask(lambda: self._daqco.mark(text), f"marked: {text}")

    def _show_recording(self) -> None:
        recording = self._daqco.recording
        self._recording = recording.active
        self.record.setChecked(recording.active)
        text = f"■ Stop {clock_text(recording.duration_s)}" if recording.active else "● Record"
        if self.record.text() != text:
            self.record.setText(text)
        usable = recording.active or self._daqco.running
        self.record.setEnabled(usable)
        tip = (
            "Record what is acquired, under this name" if usable else "Start the acquisition first"
        )
        self.record.setToolTip("Stop recording and close the file" if recording.active else tip)
        self.mark.setEnabled(recording.active)

    @override
    def sizeHint(self) -> QSize:
        return QSize(30 * STEP_PX, 50 * STEP_PX)
