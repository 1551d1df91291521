"""Paths around obstacles: planned first, shown, then followed (ECM, thesis 3.4.2)."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from cosmic.frame.errors import CosmicError, MoveCancelled
from cosmic.frame.operation import Task
from cosmic.frame.renamed import renamed_in
from cosmic.mico.api.group_movement import move_together
from cosmic.mico.core.motion.manager import DeviceManager
from cosmic.mico.core.motion.orders import Motion, MoveTo
from cosmic.mico.core.planning.problem import Plan

__getattr__ = renamed_in(__name__, {"Way": "PlannedPath"})


@dataclass(frozen=True)
class PlannedPath:
    """A path to some targets on which nothing comes closer than its margin.

    Attributes
    ----------
    start : mapping of float
        Where the axes stood when it was looked for, in gate coordinates and their units.
    waypoints : tuple of mappings of float
        Where they go, one after the other; the axes of a waypoint move at once and may arrive
        in any order. In gate coordinates.
    method : str
        How it was found: "straight", "detour", ...
    length, straight_length : float
        Of the path, and of the straight line to its end; um.
    duration_s : float
        How long it takes, at the speeds that are set.
    """

    start: Mapping[str, float]
    waypoints: tuple[Mapping[str, float], ...]
    method: str
    length: float
    straight_length: float
    duration_s: float


def path_from_plan(plan: Plan) -> PlannedPath:
    """Return a plan as scripts and windows see it."""
    return PlannedPath(
        start=dict(plan.start),
        waypoints=tuple(dict(segment.targets) for segment in plan.segments),
        method=plan.method,
        length=plan.length,
        straight_length=plan.straight_length,
        duration_s=math.nan if plan.duration_s is None else plan.duration_s,
    )


def follow(manager: DeviceManager, path: PlannedPath, task: Task, source: str) -> None:
    """Follow `path` part by part and end `task`; in the application's thread.

    The gate decides each part again when its turn comes.
    """
    try:
        count = len(path.waypoints)
        for number, waypoint in enumerate(path.waypoints):
            if task.cancel_requested:
                raise MoveCancelled("the path was abandoned")
            task.report(number / count, f"part {number + 1} of {count}: {', '.join(waypoint)}")
            motions: dict[str, Motion] = {
                name: MoveTo(target, manager.state(name).unit) for name, target in waypoint.items()
            }
            move_together(manager, motions, task, source=source)
        task.finish()
    except CosmicError as exc:
        task.fail(exc)
