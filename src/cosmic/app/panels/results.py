"""Recordings that were made, newest first, and the curve of the one that is chosen."""

import logging
from collections.abc import Callable, Sequence
from datetime import datetime
from pathlib import Path
from typing import Final

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QHBoxLayout,
    QLabel,
    QSplitter,
    QTreeWidget,
    QTreeWidgetItem,
    QVBoxLayout,
    QWidget,
)

from cosmic.app.panels.curve_frame import CurveFrame
from cosmic.daqco.api.recording import Recording, open_recording
from cosmic.daqco.core.chunk import Values
from cosmic.daqco.gui.colours import readable
from cosmic.daqco.gui.plot.units import display_unit
from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.amounts import duration_text
from cosmic.frame.gui.build import named, push_button
from cosmic.frame.gui.log_panel import SearchField
from cosmic.frame.gui.palette import OKABE_ITO, Palette
from cosmic.frame.gui.theme import STEP_PX, number_font
from cosmic.frame.overrides import override

logger = logging.getLogger(__name__)

MOST_POINTS: Final = 4000
MOST_FILES: Final = 500
AXIS_PX: Final = 56
_PATH: Final = Qt.ItemDataRole.UserRole


def recordings_below(folders: Sequence[Path]) -> list[Path]:
    """Return the recordings in folders and in those just below them, newest first."""
    found: dict[Path, float] = {}
    for folder in folders:
        try:
            for pattern in ("*.h5", "*/*.h5"):
                found |= {file: file.stat().st_mtime for file in folder.glob(pattern)}
        except OSError as exc:
            logger.debug("%s cannot be listed: %s", folder, exc)
    return sorted(found, key=lambda file: found[file], reverse=True)[:MOST_FILES]


class ResultCurve(CurveFrame):
    """One channel over time, with two cursors that a hand moves."""

    moved = Signal()

    def __init__(self) -> None:
        super().__init__(AXIS_PX)
        box, self._left = self._add_field("")
        self._add_axis_below("time, s")
        self._curve = pg.PlotCurveItem()
        self.cursors = pg.LinearRegionItem(movable=True)
        self.cursors.sigRegionChanged.connect(self.moved)
        self.cursors.hide()
        for item in (self._curve, self.cursors):
            box.addItem(item)
        self._restyle()

    def show_curve(self, name: str, times: Values, values: Values) -> None:
        """Draw another curve, with the cursors at a third and two thirds of it."""
        self._names[self._left] = name
        self._curve.setData(times, values)
        self.cursors.setVisible(len(times) > 1)
        if len(times) > 1:
            third = float(times[-1] - times[0]) / 3.0
            self.cursors.setRegion((float(times[0]) + third, float(times[-1]) - third))
        self._restyle()

    @property
    def region(self) -> tuple[float, float]:
        """Times of the two cursors."""
        low, high = self.cursors.getRegion()
        return float(low), float(high)

    @override
    def _colour(self, palette: Palette) -> None:
        self._curve.setPen(pg.mkPen(readable(OKABE_ITO["orange"]), width=1.2))


