"""How fast each axis goes on a leg and how long a way takes; the only file that knows ruckig."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

from ruckig import InputParameter, Result, Ruckig, Synchronization, Trajectory

from cosmic.frame.errors import NotAvailable
from cosmic.mico.core.planning.problem import Plan, Segment

_NO_JERK_LIMIT: Final = float("inf")


def speeds(
    segment: Segment, start: Mapping[str, float], top_speed: Mapping[str, float]
) -> Mapping[str, float]:
    """Return the speed of every axis of a leg, in unit/s, so that all arrive together.

    The axis that needs longest goes at its top speed. That keeps the leg close to its straight
    line; it is clear either way.
    """
    ways = {axis: abs(target - start[axis]) for axis, target in segment.targets.items()}
    longest_s = max((way / _positive(top_speed, axis) for axis, way in ways.items()), default=0.0)
    return {axis: way / longest_s for axis, way in ways.items() if way > 0.0}


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
    if not axes:
        return Profile((), None)
    asked = InputParameter(len(axes))
    asked.current_position = [start[axis] for axis in axes]
    asked.target_position = [segment.targets[axis] for axis in axes]
    asked.max_velocity = [_positive(top_speed, axis) for axis in axes]
    asked.max_acceleration = [_positive(acceleration, axis) for axis in axes]
    asked.max_jerk = [_NO_JERK_LIMIT] * len(axes)
    # The default, "Time", lets the axes arrive together but leaves the line on the way.
    asked.synchronization = Synchronization.Phase if in_phase else Synchronization.No
    trajectory = Trajectory(len(axes))
    result = Ruckig(len(axes)).calculate(asked, trajectory)
    if result not in (Result.Working, Result.Finished):
        raise NotAvailable(f"no speed profile for {', '.join(axes)}: ruckig says {result.name}")
    return Profile(axes, trajectory)


class Profile:
    """Positions of the axes of one leg over time."""

    def __init__(self, axes: tuple[str, ...], trajectory: Trajectory | None) -> None:
        self.axes = axes
        self._trajectory = trajectory
        self.duration_s: float = trajectory.duration if trajectory is not None else 0.0

    def at(self, time_s: float) -> Mapping[str, float]:
        """Return the position of every axis that moves, `time_s` after the start of the leg."""
        if self._trajectory is None:
            return {}
        place = self._trajectory.at_time(min(max(time_s, 0.0), self.duration_s))[0]
        return dict(zip(self.axes, place, strict=True))


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
        raise NotAvailable(f"{axis}: {value!r} per second is no top speed or acceleration")
    return value
