"""What the planner is asked and what it answers, as plain data that goes through a pipe."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from cosmic.frame.errors import UnknownAxisError, refusal
from cosmic.frame.verdict import Reason, refuse
from cosmic.mico.core.collision.answer import Approach
from cosmic.mico.core.collision.checker import Spans
from cosmic.mico.core.collision.model import SceneModel

LONGEST_S: Final = 3600.0
"""Longer is a slip of the pen; of some weeks, no time that the system waits for an answer."""


@dataclass(frozen=True)
class Problem:
    """From where to where, and what else stands or moves there.

    Positions are gate coordinates in the unit of each axis (um or deg).

    Attributes
    ----------
    start : mapping of float
        Where the axes stand; those of `goal` must be named, others are taken to rest there.
    goal : mapping of float
        Where the axes shall go; only those to move.
    limits : mapping of (float, float)
        Lowest and highest position of axes; the hard stops where an axis is not named.
    others : mapping of AxisSpan
        All other axes, where they rest or what they hold. One that is named nowhere may be
        anywhere.
    budget_s : float
        Wall time for the search. What was found is then checked once more, which takes a little
        longer.
    optimise : bool
        Use the whole budget to look for a shorter path, instead of taking the first good one.
    """

    start: Mapping[str, float]
    goal: Mapping[str, float]
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    others: Spans = field(default_factory=dict)
    budget_s: float = 1.0
    seed: int = 0
    optimise: bool = False


@dataclass(frozen=True)
class Segment:
    """One leg: the axes named start together, each at any speed, and the leg ends with the last.

    All positions the axes can have on it have been found clear, in whatever order they are
    reached: axes need not keep step with each other.
    """

    targets: Mapping[str, float]


@dataclass(frozen=True)
class Plan:
    """A path from start to goal, leg by leg.

    Attributes
    ----------
    method : str
        "straight", "steps", "one by one", "detour" or "search".
    length, straight_length : float
        Along the corners, and from start to goal; um, turning axes by the travel of their
        farthest point (see `Space`).
    found_length : float
        Before it was made shorter.
    duration_s : float or None
        How long it takes; None until `timing.timed` has worked it out.
    clearance_um : float or None
        Least distance of two watched bodies at the corners; None where there are many.
    """

    start: Mapping[str, float]
    segments: tuple[Segment, ...]
    method: str
    length: float
    straight_length: float
    found_length: float = 0.0
    duration_s: float | None = None
    clearance_um: float | None = None


@dataclass(frozen=True)
class NoPath:
    """No path was found.

    Attributes
    ----------
    text : str
        Why, for the operator: which bodies, where, what to do.
    blocking : Approach or None
        What is too close at the goal or the start, or what blocks the straight path.
    best : mapping of float
        How far the straight path can be followed, in steps; empty where it cannot.
    """

    text: str
    blocking: Approach | None = None
    best: Mapping[str, float] = field(default_factory=dict)


def limits_of(model: SceneModel, problem: Problem, axis: str) -> tuple[float, float]:
    """Return the lowest and highest position of an axis: within its limits and hard stops."""
    low, high = model.travel(axis)
    soft_low, soft_high = problem.limits.get(axis, (low, high))
    return max(low, soft_low), min(high, soft_high)


def validate(model: SceneModel, problem: Problem) -> None:
    """Refuse a problem that makes no sense.

    Raises
    ------
    UnknownAxisError
        An axis to move is not in the scene.
    MoveRefused
        A number is not finite, the position of an axis is unknown, or the time is no time.
    LimitError
        A target lies outside its limits.
    """
    if not 0.0 < problem.budget_s <= LONGEST_S:
        text = f"{problem.budget_s!r} s is not a time to plan a path in; give up to {LONGEST_S:g} s"
        raise refusal(refuse(Reason.NOT_FINITE, text))
    for axis in (*problem.goal, *problem.start):
        if axis not in model.axes:
            raise UnknownAxisError(axis, model.axes)
    for axis, point in problem.start.items():
        _finite(axis, point, "stands at")
    for axis, target in problem.goal.items():
        _finite(axis, target, "is to go to")
        if axis not in problem.start:
            raise refusal(
                refuse(
                    Reason.POSITION_UNKNOWN,
                    f"{axis}: no path can be planned from an unknown position; reference it first",
                    axis=axis,
                )
            )
        _within(model, problem, axis, target)


def _finite(axis: str, value: float, what: str) -> None:
    if not math.isfinite(value):
        raise refusal(
            refuse(Reason.NOT_FINITE, f"{axis} {what} {value!r}: not a position", axis=axis)
        )


def _within(model: SceneModel, problem: Problem, axis: str, target: float) -> None:
    low, high = limits_of(model, problem, axis)
    soft_low, soft_high = problem.limits.get(axis, (low, high))
    if not (soft_low <= soft_high and -math.inf < low <= high < math.inf):
        raise refusal(
            refuse(
                Reason.LIMIT,
                f"{axis}: a path needs limits at both ends, got {soft_low:g} to {soft_high:g}",
                axis=axis,
                value=target,
            )
        )
    if not low <= target <= high:
        raise refusal(
            refuse(
                Reason.LIMIT,
                f"{axis}: {target:g} lies outside its limits, {low:g} to {high:g}",
                axis=axis,
                value=target,
                limit=low if target < low else high,
            )
        )