class ResultsPanel(QWidget):
    """Lists recordings, draws one, and reads a slope between two cursors; GUI thread.

    Parameters
    ----------
    folders : callable
        Returns where recordings are looked for.
    """

    def __init__(
        self, folders: Callable[[], Sequence[Path]], parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        self.setObjectName("resultsPanel")
        self._folders = folders
        self._shown: Path | None = None
        self._times = self._values = np.empty(0)
        self._unit = ""
        self.search = named(SearchField(), "resultsSearch")
        self.search.setPlaceholderText("search by name")
        self.search.setToolTip("Show the recordings whose name holds this")
        self.search.textChanged.connect(self._narrow)
        self.again = named(push_button("Look again", "Look for recordings again"), "resultsAgain")
        self.again.clicked.connect(self.refresh)
        self.list = named(QTreeWidget(), "resultsList")
        self.list.setHeaderLabels(["Recording", "Made", "Size"])
        self.list.setRootIsDecorated(False)
        self.list.currentItemChanged.connect(self._on_chosen)
        self.curve = ResultCurve()
        self.curve.moved.connect(self._show_slope)
        self.facts, self.slope = QLabel("Choose a recording"), named(QLabel(), "resultsSlope")
        self.slope.setFont(number_font())
        self.facts.setWordWrap(True)
        self._arrange()

    def _arrange(self) -> None:
        left, right = QWidget(), QWidget()
        column = QVBoxLayout(left)
        column.setContentsMargins(0, 0, 0, 0)
        row = QHBoxLayout()
        row.addWidget(self.search, 1)
        row.addWidget(self.again)
        column.addLayout(row)
        column.addWidget(self.list, 1)
        column = QVBoxLayout(right)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self.facts)
        column.addWidget(self.curve, 1)
        column.addWidget(self.slope)
        split = QSplitter(Qt.Orientation.Horizontal)
        split.addWidget(left)
        split.addWidget(right)
        split.setStretchFactor(1, 1)
        split.setSizes([50 * STEP_PX, 90 * STEP_PX])
        whole = QVBoxLayout(self)
        whole.setContentsMargins(STEP_PX, STEP_PX, STEP_PX, STEP_PX)
        whole.addWidget(split)

    # The list

    def refresh(self) -> None:
        """Look for recordings again."""
        chosen = self._shown
        self.list.clear()
        for file in recordings_below(self._folders()):
            try:
                facts = file.stat()
            except OSError:
                continue
            made = datetime.fromtimestamp(facts.st_mtime).astimezone()
            size = f"{facts.st_size / 1e6:.1f} MB"
            item = QTreeWidgetItem([file.stem, f"{made:%Y-%m-%d %H:%M}", size])
            item.setData(0, _PATH, str(file))
            item.setToolTip(0, str(file))
            self.list.addTopLevelItem(item)
            if file == chosen:
                self.list.setCurrentItem(item)
        for column, width in enumerate((28, 16, 8)):
            self.list.setColumnWidth(column, width * STEP_PX)
        self._narrow()

    def _narrow(self) -> None:
        wanted = self.search.text().lower()
        for item in self._items():
            item.setHidden(wanted not in item.text(0).lower())

    def _items(self) -> list[QTreeWidgetItem]:
        found = (self.list.topLevelItem(row) for row in range(self.list.topLevelItemCount()))
        return [each for each in found if each is not None]

    def show_file(self, file: Path) -> None:
        """Choose a recording."""
        self.refresh()
        for item in self._items():
            if Path(item.data(0, _PATH)) == file:
                self.list.setCurrentItem(item)

    # The curve

    def _on_chosen(self, item: QTreeWidgetItem | None) -> None:
        if item is None:
            return
        self._shown = Path(item.data(0, _PATH))
        try:
            with open_recording(self._shown) as recording:
                self._show(recording)
        except (CosmicError, OSError) as exc:
            self.facts.setText(f"{self._shown.name} cannot be shown: {exc}")

    def _show(self, recording: Recording) -> None:
        channel = next(iter(recording.channels), "")
        times, values = recording.times(), recording.values(channel)
        step = max(1, len(values) // MOST_POINTS)
        self._times, self._values = np.asarray(times)[::step], np.asarray(values)[::step]
        self._unit = display_unit(recording.units.get(channel, ""))
        self.curve.show_curve(f"{channel}, {self._unit}", self._times, self._values)
        whole = "" if recording.complete else ", ended early"
        length = duration_text(len(values) / recording.rate_hz)
        notes = [each.text for each in recording.events if "note:" in each.text]
        note = f"\n{notes[0]}" if notes else ""
        self.facts.setText(
            f"{recording.path.name}: {length}, {recording.rate_hz:g} Hz{whole}{note}"
        )
        self._show_slope()

    def _show_slope(self) -> None:
        low, high = self.curve.region
        chosen = (self._times >= low) & (self._times <= high)
        if int(chosen.sum()) < 2:
            self.slope.setText("")
            return
        times, values = self._times[chosen], self._values[chosen]
        slope = float(np.polyfit(times, values, 1)[0])
        difference = float(values[-1] - values[0])
        self.slope.setText(
            f"between the cursors: {high - low:.3f} s   difference {difference:.2f} {self._unit}   "
            f"slope {slope:.3f} {self._unit}/s   mean {float(values.mean()):.2f} {self._unit}"
        )
