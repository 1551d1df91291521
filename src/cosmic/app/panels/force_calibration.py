"""The dialog that leads a person through a calibration of the force against known weights."""

from collections.abc import Callable
from typing import Final

from PySide6.QtCore import Qt, QTimer
from PySide6.QtWidgets import QFormLayout, QLabel, QLineEdit, QProgressBar, QVBoxLayout, QWidget

from cosmic.autonomy.calibrating.force_scale import (
    CalibrationProblem,
    ForceCalibration,
    ForceScaleResult,
    Reach,
    RestingForce,
    weight,
)
from cosmic.autonomy.handling.force import ForceWatch
from cosmic.daqco.api.daqco import Daqco
from cosmic.daqco.core.scale import Scale
from cosmic.daqco.gui.dialog import FieldDialog
from cosmic.daqco.gui.value_field import ValueField
from cosmic.frame.clock import WALL
from cosmic.frame.errors import CosmicError, QuantityError
from cosmic.frame.gui.build import named, push_button, styled, tipped
from cosmic.frame.gui.key_focus import set_usable
from cosmic.frame.gui.number_edit import read_number
from cosmic.frame.gui.theme import STEP_PX, State, state_look

LOOK_MS: Final = 50
LONGEST_LOOKS: Final = 600
"""A reading without samples ends after so many looks."""

LINES: Final = 6
"""Of text that there is room for, so that nothing moves when it changes."""

_START_TIP: Final = "Begin with these weights"
MASSES: Final = "give masses in milligrams with a comma between, such as 0.5, 1, 2"


def masses_of(text: str) -> list[float]:
    """Return the masses that were typed, with a comma between.

    Raises
    ------
    QuantityError
        One of them is no number; the text says what to do.
    """
    parts = [each.strip() for each in text.split(",")]
    while parts and not parts[-1]:
        parts.pop()
    if not parts:
        raise QuantityError(MASSES)
    try:
        return [read_number(each) for each in parts]
    except QuantityError as exc:
        raise QuantityError(f"{exc}: {MASSES}") from None


