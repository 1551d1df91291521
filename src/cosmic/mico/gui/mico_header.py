"""The line above the cards: initialise, rescan, how far it is, and how fast keys jog."""

from typing import Final

from PySide6.QtCore import QTimer, Signal
from PySide6.QtWidgets import (
    QLabel,
    QProgressBar,
    QSizePolicy,
    QStackedWidget,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from cosmic.frame.gui.build import named, push_button, tight_row, tipped
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.flow_layout import FlowLayout
from cosmic.frame.gui.quantity_field import QuantityField
from cosmic.frame.gui.theme import STEP_PX, State, number_font, state_look
from cosmic.frame.operation import Progress, Task
from cosmic.mico.core.motion.orders import FREQUENCY_HZ
from cosmic.mico.core.motion.settings import JogSettings
from cosmic.mico.hw.interface import PositionerKind

_POLL_MS: Final = 150


class MicoHeader(QWidget):
    """Only asks; `MicoWidget` acts.

    Signals
    -------
    initialise_requested(), rescan_requested(), undo_requested()
        The operator wants it.
    steps_toggled(bool)
        The steps of the initialisation shall be shown, or not.
    cards_toggled(bool)
        The cards shall be shown instead of the table, or not.
    """

    cards_toggled = Signal(bool)

    initialise_requested = Signal()
    rescan_requested = Signal()
    undo_requested = Signal()
    steps_toggled = Signal(bool)

    def __init__(self, jog: JogSettings, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._task: Task | None = None
        self._timer = QTimer(self, interval=_POLL_MS)
        self._timer.timeout.connect(self._on_timer)
        self._make_buttons()
        self._make_progress()
        self._missing = named(QLabel(), "missing")
        self._missing.setWordWrap(True)
        self._missing.hide()
        self._speeds = {
            PositionerKind.LINEAR: _speed_field("um", jog.speed_um_s, "linear axes"),
            PositionerKind.ROTARY: _speed_field("deg", jog.speed_deg_s, "rotary axes"),
            PositionerKind.OPEN_LOOP: _speed_field("Hz", jog.frequency_hz, "axes without sensor"),
        }
        self._arrange()

    def _make_buttons(self) -> None:
        self._initialise = named(
            push_button("Initialise", "Find the reference of every axis in the safe order"),
            "initialise",
        )
        self._rescan = named(
            push_button("Rescan", "Look again for the devices; nothing may be moving"), "rescan"
        )
        self._steps = named(QToolButton(), "showSteps")
        self._steps.setText("▾")
        self._steps.setCheckable(True)
        tipped(self._steps, "Show the steps of the initialisation")
        self._steps.toggled.connect(self.steps_toggled)
        self._cards = named(push_button("Cards", "Show every field of each axis"), "showCards")
        self._cards.setCheckable(True)
        self._cards.hide()
        self._cards.toggled.connect(self.cards_toggled)
        self._undo = named(push_button("Undo", ""), "undo")
        self._undo.clicked.connect(self.undo_requested)
        self.set_undo("")
        self._tips = {each: each.toolTip() for each in (self._initialise, self._rescan)}
        self._initialise.clicked.connect(self.initialise_requested)
        self._rescan.clicked.connect(self.rescan_requested)

    def _make_progress(self) -> None:
        self._message = named(ElidedLabel(), "message")
        self._message.setProperty("role", "dim")
        self._what = named(ElidedLabel(), "progressText")
        self._bar = named(QProgressBar(), "progress")
        self._bar.setFixedWidth(14 * STEP_PX)
        self._left = named(QLabel(), "timeLeft")
        self._left.setFont(number_font())
        self._left.setFixedWidth(self._left.fontMetrics().horizontalAdvance("000 s left") + 4)
        tipped(self._left, "Estimated from what is done so far")
        self._cancel = named(
            push_button("Cancel", "Cancel; the axes that it moves are stopped"), "cancel"
        )
        self._cancel.clicked.connect(self._on_cancel)
        busy, row = tight_row(STEP_PX)
        for widget in (self._bar, self._left, self._cancel):
            row.addWidget(widget)
        row.addWidget(self._what, 1)
        self._pages = QStackedWidget()
        self._pages.addWidget(self._message)
        self._pages.addWidget(busy)
        self._pages.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)

    def _arrange(self) -> None:
        caption = tipped(QLabel("jog per second"), "How far a held key moves in one second")
        caption.setProperty("role", "dim")
        # Wraps where the panel is narrow: the picture beside it needs the width.
        line = FlowLayout(STEP_PX)
        buttons = (self._initialise, self._steps, self._rescan, self._undo, self._cards)
        speeds, row = tight_row(STEP_PX)
        for widget in (caption, *self._speeds.values()):
            row.addWidget(widget)
        for widget in (*buttons, speeds):
            line.addWidget(widget)
        column = QVBoxLayout(self)
        column.setContentsMargins(STEP_PX, STEP_PX, STEP_PX, STEP_PX)
        column.setSpacing(STEP_PX // 2)
        column.addLayout(line)
        column.addWidget(self._pages)
        column.addWidget(self._missing)

    def speed(self, kind: PositionerKind) -> float:
        """Return the jog speed for `kind`, in its unit per second; in Hz without a sensor."""
        return self._speeds[kind].value()

    def set_missing(self, lines: tuple[str, ...]) -> None:
        """List what was configured and is not there."""
        shape = state_look(State.UNKNOWN).glyph
        self._missing.setText("\n".join(f"{shape} {line}" for line in lines))
        self._missing.setToolTip("Switch it on or connect it, then press Rescan")
        self._missing.setVisible(bool(lines))

    def set_message(self, text: str, state: State = State.OK) -> None:
        """Show one line, such as how the last operation ended."""
        self._message.set_text(f"{state_look(state).glyph} {text}" if text else "")

    def set_undo(self, what: str) -> None:
        """Say what Undo takes back; empty when there is nothing."""
        self._undo.setEnabled(bool(what))
        why_not = "Not available: there is no movement to undo"
        self._undo.setToolTip(f"Ctrl+Z: {what}" if what else why_not)

    def offer_cards(self) -> None:
        """Have a button that turns between table and cards."""
        self._cards.show()

    def show_cards(self, shown: bool) -> None:
        """Show which of them is seen."""
        self._cards.setChecked(shown)

    def set_steps_shown(self, shown: bool) -> None:
        """Show whether the steps are to be seen."""
        self._steps.setChecked(shown)

    # A long operation

    def follow(self, task: Task) -> None:
        """Show how far `task` is until it ends."""
        self._task = task
        self._pages.setCurrentIndex(1)
        self._cancel.setEnabled(True)
        for button in self._tips:
            button.setEnabled(False)
            button.setToolTip(f"Not available: {task.title} is running")
        self._timer.start()
        self._on_timer()

    def _on_timer(self) -> None:
        if self._task is None:
            return
        progress = self._task.progress
        self._show(progress)
        if progress.done:
            self._on_task_ended(progress)

    def _show(self, progress: Progress) -> None:
        self._bar.setValue(round(100 * progress.fraction))
        left_s = progress.left_s
        self._left.setText("" if left_s is None else f"{left_s:.0f} s left")
        self._what.set_text(
            f"{progress.title}: {progress.text}" if progress.text else progress.title
        )

    def _on_task_ended(self, progress: Progress) -> None:
        self._task = None
        self._timer.stop()
        self._pages.setCurrentIndex(0)
        for button, tip in self._tips.items():
            button.setEnabled(True)
            button.setToolTip(tip)
        if progress.error:
            self.set_message(f"{progress.title} ended: {progress.error}", State.ERROR)
        else:
            self.set_message(f"{progress.title} finished after {progress.elapsed_s:.1f} s")

    def _on_cancel(self) -> None:
        if self._task is not None:
            self._task.cancel()
            self._cancel.setEnabled(False)


def _speed_field(unit: str, value: float, of_what: str) -> QuantityField:
    whole = unit == "Hz"
    low = 1.0 if whole else 0.001
    field = QuantityField(
        unit,
        low=low,
        high=float(FREQUENCY_HZ[1]),
        value=float(value),
        decimals=None if unit != "deg" else 2,
        integers=whole,
        name=f"Jog speed of {of_what}, per second" if not whole else f"Jog frequency of {of_what}",
    )
    field.setMaximumWidth(12 * STEP_PX)
    return named(field, f"jogSpeed_{unit}")
