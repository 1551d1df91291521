"""The outputs that the configuration names: what each gives, and a value for each."""

from collections.abc import Callable
from typing import Final

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QGridLayout, QHBoxLayout, QLabel, QPushButton, QVBoxLayout, QWidget

from cosmic.daqco.api.daqco import Daqco
from cosmic.daqco.core.output_control import OutputState
from cosmic.daqco.gui.asking import Asking
from cosmic.daqco.gui.value_field import ValueField
from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.chip import Chip
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.relay import Relay
from cosmic.frame.gui.theme import STEP_PX, number_font

COLUMNS: Final = 2
"""Outputs beside each other."""
PARTS: Final = 5
"""Columns of the grid that one output takes."""
FIELD_PX: Final = 10 * STEP_PX
SHOWN_PX: Final = 8 * STEP_PX


class OutputRow:
    """One output: name, what it gives, and what sets it; GUI thread.

    Parameters
    ----------
    give : callable
        Takes the action that sets the output.
    """

    def __init__(
        self, state: OutputState, daqco: Daqco, give: Callable[[Callable[[], object]], object]
    ) -> None:
        self._name, self._analog = state.name, state.analog
        self._daqco, self._give = daqco, give
        self.name = QLabel(state.name)
        self.shown = QLabel()
        self.shown.setFont(number_font())
        self.shown.setMinimumWidth(SHOWN_PX)
        self.field: ValueField | None = None
        if state.analog:
            self.field = ValueField(state.name, "V")
            self.field.setMaximumWidth(FIELD_PX)
            self.field.set_value(state.safe)
            self.button = QPushButton("Set")
            # Enter or the button, and not that the field was left, gives a voltage.
            self.field.returnPressed.connect(self._on_set)
            self.button.clicked.connect(self._on_set)
        else:
            self.button = QPushButton("Switch on")
            self.button.clicked.connect(self._on_switch)
        self._high = False
        self.show_state(state, blocked="")

    @property
    def widgets(self) -> tuple[QWidget, ...]:
        """Its parts, from left to right."""
        middle = self.field if self.field is not None else QLabel()
        return self.name, self.shown, middle, self.button

    def show_state(self, state: OutputState, blocked: str) -> None:
        """Show what the output gives; `blocked` says why it cannot be set."""
        self.shown.setText(_given(state))
        limits = f"{state.low_v:g} to {state.high_v:g} V" if state.analog else "a digital line"
        safe = f"{state.safe:g} V" if state.analog else ("high" if state.safe else "low")
        stop = "driven there by a stop" if state.stops else "left alone by a stop"
        self.name.setToolTip(f"{state.place}: {limits}; safe value {safe}, {stop}")
        self.shown.setToolTip(state.problem)
        self._high = bool(state.value)
        if not state.analog:
            self.button.setText("Switch off" if self._high else "Switch on")
        for widget in (self.field, self.button):
            if widget is not None:
                widget.setEnabled(not blocked)
        self.button.setToolTip(blocked)

    def _on_set(self) -> None:
        if self.field is not None and self.field.take():
            volts = self.field.value()
            self._give(lambda: self._daqco.set_output(self._name, volts))

    def _on_switch(self) -> None:
        high = not self._high
        self._give(lambda: self._daqco.set_line(self._name, high=high))


class OutputsPanel(QWidget):
    """All outputs in a few lines; hidden where the configuration names none. GUI thread."""

    def __init__(self, daqco: Daqco, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._daqco = daqco
        self.rows: dict[str, OutputRow] = {}
        self._trouble = ""
        self.state = Chip("OUTPUTS", tip="Whether outputs may be set")
        self.refusal = ElidedLabel()
        self.safe = QPushButton("Stop outputs")
        self.safe.setToolTip("Drive outputs to their safe values, and set none until the reset")
        self.reset = QPushButton("Reset")
        self.reset.setToolTip("Let outputs be set again; they keep their safe values until then")
        self._grid = QGridLayout()
        self._grid.setHorizontalSpacing(STEP_PX)
        self._grid.setVerticalSpacing(STEP_PX // 2)
        self._grid.setColumnStretch(COLUMNS * PARTS, 1)
        self._asking = Asking(daqco, self)
        self._build()
        # At once: it waits for no board.
        self.safe.clicked.connect(lambda: self._asking.ask(daqco.stop_outputs, self._on_done))
        self.reset.clicked.connect(lambda: self._ask(daqco.reset_outputs))
        self._relay = Relay(self.look).follow(daqco.on_change)
        self.look()

    def _build(self) -> None:
        head = QHBoxLayout()
        head.setSpacing(STEP_PX)
        head.addWidget(self.state)
        head.addWidget(self.refusal, 1)
        head.addWidget(self.reset)
        head.addWidget(self.safe)
        column = QVBoxLayout(self)
        column.setContentsMargins(STEP_PX, STEP_PX // 2, STEP_PX, STEP_PX // 2)
        column.setSpacing(STEP_PX // 2)
        column.addLayout(head)
        column.addLayout(self._grid)

    def look(self) -> None:
        """Show how things stand now."""
        states, away = self._daqco.outputs, self._daqco.away
        stopped = self._daqco.outputs_stopped
        if tuple(self.rows) != tuple(each.name for each in states):
            self._make_rows(states)
        self.setVisible(bool(states))
        blocked = away or (f"Outputs are stopped: {stopped}" if stopped else "")
        for each in states:
            self.rows[each.name].show_state(each, blocked)
        self.state.setText("OUTPUTS STOPPED" if stopped else "OUTPUTS")
        self.state.set_tone("warning" if stopped else "quiet")
        self.state.setToolTip(blocked or "Outputs may be set")
        self.reset.setVisible(bool(stopped))
        self.reset.setEnabled(not away)
        problem = next((each.problem for each in states if each.problem), "")
        before, self._trouble = self._trouble, problem or stopped
        if self._trouble or before:  # else a refusal stands there
            self._say(self._trouble)

    def _make_rows(self, states: tuple[OutputState, ...]) -> None:
        while (item := self._grid.takeAt(0)) is not None:
            if (widget := item.widget()) is not None:
                widget.deleteLater()
        self.rows = {each.name: OutputRow(each, self._daqco, self._ask) for each in states}
        for number, row in enumerate(self.rows.values()):
            line, place = divmod(number, COLUMNS)
            for part, widget in enumerate(row.widgets):
                self._grid.addWidget(
                    widget, line, place * PARTS + part, Qt.AlignmentFlag.AlignVCenter
                )
            self._grid.setColumnMinimumWidth(place * PARTS + PARTS - 1, 2 * STEP_PX)

    def _ask(self, action: Callable[[], object]) -> None:
        self._asking.ask(action, self._on_done, slow=True)

    def _on_done(self, _result: object, error: CosmicError | None) -> None:
        self._say("" if error is None else str(error))
        if error is None:
            self.look()

    def _say(self, text: str) -> None:
        self.refusal.set_text(f"■ {text}" if text else "")


def _given(state: OutputState) -> str:
    if state.problem:
        return "■ no answer"
    if state.playing:
        return "waveform"
    if state.value is None:
        return "unknown"
    return f"{state.value:.4g} V" if state.analog else ("high" if state.value else "low")
