"""Scenes and problems for the planner, and a check of its plans that shares no code with it."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import pairwise, product

from cosmic.mico.core.collision.checker import AxisSpan
from cosmic.mico.core.collision.model import SceneModel
from cosmic.mico.core.collision.sweep import Sweep
from cosmic.mico.core.planning.planner import plan_path
from cosmic.mico.core.planning.problem import Plan, Problem
from unit.mico.small_scenes import turntable, two_arms

LEFT = ("left.x", "left.y", "left.z")
RIGHT = ("right.x", "right.y", "right.z")
LIMITS = dict.fromkeys((*LEFT, *RIGHT), (-4000.0, 4000.0))


def arms(overshoot: float = 1.0, lift: float | None = 2000.0) -> SceneModel:
    """The two arms, with stages that overshoot and a height at which they travel freely."""
    model = two_arms()
    heights = {} if lift is None else {"left.z": lift, "right.z": lift}
    drives = tuple(replace(drive, overshoot=overshoot) for drive in model.drives)
    return replace(model, drives=drives, detour_height=heights)


def at(**places: float) -> dict[str, float]:
    """All axes at 0 but those given, `left_x` for "left.x"."""
    given = {name.replace("_", "."): place for name, place in places.items()}
    return {axis: given.get(axis, 0.0) for axis in LIMITS}


def solved(sweep: Sweep, problem: Problem) -> Plan:
    """The plan that there must be."""
    found = plan_path(sweep, problem)
    assert isinstance(found, Plan), found
    return found


def corners(found: Plan) -> list[Mapping[str, float]]:
    """Where all axes stand after each leg, beginning with the start."""
    places = [dict(found.start)]
    for leg in found.segments:
        places.append({**places[-1], **leg.targets})
    return places


def boxes(found: Plan) -> Iterator[dict[str, AxisSpan]]:
    """What is asked of the gate for each leg when it is driven, as the gate of a rig asks."""
    for here, there in pairwise(corners(found)):
        yield {
            axis: AxisSpan(
                min(here[axis], there[axis]),
                max(here[axis], there[axis]),
                here[axis],
                moving=here[axis] != there[axis],
            )
            for axis in here
        }


def holds_with_sloppy_stages(model: SceneModel, found: Plan, off: float) -> bool:
    """Whether legs are clear though axes of the way rest up to `off` from where they were sent."""
    sweep = Sweep(model)
    driven = {axis for leg in found.segments for axis in leg.targets}
    for spans in boxes(found):
        sloppy = {
            axis: replace(span, now=None)
            if span.moving
            else (AxisSpan(span.low - off, span.high + off) if axis in driven else span)
            for axis, span in spans.items()
        }
        if not sweep.check(sloppy).clear:
            return False
    return True


def certified(model: SceneModel, found: Plan) -> bool:
    """Whether a gate that has never seen the plan lets every leg pass."""
    return all(Sweep(model).check(spans).clear for spans in boxes(found))


def least_gap(model: SceneModel, found: Plan, steps: int = 4) -> float:
    """The least distance over a dense grid of poses in all boxes of a plan, um."""
    sweep = Sweep(model)
    least = float("inf")
    for here, there in pairwise(corners(found)):
        moving = [axis for axis in here if here[axis] != there[axis]]
        for shares in product([step / steps for step in range(steps + 1)], repeat=len(moving)):
            pose = dict(here)
            for axis, share in zip(moving, shares, strict=True):
                pose[axis] = here[axis] + share * (there[axis] - here[axis])
            nearest = sweep.nearest(pose)
            assert nearest is not None
            least = min(least, nearest.distance_um)
    return least


def table_and_arm() -> SceneModel:
    """A bar that turns below an arm; both overshoot."""
    model = turntable()
    over = {"table.rotation": 0.01}
    drives = tuple(replace(d, overshoot=over.get(d.axis, 1.0)) for d in model.drives)
    return replace(model, drives=drives)
