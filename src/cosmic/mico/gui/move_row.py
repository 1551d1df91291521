"""The fields that a movement to or by a position is made with (MiCoCL.8 to MiCoCL.11)."""

from PySide6.QtWidgets import QCheckBox

from cosmic.frame.errors import QuantityError
from cosmic.frame.gui.build import named, push_button, tipped
from cosmic.frame.gui.quantity_field import QuantityField
from cosmic.frame.gui.theme import STEP_PX
from cosmic.frame.overrides import override
from cosmic.mico.api.axis import Axis
from cosmic.mico.api.stepwise import StepwiseMove
from cosmic.mico.core.motion.movement import Movement
from cosmic.mico.core.motion.settings import MotionDefaults
from cosmic.mico.gui.detour_request import Goal


class StepField(QuantityField):
    """Takes how far one click moves; the button alone says in which direction."""

    @override
    def _parse(self) -> float:
        value = super()._parse()
        if not value > 0.0:
            raise QuantityError(
                "a step size is above zero and has no sign: the button gives the direction, and "
                "Go to takes a position"
            )
        return value


class MoveFields:
    """Step size, target, Go to, and the splitting of a move; the card arranges the widgets.

    Parameters
    ----------
    axis : Axis
        What moves.
    defaults : MotionDefaults
        The step size that stands there at first, also for the parts.
    """

    def __init__(self, axis: Axis, defaults: MotionDefaults) -> None:
        self._axis = axis
        unit = axis.unit
        usual = defaults.distance_deg if unit == "deg" else defaults.distance_um
        smallest = 0.001 if unit == "deg" else 0.1
        self.distance = named(
            StepField(unit, value=usual, name=f"Step size of {axis.key}, for both buttons"),
            "MiCoCL_8",
        )
        self.target = named(QuantityField(unit, name=f"Target of {axis.key}, for Go to"), "target")
        self._target_set = False
        self.go_to = named(
            push_button("Go to", f"Move {axis.key} to the position in the field beside"),
            "MiCoCL_9",
        )
        self.split = named(QCheckBox("in steps of"), "MiCoCL_10")
        tipped(self.split, "Make each move as a series of moves of at most this size")
        self.largest = named(
            QuantityField(unit, low=smallest, value=usual, name="Largest step of a move"),
            "MiCoCL_11",
        )
        self.split.toggled.connect(self.largest.setEnabled)
        self.largest.setEnabled(False)
        for field in (self.distance, self.target, self.largest):
            field.setMaximumWidth(16 * STEP_PX)

    def begin_at(self, position: float | None) -> None:
        """Have the target begin where the axis stands: Go to then goes nowhere unasked."""
        if self._target_set or position is None:
            return
        self._target_set = True
        self.target.set_value(position)

    def commit_step(self) -> bool:
        """Check the entries that a button needs; False when one was refused."""
        return self._commit(self.distance)

    def commit_target(self) -> bool:
        """Check the entries that Go to needs; False when one was refused."""
        return self._commit(self.target)

    def _commit(self, field: QuantityField) -> bool:
        fields = [field, *([self.largest] if self.split.isChecked() else [])]
        accepted = [each.commit() for each in fields]  # each shows its own reason
        return all(accepted)

    def move_by(self, direction: int, *, consent: bool) -> Movement | StepwiseMove:
        """Move by the step size in `direction`, 1 or -1, at once or in steps."""
        distance_typed = direction * self.distance.value()
        if self.split.isChecked():
            return StepwiseMove.by(
                self._axis, distance_typed, self.largest.value(), consent=consent
            )
        return self._axis.move_by(distance_typed, wait=False, consent=consent)

    def move_to(self, *, consent: bool) -> Movement | StepwiseMove:
        """Move to the position, at once or in steps."""
        target = self.target.value()
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
        return self._goal(self.target.value())

    def _goal(self, shown: float) -> Goal:
        state = self._axis.details
        return Goal(target=shown + state.zero, shown=shown, unit=state.unit)
