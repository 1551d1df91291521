"""Says which limit was crossed, by what and how fast the stop came; offers to reset it."""

from collections.abc import Sequence

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QHBoxLayout, QWidget

from cosmic.daqco.api.daqco import DaqLimit
from cosmic.daqco.gui.plot.units import display_unit
from cosmic.frame.gui.build import named, push_button
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.state_badge import StateBadge
from cosmic.frame.gui.theme import STEP_PX, State


def limit_text(limit: DaqLimit, unit: str) -> str:
    """Return what happened at a limit that was crossed."""
    shown = display_unit(unit)
    sides = [
        f"{side} {value:g} {shown}"
        for side, value in (("low", limit.settings.low), ("high", limit.settings.high))
        if value is not None
    ]
    stopped = ""
    if limit.reaction_ms is not None:
        stopped = f", stopped after {limit.reaction_ms:.1f} ms"
    if limit.value is None and limit.reason:  # nobody knows whether it was crossed
        return f"{limit.reason}{stopped}"
    value = "" if limit.value is None else f": {limit.value:.4g} {shown}"
    return f"{limit.settings.channel} crossed its limit ({', '.join(sides)}){value}{stopped}"


class LimitBanner(QWidget):
    """One line over the image while a limit is latched."""

    reset_requested = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("failedBanner")
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self._channel = ""
        self.text = ElidedLabel()
        self.reset = named(push_button("Reset limit", "Reset the limit"), "resetLimit")
        self.reset.clicked.connect(lambda: self.reset_requested.emit(self._channel))
        row = QHBoxLayout(self)
        row.setContentsMargins(STEP_PX, STEP_PX // 2, STEP_PX, STEP_PX // 2)
        row.addWidget(StateBadge(State.ERROR))
        row.addWidget(self.text, 1)
        row.addWidget(self.reset)
        self.hide()

    def show_limits(self, limits: Sequence[DaqLimit], units: dict[str, str]) -> None:
        """Show the first limit that is latched, and how many more there are."""
        crossed = [limit for limit in limits if limit.crossed]
        self.setVisible(bool(crossed))
        if not crossed:
            return
        first = crossed[0]
        self._channel = first.settings.channel
        text = limit_text(first, units.get(self._channel, ""))
        self.text.set_text(text + (f" (and {len(crossed) - 1} more)" if len(crossed) > 1 else ""))
