"""All axes at once, one row each: where each stands, a step either way, a target, a stop."""

from collections.abc import Mapping, Sequence
from typing import Final

from PySide6.QtCore import QObject, Qt
from PySide6.QtWidgets import (
    QGridLayout,
    QLabel,
    QPushButton,
    QSizePolicy,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from cosmic.frame.gui.build import named, push_button, styled, tipped
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.quantity_field import QuantityField
from cosmic.frame.gui.state_badge import StateBadge
from cosmic.frame.gui.theme import STEP_PX, State
from cosmic.mico.core.motion.orders import LARGEST_STEPS
from cosmic.mico.core.motion.positioner import Confidence, PositionerState
from cosmic.mico.core.motion.settings import MotionDefaults
from cosmic.mico.gui.card import CONFIDENCE, PositionDisplay
from cosmic.mico.gui.detour_request import Goal
from cosmic.mico.gui.move_row import StepField
from cosmic.mico.gui.positioner_gui import STATES, PositionerBaseGUI
from cosmic.mico.hw.interface import PositionerKind

_HEADS: Final = ("Axis", "State", "Position", "", "", "Step", "", "Target", "", "", "")
_STEP_FIELD_PX: Final = 10 * STEP_PX
_TARGET_PX: Final = 11 * STEP_PX
"""Room for "-5500.0 µm": a sign that is out of sight makes another number of it."""
_SIDE_PX: Final = 9 * STEP_PX


class AxisRow(QObject):
    """The widgets of one axis; its commands are those of the card, so both say the same.

    Parameters
    ----------
    card : PositionerBaseGUI
        The card of the same axis.
    defaults : MotionDefaults
        What stands in the fields at first.
    """

    def __init__(self, card: PositionerBaseGUI, defaults: MotionDefaults, parent: QObject) -> None:
        super().__init__(parent)
        self.card = card
        self._defaults = defaults
        self._target_set = False
        self._state: PositionerState | None = None
        axis, settings = card.axis, card.settings
        self._has_sensor = axis.kind is not PositionerKind.OPEN_LOOP
        self.name = named(QLabel(settings.name), "rowName")
        self.badge = StateBadge(State.UNKNOWN)
        self.position = PositionDisplay(settings.unit, "rowPosition")
        self.confidence = named(QLabel(), "rowConfidence")
        self.confidence.setFixedWidth(2 * STEP_PX)
        self.step = self._make_step()
        self.backward = self._side(settings.backward_text, -1)
        self.forward = self._side(settings.forward_text, 1)
        self.target = named(
            QuantityField(axis.unit, name=f"Target of {axis.key}, for Go to"), "rowTarget"
        )
        self.go_to = named(push_button("Go to", f"Move {axis.key} to the target"), "rowGoTo")
        styled(self.go_to, "narrow")
        self.stop = named(QToolButton(), "stopAxis")
        self.stop.setText("■")
        tipped(self.stop, f"Stop {axis.key}; the other axes go on")
        self.line = named(ElidedLabel(), "rowLine")
        self.line.set_dim(True)
        self.step.setFixedWidth(_STEP_FIELD_PX)
        self.target.setFixedWidth(_TARGET_PX)
        self.target.entered.connect(self._on_go_to)
        self.go_to.clicked.connect(self._on_go_to)
        self.stop.clicked.connect(card.halt)
        for each in (self.target, self.go_to):
            each.setVisible(self._has_sensor)
        card.status_changed.connect(self._show_line)

    def _make_step(self) -> QuantityField:
        axis, defaults = self.card.axis, self._defaults
        if not self._has_sensor:
            field = QuantityField(
                "steps",
                low=1,
                high=LARGEST_STEPS,
                value=float(defaults.steps),
                integers=True,
                name=f"Steps per click of {axis.key}",
            )
            return named(field, "rowStep")
        usual = defaults.distance_deg if axis.unit == "deg" else defaults.distance_um
        return named(StepField(axis.unit, value=usual, name=f"Step size of {axis.key}"), "rowStep")

    def _side(self, text: str, direction: int) -> QPushButton:
        button = styled(
            push_button(text, f"Move {self.card.axis.key} {text} by the step"), "narrow"
        )
        button.setFixedWidth(_SIDE_PX)
        button.clicked.connect(self._on_forward if direction > 0 else self._on_backward)
        return button

    @property
    def cells(self) -> tuple[QWidget, ...]:
        """What stands in the row, from the left."""
        where = (self.name, self.badge, self.position, self.confidence)
        moves = (self.backward, self.step, self.forward, self.target, self.go_to)
        return (*where, *moves, self.stop, self.line)

    def show_state(self, state: PositionerState) -> None:
        """Show the newest state of the axis."""
        self._state = state
        known = state.confidence is not Confidence.UNKNOWN
        self.position.show_position(state.shown_position, known=known)
        text, _tone, tip = CONFIDENCE[state.confidence]
        if self.confidence.toolTip() != tip:
            self.confidence.setText(text.split(" ")[0])
            self.confidence.setToolTip(tip)
        for widget in (self.backward, self.forward, self.step, self.target, self.go_to, self.stop):
            widget.setEnabled(state.present)
        if not self._target_set and state.shown_position is not None:
            self._target_set = True
            self.target.set_value(state.shown_position)
        self._show_line()

    def _show_line(self) -> None:
        if self._state is not None:
            self.card.put_on(self.badge, STATES[self._state.status], self._state.error)
        text = self.card.status_text
        self.line.set_text(text, *_shorter(text))

    # Commanding

    def _on_forward(self) -> None:
        self.move_once(1)

    def _on_backward(self) -> None:
        self.move_once(-1)

    def move_once(self, direction: int) -> None:
        """Move once forwards (1) or backwards (-1) by the step in the row."""
        if not self.step.commit():
            return
        axis, amount = self.card.axis, self.step.value()
        if not self._has_sensor:
            self.card.commands.issue(
                "make steps",
                lambda consent: axis.steps(
                    direction * round(amount),
                    amplitude_v=self._defaults.amplitude_v,
                    frequency_hz=self._defaults.frequency_hz,
                    wait=False,
                    consent=consent,
                ),
                self.step,
            )
            return
        state = axis.details
        here = state.shown_position
        goal = None
        if here is not None:
            there = here + direction * amount
            goal = Goal(target=there + state.zero, shown=there, unit=state.unit)
        self.card.commands.issue(
            "move by a distance",
            lambda consent: axis.move_by(direction * amount, wait=False, consent=consent),
            self.step,
            goal=goal,
        )

    def _on_go_to(self) -> None:
        if not self.target.commit():
            return
        axis, there = self.card.axis, self.target.value()
        state = axis.details
        self.card.commands.issue(
            "move to a position",
            lambda consent: axis.move_to(there, wait=False, consent=consent),
            self.target,
            goal=Goal(target=there + state.zero, shown=there, unit=state.unit),
        )


class AxisTable(QWidget):
    """One compact row for each axis, so that a platform of eleven is seen at once; GUI thread."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("axisTable")
        self._rows: dict[str, AxisRow] = {}
        self._body = QWidget()
        self._column = QVBoxLayout(self)
        self._column.setContentsMargins(STEP_PX, 0, STEP_PX, STEP_PX // 2)
        self._column.addWidget(self._body)
        self._column.addStretch(1)

    @property
    def rows(self) -> dict[str, AxisRow]:
        """The rows by the name of their axis."""
        return dict(self._rows)

    def set_cards(
        self, cards: Mapping[str, PositionerBaseGUI], defaults: MotionDefaults
    ) -> Sequence[AxisRow]:
        """Show a row for each card; those shown before are deleted."""
        for row in self._rows.values():
            row.deleteLater()
        old = self._body
        self._body = QWidget()
        self._column.replaceWidget(old, self._body)
        old.hide()
        old.deleteLater()
        grid = QGridLayout(self._body)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setHorizontalSpacing(STEP_PX // 2)
        grid.setVerticalSpacing(2)
        for column, text in enumerate(_HEADS):
            head = QLabel(text)
            head.setProperty("role", "dim")
            grid.addWidget(head, 0, column)
        self._rows = {name: AxisRow(card, defaults, self) for name, card in cards.items()}
        for number, row in enumerate(self._rows.values(), start=1):
            for column, cell in enumerate(row.cells):
                grid.addWidget(cell, number, column, Qt.AlignmentFlag.AlignVCenter)
        grid.setColumnStretch(len(_HEADS) - 1, 1)
        self._body.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self._body.show()
        return tuple(self._rows.values())


def _shorter(text: str) -> tuple[str, ...]:
    """Return what a narrow window says in place of the usual lines; others are elided."""
    if text.endswith(" travel"):
        span = text.removesuffix(" travel")
        return span, span.split(" ")[0]
    if text.startswith("■ STOPPED"):
        return "■ STOPPED", "STOPPED"
    return ("no sensor",) if text.startswith("no sensor") else ()
