"""How near the two nearest bodies are to each other, readable at a glance."""

from dataclasses import dataclass
from typing import Final

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QHBoxLayout, QLabel, QSizePolicy, QWidget

from cosmic.frame.gui.build import named
from cosmic.frame.gui.chip import Chip, Tone
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.theme import STEP_PX, number_font

NEAR_MARGINS: Final = 5.0
"""Below so many margins the clearance is said to be small."""

_TENTHS_BELOW_UM: Final = 9.95
_WIDEST: Final = "999999"


@dataclass(frozen=True, slots=True)
class Clearance:
    """The distance of the two nearest bodies, and the least that is allowed."""

    distance_um: float
    bodies: tuple[str, str]
    margin_um: float = 0.0

    @property
    def figures(self) -> str:
        """The distance as it is shown, without its unit."""
        shown = self.distance_um
        return f"{shown:.1f}" if shown < _TENTHS_BELOW_UM else f"{shown:.0f}"


_LOOKS: Final[dict[str, tuple[str, Tone]]] = {
    "far": ("● clearance", "quiet"),
    "near": ("▲ close", "warning"),
    "margin": ("◆ at margin", "alarm"),
    "unknown": ("? clearance", "quiet"),
}


def closeness(reading: Clearance | None) -> str:
    """Return "far", "near", "margin" or "unknown"."""
    if reading is None:
        return "unknown"
    # Written so that a distance that is no number counts as too close.
    if not reading.distance_um > reading.margin_um:
        return "margin"
    return "far" if reading.distance_um >= NEAR_MARGINS * reading.margin_um else "near"


class ClearanceMeter(QWidget):
    """Figures that stay in their place; names that are elided; closeness by colour and sign."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._word = Chip("")
        self._word.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._figures = named(QLabel(), "clearance")
        self._figures.setFont(number_font(bold=True))
        self._figures.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        self._figures.setFixedWidth(self._figures.fontMetrics().horizontalAdvance(_WIDEST) + 2)
        self._unit = QLabel("µm")
        self._unit.setProperty("role", "dim")
        self._names = named(ElidedLabel(), "clearanceBodies")
        self._fix_word_width()
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(STEP_PX // 2)
        for widget in (self._word, self._figures, self._unit):
            row.addWidget(widget)
        row.addSpacing(STEP_PX // 2)
        row.addWidget(self._names, 1)
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self.setMinimumWidth(self._fixed_px() + 6 * STEP_PX)
        self.show_unknown("")

    def set_compact(self) -> None:
        """Leave the names to the tooltip where there is no room for them."""
        self.setMinimumWidth(self._fixed_px())

    def _fix_word_width(self) -> None:
        self._word.set_tone("alarm")  # set in bold, which is the widest
        metrics = self._word.fontMetrics()
        widest = max(metrics.horizontalAdvance(text) for text, _tone in _LOOKS.values())
        self._word.setFixedWidth(widest + 3 * STEP_PX)

    def _fixed_px(self) -> int:
        parts = (self._word.maximumWidth(), self._figures.maximumWidth())
        return sum(parts) + self._unit.sizeHint().width() + 2 * STEP_PX

    @property
    def text(self) -> str:
        """What it says, in one line."""
        return self.accessibleName()

    def show_clearance(self, reading: Clearance) -> None:
        """Show another distance."""
        one, other = reading.bodies
        self._figures.setText(reading.figures)
        self._names.set_text(f"{one} – {other}")
        line = f"clearance {reading.figures} µm  {one} – {other}"
        margin = f"{reading.margin_um:g} µm"
        self._show(
            closeness(reading),
            line,
            f"{one} and {other} are nearest to each other: {reading.figures} µm; "
            f"no movement may bring them closer than their margin of {margin}",
        )

    def show_unknown(self, why: str) -> None:
        """Say that the clearance is not known, and why."""
        self._figures.setText("–")
        self._names.set_text(f"unknown: {why}" if why else "unknown")
        line = f"clearance unknown: {why}" if why else "clearance unknown"
        self._show("unknown", line, line)

    def _show(self, state: str, line: str, tip: str) -> None:
        text, tone = _LOOKS[state]
        if text != self._word.text():
            self._word.setText(text)
            self._word.set_tone(tone)
        for widget in (self._word, self._figures, self._names):
            widget.setToolTip(tip)
        self.setAccessibleName(line)
