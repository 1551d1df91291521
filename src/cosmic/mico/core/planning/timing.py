"""How fast each axis goes on a leg, and how long a path takes."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from cosmic.frame.errors import NotAvailable
from cosmic.mico.core.planning.problem import Plan, Segment


def speeds(
    segment: Segment, start: Mapping[str, float], top_speed: Mapping[str, float]
) -> Mapping[str, float]:
    """Return the speed of every axis of a leg, in unit/s, so that all arrive together.

    The axis that needs longest goes at its top speed. That keeps the leg close to its straight
    line; it is clear either path.
    """
    distances = {axis: abs(target - start[axis]) for axis, target in segment.targets.items()}
    longest_s = max(
        (distance / _positive(top_speed, axis) for axis, distance in distances.items()), default=0.0
    )
    return {axis: distance / longest_s for axis, distance in distances.items() if distance > 0.0}


def profile(
    segment: Segment,
    start: Mapping[str, float],
    top_speed: Mapping[str, float],
    acceleration: Mapping[str, float],
    *,
    in_phase: bool = True,
) -> "Profile":
    """Return where the axes are at every time of a leg, from rest to rest.

    Parameters
    ----------
    in_phase : bool
        The axes keep step exactly, which stays on the straight line; else each goes as fast as
        it can, as axes do whose controllers know nothing of each other.

    Raises
    ------
    NotAvailable
        There is no such profile.
    """
    axes = tuple(axis for axis, target in segment.targets.items() if target != start[axis])
    distances = {axis: segment.targets[axis] - start[axis] for axis in axes}
    if in_phase:
        shared = _slowest(distances, top_speed, acceleration)
        ramps = dict.fromkeys(axes, shared)
    else:
        ramps = {axis: _slowest({axis: distances[axis]}, top_speed, acceleration) for axis in axes}
    return Profile({axis: _Stroke(start[axis], distances[axis], ramps[axis]) for axis in axes})


class Profile:
    """Positions of the axes of one leg over time."""

    def __init__(self, strokes: "Mapping[str, _Stroke]") -> None:
        self.axes = tuple(strokes)
        self.duration_s = max((each.ramp.duration_s for each in strokes.values()), default=0.0)
        self._strokes = strokes

    def at(self, time_s: float) -> Mapping[str, float]:
        """Return the position of every axis that moves, `time_s` after the start of the leg."""
        return {
            axis: each.begin + each.distance * each.ramp.share(time_s)
            for axis, each in self._strokes.items()
        }


@dataclass(frozen=True, slots=True)
class _Ramp:
    """The share of a stroke that is done over time: a trapezoid of speed, or a triangle.

    Attributes
    ----------
    speed, acceleration : float
        Highest ones, in shares per second, and per second squared.
    """

    speed: float
    acceleration: float

    @property
    def rise_s(self) -> float:
        """How long it gets faster, and at the end slower."""
        return min(self.speed / self.acceleration, math.sqrt(1.0 / self.acceleration))

    @property
    def duration_s(self) -> float:
        """From rest to rest."""
        top = self.acceleration * self.rise_s
        return 1.0 / top + self.rise_s

    def share(self, time_s: float) -> float:
        """Return how much is done at a time; 0 before and 1 after."""
        if time_s >= self.duration_s:
            return 1.0
        rise_s = self.rise_s
        into_s, left_s = max(time_s, 0.0), self.duration_s - max(time_s, 0.0)
        if into_s < rise_s:
            return self.acceleration * into_s**2 / 2.0
        if left_s < rise_s:
            return 1.0 - self.acceleration * left_s**2 / 2.0
        return self.acceleration * rise_s * (into_s - rise_s / 2.0)


@dataclass(frozen=True, slots=True)
class _Stroke:
    """What one axis does on a leg."""

    begin: float
    distance: float
    ramp: _Ramp


def _slowest(
    distances: Mapping[str, float],
    top_speed: Mapping[str, float],
    acceleration: Mapping[str, float],
) -> _Ramp:
    """Return the fastest ramp that no axis is too slow for, if all keep step."""

    def least(most: Mapping[str, float]) -> float:
        shares: Sequence[float] = [
            _positive(most, axis) / abs(distance) for axis, distance in distances.items()
        ]
        return min(shares, default=math.inf)

    return _Ramp(least(top_speed), least(acceleration))


def duration_s(
    plan: Plan,
    top_speed: Mapping[str, float],
    acceleration: Mapping[str, float],
    *,
    in_phase: bool = True,
) -> float:
    """Return how long the legs of a plan take one after the other, without pauses between."""
    total_s = 0.0
    at = dict(plan.start)
    for segment in plan.segments:
        leg = profile(segment, at, top_speed, acceleration, in_phase=in_phase)
        total_s += leg.duration_s
        at.update(segment.targets)
    return total_s


def timed(plan: Plan, top_speed: Mapping[str, float], acceleration: Mapping[str, float]) -> Plan:
    """Return the plan with its duration."""
    return replace(plan, duration_s=duration_s(plan, top_speed, acceleration))


def _positive(values: Mapping[str, float], axis: str) -> float:
    value = values.get(axis, float("nan"))
    if not 0.0 < value < float("inf"):
        raise NotAvailable(f"{axis}: {value!r} per second is not a top speed or acceleration")
    return value
