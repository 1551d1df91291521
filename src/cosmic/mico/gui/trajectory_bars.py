"""The bars of the trajectory panel: recording, running, and the question where to start."""

from collections.abc import Sequence
from typing import Final

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QDoubleSpinBox,
    QLabel,
    QProgressBar,
    QSpinBox,
    QVBoxLayout,
    QWidget,
)

from cosmic.frame.gui.build import named, push_button, tight_row, tipped
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.flow_layout import FlowLayout
from cosmic.frame.gui.theme import STEP_PX, number_font
from cosmic.mico.api.trajectory_player import SPEEDS
from cosmic.mico.api.trajectory_state import PlayProgress, PlayState

SOURCES: Final[dict[str, tuple[str, ...] | None]] = {
    "everything": None,
    "window and keys": ("window", "key", "click"),
    "gamepad": ("teleoperation",),
    "console and scripts": ("console", "script"),
}
NO_POSE: Final = "no pose"
_MOST_LOOPS: Final = 9999


class RecordBar(QWidget):
    """What is recorded, and how.

    Signals
    -------
    record_requested(), stop_requested()
        The operator pressed the button.
    """

    record_requested = Signal()
    stop_requested = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.button = named(push_button("Record…", "Record every movement to a file"), "record")
        self.source = tipped(QComboBox(), "Axes whose movements are recorded")
        self.source.addItems(list(SOURCES))
        self.timed = tipped(QCheckBox("With timing"), "Record start times and jog speeds")
        self.timed.setChecked(True)
        self.pose = tipped(QComboBox(), "Named pose that recorded positions count from")
        self.message = ElidedLabel()
        self.message.setFont(number_font())
        self.message.hide()
        self._recording = False
        row, flow = QWidget(), FlowLayout(STEP_PX)
        row.setLayout(flow)
        for widget in (self.button, self.source, self.timed, QLabel("counted from"), self.pose):
            flow.addWidget(widget)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(STEP_PX // 2)
        column.addWidget(row)
        column.addWidget(self.message)
        self.button.clicked.connect(self._on_clicked)
        self.set_poses([])

    @property
    def sources(self) -> tuple[str, ...] | None:
        """Whose movements are wanted; None: everybody's."""
        return SOURCES[self.source.currentText()]

    @property
    def relative_to(self) -> str:
        """The pose that positions count from; empty for none."""
        return "" if self.pose.currentIndex() <= 0 else self.pose.currentText()

    def set_poses(self, names: Sequence[str]) -> None:
        """Offer these poses."""
        chosen = self.relative_to
        self.pose.clear()
        self.pose.addItems([NO_POSE, *names])
        if chosen in names:
            self.pose.setCurrentText(chosen)

    def show_recording(self, text: str, *, recording: bool) -> None:
        """Show whether something is recorded, and what to say of it."""
        self._recording = recording
        self.button.setText("Stop recording" if recording else "Record…")
        for widget in (self.source, self.timed, self.pose):
            widget.setEnabled(not recording)
        self.message.set_text(text)
        self.message.setVisible(bool(text))

    def _on_clicked(self) -> None:
        (self.stop_requested if self._recording else self.record_requested).emit()


class StartQuestion(QWidget):
    """Asks what to do where the axes do not stand where a trajectory begins.

    Signals
    -------
    chosen(str)
        "straight" or "detour".
    """

    chosen = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.words = named(QLabel(), "startWords")
        self.words.setTextFormat(Qt.TextFormat.PlainText)
        self.words.setWordWrap(True)
        self.straight = named(
            push_button("Go there straight", "All axes together; the gate decides"), "goStraight"
        )
        self.around = named(push_button("Plan a path", "Plan a path around obstacles"), "goDetour")
        self.leave = named(push_button("Leave it", "Nothing moves"), "leaveStart")
        row, beside = tight_row(STEP_PX)
        beside.addStretch(1)
        for button in (self.straight, self.around, self.leave):
            beside.addWidget(button)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(STEP_PX // 2)
        column.addWidget(self.words)
        column.addWidget(row)
        self.straight.clicked.connect(lambda: self._choose("straight"))
        self.around.clicked.connect(lambda: self._choose("detour"))
        self.leave.clicked.connect(self.hide)
        self.hide()

    def ask(self, why: str, *, has_model: bool) -> None:
        """Show the question."""
        self.words.setText(f"{why.partition('; go there first')[0]}.")
        self.around.setVisible(has_model)
        self.show()

    def _choose(self, mode: str) -> None:
        self.hide()
        self.chosen.emit(mode)


class RunBar(QWidget):
    """Run, pause, step, loop, speed, progress and time left.

    Signals
    -------
    run_requested(), pause_requested(), step_requested(), cancel_requested()
        The operator pressed a button.
    speed_changed(float)
        The operator wants another speed.
    """

    run_requested = Signal()
    pause_requested = Signal()
    step_requested = Signal()
    cancel_requested = Signal()
    speed_changed = Signal(float)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.run = named(push_button("Run", "Rehearse, then run the trajectory"), "runTrajectory")
        self.pause = named(push_button("Pause", "After the current line"), "pause")
        self.step = named(push_button("Step", "Run one line, then pause"), "step")
        self.cancel = named(push_button("Cancel", "End it now and stop its axes"), "cancelRun")
        self.loops = tipped(QSpinBox(), "Number of repetitions; 0: until paused or cancelled")
        self.loops.setRange(0, _MOST_LOOPS)
        self.loops.setValue(1)
        self.loops.setSuffix(" ×")
        self.loops.setSpecialValueText("for ever")
        self.speed = tipped(QDoubleSpinBox(), "Speed factor; waits are not scaled")
        self.speed.setRange(*SPEEDS)
        self.speed.setDecimals(2)
        self.speed.setSingleStep(0.25)
        self.speed.setValue(1.0)
        self.speed.setPrefix("speed ")
        self.progress = named(QProgressBar(), "trajectoryProgress")
        self.progress.setAccessibleName("Progress of the trajectory")
        self.left = ElidedLabel()
        self.left.setFont(number_font())
        self._arrange()
        self.run.clicked.connect(self.run_requested)
        self.pause.clicked.connect(self.pause_requested)
        self.step.clicked.connect(self.step_requested)
        self.cancel.clicked.connect(self.cancel_requested)
        self.speed.valueChanged.connect(self.speed_changed)
        self.show_state(None, ready=False)

    def _arrange(self) -> None:
        row, flow = QWidget(), FlowLayout(STEP_PX)
        row.setLayout(flow)
        for widget in (self.run, self.pause, self.step, self.cancel, self.loops, self.speed):
            flow.addWidget(widget)
        below, under = tight_row(STEP_PX)
        under.addWidget(self.progress, 2)
        under.addWidget(self.left, 3)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(STEP_PX // 2)
        column.addWidget(row)
        column.addWidget(below)

    @property
    def wanted_loops(self) -> int | None:
        """How many times; None: for ever."""
        return self.loops.value() or None

    def show_state(self, progress: PlayProgress | None, *, ready: bool) -> None:
        """Show how far a player is; None without one."""
        state = progress.state if progress is not None else PlayState.READY
        running = state is PlayState.RUNNING
        resumable = state in (PlayState.PAUSED, PlayState.FAILED)
        self.run.setText("Resume" if resumable else "Run")
        self.run.setEnabled(ready and not running)
        self.step.setEnabled(ready and not running)
        self.pause.setEnabled(running)
        self.cancel.setEnabled(running or resumable)
        self.loops.setEnabled(not running)
        self.progress.setValue(round(100 * progress.fraction) if progress is not None else 0)
        self.left.set_text(_words(progress) if progress is not None else "")


def _words(progress: PlayProgress) -> str:
    parts = [str(progress.state)]
    if progress.loops != 1:
        of = "" if progress.loops is None else f" of {progress.loops}"
        parts.append(f"pass {progress.loop}{of}")
    if progress.line:
        parts.append(f"line {progress.line}")
    if progress.left_s is not None and progress.state is not PlayState.ENDED:
        parts.append(f"{progress.left_s:.1f} s left")
    return ", ".join(parts)
