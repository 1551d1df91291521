"""Ranges of the vertical axes, one a unit, and round numbers for them."""

import math
from dataclasses import dataclass
from typing import Final

from cosmic.frame.units import DISPLAY

_DISPLAY: Final = {**DISPLAY, "uN": "µN", "mN": "mN", "uV": "µV", "ohm": "Ω", "degC": "°C"}
LARGEST: Final = 1e30


def display_unit(unit: str) -> str:
    """Return a unit as the operator reads it."""
    return _DISPLAY.get(unit, unit)


@dataclass(frozen=True, slots=True)
class AxisRange:
    """What one vertical axis shows.

    Attributes
    ----------
    low, high : float
        At the bottom and at the top.
    step : float
        Between two labelled lines.
    """

    low: float
    high: float
    step: float

    def problem(self) -> tuple[str, str]:
        """Return which of "low", "high", "step" is wrong and why; two empty texts when none is."""
        for name in ("low", "high", "step"):
            value = getattr(self, name)
            if not abs(value) <= LARGEST:
                return name, f"give a number up to {LARGEST:g}"
        if not self.low < self.high:
            return "high", f"y-max must lie above y-min, {self.low:g}"
        smallest = max(abs(self.low), abs(self.high)) * 1e-9
        if not self.high - self.low > smallest:
            return "high", "y-min and y-max are too close to each other"
        if not 0.0 < self.step <= self.high - self.low:
            return "step", f"give more than 0 and at most {self.high - self.low:g}"
        if not (self.high - self.low) / self.step <= 100.0:
            return "step", "more than 100 lines would be drawn; enter a larger interval"
        return "", ""

    def lines(self) -> tuple[float, ...]:
        """Return the labelled values."""
        first, last = (
            math.ceil(self.low / self.step - 1e-9),
            math.floor(self.high / self.step + 1e-9),
        )
        return tuple(number * self.step for number in range(first, last + 1))

    def share(self, value: float) -> float:
        """Return where `value` lies: 0 at the bottom, 1 at the top."""
        return (value - self.low) / (self.high - self.low)

    def at(self, share: float) -> float:
        """Return the value there."""
        return self.low + share * (self.high - self.low)

    def decimals(self) -> int:
        """Return how many decimals tell values apart that are a pixel or so apart."""
        return min(9, max(0, 3 - math.floor(math.log10(self.high - self.low))))

    def zoomed(self, factor: float, share: float) -> "AxisRange":
        """Return a range `factor` as wide in which the value at `share` stays where it is."""
        fixed, width = self.at(share), (self.high - self.low) * factor
        low = fixed - share * width
        return AxisRange(low, low + width, round_step(width))


def round_step(width: float, lines: int = 6) -> float:
    """Return 1, 2 or 5 times a power of ten, so that about `lines` steps make `width`."""
    rough = width / lines
    power = 10.0 ** math.floor(math.log10(rough))
    for part in (1.0, 2.0, 5.0):
        if rough <= part * power * (1.0 + 1e-9):
            return part * power
    return 10.0 * power


def range_around(low: float, high: float, head_room: float = 0.15) -> AxisRange:
    """Return a range with round ends in which `low` to `high` lies, with room to move."""
    middle, width = (low + high) / 2.0, high - low
    least = max(abs(middle) * 1e-6, 1e-9)
    width = max(width, least) * (1.0 + 2.0 * head_room)
    step = round_step(width)
    bottom = math.floor((middle - width / 2.0) / step) * step
    top = math.ceil((middle + width / 2.0) / step) * step
    return AxisRange(bottom, top, step)