class ForceCalibrationDialog(FieldDialog):
    """Asks for weights, then for one load after the other; only "Use" changes the scale.

    Parameters
    ----------
    daqco : Daqco
        Of this computer.
    channel : str
        The one that is calibrated.
    running : callable, optional
        Names what measures with the scale just now; "" where nothing does.
    reach : Reach, optional
        No weight may be heavier.
    name : str, optional
        Of the new scale; that of the one before if None.
    """

    def __init__(
        self,
        daqco: Daqco,
        channel: str,
        parent: QWidget | None = None,
        *,
        running: Callable[[], str] = str,
        reach: Reach | None = None,
        name: str | None = None,
    ) -> None:
        super().__init__(parent)
        self.setWindowTitle(f"Calibrate {channel}")
        self._daqco, self._channel, self._running = daqco, channel, running
        self._reach, self._name = reach, name
        self._watch = ForceWatch(daqco, channel, WALL)
        self._watch.open()
        self._calibration: ForceCalibration | None = None
        self._before: Scale | None = None
        self._resting: RestingForce | None = None
        self._looks = 0
        self.found: ForceScaleResult | None = None
        self.weights = named(
            tipped(QLineEdit("1, 2, 5"), "Masses of the weights, mg, such as 0.5, 1, 2"),
            "calibrationWeights",
        )
        self.expanded = ValueField("Expanded uncertainty of the masses, k = 2", "%")
        self.expanded.set_value(1.0)
        self.start = named(push_button("Start", _START_TIP), "calibrationStart")
        self.instruction = named(QLabel(), "calibrationInstruction")
        self.read = named(push_button("Read", "Read the force as it is now"), "calibrationRead")
        self.undo = named(push_button("Take back", "Take the last reading back"), "calibrationUndo")
        self.use = named(
            push_button("Use this scale", "Put the scale of the channel right"), "calibrationUse"
        )
        self.bar = styled(QProgressBar(), "bar")
        self.bar.setTextVisible(False)
        self.message = named(QLabel(), "calibrationMessage")
        for label in (self.instruction, self.message):
            label.setWordWrap(True)
            label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
            label.setAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop)
        self.instruction.setMinimumHeight(2 * self.instruction.fontMetrics().lineSpacing())
        self.message.setMinimumHeight(LINES * self.message.fontMetrics().lineSpacing())
        self._timer = QTimer(self, interval=LOOK_MS)
        self._arrange()
        self._connect()
        self._show()

    def _arrange(self) -> None:
        form = QFormLayout()
        form.setVerticalSpacing(STEP_PX)
        form.addRow("Weights, mg", self.weights)
        form.addRow("Uncertainty", self.expanded)
        column = QVBoxLayout(self)
        column.setSpacing(STEP_PX)
        column.addLayout(form)
        for widget in (
            self.start,
            self.instruction,
            self.bar,
            self.read,
            self.undo,
            self.message,
            self.use,
        ):
            column.addWidget(widget)
        self.setMinimumWidth(60 * STEP_PX)

    def _connect(self) -> None:
        self.start.clicked.connect(self._on_start)
        self.read.clicked.connect(self._on_read)
        self.undo.clicked.connect(self._on_undo)
        self.use.clicked.connect(self._on_use)
        self._timer.timeout.connect(self._look)
        self.finished.connect(self._on_finished)

    # What its buttons do

    def _on_start(self) -> None:
        if self._calibration is not None:
            self._drop("the readings were dropped")
            return
        if not self.expanded.take():
            self._say(f"uncertainty of the masses: {self.expanded.reason}", refused=True)
            return
        try:
            masses = masses_of(self.weights.text())
            loads = [weight(each, self.expanded.value()) for each in masses]
            self._calibration = ForceCalibration(loads, reach=self._reach)
        except CosmicError as exc:
            self._say(str(exc), refused=True)
            return
        self._before = self._daqco.scales[self._channel]
        self.found = None
        listed = ", ".join(f"{each:g} mg" for each in sorted(masses))
        self._say(f"{listed}: {self._calibration.count} readings")
        self._show()
        self.read.setFocus()

    def _drop(self, why: str, *, refused: bool = False) -> None:
        """Begin anew, with nothing read."""
        self._calibration = self.found = self._before = None
        self._say(why, refused=refused)
        self._show()

    def _changed(self) -> bool:
        """Drop the readings, and say so, where the scale is another one than at the start."""
        if self._daqco.scales.get(self._channel) == self._before:
            return False
        self._drop(
            f"the scale of {self._channel} was changed meanwhile, such as by Tare: readings of "
            "before and after do not fit together. Nothing was changed here: start anew",
            refused=True,
        )
        return True

    def _on_read(self) -> None:
        chunk = self._daqco.latest_chunk
        if chunk is None or not self._daqco.running:
            self._say("nothing is acquired: start the acquisition, and read again", refused=True)
            return
        if self._changed():
            return
        self._resting, self._looks = RestingForce(self._watch, chunk.end_time_s), 0
        self._say("reading: do not touch anything")
        self._timer.start()
        self._show()

    def _look(self) -> None:
        self._looks += 1
        taken = None if self._resting is None else self._resting.taken()
        if taken is None and self._looks < LONGEST_LOOKS and self._daqco.running:
            return
        self._timer.stop()
        self._resting = None
        self._take(taken)
        self._show()
        if self.read.isEnabled() and self.focusWidget() in (None, self):
            self.read.setFocus()

    def _take(self, taken: tuple[float, float] | None) -> None:
        calibration = self._calibration
        if calibration is None or taken is None:
            why = self._watch.problem if self._daqco.running else "the acquisition was stopped"
            self._say(f"no samples come: {why}. Read again when they do", refused=True)
            return
        if self._changed():
            return
        try:
            calibration.take(*taken)
            self._say(f"{taken[0]:+.3f} µN")
            if calibration.done:
                self.found = calibration.result()
                self._say(self.found.words)
        except CalibrationProblem as exc:
            self._say(str(exc), refused=True)

    def _on_undo(self) -> None:
        if self._calibration is not None:
            self._calibration.undo()
            self.found = None
            self._say("")
            self._show()

    def _on_use(self) -> None:
        before = self._before
        if self.found is None or before is None or self._changed():
            return
        if what := self._running():
            self._say(f"{what} measures with this scale: end it first", refused=True)
            return
        after = self.found.applied_to(before)
        own = Scale(self._name or after.name, after.unit, after.coefficients)
        try:
            self._daqco.set_scale(self._channel, own)
        except CosmicError as exc:
            self._say(str(exc), refused=True)
            return
        numbers = ", ".join(f"{each:.6g}" for each in own.coefficients)
        self._drop(
            f"In force until the program ends. To keep it, write into the platform file, scale "
            f"{own.name!r} of {self._channel}: coefficients = [{numbers}]; and into recipes, under "
            f"[parameters.push.fit]: gain_std_part = {self.found.gain_std_part:.4f}"
        )

    def _on_finished(self) -> None:
        self._timer.stop()
        self._watch.close()

    # What it shows

    def _show(self) -> None:
        calibration, reading = self._calibration, self._resting is not None
        begun = calibration is not None
        count = calibration.count if calibration is not None else 1
        taken = len(calibration.readings) if calibration is not None else 0
        asked = calibration.instruction if calibration is not None else ""
        self.instruction.setText(f"{taken + 1} of {count}: {asked}" if asked else "")
        self.start.setText("Start anew" if begun else "Start")
        tip = "Drop these readings, and begin with other weights" if begun else _START_TIP
        self.start.setToolTip(tip)
        for widget, usable in (
            (self.weights, not begun),
            (self.expanded, not begun),
            (self.start, not reading),
            (self.read, begun and not reading and taken < count),
            (self.undo, taken > 0 and not reading),
            (self.use, self.found is not None),
        ):
            set_usable(widget, self, usable=usable)
        self.bar.setMaximum(count)
        self.bar.setValue(taken)

    def _say(self, text: str, *, refused: bool = False) -> None:
        glyph = f"{state_look(State.REFUSED).glyph} " if refused else ""
        self.message.setText(f"{glyph}{text}")
