"""Where one axis of a tool stands, and where it is to go."""

from collections.abc import Callable, Mapping
from typing import Final

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLabel

from cosmic.frame.gui.build import named
from cosmic.frame.gui.quantity_field import QuantityField
from cosmic.frame.gui.theme import STEP_PX, number_font
from cosmic.frame.units import format_quantity
from cosmic.mico.api.axis import Axis
from cosmic.mico.core.motion.positioner import Confidence, PositionerState

STANDS: Final[Mapping[str, float]] = {"um": 0.5, "deg": 0.05}
"""An axis that is found less far away has not been moved: positions are noisy."""


class TargetRow:
    """Position and target of one axis.

    A target that is typed waits for Enter, or for Go to. Where the axis is brought elsewhere
    meanwhile, the target is where it stands then: Go to moves what was typed, and nothing back.
    """

    def __init__(self, axis: Axis, caption: str, go: Callable[[], None]) -> None:
        self.axis = axis
        self._stood: float | None = None
        self._typed = False
        self.caption = QLabel(caption)
        self.caption.setFixedWidth(STEP_PX + 2)
        self.position = named(QLabel("–"), "toolPosition")
        self.position.setFont(number_font(bold=True))
        self.position.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        widest = self.position.fontMetrics().horizontalAdvance("-5000.0")
        self.position.setMinimumWidth(widest)
        self.target = named(
            QuantityField(axis.unit, name=f"Target of {axis.key}; Enter moves there"), "toolTarget"
        )
        self.target.setMinimumWidth(9 * STEP_PX)
        self.target.textEdited.connect(self._on_typed)
        self.target.entered.connect(lambda _value: go())

    def _on_typed(self) -> None:
        self._typed = True

    def show_state(self, state: PositionerState) -> None:
        """Show the newest state of the axis."""
        here = state.shown_position
        text = "–" if here is None else format_quantity(here, state.unit).split(" ")[0]
        if text != self.position.text():
            self.position.setText(text)
        sure = state.confidence is Confidence.KNOWN
        self.position.setEnabled(sure)
        tip = "" if sure else "The position is not known; initialise first"
        if self.position.toolTip() != tip:
            self.position.setToolTip(tip)
        stands = state.activity.at_rest and not state.in_motion
        if here is not None and (stands or self._stood is None):
            self._stand(here, STANDS[state.unit])
        self.target.setEnabled(state.present)

    @property
    def _being_typed(self) -> bool:
        field = self.target
        return field.hasFocus() and field.is_editing and not field.reason

    def _stand(self, here: float, near: float) -> None:
        """Have the target follow an axis that was brought elsewhere than to it."""
        before, typed = self._stood, self._typed or self._being_typed
        if before is not None and not typed and abs(here - before) <= near:
            return
        self._stood, self._typed = here, False
        if before is not None and (typed or abs(here - self.target.value()) <= near):
            return
        if self.target.is_editing:
            self.target.revert()
        self.target.set_value(round(here, 1))
