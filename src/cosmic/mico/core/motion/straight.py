"""Axes of one controller that keep to a straight line: how, and whether the line is clear.

A controller that starts several channels by one command and controls their speeds keeps them at
the same share of their ways. What can be swept is then the line, as wide as an axis may lag
behind before all are stopped, and not the box that all ways span.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from threading import Lock
from typing import Final

from cosmic.frame.units import format_quantity
from cosmic.frame.verdict import ALLOWED, MoveVerdict, Reason, refuse
from cosmic.mico.core.collision.checker import AxisSpan, Spans
from cosmic.mico.hw.interface import MatchedMove

FINE: Final = 0.1
MOST_CHECKS: Final = 256
"""So many parts of a line are looked at before it is refused."""


@dataclass(frozen=True, slots=True)
class AxisTravel:
    """One axis' part of a line, in its unit.

    Attributes
    ----------
    start, end : float
        Where it stands, and where it goes, in gate coordinates.
    move : MatchedMove
        How it goes.
    beside : str
        The axis whose share of its way is known best, which this one is compared with.
    lag : float
        How far it may fall behind that one before all are stopped.
    wide : float
        How far it may be from its place on the line until all have stopped.
    """

    start: float
    end: float
    move: MatchedMove
    beside: str
    lag: float
    wide: float

    @property
    def length(self) -> float:
        """How far it goes, with its sign."""
        return self.end - self.start

    def share(self, position: float) -> float:
        """Return which part of its way lies behind it."""
        return (position - self.start) / self.length


@dataclass(frozen=True, slots=True)
class StraightLine:
    """The ways of all axes of a group, by name; those without one stay where they are."""

    travels: Mapping[str, AxisTravel]

    @property
    def moves(self) -> tuple[MatchedMove, ...]:
        """What the controller is told."""
        return tuple(own.move for own in self.travels.values())

    def part(self, box: Spans, first: float, last: float) -> Spans:
        """Return where all axes may be between two shares of the line.

        Parameters
        ----------
        box : Spans
            The same for the whole movement with its axes in any order.
        """
        spans = dict(box)
        for name, own in self.travels.items():
            span = box[name]
            ends = own.start + first * own.length, own.start + last * own.length
            low, high = min(ends) - own.wide, max(ends) + own.wide
            # Only at its beginning is it known where everything stands.
            known = span if first == 0.0 else replace(span, now=None, heading=None)
            spans[name] = replace(known, low=_inside(low, span), high=_inside(high, span))
        return spans

    def fine(self, first: float, last: float) -> bool:
        """Return whether a part is so short that its halves would say no more."""
        travels = self.travels.values()
        return all(abs(own.length) * (last - first) <= FINE * own.wide for own in travels)


def _inside(end: float, span: AxisSpan) -> float:
    """Return an end of a part within what the axis may sweep: it is not gone beyond."""
    return min(max(end, span.low), span.high)


def check_line(
    line: StraightLine, box: Spans, check: Callable[[Spans], MoveVerdict]
) -> MoveVerdict:
    """Return whether all of a line is clear, looked at in ever smaller parts.

    Parameters
    ----------
    box : Spans
        Where all axes may be during the whole movement.
    check : callable
        Judges a volume.
    """
    left, checks = [(0.0, 0.5), (0.5, 1.0)][::-1], 0
    while left:
        first, last = left.pop()
        verdict = check(line.part(box, first, last))
        checks += 1
        if verdict.allowed:
            continue
        if verdict.reason is not Reason.COLLISION or line.fine(first, last):
            return verdict
        if checks >= MOST_CHECKS:
            text = "the line is too long to be looked at so finely; move in several parts"
            return refuse(Reason.NO_ANSWER, text)
        middle = (first + last) / 2.0
        left += [(middle, last), (first, middle)]
    return ALLOWED


class LineWatch:
    """Compares how far the axes of a line are; any thread.

    Every reading is of a later moment than those before it, so that an axis which is behind an
    earlier reading of another is behind the axis itself.
    """

    def __init__(self, line: StraightLine) -> None:
        self._line = line
        self._lock = Lock()
        self._shares: dict[str, float] = {}

    def lags(self, name: str, position: float) -> str | None:
        """Take a position that was just read; return why the line is left, or None."""
        own = self._line.travels.get(name)
        if own is None:
            return None
        share = own.share(position)
        with self._lock:
            self._shares[name] = max(share, self._shares.get(name, 0.0))
            beside = self._shares.get(own.beside, share)
        behind = (beside - share) * abs(own.length)
        if behind <= own.lag:
            return None
        unit = own.move.unit
        return (
            f"{name}: it is {format_quantity(behind, unit)} behind {own.beside}; both are stopped"
        )
