"""The joint box of a movement: all values that all joints may have until it is over."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from cosmic.mico.core.collision.checker import AxisSpan, Spans
from cosmic.mico.core.collision.model import Drive, Floats, Joint, JointKind, SceneModel

Flags = npt.NDArray[np.bool_]
_Row = tuple[float, ...]


@dataclass(frozen=True, eq=False)
class MotionBox:
    """Intervals of joint values; arrays of shape (joints,), um or rad.

    Attributes
    ----------
    low, high
        All places, where everything stands among them, with overshoot.
    origin
        Where everything stands, as far as it is known; else the middle of the interval. An
        estimated axis that goes one way only: the place farthest behind at which it may stand.
    origin_known
        False for joints whose axis moves from somewhere in its interval.
    moving
        Joints of moving axes that collision detection looks after.
    lowest, highest
        How far down and up the joints can go from `origin`, overshoot included.

        An axis sent to one side does not overshoot to the other: else nothing could be driven
        away from where it is too close. One sent nowhere may overshoot to both.
    sure
        False for joints whose axis is only estimated and moves.
    goes
        Joints of all axes that move, also of those taken out of collision detection.
    """

    low: Floats
    high: Floats
    origin: Floats
    origin_known: Flags
    moving: Flags
    lowest: Floats
    highest: Floats
    sure: Flags
    goes: Flags

    @property
    def centre(self) -> Floats:
        """The middle of all intervals."""
        return (self.low + self.high) / 2.0

    @property
    def half(self) -> Floats:
        """Half the width of all intervals."""
        return (self.high - self.low) / 2.0

    @property
    def onward(self) -> "MotionBox":
        """The part that is still gone to: from `origin`, what rests where it is believed to be."""
        lowest = np.where(self.goes, self.lowest, 0.0)
        highest = np.where(self.goes, self.highest, 0.0)
        low, high = self.origin + lowest, self.origin + highest
        return replace(self, low=low, high=high, lowest=lowest, highest=highest)


class SpanError(ValueError):
    """What was asked makes no sense; the text says why."""


def make_box(model: SceneModel, spans: Spans) -> MotionBox:
    """Return the joint box of `spans`.

    Axes of the scene that `spans` does not name may be anywhere in their travel.

    Raises
    ------
    SpanError
        A number is NaN, an interval is empty or outside the travel, or an axis that moves is
        not in the scene.
    """
    for axis, span in spans.items():
        _check(axis, span, model)
    number_of = model.joint_number
    rows = [_REST] * len(model.joints)
    for drive in model.drives:
        number = number_of[drive.joint]
        rows[number] = _row(drive, model.joints[number], spans.get(drive.axis, _ANYWHERE))
    table = np.array(rows, dtype=float).reshape(-1, 9).T
    low, high, origin, known, moving, lowest, highest, sure, goes = table
    if not np.isfinite(table).all():
        raise SpanError("a joint without end has no interval")
    return MotionBox(
        low, high, origin, known > 0.0, moving > 0.0, lowest, highest, sure > 0.0, goes > 0.0
    )


_ANYWHERE: Final = AxisSpan(-math.inf, math.inf)
_REST: Final[_Row] = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0)


def _check(axis: str, span: AxisSpan, model: SceneModel) -> None:
    now = 0.0 if span.now is None else span.now
    if not (span.low <= span.high and math.isfinite(now)):
        raise SpanError(f"{axis}: {span.low} to {span.high} at {span.now} is not an interval")
    if span.moving and not span.free and axis not in model.axes:
        raise SpanError(f"{axis} moves nothing in the scene {model.name}; describe its bodies")


def _row(drive: Drive, joint: Joint, span: AxisSpan) -> _Row:
    """Return one joint's numbers in the order of the fields of `MotionBox`."""
    if span.low == span.now == span.high and not (span.moving or span.estimated):
        rest = drive.offset + drive.factor * span.now
        return rest, rest, rest, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0
    believed = drive.uncertainty if span.spread is None else span.spread
    spread = believed if span.estimated else 0.0
    over = drive.overshoot if span.moving else 0.0
    now = None if span.now is None else drive.offset + drive.factor * span.now
    asked = low, high = _interval(drive, joint, span, spread, now)
    if over != 0.0:
        low, high = _interval(drive, joint, span, spread + over, now)
    heading = (span.heading or 0) if drive.factor > 0.0 else -(span.heading or 0)
    sure = not (span.estimated and span.moving)
    # An axis at rest whose place is only believed keeps nobody from retreating: the gap that
    # counts is then the one where it is believed to be.
    known = now is not None and (sure or heading != 0)
    origin = (low + high) / 2.0 if now is None else now
    if heading and not sure and now is not None:
        around = _within(
            now - abs(drive.factor) * spread, now + abs(drive.factor) * spread, joint, now
        )
        origin = around[0] if heading > 0 else around[1]
    down = heading < 0 or (heading == 0 and asked[0] < origin) or not span.moving
    up = heading > 0 or (heading == 0 and asked[1] > origin) or not span.moving
    lowest = min(low - origin, 0.0) if down or not up else 0.0
    highest = max(high - origin, 0.0) if up or not down else 0.0
    moves = span.moving and not span.free
    return (
        low,
        high,
        origin,
        float(known),
        float(moves),
        lowest,
        highest,
        float(sure),
        float(span.moving),
    )


def _interval(
    drive: Drive, joint: Joint, span: AxisSpan, wider: float, now: float | None
) -> tuple[float, float]:
    """Return where a joint may be, `wider` on both sides, with where it stands."""
    one = drive.offset + drive.factor * (span.low - wider)
    other = drive.offset + drive.factor * (span.high + wider)
    low, high = (one, other) if one <= other else (other, one)
    if now is not None:
        low, high = min(low, now), max(high, now)
    return _within(low, high, joint, now)


def _within(low: float, high: float, joint: Joint, now: float | None) -> tuple[float, float]:
    """Return the part of an interval between the hard stops, which nothing goes beyond.

    A reading a little beyond a stop moves the stop.
    """
    first, last = joint.low, joint.high
    if joint.kind is JointKind.REVOLUTE and not math.isfinite(last - first):
        # Without stops one whole turn is everywhere, wherever it is counted from.
        return (low, high) if math.isfinite(high - low) else _whole_turn(now)
    if now is not None:
        first, last = min(first, now), max(last, now)
    inside = max(low, first), min(high, last)
    if inside[0] <= inside[1]:
        return inside
    raise SpanError(f"{joint.name}: {low:g} to {high:g} lies beyond its hard stops")


def _whole_turn(now: float | None) -> tuple[float, float]:
    middle = now or 0.0
    return middle - math.pi, middle + math.pi


def axis_positions(model: SceneModel, values: Floats) -> Mapping[str, float]:
    """Return the position of every axis, in its unit, at joint `values`."""
    positions: dict[str, float] = {}
    for drive in model.drives:
        value = float(values[model.joint_number[drive.joint]])
        positions.setdefault(drive.axis, (value - drive.offset) / drive.factor)
    return positions
