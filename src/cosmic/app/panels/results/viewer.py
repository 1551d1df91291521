"""The viewer: force, positions, image, scene and log of a recording at one moment."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from PySide6.QtCore import Qt, QTimer, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import (
    QComboBox,
    QHBoxLayout,
    QHeaderView,
    QLabel,
    QPushButton,
    QSlider,
    QSplitter,
    QTreeWidget,
    QTreeWidgetItem,
    QVBoxLayout,
    QWidget,
)

from cosmic.app.panels.results.curves import TIME, ResultCurves
from cosmic.app.panels.results.pictures import ResultPictures
from cosmic.app.results.timeline import Timeline
from cosmic.daqco.core.curves import FEWEST_SAMPLES
from cosmic.daqco.gui.plot.units import display_unit
from cosmic.frame.background import BackgroundJobs
from cosmic.frame.gui.amounts import duration_text
from cosmic.frame.gui.build import named, push_button, styled, tipped
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.theme import STEP_PX, number_font
from cosmic.frame.overrides import override
from cosmic.frame.units import with_micro_signs
from cosmic.mico.core.collision.model import SceneModel

PLAY_MS: Final = 40
STEPS: Final = 2000
"""Of the slider over the whole recording."""
_TIME: Final = Qt.ItemDataRole.UserRole


@dataclass(frozen=True, slots=True)
class Happening:
    """A mark of the recording or a line of the log."""

    time_s: float
    word: str
    text: str


class ResultViewer(QWidget):
    """Shows one recording, with others to compare; one moment of it everywhere; GUI thread.

    Parameters
    ----------
    jobs : BackgroundJobs
        Where images are read.
    model : callable
        Returns the bodies of the platform; None without any.

    Signals
    -------
    export_requested()
        What is seen is to be written.
    report_requested()
        The report of the recording is wanted.
    """

    export_requested = Signal()
    report_requested = Signal()

    def __init__(
        self,
        jobs: BackgroundJobs,
        model: Callable[[], SceneModel | None],
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self.setObjectName("resultViewer")
        self._timelines: tuple[Timeline, ...] = ()
        self._happenings: tuple[Happening, ...] = ()
        self._after_s = 0.0
        self.pictures = ResultPictures(jobs, model)
        self.curves = ResultCurves()
        self.curves.moved.connect(self._show_slope)
        self.curves.time_chosen.connect(self.show_moment)
        self._make_widgets()
        self._arrange()
        self._play = QTimer(self, timerType=Qt.TimerType.PreciseTimer, interval=PLAY_MS)
        self._play.timeout.connect(self._on_play)
        self.show_timelines(())

    def _make_widgets(self) -> None:
        self.facts = named(ElidedLabel(), "resultsFacts")
        self.slope = named(QLabel(), "resultsSlope")
        self.slope.setFont(number_font())
        self.slope.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.moment = named(ElidedLabel(), "resultsMoment")
        self.moment.setFont(number_font())
        self.channel = named(tipped(QComboBox(), "Which channel is drawn"), "resultsChannel")
        self.channel.activated.connect(self._redraw)
        self.across = named(
            tipped(QComboBox(), "What lies along the horizontal axis"), "resultsAcross"
        )
        self.across.activated.connect(self._redraw)
        self.play = self._button("▶ Play", "Play from the moment shown (Space)", "resultsPlay")
        self.play.setCheckable(True)
        self.play.toggled.connect(self._on_play_toggled)
        self.fibres = self._button("Fibres", "Find the fibres on the image shown", "resultsFibres")
        self.fibres.setCheckable(True)
        self.fibres.toggled.connect(self.pictures.set_finding)
        self.near = self._button("Zoom", "Show what lies between the cursors", "resultsZoom")
        self.near.clicked.connect(self.curves.zoom_to_cursors)
        self.whole = self._button("All", "Show all of the recording", "resultsWhole")
        self.whole.clicked.connect(self.curves.show_all)
        tip = "Write what is seen: an image of it, and the values between the cursors"
        self.export = self._button("Export", tip, "resultsExport")
        self.export.clicked.connect(self.export_requested)
        tip = "Open the report of this recording: force, what happened, sample and operator"
        self.report = self._button("Report", tip, "resultsReport")
        self.report.clicked.connect(self.report_requested)
        self.slider = named(QSlider(Qt.Orientation.Horizontal), "resultsSlider")
        self.slider.setRange(0, STEPS)
        self.slider.setSingleStep(STEPS // 200)
        self.slider.setPageStep(STEPS // 20)
        self.slider.setToolTip("The moment shown")
        self.slider.valueChanged.connect(self._on_slider)
        self.log = named(QTreeWidget(), "resultsLog")
        self.log.setHeaderLabels(["s", "What happened"])
        self.log.setRootIsDecorated(False)
        self.log.header().setSectionResizeMode(0, QHeaderView.ResizeMode.ResizeToContents)
        self.log.setMinimumWidth(18 * STEP_PX)
        self.log.itemClicked.connect(self._on_line)

    @staticmethod
    def _button(text: str, tip: str, name: str) -> QPushButton:
        return styled(named(push_button(text, tip), name), "narrow")

    def _arrange(self) -> None:
        self._upper = QSplitter(Qt.Orientation.Horizontal)
        self._upper.addWidget(self.pictures)
        self._upper.addWidget(self.log)
        self._upper.setStretchFactor(0, 3)
        self._upper.setStretchFactor(1, 1)
        self._upper.setChildrenCollapsible(False)
        self._upper.setSizes([3000, 1000])
        self.split = QSplitter(Qt.Orientation.Vertical)
        self.split.addWidget(self._upper)
        self.split.addWidget(self.curves)
        self.split.setStretchFactor(0, 1)
        self.split.setStretchFactor(1, 1)
        self.split.setChildrenCollapsible(False)
        self.split.setSizes([1000, 1000])
        self.curves.setMinimumHeight(14 * STEP_PX)
        row = QHBoxLayout()
        row.setSpacing(STEP_PX // 2)
        for each in (self.play, self.slider):
            row.addWidget(each, 1 if each is self.slider else 0)
        second = QHBoxLayout()
        second.setSpacing(STEP_PX // 2)
        second.addWidget(self.channel)
        self._over = QLabel("over")
        self._over.setProperty("role", "dim")
        second.addWidget(self._over)
        second.addWidget(self.across)
        for each in (self.near, self.whole, self.fibres, self.export, self.report):
            second.addWidget(each)
        second.addWidget(self.moment, 1)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(STEP_PX // 2)
        column.addWidget(self.facts)
        column.addWidget(self.split, 1)
        column.addLayout(row)
        column.addLayout(second)
        column.addWidget(self.slope)
        # What is left below where neither image nor curve is shown; nothing beside them.
        column.addStretch(0)

    # What is shown

    @property
    def timelines(self) -> tuple[Timeline, ...]:
        """The recording shown, then those it is compared with."""
        return self._timelines

    @property
    def after_s(self) -> float:
        """The moment shown, in seconds after the start."""
        return self._after_s

    def show_timelines(self, timelines: Sequence[Timeline]) -> None:
        """Show a recording, and compare it with others; the same one as before has grown."""
        before = self._timelines
        self._timelines = tuple(timelines)
        same = [each.path for each in before] == [each.path for each in timelines]
        first = timelines[0] if timelines else None
        self._fill(self.channel, [each.name for each in first.forces] if first else [])
        axes = [each.name for each in first.moved] if first and first.forces else []
        self._fill(self.across, [TIME, *axes])
        self.pictures.set_film(first.films[0] if first and first.films else None)
        self.pictures.set_scene_shown(bool(first and first.positions))
        pictured = bool(first and (first.films or first.positions))
        self.pictures.setVisible(pictured)
        curved = bool(first and (first.forces or first.moved))
        self.curves.setVisible(curved)
        self._happenings = _happenings(first) if first else ()
        above = pictured or bool(self._happenings)
        self._upper.setVisible(above)
        self.split.setVisible(above or curved)
        self._fill_log()
        self._show_facts()
        self._redraw(keep=same)
        follows = same and bool(before) and self._at_end(before[0]) and not timelines[0].complete
        self.show_moment(timelines[0].end_s if follows else self._after_s if same else 0.0)
        self._show_controls()

    def _at_end(self, timeline: Timeline) -> bool:
        return self._after_s >= timeline.end_s - timeline.start_s - 1e-3

    @staticmethod
    def _fill(box: QComboBox, texts: list[str]) -> None:
        chosen = box.currentText()
        if texts == [box.itemText(row) for row in range(box.count())]:
            return
        box.clear()
        box.addItems(texts)
        if chosen in texts:
            box.setCurrentText(chosen)

    def _redraw(self, _index: int = 0, *, keep: bool = False) -> None:
        self.curves.show_timelines(
            self._timelines, self.channel.currentText(), self.across.currentText(), keep=keep
        )
        self._show_slope()
        self.show_moment(self._after_s)

    def _show_facts(self) -> None:
        if not self._timelines:
            self.facts.set_text("Choose a recording; Record in Measure makes one")
            return
        first = self._timelines[0]
        words = [f"{first.path.stem}: {duration_text(first.end_s - first.start_s)}"]
        if first.rate_hz and first.forces:
            words.append(f"{first.rate_hz:g} Hz")
        if not first.complete:
            words.append("not closed: it is still written, or ended early")
        words += [each.text for each in first.marks if each.text.startswith("note:")][:1]
        if len(self._timelines) > 1:
            others = ", ".join(each.path.stem for each in self._timelines[1:])
            words.append(f"compared with {others}")
        self.facts.set_text(", ".join(words))

    def _show_controls(self) -> None:
        first = self._timelines[0] if self._timelines else None
        long = first is not None and first.end_s > first.start_s
        self.play.setEnabled(long)
        self.slider.setEnabled(long)
        forces = bool(first and first.forces)
        for button in (self.near, self.whole, self.report):
            button.setVisible(forces)
        for each in (self.channel, self.across, self._over):
            each.setVisible(forces)
        self.fibres.setVisible(bool(first and first.films))
        for shown in (self.play, self.slider, self.export):
            shown.setVisible(first is not None)
        self.log.setVisible(bool(self._happenings))

    # The moment

    def show_moment(self, after_s: float) -> None:
        """Show a moment, in seconds after the start; the nearest one that was recorded."""
        if not self._timelines:
            self.moment.set_text("")
            return
        first = self._timelines[0]
        length_s = first.end_s - first.start_s
        self._after_s = min(max(0.0, after_s), length_s)
        now_s = first.start_s + self._after_s
        self.slider.blockSignals(True)
        self.slider.setValue(round(STEPS * self._after_s / length_s) if length_s > 0.0 else 0)
        self.slider.blockSignals(False)
        force = next((e for e in first.forces if e.name == self.channel.currentText()), None)
        value = force.at(now_s) if force is not None else float("nan")
        across = next((e for e in first.positions if e.name == self.curves.across), None)
        there = across.at(now_s) if across is not None else self._after_s
        known = bool(np.isfinite(value) and np.isfinite(there))
        self.curves.show_moment(self._after_s, (there, value) if known else None)
        self.pictures.show_moment(now_s, first.poses_at(now_s))
        words = [f"{self._after_s:.2f} s"]
        if np.isfinite(value) and force is not None:
            words.append(f"{force.name} {value:.2f} {display_unit(force.unit)}")
        words += [
            f"{each.name} {each.at(now_s):.1f} {display_unit(each.unit)}"
            for each in first.moved[:3]
            if np.isfinite(each.at(now_s))
        ]
        self.moment.set_text(",  ".join(words))
        self._show_line(now_s)

    def _on_slider(self, value: int) -> None:
        if self._timelines:
            length_s = self._timelines[0].end_s - self._timelines[0].start_s
            self.show_moment(length_s * value / STEPS)

    def _on_play_toggled(self, on: bool) -> None:
        self.play.setText("❚❚ Pause" if on else "▶ Play")
        if on and self._timelines and self._at_end(self._timelines[0]):
            self.show_moment(0.0)
        if on:
            self._play.start()
        else:
            self._play.stop()

    def _on_play(self) -> None:
        self.show_moment(self._after_s + PLAY_MS / 1000.0)
        if not self._timelines or self._at_end(self._timelines[0]) or not self.isVisible():
            self.play.setChecked(False)

    @override
    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() == Qt.Key.Key_Space and self.play.isEnabled():
            self.play.toggle()
            return
        super().keyPressEvent(event)

    # Marks and log

    def _fill_log(self) -> None:
        self.log.clear()
        start_s = self._timelines[0].start_s if self._timelines else 0.0
        for each in self._happenings:
            item = QTreeWidgetItem([f"{each.time_s - start_s:.1f}", each.text])
            item.setToolTip(1, f"{each.word}: {each.text}")
            item.setData(0, _TIME, each.time_s - start_s)
            self.log.addTopLevelItem(item)

    def _show_line(self, now_s: float) -> None:
        """Choose the line that was the newest at that moment."""
        times = [each.time_s for each in self._happenings]
        row = int(np.searchsorted(times, now_s, side="right")) - 1
        item = self.log.topLevelItem(row) if row >= 0 else None
        if item is not None and item is not self.log.currentItem():
            self.log.setCurrentItem(item)

    def _on_line(self, item: QTreeWidgetItem) -> None:
        self.show_moment(float(item.data(0, _TIME)))

    # Cursors

    def _show_slope(self) -> None:
        texts = []
        over, (low, high) = self.curves.unit_across, self.curves.region
        for number, (name, _, _, _) in enumerate(self.curves.lines):
            line = self.curves.slope(number)
            _, what = self.curves.between(number)
            if what.size < FEWEST_SAMPLES:
                continue
            slope = f"slope {line.text}" if line is not None else "no slope, it stood still"
            unit = self.curves.unit
            of = f"{name}: " if len(self.curves.lines) > 1 else ""
            texts.append(
                f"{of}{slope}   "
                f"difference {float(what[-1] - what[0]):.2f} {unit}   "
                f"mean {float(what.mean()):.2f} {unit}"
            )
        if texts:
            texts[0] = f"between the cursors, {high - low:.3f} {over}: {texts[0]}"
        self.slope.setText("\n".join(texts))

    def between_cursors(self) -> list[tuple[str, np.ndarray, np.ndarray]]:
        """Return name, where and what of every curve between the cursors."""
        return [
            (name, *self.curves.between(number))
            for number, (name, _, _, _) in enumerate(self.curves.lines)
        ]

    @property
    def path(self) -> Path | None:
        """The recording shown; None without any."""
        return self._timelines[0].path if self._timelines else None


def _happenings(timeline: Timeline) -> tuple[Happening, ...]:
    """Return marks and lines of the log in the order in which they came."""
    found = [
        Happening(each.time_s, each.kind, with_micro_signs(each.text)) for each in timeline.marks
    ]
    found += [
        Happening(each.time_s, each.where, with_micro_signs(each.text)) for each in timeline.log
    ]
    return tuple(sorted(found, key=lambda each: each.time_s))
