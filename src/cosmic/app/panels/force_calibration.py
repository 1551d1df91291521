"""The dialog that leads a person through a calibration of the force against known weights."""

from typing import Final

from PySide6.QtCore import Qt, QTimer
from PySide6.QtWidgets import QFormLayout, QLabel, QLineEdit, QProgressBar, QVBoxLayout, QWidget

from cosmic.autonomy.calibrating.force_scale import (
    CalibrationProblem,
    ForceCalibration,
    ForceScaleResult,
    RestingForce,
    weight,
)
from cosmic.autonomy.handling.force import ForceWatch
from cosmic.daqco.api.daqco import Daqco
from cosmic.daqco.gui.dialog import FieldDialog
from cosmic.daqco.gui.value_field import ValueField
from cosmic.frame.clock import WALL
from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.build import named, push_button, tipped
from cosmic.frame.gui.theme import STEP_PX, State, state_look

LOOK_MS: Final = 50
LONGEST_LOOKS: Final = 600
"""A reading without samples ends after so many looks."""


class ForceCalibrationDialog(FieldDialog):
    """Asks for weights, then for one load after the other; only "Use" changes the scale.

    Parameters
    ----------
    daqco : Daqco
        Of this computer.
    channel : str
        The one that is calibrated.
    """

    def __init__(self, daqco: Daqco, channel: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWindowTitle(f"Calibrate {channel}")
        self._daqco, self._channel = daqco, channel
        self._watch = ForceWatch(daqco, channel, WALL)
        self._watch.open()
        self._calibration: ForceCalibration | None = None
        self._resting: RestingForce | None = None
        self._looks = 0
        self.found: ForceScaleResult | None = None
        self.weights = named(
            tipped(QLineEdit("1, 2, 5"), "Masses of the weights, mg, with a comma between"),
            "calibrationWeights",
        )
        self.expanded = ValueField("Expanded uncertainty of the masses, k = 2", "%")
        self.expanded.set_value(1.0)
        self.start = named(push_button("Start", "Begin with these weights"), "calibrationStart")
        self.instruction = named(QLabel(), "calibrationInstruction")
        self.read = named(push_button("Read", "Read the force as it is now"), "calibrationRead")
        self.undo = named(push_button("Take back", "Take the last reading back"), "calibrationUndo")
        self.use = named(
            push_button("Use this scale", "Put the scale of the channel right"), "calibrationUse"
        )
        self.bar = QProgressBar()
        self.message = named(QLabel(), "calibrationMessage")
        for label in (self.instruction, self.message):
            label.setWordWrap(True)
            label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
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
        self.setMinimumWidth(48 * STEP_PX)

    def _connect(self) -> None:
        self.start.clicked.connect(self._on_start)
        self.read.clicked.connect(self._on_read)
        self.undo.clicked.connect(self._on_undo)
        self.use.clicked.connect(self._on_use)
        self._timer.timeout.connect(self._look)
        self.finished.connect(self._on_finished)

    # What its buttons do

    def _on_start(self) -> None:
        try:
            masses = [float(each) for each in self.weights.text().split(",")]
            percent = self.expanded.value()
            loads = [weight(each, 0.0 if percent is None else percent) for each in masses]
            self._calibration = ForceCalibration(loads)
        except ValueError:
            self._say(
                "give masses in milligrams with a comma between, such as 1, 2, 5", refused=True
            )
            return
        except CosmicError as exc:
            self._say(str(exc), refused=True)
            return
        self.found = None
        self._say("")
        self._show()

    def _on_read(self) -> None:
        chunk = self._daqco.latest_chunk
        if chunk is None:
            self._say("nothing is acquired: start the acquisition, and read again", refused=True)
            return
        self._resting, self._looks = RestingForce(self._watch, chunk.end_time_s), 0
        self._say("reading: do not touch anything")
        self._timer.start()
        self._show()

    def _look(self) -> None:
        self._looks += 1
        taken = None if self._resting is None else self._resting.taken()
        if taken is None and self._looks < LONGEST_LOOKS:
            return
        self._timer.stop()
        self._resting = None
        self._take(taken)
        self._show()

    def _take(self, taken: tuple[float, float] | None) -> None:
        calibration = self._calibration
        if calibration is None or taken is None:
            self._say(f"no samples come: {self._watch.problem}", refused=True)
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
        if self.found is None:
            return
        before = self._daqco.scales[self._channel]
        after = self.found.applied_to(before)
        try:
            self._daqco.set_scale(self._channel, after)
        except CosmicError as exc:
            self._say(str(exc), refused=True)
            return
        numbers = ", ".join(f"{each:.6g}" for each in after.coefficients)
        self._say(
            f"In force until the program ends. To keep it, write into the platform file, scale "
            f"{before.name!r}: coefficients = [{numbers}]; and into recipes, under "
            f"[parameters.push.fit]: gain_std_part = {self.found.gain_std_part:.4f}"
        )
        self.found = None
        self._show()

    def _on_finished(self) -> None:
        self._timer.stop()
        self._watch.close()

    # What it shows

    def _show(self) -> None:
        calibration, reading = self._calibration, self._resting is not None
        begun = calibration is not None
        self.instruction.setText(calibration.instruction if calibration is not None else "")
        self.read.setEnabled(begun and not reading and not (calibration and calibration.done))
        self.undo.setEnabled(calibration is not None and bool(calibration.readings) and not reading)
        self.use.setEnabled(self.found is not None)
        self.start.setEnabled(not reading)
        self.bar.setMaximum(calibration.count if calibration is not None else 1)
        self.bar.setValue(len(calibration.readings) if calibration is not None else 0)

    def _say(self, text: str, *, refused: bool = False) -> None:
        glyph = f"{state_look(State.REFUSED).glyph} " if refused else ""
        self.message.setText(f"{glyph}{text}")
