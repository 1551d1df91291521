"""Tools in space: where their working points are, and where axes must stand for them; pure.

Manipulators may stand at any angle and be turned by axes of their own: nothing here takes an axis
for one of x, y and z.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from cosmic.frame.errors import NotAvailable
from cosmic.frame.units import AxisUnit, format_quantity
from cosmic.frame.verdict import MoveVerdict, Reason, refuse
from cosmic.mico.core.collision.kinematics import body_poses
from cosmic.mico.core.collision.model import Floats, SceneModel, ToolFrame

FrameName = Literal["world", "plate", "tool"]
Point = tuple[float, float, float]
REACHED_UM: Final = 0.05
"""So near to a point an axis counts as there."""
_MOST_ROUNDS: Final = 60
_PROBE: Final[dict[str, float]] = {"um": 1.0, "deg": 1e-3}
_COST: Final[dict[str, float]] = {"um": 1.0, "deg": 1e4}
"""What a way of 1 is taken for when several axes could do it: turning is the last resort."""
_NO_STEP: Final = 1e-9


@dataclass(frozen=True, slots=True)
class Travel:
    """What an axis can do here: its unit and its soft limits, in gate coordinates."""

    unit: AxisUnit
    low: float
    high: float
    zero: float = 0.0


def find_tool(model: SceneModel, name: str) -> ToolFrame:
    """Return the tool of that name.

    Raises
    ------
    NotAvailable
        The scene has none.
    """
    for tool in model.tools:
        if tool.name == name:
            return tool
    known = ", ".join(each.name for each in model.tools) or "none"
    raise NotAvailable(f"the scene {model.name} has no tool {name!r}; it has: {known}")


def axes_of(model: SceneModel, tool: ToolFrame) -> tuple[str, ...]:
    """Return the axes that carry a tool."""
    return tuple(axis for axis in model.axes if tool.body in model.carried(axis))


def tool_pose(model: SceneModel, tool: ToolFrame, positions: Mapping[str, float]) -> Floats:
    """Return `world_from_tool`, shape (4, 4), um."""
    poses = body_poses(model, model.joint_values(positions))
    return np.asarray(poses[model.body_number[tool.body]] @ tool.body_from_tool)


def frame_pose(
    model: SceneModel, tool: ToolFrame, frame: FrameName, positions: Mapping[str, float]
) -> Floats:
    """Return `world_from_frame`, shape (4, 4), um, as the axes stand.

    Raises
    ------
    NotAvailable
        There is no such frame, or the scene names no plate.
    """
    if frame == "world":
        return np.eye(4)
    if frame == "tool":
        return tool_pose(model, tool, positions)
    if frame != "plate":
        raise NotAvailable(f"there is no frame {frame!r}: it is world, plate or tool")
    if not model.plate:
        raise NotAvailable(f"the scene {model.name} names no plate; add plate = LINK to it")
    poses = body_poses(model, model.joint_values(positions))
    return np.asarray(poses[model.body_number[model.plate]])


class UnreachableError(Exception):
    """A point that a tool cannot be brought to; `verdict` says which axis lacks what."""

    def __init__(self, verdict: MoveVerdict) -> None:
        super().__init__(verdict.text)
        self.verdict = verdict


def solve(
    model: SceneModel,
    tool: ToolFrame,
    wanted_um: Sequence[float],
    positions: Mapping[str, float],
    travels: Mapping[str, Travel],
) -> dict[str, float]:
    """Return where axes must stand for the working point to be at `wanted_um`, in the world.

    Of several solutions it is the one nearest to where the axes stand; axes that are not in
    `travels` stay there.

    Raises
    ------
    UnreachableError
        No solution lies within the limits.
    """
    free = [axis for axis in axes_of(model, tool) if axis in travels]
    goal = np.asarray(wanted_um, dtype=float)
    stand, missed = _approach(model, tool, goal, dict(positions), free, travels)
    first = dict(stand)
    beyond = _beyond(stand, free, travels)
    # An axis at its limit may leave the rest to others; the point itself is never moved.
    while beyond and missed <= REACHED_UM:
        for axis in beyond:
            travel = travels[axis]
            stand[axis] = min(max(stand[axis], travel.low), travel.high)
        free = [axis for axis in free if axis not in beyond]
        stand, missed = _approach(model, tool, goal, stand, free, travels)
        beyond = _beyond(stand, free, travels)
    if missed > REACHED_UM:
        raise UnreachableError(_why(tool, first, travels, positions, missed))
    return {axis: stand[axis] for axis in axes_of(model, tool) if axis in travels}


def _beyond(
    stand: Mapping[str, float], axes: Sequence[str], travels: Mapping[str, Travel]
) -> list[str]:
    return [axis for axis in axes if not travels[axis].low <= stand[axis] <= travels[axis].high]


def _approach(
    model: SceneModel,
    tool: ToolFrame,
    goal: Floats,
    start: Mapping[str, float],
    free: Sequence[str],
    travels: Mapping[str, Travel],
) -> tuple[dict[str, float], float]:
    """Return where `free` axes come nearest to the goal, and how far off that is, um."""
    stand = dict(start)
    missed = goal - tool_pose(model, tool, stand)[:3, 3]
    for _ in range(_MOST_ROUNDS):
        if float(np.linalg.norm(missed)) < REACHED_UM / 100.0 or not free:
            break
        costs = np.array([_COST[travels[axis].unit] for axis in free])
        slopes = np.column_stack([_slope(model, tool, stand, axis, travels[axis]) for axis in free])
        step = np.linalg.lstsq(slopes / costs, missed, rcond=1e-6)[0] / costs
        tried = stand | {axis: stand[axis] + float(d) for axis, d in zip(free, step, strict=True)}
        left = goal - tool_pose(model, tool, tried)[:3, 3]
        if float(np.linalg.norm(left)) >= float(np.linalg.norm(missed)) - _NO_STEP:
            break
        stand, missed = tried, left
    return stand, float(np.linalg.norm(missed))


def _slope(
    model: SceneModel, tool: ToolFrame, stand: Mapping[str, float], axis: str, travel: Travel
) -> Floats:
    probe = _PROBE[travel.unit]
    ends = [
        tool_pose(model, tool, {**stand, axis: stand[axis] + sign * probe})[:3, 3]
        for sign in (1.0, -1.0)
    ]
    return np.asarray((ends[0] - ends[1]) / (2.0 * probe))


def _why(
    tool: ToolFrame,
    stand: Mapping[str, float],
    travels: Mapping[str, Travel],
    positions: Mapping[str, float],
    missed_um: float,
) -> MoveVerdict:
    """Return the refusal of a point: the axis that would have to go beyond its limit, or none."""
    beyond = _beyond(stand, [axis for axis in travels if axis in stand], travels)
    moved = [axis for axis in beyond if stand[axis] != positions.get(axis)]
    if not moved:
        text = (
            f"{tool.name}: its axes do not move it in that direction; "
            f"{format_quantity(missed_um, 'um')} are missing at the nearest point"
        )
        return refuse(Reason.WRONG_KIND, text)
    lacks = []
    for axis in moved:
        travel = travels[axis]
        limit = travel.high if stand[axis] > travel.high else travel.low
        lacks.append((axis, stand[axis] - travel.zero, limit - travel.zero, travel.unit))
    said = "; ".join(
        f"{axis} would have to be at {format_quantity(value, unit)}, its limit is "
        f"{format_quantity(limit, unit)}: {format_quantity(abs(value - limit), unit)} are missing"
        for axis, value, limit, unit in lacks
    )
    axis, value, limit, unit = lacks[0]
    text = f"{tool.name}: {said}"
    return refuse(Reason.LIMIT, text, axis=axis, value=value, limit=limit, unit=unit)
