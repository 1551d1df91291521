"""The fields that a movement to or by a position is made with (MiCoCL.8 to MiCoCL.11)."""

from PySide6.QtWidgets import QCheckBox

from cosmic.frame.gui.build import named, push_button, tipped
from cosmic.frame.gui.quantity_field import QuantityField
from cosmic.frame.gui.theme import STEP_PX
from cosmic.mico.api.axis import Axis
from cosmic.mico.api.stepwise import StepwiseMove
from cosmic.mico.core.movement import Movement
from cosmic.mico.core.settings import MotionDefaults
from cosmic.mico.gui.way_request import Goal


class MoveFields:
    """Distance, Go to, and the splitting of a move; the card puts the widgets where it wants.

    Parameters
    ----------
    axis : Axis
        What moves.
    defaults : MotionDefaults
        The distance that stands there at first, also for the parts.
    """

    def __init__(self, axis: Axis, defaults: MotionDefaults) -> None:
        self._axis = axis
        unit = axis.unit
        usual = defaults.distance_deg if unit == "deg" else defaults.distance_um
        smallest = 0.001 if unit == "deg" else 0.1
        self.distance = named(
            QuantityField(unit, value=usual, name="Distance of the buttons, target of Go to"),
            "MiCoCL_8",
        )
        self.go_to = named(
            push_button("Go to", f"Move {axis.name} to the position in the field"), "MiCoCL_9"
        )
        self.split = named(QCheckBox("in parts of"), "MiCoCL_10")
        tipped(self.split, "Make each move as a series of moves of at most this size")
        self.largest = named(
            QuantityField(unit, low=smallest, value=usual, name="Largest part of a move"),
            "MiCoCL_11",
        )
        self.split.toggled.connect(self.largest.setEnabled)
        self.largest.setEnabled(False)
        for field in (self.distance, self.largest):
            field.setMaximumWidth(16 * STEP_PX)

    def commit(self) -> bool:
        """Judge the entries that count; False when one was refused."""
        fields = [self.distance, *([self.largest] if self.split.isChecked() else [])]
        judged = [field.commit() for field in fields]  # each shows its own reason
        return all(judged)

    def move_by(self, direction: int, *, consent: bool) -> Movement | StepwiseMove:
        """Move by the distance, at once or in parts."""
        way = direction * self.distance.value()
        if self.split.isChecked():
            return StepwiseMove.by(self._axis, way, self.largest.value(), consent=consent)
        return self._axis.move_by(way, wait=False, consent=consent)

    def move_to(self, *, consent: bool) -> Movement | StepwiseMove:
        """Move to the position, at once or in parts."""
        target = self.distance.value()
        if self.split.isChecked():
            return StepwiseMove(self._axis, target, self.largest.value(), consent=consent)
        return self._axis.move_to(target, wait=False, consent=consent)

    def goal_by(self, direction: int) -> Goal | None:
        """Return where `move_by` leads from here; None before a position was read."""
        position = self._axis.details.shown_position
        if position is None:
            return None
        return self._goal(position + direction * self.distance.value())

    def goal_to(self) -> Goal:
        """Return where `move_to` leads."""
        return self._goal(self.distance.value())

    def _goal(self, shown: float) -> Goal:
        state = self._axis.details
        return Goal(target=shown + state.zero, shown=shown, unit=state.unit)
