"""The steps of the initialisation sequence as a list, with what became of each."""

from collections.abc import Callable
from typing import Final

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QHBoxLayout,
    QLabel,
    QListWidget,
    QListWidgetItem,
    QVBoxLayout,
    QWidget,
)

from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.build import named, push_button, tight_row, tipped
from cosmic.frame.gui.theme import STEP_PX, State, state_look, ui_font
from cosmic.frame.operation import Task
from cosmic.frame.units import format_quantity
from cosmic.mico.api.initialisation import Asker
from cosmic.mico.api.mico import Mico
from cosmic.mico.core.motion.positioner import Confidence, PositionerState
from cosmic.mico.core.sequence.plan import plan_sequence
from cosmic.mico.core.sequence.report import SequenceReport, StepReport, StepState
from cosmic.mico.hw.interface import PositionerKind

_GLYPHS: Final = {
    StepState.WAITING: "○",
    StepState.RUNNING: state_look(State.BUSY).glyph,
    StepState.DONE: "✓",
    StepState.SKIPPED: "–",
    StepState.FAILED: state_look(State.ERROR).glyph,
}
_LOUD: Final = (StepState.RUNNING, StepState.FAILED)
_ROWS: Final = 6
_OPEN_UM: Final = 50.0
"""A gripper that is further open than a fibre is thick holds none."""
_START_TIP: Final = "Run these steps in order"


