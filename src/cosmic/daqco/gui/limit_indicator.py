"""Shows which force limit is in force, whether it is watched, and how far the force is from it."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QWidget

from cosmic.daqco.api.daqco import Daqco, DaqLimit
from cosmic.daqco.gui.limit_banner import limit_text
from cosmic.daqco.gui.plot.units import display_unit
from cosmic.frame.errors import NotAvailable
from cosmic.frame.gui.chip import Chip, Tone
from cosmic.frame.gui.theme import STEP_PX

LOOK_MS: Final = 200


@dataclass(frozen=True, slots=True)
class LimitReading:
    """A limit in one line, and what the pointer over it tells."""

    text: str
    tone: Tone
    tip: str


def distance(limit: DaqLimit, value: float) -> float:
    """Return how far a value is from the nearer side of a limit; negative beyond it."""
    low, high = limit.settings.low, limit.settings.high
    below = math.inf if high is None else high - value
    return min(below, math.inf if low is None else value - low)


def sides_text(low: float | None, high: float | None) -> str:
    """Return the sides that a limit has, in as few signs as say it."""
    if low is None or high is None:
        return f"up to {high:g}" if high is not None else f"down to {low:g}"
    return f"±{high:g}" if low == -high else f"{low:g} to {high:g}"


def reading(limit: DaqLimit, unit: str, value: float | None) -> LimitReading:
    """Return what is shown of a limit; `value` is None where the channel is not measured."""
    given, shown = limit.settings, display_unit(unit)
    name = f"{given.channel} limit {sides_text(given.low, given.high)} {shown}"
    if limit.crossed:
        return LimitReading(f"■ {name}: CROSSED", "alarm", limit_text(limit, unit))
    if not given.armed:
        why = limit.reason or "Arm it in Acquisition > Limits…"
        word = "NOT WATCHED" if limit.reason else "DISARMED"
        return LimitReading(f"▲ {name}: {word}", "warning", f"It stops nothing. {why}")
    if value is None:
        return LimitReading(f"■ {name}: NO DATA", "alarm", "The channel is not measured")
    left = distance(limit, value)
    text = f"{name}: armed, {left:.0f} {shown} to go"
    return LimitReading(text, "quiet", "Crossing it stops every actuator at once")


def short_text(limit: DaqLimit, value: float | None) -> str:
    """Return value, limit and whether it is armed in as little room as a bar has."""
    given = limit.settings
    low, high = given.low, given.high
    nearer_low = high is None or (value is not None and low is not None and value < 0.0)
    side = low if nearer_low else high
    now = "–" if value is None else f"{value:.1f}"
    if not (limit.crossed or given.armed):  # no bound, then: the bar is as wide as with one
        return f"{given.channel} {now} DISARMED"
    bound = "–" if side is None else f"{side:g}"
    return f"{given.channel} {now}/{bound} {'CROSSED' if limit.crossed else 'ARMED'}"


class LimitIndicator(Chip):
    """The limit that matters most: crossed, not watched, or else the nearest; GUI thread.

    Parameters
    ----------
    compact : bool
        Say it in as little room as there is; the tooltip says the rest.
    """

    def __init__(
        self, daqco: Daqco, parent: QWidget | None = None, *, compact: bool = False
    ) -> None:
        super().__init__("", parent=parent)
        self._compact = compact
        self._daqco = daqco
        self._timer = QTimer(self, interval=LOOK_MS)
        self._timer.timeout.connect(self.look)
        self._timer.start()
        self.look()

    def look(self) -> None:
        """Show how things stand now."""
        daqco = self._daqco
        try:
            values = daqco.latest() if daqco.running and not daqco.away else {}
        except NotAvailable:
            values = {}
        self.show_limits(daqco.limits, daqco.units, values)

    def show_limits(
        self, limits: Sequence[DaqLimit], units: Mapping[str, str], values: Mapping[str, float]
    ) -> None:
        """Show the most urgent of `limits`; nothing where there are none."""
        self.setVisible(bool(limits))
        if not limits:
            return

        def urgency(limit: DaqLimit) -> tuple[bool, bool, float]:
            value = values.get(limit.settings.channel, math.nan)
            left = distance(limit, value)
            return (not limit.crossed, limit.settings.armed, left if math.isfinite(left) else 0.0)

        first = min(limits, key=urgency)
        channel = first.settings.channel
        shown = reading(first, units.get(channel, ""), values.get(channel))
        if self._compact:
            self.setText(short_text(first, values.get(channel)))
            self.setToolTip(f"{shown.text}\n{shown.tip}")
            widest = self.fontMetrics().horizontalAdvance(f"{channel} -150.0/-150 ARMED")
            self.setFixedWidth(widest + 3 * STEP_PX)
        else:
            self.setText(shown.text)
            self.setToolTip(shown.tip)
        self.set_tone(shown.tone)
