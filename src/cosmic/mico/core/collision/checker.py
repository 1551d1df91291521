"""The place where a collision model plugs into the gate: what it is asked, and by which calls.

Thesis 6.1.2, Fig. 6.5. Without Qt, and without the model.
"""

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, fields
from operator import attrgetter
from typing import Any, Final, Protocol

from typing_extensions import override

from cosmic.frame.verdict import MoveVerdict, Reason

NO_MODEL_TEXT = "no collision model"


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


class CollisionChecker(Protocol):
    """Decides whether the volume that some axes may sweep is clear of everything."""

    @property
    @abstractmethod
    def available(self) -> bool:
        """False where there is no model, which windows say loudly."""

    @abstractmethod
    def check(self, spans: Spans, *, advice: bool = True) -> MoveVerdict:
        """Check where all axes may be, those about to move, in flight and at rest; any thread.

        An exception counts as a refusal. Without `advice` a refusal does not say how far the
        axis could go, which takes longer to find out than that it cannot.
        """

    def check_promptly(self, spans: Spans) -> MoveVerdict | None:
        """Answer as `check` where that takes a few milliseconds at most; None where it may not.

        A refusal is said without haste: None leaves it to `check`, as a checker may always do.
        """

    @abstractmethod
    def start(self) -> None:
        """Make it ready to answer; returns when it is, or has failed and answers no."""

    @abstractmethod
    def close(self) -> None:
        """Give everything back; harmless the second time."""


class NoCollisionModel(CollisionChecker):
    """Lets everything pass and says so."""

    @property
    @override
    def available(self) -> bool:
        return False

    @override
    def check(self, spans: Spans, *, advice: bool = True) -> MoveVerdict:
        return MoveVerdict(allowed=True, reason=Reason.ALLOWED, text=f"allowed; {NO_MODEL_TEXT}")

    @override
    def check_promptly(self, spans: Spans) -> MoveVerdict | None:
        return self.check(spans)

    @override
    def start(self) -> None:
        """Do nothing: there is nothing to start."""

    @override
    def close(self) -> None:
        """Do nothing: nothing was started."""