class InitialisationPanel(QWidget):
    """Shows the sequence, begins it, and asks what its steps ask; GUI thread.

    Signals
    -------
    refused(str)
        It could not be begun; the text says why.
    begun()
        It was begun.
    doubted(object)
        It was not begun, as something may be held or touched; a tuple of reasons.

    Attributes
    ----------
    doubt : callable
        Returns what speaks against it beside what the axes know; empty where nothing does.
    """

    refused = Signal(str)
    begun = Signal()
    doubted = Signal(object)

    def __init__(self, mico: Mico, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("initialisationPanel")
        self.doubt: Callable[[], str] = str
        self._mico = mico
        self._application = mico.application
        self._task: Task | None = None
        self._asker: Asker | None = None
        self._report = SequenceReport(())
        self._make_head()
        self._make_question()
        self._list = named(QListWidget(), "initialisationSteps")
        self._list.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self._list.setSelectionMode(QListWidget.SelectionMode.NoSelection)
        self._list.setAccessibleName("Steps of the initialisation")
        self._list.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self._list.setTextElideMode(Qt.TextElideMode.ElideRight)
        column = QVBoxLayout(self)
        column.setContentsMargins(STEP_PX, 0, STEP_PX, STEP_PX)
        column.setSpacing(STEP_PX // 2)
        column.addLayout(self._head)
        column.addWidget(self._question)
        column.addWidget(self._list, 1)
        self._application.initialisation_changed.connect(self._on_changed)
        self.preview()

    def _make_head(self) -> None:
        title = QLabel("Initialisation")
        title.setFont(ui_font(bold=True))
        self._skip = named(QCheckBox("skip what is known"), "skipKnown")
        tipped(self._skip, "Skip axes whose position is known")
        self._skip.toggled.connect(self.preview)
        self._start = named(push_button("Start", _START_TIP), "start")
        self._start.clicked.connect(self.start)
        self._close = named(
            push_button("Hide", "Hide the steps; a running initialisation continues"), "hideSteps"
        )
        self._close.clicked.connect(self.hide)
        self._head = QHBoxLayout()
        self._head.setSpacing(STEP_PX)
        self._head.addWidget(title)
        self._head.addWidget(self._skip)
        self._head.addStretch(1)
        self._head.addWidget(self._start)
        self._head.addWidget(self._close)

    def _make_question(self) -> None:
        self._question, row = tight_row(STEP_PX)
        self._question.setObjectName("confirmRow")
        self._text = named(QLabel(""), "confirmText")
        self._text.setTextFormat(Qt.TextFormat.PlainText)
        self._text.setWordWrap(True)
        self._text.setFont(ui_font(bold=True))
        self._yes = named(push_button("Yes, go on", "Continue with the next step"), "confirmYes")
        self._no = named(push_button("No", "End the sequence here"), "confirmNo")
        row.addWidget(self._text, 1)
        row.addWidget(self._yes)
        row.addWidget(self._no)
        self._yes.clicked.connect(self._on_yes)
        self._no.clicked.connect(self._on_no)
        self._question.hide()

    @property
    def report(self) -> SequenceReport:
        """What is shown."""
        return self._report

    @property
    def running(self) -> bool:
        """True while a sequence that was begun here is under way."""
        return self._task is not None and not self._task.done

    def preview(self) -> None:
        """Show the steps as they would be made now, unless some are being made."""
        if self.running:
            return
        try:
            skip_known = self._skip.isChecked()
            steps = plan_sequence(self._mico.settings, self._mico.states(), skip_known=skip_known)
        except CosmicError as exc:  # a rescan takes the devices apart in its own thread
            self._show(SequenceReport((StepReport(str(exc), StepState.WAITING),)))
            return
        self._show(
            SequenceReport(
                tuple(
                    StepReport(
                        step.title,
                        StepState.SKIPPED if step.idle else StepState.WAITING,
                        "; ".join(step.left_out),
                    )
                    for step in steps
                )
            )
        )

    def start(self) -> None:
        """Begin the sequence, unless something may be held: `doubted` tells that."""
        states = self._mico.states().values()
        grippers = (_may_hold(each) for each in states if each.present)
        reasons = self._application.cautions.reasons()
        doubts = tuple(text for text in (self.doubt(), *reasons, *grippers) if text)
        if doubts:
            self.doubted.emit(doubts)
        else:
            self.start_anyway()

    def start_anyway(self) -> None:
        """Begin the sequence; `refused` tells why where it cannot be begun."""
        asker = Asker(self._is_over)
        try:
            task = self._application.initialise_platform(
                skip_known=self._skip.isChecked(), confirm=asker.ask, may_hold=True
            )
        except CosmicError as exc:
            self.refused.emit(str(exc))
            return
        self._task, self._asker = task, asker
        self.begun.emit()

    def _is_over(self) -> bool:
        task = self._application.running_task
        stopped = self._mico.stop_state.latched
        return stopped or task is None or task.cancel_requested

    def _on_changed(self, report: SequenceReport) -> None:
        self._show(report)

    def _on_yes(self) -> None:
        self._answer(agreed=True)

    def _on_no(self) -> None:
        self._answer(agreed=False)

    def _answer(self, *, agreed: bool) -> None:
        if self._asker is not None:
            self._asker.answer(agreed)

    # Showing

    def _show(self, report: SequenceReport) -> None:
        self._report = report
        asked = self._asker is not None and bool(report.question)
        self._text.setText(report.question)
        self._question.setVisible(asked)
        self._show_usable(running=any(each.state is StepState.RUNNING for each in report.steps))
        while self._list.count() > len(report.steps):
            self._list.takeItem(self._list.count() - 1)
        for number, step in enumerate(report.steps):
            if number >= self._list.count():
                self._list.addItem(QListWidgetItem())
            self._show_step(number, step)
        rows = min(_ROWS, max(1, self._list.count()))
        height = max(self._list.sizeHintForRow(0), 2 * STEP_PX)
        self._list.setFixedHeight(rows * height + 2 * self._list.frameWidth() + 2)

    def _show_usable(self, *, running: bool) -> None:
        self._start.setEnabled(not running)
        self._start.setToolTip("Not available: the steps are running" if running else _START_TIP)
        self._skip.setEnabled(not running)

    def _show_step(self, number: int, step: StepReport) -> None:
        item = self._list.item(number)
        note = f": {step.note}" if step.note else ""
        text = f"{_GLYPHS[step.state]} {number + 1}. {step.title}{note}"
        if item.text() == text:
            return
        item.setText(text)
        item.setToolTip(f"{step.state}: {step.title}{note}")
        loud = step.state in _LOUD
        item.setFont(ui_font(bold=loud))
        if loud:
            self._list.scrollToItem(item)


def _may_hold(state: PositionerState) -> str:
    """Return why an actuator without sensor, a gripper, may hold something; empty for others."""
    if state.kind is not PositionerKind.OPEN_LOOP:
        return ""
    if state.position is None or state.confidence is Confidence.UNKNOWN:
        return f"the opening of {state.name} is unknown: it may hold something"
    if not state.position > _OPEN_UM:
        opening = format_quantity(state.position, state.unit)
        return f"{state.name} is taken to be {opening} open: it may hold something"
    return ""


def make_initialisation_panel(mico: Mico) -> InitialisationPanel:
    """Return a panel that shows and begins the initialisation sequence of `mico`."""
    return InitialisationPanel(mico)
