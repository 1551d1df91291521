"""The lines below the scene: how near the nearest pair is, and what was refused."""

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QHBoxLayout, QLabel, QToolButton, QWidget

from cosmic.frame.gui.build import named, set_style_property, tipped
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.state_badge import StateBadge
from cosmic.frame.gui.theme import LARGE_PX, STEP_PX, State, number_font
from cosmic.mico.core.collision.answer import Approach
from cosmic.mico.gui.scene.annotations import distance_text


class ClearanceLine(QWidget):
    """The distance of the nearest pair in figures of one width, and the two bodies."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._approach: Approach | None = None
        self._figures = named(QLabel(), "sceneClearance")
        self._figures.setFont(number_font(LARGE_PX, bold=True))
        self._figures.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        self._figures.setFixedWidth(self._figures.fontMetrics().horizontalAdvance("999999") + 2)
        unit = QLabel("µm")
        unit.setProperty("role", "dim")
        self._names = named(ElidedLabel(), "sceneNearest")
        row = QHBoxLayout(self)
        row.setContentsMargins(STEP_PX, 0, STEP_PX, 0)
        row.setSpacing(STEP_PX // 2)
        row.addWidget(self._figures)
        row.addWidget(unit)
        row.addSpacing(STEP_PX)
        row.addWidget(self._names, 1)
        self.set_nearest(None)

    @property
    def text(self) -> str:
        """What it says, in one line."""
        return f"{self._figures.text()} µm  {self._names.text()}"

    def set_nearest(self, approach: Approach | None) -> None:
        """Show another pair, or that none is known."""
        self._approach = approach
        if approach is None:
            self._figures.setText("–")
            self._names.set_text("nearest pair not known")
            self._tint(refused=False)
            return
        one, other = approach.bodies
        self._figures.setText(distance_text(approach.distance_um))
        inside = approach.distance_um <= approach.margin_um
        margin = f"  (margin {distance_text(approach.margin_um)} µm reached)" if inside else ""
        self._names.set_text(f"{one} – {other}{margin}")
        self._tint(refused=inside)

    def _tint(self, *, refused: bool) -> None:
        set_style_property(self._figures, "role", "refused" if refused else "")


class RefusedLine(QWidget):
    """Says which movement was refused, and takes the ghost away."""

    cleared = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._words = named(ElidedLabel(), "sceneRefused")
        away = tipped(QToolButton(), "Hide the refused movement")
        away.setText("✕")
        away.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        away.clicked.connect(self.cleared)
        row = QHBoxLayout(self)
        row.setContentsMargins(STEP_PX, STEP_PX // 2, STEP_PX, STEP_PX // 2)
        row.setSpacing(STEP_PX)
        self.setAutoFillBackground(True)
        self._badge = StateBadge(State.REFUSED)
        # At the left: another picture lies over the lower right of a large scene.
        for widget in (self._badge, away):
            row.addWidget(widget)
        row.addWidget(self._words, 1)
        self.hide()

    def set_compact(self, compact: bool) -> None:
        """Leave out the badge, which an inset has no room for; the ghost is drawn there."""
        self._badge.setVisible(not compact)

    @property
    def text(self) -> str:
        """What it says; empty when nothing was refused."""
        return self._words.text()

    def set_refused(self, approach: Approach | None) -> None:
        """Show another refused movement, or none."""
        self._words.set_text("" if approach is None else refused_text(approach))
        self.setVisible(approach is not None)


def refused_text(approach: Approach) -> str:
    """Return in words what stood in the way of a movement."""
    one, other = approach.bodies
    if approach.distance_um <= 0.0:
        return f"{one} would touch {other}"
    gap, margin = distance_text(approach.distance_um), distance_text(approach.margin_um)
    return f"{one} would come within {gap} µm of {other} (margin {margin} µm)"
