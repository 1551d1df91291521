"""The three fields that a movement by steps is made with (MiCoOL.5 to MiCoOL.7)."""

from PySide6.QtWidgets import QHBoxLayout, QWidget

from cosmic.frame.gui.build import named
from cosmic.frame.gui.quantity_field import QuantityField
from cosmic.frame.gui.theme import STEP_PX
from cosmic.mico.api.axis import Axis
from cosmic.mico.core.motion.movement import Movement
from cosmic.mico.core.motion.orders import AMPLITUDE_V, FREQUENCY_HZ, LARGEST_STEPS
from cosmic.mico.core.settings import MotionDefaults


class StepsPart(QWidget):
    """How many steps, how fast and how large; used by every kind of positioner."""

    def __init__(self, axis: Axis, defaults: MotionDefaults, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._axis = axis
        self.steps = _whole(
            "MiCoOL_5", "steps", (0, LARGEST_STEPS), defaults.steps, "Steps of one click"
        )
        self.frequency = _whole(
            "MiCoOL_6", "Hz", FREQUENCY_HZ, defaults.frequency_hz, "Steps per second"
        )
        low, high = AMPLITUDE_V
        self.amplitude = named(
            QuantityField(
                "V", low=low, high=high, value=defaults.amplitude_v, name="Amplitude of a step"
            ),
            "MiCoOL_7",
        )
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(STEP_PX // 2)
        for field in self.fields:
            field.setMaximumWidth(15 * STEP_PX)
            row.addWidget(field, 1)

    @property
    def fields(self) -> tuple[QuantityField, QuantityField, QuantityField]:
        """Steps, frequency and amplitude."""
        return self.steps, self.frequency, self.amplitude

    def commit(self) -> bool:
        """Judge all three entries; False when one was refused."""
        judged = [field.commit() for field in self.fields]  # each shows its own reason
        return all(judged)

    def make(self, direction: int, *, consent: bool) -> Movement:
        """Make the steps in `direction`, 1 or -1."""
        return self._axis.steps(
            direction * self.steps.value(),
            amplitude_v=self.amplitude.value(),
            frequency_hz=self.frequency.value(),
            wait=False,
            consent=consent,
        )


def _whole(
    object_name: str, unit: str, span: tuple[int, int], value: int, name: str
) -> QuantityField:
    field = QuantityField(
        unit, low=span[0], high=span[1], value=float(value), integers=True, name=name
    )
    return named(field, object_name)
