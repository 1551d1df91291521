"""Small plots as SVG: axes with units and ticks, lines, points, bars."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Final

INK: Final = "#202428"
FAINT: Final = "#d9dde1"
BLUE: Final = "#1f6fb2"
ORANGE: Final = "#c9600c"
GREY: Final = "#7a828a"
LEFT, RIGHT, TOP, BOTTOM = 58.0, 14.0, 12.0, 44.0
TEXT: Final = 11
LETTER: Final = 6.0
"""Width of a letter, more or less."""
AMOUNT, SHORTEST_BAR = 70.0, 60.0
"""Room for an amount beside its bar, and for the longest bar whatever its name."""
STEPS: Final = (1.0, 2.0, 5.0, 10.0)
LOG_PARTS: Final = (
    (0.4, (1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8)),
    (1.2, (1, 1.5, 2, 3, 5, 7)),
    (2.5, (1, 2, 5)),
)
"""Up to how many decades, and which values of each are told."""


@dataclass(frozen=True, slots=True)
class Axis:
    """One axis, with its unit in the label.

    Attributes
    ----------
    low, high : float
        What it shows; both positive where it is logarithmic.
    whole : bool
        Only whole numbers are told.
    """

    label: str
    low: float
    high: float
    log: bool = False
    whole: bool = False

    def part(self, value: float) -> float:
        """Return where a value lies, 0 at the low end and 1 at the high one."""
        low, high = self.low, self.high
        if self.log:
            value, low, high = math.log(value), math.log(low), math.log(high)
        return (value - low) / (high - low)

    def ticks(self) -> list[float]:
        """Return round values inside, five or so."""
        return self._log_ticks() if self.log else self._linear_ticks()

    def _linear_ticks(self) -> list[float]:
        raw = (self.high - self.low) / 5.0
        power = 10.0 ** math.floor(math.log10(raw))
        step = next(each for each in STEPS if each * power >= raw * 0.999) * power
        step = max(step, 1.0) if self.whole else step
        first = math.ceil(self.low / step - 1e-9)
        last = math.floor(self.high / step + 1e-9)
        return [n * step for n in range(first, last + 1)]

    def _log_ticks(self) -> list[float]:
        decades = math.log10(self.high / self.low)
        parts = next((each for most, each in LOG_PARTS if decades < most), (1.0,))
        first, last = math.floor(math.log10(self.low)), math.ceil(math.log10(self.high))
        values = [part * 10.0**n for n in range(first, last + 1) for part in parts]
        return [v for v in values if self.low * 0.999 <= v <= self.high * 1.001]


@dataclass
class Plot:
    """A plot that is drawn part by part.

    Attributes
    ----------
    title : str
        What is told to those who cannot see it.
    """

    x: Axis
    y: Axis
    title: str
    width: float = 430.0
    height: float = 260.0
    _parts: list[str] = field(default_factory=list)

    def line(
        self, xs: Sequence[float], ys: Sequence[float], colour: str = INK, *, dashed: bool = False
    ) -> None:
        """Draw a line through points."""
        path = " ".join(f"{self._px(x):.1f},{self._py(y):.1f}" for x, y in zip(xs, ys, strict=True))
        dash = ' stroke-dasharray="5 4"' if dashed else ""
        self._parts.append(
            f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="1.3"{dash}/>'
        )

    def points(
        self, xs: Sequence[float], ys: Sequence[float], colour: str = BLUE, *, hollow: bool = False
    ) -> None:
        """Draw points: discs, or circles that leave a disc inside to be seen."""
        fill, radius = ("none", 3.6) if hollow else (colour, 2.0)
        for x, y in zip(xs, ys, strict=True):
            self._parts.append(
                f'<circle cx="{self._px(x):.1f}" cy="{self._py(y):.1f}" r="{radius}" fill="{fill}" '
                f'stroke="{colour}" stroke-width="1.1"/>'
            )

    def box(self, x0: float, x1: float, y0: float, y1: float, colour: str = BLUE) -> None:
        """Draw a filled box between values of both axes."""
        left, right = sorted((self._px(x0), self._px(x1)))
        top, bottom = sorted((self._py(y0), self._py(y1)))
        self._parts.append(
            f'<rect x="{left:.1f}" y="{top:.1f}" width="{right - left:.1f}" '
            f'height="{bottom - top:.1f}" fill="{colour}"/>'
        )

    def note(self, x: float, y: float, text: str, *, end: bool = False) -> None:
        """Write a text beside a position."""
        shift = -8.0 if end else 6.0
        self._parts.append(
            _text(self._px(x) + shift, self._py(y) + 4.0, text, anchor="end" if end else "start")
        )

    def svg(self) -> str:
        """Return the drawing."""
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{self.width:g}" '
            f'height="{self.height:g}" viewBox="0 0 {self.width:g} {self.height:g}" role="img" '
            f'aria-label="{escape(self.title)}" font-family="sans-serif" font-size="{TEXT}">'
            f'<rect width="{self.width:g}" height="{self.height:g}" fill="#ffffff"/>'
            f"{self._frame()}{''.join(self._parts)}</svg>"
        )

    def _px(self, x: float) -> float:
        return LEFT + self.x.part(x) * (self.width - LEFT - RIGHT)

    def _py(self, y: float) -> float:
        return self.height - BOTTOM - self.y.part(y) * (self.height - TOP - BOTTOM)

    def _frame(self) -> str:
        bottom, right = self.height - BOTTOM, self.width - RIGHT
        parts = []
        for value in self.x.ticks():
            at = self._px(value)
            parts.append(_stroke(at, TOP, at, bottom, FAINT))
            parts.append(_text(at, bottom + 15.0, _number(value), anchor="middle"))
        for value in self.y.ticks():
            at = self._py(value)
            parts.append(_stroke(LEFT, at, right, at, FAINT))
            parts.append(_text(LEFT - 6.0, at + 4.0, _number(value), anchor="end"))
        parts.append(_stroke(LEFT, bottom, right, bottom, INK))
        parts.append(_stroke(LEFT, TOP, LEFT, bottom, INK))
        middle = (LEFT + right) / 2.0, (TOP + bottom) / 2.0
        parts.append(_text(middle[0], self.height - 10.0, self.x.label, anchor="middle"))
        turned = f'transform="translate(14 {middle[1]:.1f}) rotate(-90)"'
        parts.append(
            f'<text {turned} text-anchor="middle" fill="{INK}">{escape(self.y.label)}</text>'
        )
        return "".join(parts)


def bars(title: str, rows: Sequence[tuple[str, float, str]], *, width: float = 430.0) -> str:
    """Return lying bars: what, how much, and how much in words."""
    height = 24.0 * len(rows) + 8.0
    most = max((amount for _, amount, _ in rows), default=1.0) or 1.0
    letters = int((width - AMOUNT - SHORTEST_BAR - 16.0) / LETTER)
    rows = [(_shortened(name, letters), amount, words) for name, amount, words in rows]
    begin = LETTER * max((len(name) for name, _, _ in rows), default=0) + 16.0
    parts = []
    for number, (name, amount, amount_text) in enumerate(rows):
        top = 24.0 * number + 6.0
        long = max(amount / most * (width - begin - AMOUNT), 1.0)
        parts.append(_text(begin - 8.0, top + 13.0, name, anchor="end"))
        parts.append(
            f'<rect x="{begin:.1f}" y="{top:.1f}" width="{long:.1f}" height="17" fill="{BLUE}"/>'
        )
        parts.append(_text(begin + 6.0 + long, top + 13.0, amount_text, anchor="start"))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}" height="{height:g}" '
        f'viewBox="0 0 {width:g} {height:g}" role="img" aria-label="{escape(title)}" '
        f'font-family="sans-serif" font-size="{TEXT}">'
        f'<rect width="{width:g}" height="{height:g}" fill="#ffffff"/>{"".join(parts)}</svg>'
    )


def _shortened(text: str, letters: int) -> str:
    return text if len(text) <= letters else f"{text[: letters - 1].rstrip()}…"


def around(low: float, high: float, part: float = 0.06) -> tuple[float, float]:
    """Return a range a little wider, and of some width whatever is given."""
    if not high > low:
        room = abs(low) * 0.5 or 1.0
        return low - room, high + room
    return low - part * (high - low), high + part * (high - low)


def _stroke(x0: float, y0: float, x1: float, y1: float, colour: str) -> str:
    return (
        f'<line x1="{x0:.1f}" y1="{y0:.1f}" x2="{x1:.1f}" y2="{y1:.1f}" stroke="{colour}" '
        'stroke-width="1"/>'
    )


def _text(x: float, y: float, text: str, *, anchor: str) -> str:
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{INK}">{escape(text)}</text>'
    )


def _number(value: float) -> str:
    return f"{value:g}" if abs(value) > 1e-12 else "0"
