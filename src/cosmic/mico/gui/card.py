"""What every card of a positioner is drawn on, and the small parts it is put together from."""

import math
from typing import Final

from PySide6.QtCore import QEvent, QRectF, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QHBoxLayout, QLabel, QSizePolicy, QWidget

from cosmic.frame.gui.build import named
from cosmic.frame.gui.chip import Chip, Tone
from cosmic.frame.gui.painting import painting
from cosmic.frame.gui.palette import OKABE_ITO, blend
from cosmic.frame.gui.theme import (
    LARGE_PX,
    STEP_PX,
    State,
    current_palette,
    number_font,
    state_look,
)
from cosmic.frame.overrides import override
from cosmic.frame.units import DISPLAY, format_quantity
from cosmic.mico.core.motion.positioner import Confidence

_EDGE_PX: Final = 3
_LOUD_PX: Final = 2.0
_CALM: Final = (State.OK,)

CONFIDENCE: Final[dict[Confidence, tuple[str, Tone, str]]] = {
    Confidence.KNOWN: ("✓ known", "quiet", "The position is referenced"),
    Confidence.ESTIMATED: ("≈ estimated", "quiet", "No sensor: the position is counted from steps"),
    Confidence.UNKNOWN: (
        "? unknown",
        "warning",
        "The position has no reference yet: initialise, or reference this axis",
    ),
}


class Card(QWidget):
    """A rounded ground whose left edge takes the colour of the state."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._edge = State.OK
        self._loud = False
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Fixed)

    def set_edge(self, state: State) -> None:
        """Colour the edge."""
        if state is not self._edge:
            self._edge = state
            self.update()

    def set_loud(self, loud: bool) -> None:
        """Draw a border that cannot be missed, or the usual one."""
        if loud is not self._loud:
            self._loud = loud
            self.update()

    @override
    def paintEvent(self, event: QPaintEvent) -> None:
        palette = current_palette()
        with painting(self) as painter:
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            inset = _LOUD_PX / 2.0 if self._loud else 0.5
            box = QRectF(self.rect()).adjusted(inset, inset, -inset, -inset)
            loud = QPen(QColor(OKABE_ITO["vermillion"]), _LOUD_PX)
            painter.setPen(loud if self._loud else QColor(palette.border))
            painter.setBrush(QColor(blend(palette.raised, palette.panel, 0.45)))
            painter.drawRoundedRect(box, 5.0, 5.0)
            if self._edge in _CALM:
                return
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(QColor(state_look(self._edge, palette).colour))
            painter.drawRoundedRect(QRectF(0.0, 4.0, _EDGE_PX, self.height() - 8.0), 1.5, 1.5)

    @override
    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange:
            self.update()


class PositionDisplay(QWidget):
    """A position in figures of one width, its unit dimmed beside it; it never changes its size.

    Parameters
    ----------
    unit : str
        "um" or "deg".
    name : str
        Object name of the label with the figures.
    """

    def __init__(self, unit: str, name: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._unit = unit
        self._figures = named(QLabel("–"), name)
        self._figures.setFont(number_font(LARGE_PX, bold=True))
        self._figures.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        widest = format_quantity(-99999.9 if unit == "um" else -359.9999, unit).split(" ")[0]
        self._figures.setFixedWidth(self._figures.fontMetrics().horizontalAdvance(widest) + 2)
        unit_label = QLabel(DISPLAY[unit])
        unit_label.setProperty("role", "dim")
        unit_label.setFixedWidth(unit_label.fontMetrics().horizontalAdvance("µm") + 2)
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(STEP_PX // 2)
        row.addWidget(self._figures)
        row.addWidget(unit_label)
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Preferred)

    @property
    def text(self) -> str:
        """The figures shown."""
        return self._figures.text()

    def show_position(self, position: float | None, *, known: bool = True) -> None:
        """Show `position`, from the user's zero, in grey where it is not known; a dash for none."""
        self._figures.setEnabled(known)
        text = "–" if position is None else format_quantity(position, self._unit).split(" ")[0]
        if text != self._figures.text():
            self._figures.setText(text)


class ConfidenceMark(Chip):
    """Says by shape and word how well a position is known; as wide as its longest word."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("≈ estimated", "warning", parent=parent)
        self.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.setFixedWidth(self.fontMetrics().horizontalAdvance("≈ estimated") + 2 * STEP_PX + 2)
        self.set_confidence(Confidence.UNKNOWN)

    def set_confidence(self, confidence: Confidence, std: float = math.inf) -> None:
        """Show `confidence`, and of an estimate its standard deviation where that is known."""
        text, tone, tip = CONFIDENCE[confidence]
        if confidence is Confidence.ESTIMATED and math.isfinite(std):
            text, tip = f"≈ ± {std:.0f} {DISPLAY['um']}", f"{tip}, ± {std:.0f} {DISPLAY['um']}"
        if text == self.text():
            return
        self.setText(text)
        self.setToolTip(tip)
        self.setAccessibleName(f"position {confidence}")
        self.set_tone(tone)
