"""How much of a refused movement could be made."""

import math
from collections.abc import Set
from dataclasses import replace
from typing import Final

from cosmic.frame.clock import WALL
from cosmic.mico.core.collision.checker import Spans
from cosmic.mico.core.collision.model import BodyPair
from cosmic.mico.core.collision.sweep import Sweep

RESOLUTION: Final = 1.0
"""How closely the end of the free way is found, um or degrees; a thousandth of short ways."""
BUDGET_S: Final = 0.05
"""A refusal must not keep others waiting: what was proved until then is told."""


def clear_travel(
    sweep: Sweep,
    spans: Spans,
    axis: str,
    ignored: Set[BodyPair] = frozenset(),
    budget_s: float = BUDGET_S,
) -> float | None:
    """Return how far `axis` may go towards the end of its span, in its unit.

    Every position told is proved free. None when the axis may not go that way at all, when the
    movement has no single end, or when time ran out before anything was known.
    """
    span = spans[axis]
    end = _reachable(sweep, axis, span.end)
    if span.now is None or end is None:
        return None
    until_s = WALL.now_s() + budget_s
    free, blocked = span.now, end
    resolution = min(RESOLUTION, abs(end - span.now) / 1000.0)
    while abs(blocked - free) > resolution and WALL.now_s() < until_s:
        middle = (free + blocked) / 2.0
        part = replace(span, low=min(span.now, middle), high=max(span.now, middle))
        if sweep.check({**spans, axis: part}, ignored).clear:
            free = middle
        else:
            blocked = middle
    return None if free == span.now else free


def _reachable(sweep: Sweep, axis: str, end: float | None) -> float | None:
    """Return `end`, or the hard stop where it has none; None where nothing stops the axis."""
    if end is None or axis not in sweep.model.axes:
        return None
    low, high = sweep.model.travel(axis)
    end = min(max(end, low), high)
    return end if math.isfinite(end) else None
