"""The rows of a gripper in the column TOOL: its opening, and how to change it."""

import math
from collections.abc import Callable

from PySide6.QtWidgets import QLabel, QVBoxLayout, QWidget

from cosmic.frame.gui.build import named, push_button, styled, tight_row
from cosmic.frame.gui.quantity_field import QuantityField
from cosmic.frame.gui.theme import STEP_PX, number_font
from cosmic.frame.units import TWO_SIDED
from cosmic.mico.api.axis import Axis
from cosmic.mico.core.motion.positioner import PositionerState


def opening_text(state: PositionerState) -> str:
    """Return the opening that steps tell, with half of its 95 % interval."""
    here = state.shown_position
    if here is None:
        return "opening ?"
    if not math.isfinite(state.std):
        return f"{here:.0f} ± ? µm"
    return f"{here:.0f} ± {TWO_SIDED * state.std:.0f} µm"


class GripperRow(QWidget):
    """Closes and opens by the step or to a width, closes gently, and holds.

    Parameters
    ----------
    axis : Axis
        The one that opens the jaws; it has no sensor.
    step : callable
        Moves by the step of the pad, forwards (1) or backwards (-1).
    open_to : callable
        Opens to a width, um; the field it came from shows a refusal.
    gently : callable
        Closes gently.
    hold : callable
        Stops the jaws where they are.
    """

    def __init__(
        self,
        axis: Axis,
        step: Callable[[int], None],
        open_to: Callable[[float, QuantityField], None],
        gently: Callable[[], None],
        hold: Callable[[], None],
    ) -> None:
        super().__init__()
        first, line = tight_row(STEP_PX // 2)
        for direction, text in ((-1, "close"), (1, "open")):
            button = styled(push_button(text, f"{text} the jaws by the step"), "narrow")
            button.setAccessibleName(f"{axis.key} {text}")
            button.clicked.connect(lambda _=False, d=direction: step(d))
            line.addWidget(button)
        self.width_field = named(
            QuantityField("um", low=0.0, name=f"Opening of {axis.key}; Enter goes there"),
            "gripperWidth",
        )
        self.width_field.setMinimumWidth(9 * STEP_PX)
        self.width_field.entered.connect(lambda there: open_to(there, self.width_field))
        line.addWidget(self.width_field, 1)
        second, line = tight_row(STEP_PX // 2)
        self.opening = named(QLabel("–"), "gripperOpening")
        self.opening.setFont(number_font(bold=True))
        self.opening.setToolTip(
            "Opening, counted from steps, with its 95 % interval; ?: until the jaws were closed"
        )
        self.gently = styled(
            named(
                push_button("gently", "Close slowly until a force is felt, or all steps are made"),
                "gripperGently",
            ),
            "narrow",
        )
        self.hold = styled(
            named(push_button("hold", "Stop the jaws here; they hold by friction"), "gripperHold"),
            "narrow",
        )
        self.gently.clicked.connect(lambda: gently())
        self.hold.clicked.connect(lambda: hold())
        line.addWidget(self.opening, 1)
        line.addWidget(self.gently)
        line.addWidget(self.hold)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(STEP_PX // 2)
        column.addWidget(first)
        column.addWidget(second)
        state = axis.details
        if state.shown_position is not None:
            self.width_field.set_value(round(state.shown_position))
        self.show_state(state)

    def show_state(self, state: PositionerState) -> None:
        """Show the newest state of the axis."""
        text = opening_text(state)
        if text != self.opening.text():
            self.opening.setText(text)
