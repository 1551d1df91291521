"""What the collision gate tells the operator: which bodies, where, how close, what to do."""

import math
from collections.abc import Sequence

from cosmic.frame.units import DISPLAY
from cosmic.frame.verdict import MoveVerdict, Reason, refuse
from cosmic.mico.core.collision.answer import Approach
from cosmic.mico.core.collision.checker import AxisSpan, Spans
from cosmic.mico.core.collision.model import BodyPair, JointKind, SceneModel


def moving_axes(spans: Spans) -> tuple[str, ...]:
    """Return the axes that move and are looked after."""
    return tuple(axis for axis, span in spans.items() if span.moving and not span.free)


def unit_of(model: SceneModel, axis: str) -> str:
    """Return "um" or "deg", empty for an axis that moves nothing in the scene."""
    for drive in model.drives:
        if drive.axis == axis:
            joint = model.joints[model.joint_number[drive.joint]]
            return "deg" if joint.kind is JointKind.REVOLUTE else "um"
    return ""


_REFUSED = "The move was refused. Press Rescan if it happens again."


def no_answer(why: str) -> MoveVerdict:
    """Return the refusal for want of an answer."""
    return refuse(Reason.NO_ANSWER, f"Collision check did not answer ({why}). {_REFUSED}")


def late_answer(how: str) -> MoveVerdict:
    """Return the refusal for want of an answer in time, such as "within 5 s"."""
    return refuse(Reason.NO_ANSWER, f"Collision check did not answer {how}. {_REFUSED}")


def changed() -> MoveVerdict:
    """Return the refusal where what was judged was not true any more when the answer came."""
    return refuse(
        Reason.NO_ANSWER,
        "The platform changed while the collision check looked at it. The move was refused. "
        "Try again.",
    )


def cannot_check(reason: str) -> MoveVerdict:
    """Return the refusal of a question that makes no sense to the gate."""
    return refuse(
        Reason.NO_ANSWER,
        f"the collision check cannot decide this movement: {reason}; nothing was moved",
    )


def collision(
    model: SceneModel, spans: Spans, approach: Approach, *, inside: bool, free_to: float | None
) -> MoveVerdict:
    """Return the refusal of a movement that would bring two bodies too close.

    Parameters
    ----------
    inside : bool
        They are closer than their margin already.
    free_to : float or None
        How far the one axis that moves may go instead, where that is known.
    """
    axes = moving_axes(spans)
    axis = axes[0] if len(axes) == 1 else ""
    unit = unit_of(model, axis)
    limit = _rounded_towards(spans[axis], free_to) if axis and free_to is not None else None
    value = spans[axis].end if axis else None
    story = _already(model, axes, approach) if inside else _would(model, axes, approach)
    return MoveVerdict(
        allowed=False,
        reason=Reason.COLLISION,
        axis=axis,
        value=value if value is not None and math.isfinite(value) else None,
        limit=limit,
        unit=unit,
        bodies=approach.bodies,
        place_um=approach.place_um,
        clearance_um=approach.distance_um,
        pose=tuple(approach.pose.items()),
        text=story if inside else f"{story}; {_advice(axes, spans, limit, unit)}",
    )


def _rounded_towards(span: AxisSpan, free_to: float) -> float:
    """Return the end of the free way in tenths, rounded back towards where the axis stands."""
    now = span.now or 0.0
    tenths = math.floor(free_to * 10.0) if free_to > now else math.ceil(free_to * 10.0)
    return free_to if abs(tenths / 10.0 - free_to) > abs(free_to - now) else tenths / 10.0


def _would(model: SceneModel, axes: Sequence[str], approach: Approach) -> str:
    one, other = _mover_first(model, axes, approach.bodies)
    gap_um = approach.distance_um
    how = f"come within {_length(gap_um)} of" if gap_um > 0.0 else "touch"
    return (
        f"{_names(axes)}: {one} would {how} {other} (margin {_length(approach.margin_um)}) "
        f"at {_place(approach)}"
    )


def _already(model: SceneModel, axes: Sequence[str], approach: Approach) -> str:
    one, other = _mover_first(model, axes, approach.bodies)
    return (
        f"{_names(axes)}: {one} and {other} are closer than their margin of "
        f"{_length(approach.margin_um)} already, at {_place(approach)}; they may only retreat: "
        "move them away from each other"
    )


def _advice(axes: Sequence[str], spans: Spans, limit: float | None, unit: str) -> str:
    if limit is not None:
        shown = f"{limit:.1f} {DISPLAY.get(unit, unit)}".strip()
        return f"it may go to {shown}, or move one of them aside first"
    lost = [axis for axis in axes if _may_be_anywhere(spans[axis])]
    if lost and len(axes) > 1:
        return (
            f"nobody knows where {_names(lost)} is: press Rescan when its device answers again; "
            "if that does not help, restart the program"
        )
    if len(axes) > 1:
        return "move one axis after the other, or one of the two aside first"
    return "move one of them aside first"


def _may_be_anywhere(span: AxisSpan) -> bool:
    return span.now is None and math.isinf(span.low) and math.isinf(span.high)


def _mover_first(model: SceneModel, axes: Sequence[str], bodies: BodyPair) -> BodyPair:
    """Return the two with the one that moves in front, where only one does."""
    joints = {drive.joint for drive in model.drives if drive.axis in axes}
    first, second = (_is_carried(model, body, joints) for body in bodies)
    return (bodies[1], bodies[0]) if second and not first else bodies


def _is_carried(model: SceneModel, body: str, joints: set[str]) -> bool:
    above = {joint.child: joint for joint in model.joints}
    while body in above:
        if above[body].name in joints:
            return True
        body = above[body].parent
    return False


def _names(axes: Sequence[str]) -> str:
    if len(axes) < 2:
        return "".join(axes) or "this movement"
    return f"{', '.join(axes[:-1])} and {axes[-1]}"


def _length(length_um: float) -> str:
    return f"{length_um:.3g} {DISPLAY['um']}" if length_um < 1000.0 else f"{length_um:.0f} µm"


def _place(approach: Approach) -> str:
    x, y, z = (f"{round(value / 1000.0, 2) + 0.0:.2f}" for value in approach.place_um)
    return f"({x}, {y}, {z}) mm"
