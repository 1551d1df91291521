"""What is asked of the collision gate and what it answers, as plain data; without Qt."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from operator import attrgetter
from typing import Any, Final

from cosmic.mico.core.collision.model import BodyPair

INSIDE_TEXT: Final = "closer than the margin already; they may only move apart"


@dataclass(frozen=True)
class AxisSpan:
    """Where one axis may be from now until the movement is over, in its unit.

    Attributes
    ----------
    low, high : float
        All places it can be at; infinite ends stand for the hard stops.
    now : float or None
        Where it stands as far as is known; None while it moves or is unknown.
    moving : bool
        It is about to move or does already. Pairs that no moving axis brings closer to each
        other are not looked at.
    estimated : bool
        The position is believed, not measured: the span is widened by the drive's uncertainty.
    free : bool
        It was taken out of collision detection: on its own it makes no pair worth looking at.
    heading : int or None
        Which way it goes on from `now` while it moves, 1 or -1; None: either, or nobody knows.
        What lies behind is part of the span, but is not gone to again.
    spread : float or None
        How far an estimated axis may be from where it is believed to be, in its unit; None: the
        drive's uncertainty.
    """

    low: float
    high: float
    now: float | None = None
    moving: bool = False
    estimated: bool = False
    free: bool = False
    heading: int | None = None
    spread: float | None = None

    @property
    def end(self) -> float | None:
        """Where a movement goes; None when it has two ends or nobody knows where it starts."""
        if self.now is None or not self.low <= self.now <= self.high:
            return None
        if self.heading is not None:
            return self.high if self.heading > 0 else self.low
        ends = [end for end in (self.low, self.high) if end != self.now]
        return ends[0] if len(ends) == 1 else None


Spans = Mapping[str, AxisSpan]
PackedSpans = Mapping[str, tuple[Any, ...]]

# Tuples are written and read faster than objects.
_values_of: Final = attrgetter(*(each.name for each in fields(AxisSpan)))


def pack_spans(spans: Spans) -> PackedSpans:
    """Return `spans` as plain tuples."""
    return {axis: _values_of(span) for axis, span in spans.items()}


def unpack_spans(packed: PackedSpans) -> Spans:
    """Return what `pack_spans` packed."""
    return {axis: AxisSpan(*values) for axis, values in packed.items()}


@dataclass(frozen=True)
class Approach:
    """Two bodies at a pose: how far apart, and where.

    Attributes
    ----------
    distance_um : float
        Gap between the two; 0 when they touch or overlap.
    places_um : two tuples of float
        The two points nearest to each other, in world coordinates.
    pose : mapping of float
        Position of every axis, in its unit.
    """

    bodies: BodyPair
    distance_um: float
    places_um: tuple[tuple[float, float, float], tuple[float, float, float]]
    margin_um: float = 0.0
    pose: Mapping[str, float] = field(default_factory=dict)

    @property
    def place_um(self) -> tuple[float, float, float]:
        """The middle between the two points."""
        (ax, ay, az), (bx, by, bz) = self.places_um
        return (ax + bx) / 2.0, (ay + by) / 2.0, (az + bz) / 2.0


@dataclass(frozen=True)
class SweepAnswer:
    """What the gate found in the volume swept.

    Attributes
    ----------
    clear : bool
        No pair can come closer than its margin.
    approach : Approach or None
        Where a pair does, when it is not clear; else the nearest that was looked at, if any.
    reason : str
        Why there is no answer, when there is none; then `clear` is False.
    """

    clear: bool
    approach: Approach | None = None
    reason: str = ""
