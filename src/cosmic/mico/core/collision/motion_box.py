"""The joint box of a movement: all values that all joints may have until it is over."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from cosmic.mico.core.collision.answer import AxisSpan, Spans
from cosmic.mico.core.collision.model import Drive, Floats, Joint, JointKind, SceneModel

Flags = npt.NDArray[np.bool_]
_Row = tuple[float, float, float, float, float, float, float]


@dataclass(frozen=True, eq=False)
class MotionBox:
    """Intervals of joint values; arrays of shape (joints,), um or rad.

    Attributes
    ----------
    low, high
        All places, where everything stands among them, with overshoot.
    asked_low, asked_high
        The same without overshoot.
    origin
        Where everything stands, as far as it is known; else the middle of the interval.
    origin_known
        False for joints whose axis moves from somewhere in its interval.
    moving
        Joints of moving axes that collision detection looks after.
    """

    low: Floats
    high: Floats
    asked_low: Floats
    asked_high: Floats
    origin: Floats
    origin_known: Flags
    moving: Flags

    @property
    def centre(self) -> Floats:
        """The middle of all intervals."""
        return (self.low + self.high) / 2.0

    @property
    def half(self) -> Floats:
        """Half the width of all intervals."""
        return (self.high - self.low) / 2.0

    @property
    def outward(self) -> tuple[Floats, Floats]:
        """How far down and up the joints can go from `origin`.

        An axis sent to one side does not overshoot to the other: else nothing could be driven
        away from where it is too close. One sent nowhere may overshoot to both.
        """
        down, up = self.asked_low < self.origin, self.asked_high > self.origin
        still = ~(down | up)
        lowest = np.where(down | still, self.low - self.origin, 0.0)
        highest = np.where(up | still, self.high - self.origin, 0.0)
        return np.minimum(lowest, 0.0), np.maximum(highest, 0.0)


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
    table = np.array(rows, dtype=float).reshape(-1, 7).T
    low, high, asked_low, asked_high, origin, known, moving = table
    if not np.isfinite(table).all():
        raise SpanError("a joint without end has no interval")
    return MotionBox(low, high, asked_low, asked_high, origin, known > 0.0, moving > 0.0)


_ANYWHERE: Final = AxisSpan(-math.inf, math.inf)
_REST: Final[_Row] = (0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0)


def _check(axis: str, span: AxisSpan, model: SceneModel) -> None:
    now = 0.0 if span.now is None else span.now
    if not (span.low <= span.high and math.isfinite(now)):
        raise SpanError(f"{axis}: {span.low} to {span.high} at {span.now} is no interval")
    if span.moving and not span.free and axis not in model.axes:
        raise SpanError(f"{axis} moves nothing in the scene {model.name}; describe its bodies")


def _row(drive: Drive, joint: Joint, span: AxisSpan) -> _Row:
    """Return one joint's numbers in the order of the fields of `MotionBox`."""
    if span.low == span.now == span.high and not (span.moving or span.estimated):
        rest = drive.offset + drive.factor * span.now
        return rest, rest, rest, rest, rest, 1.0, 0.0
    spread = drive.uncertainty if span.estimated else 0.0
    over = drive.overshoot if span.moving else 0.0
    now = None if span.now is None else drive.offset + drive.factor * span.now
    asked_low, asked_high = low, high = _interval(drive, joint, span, spread, now)
    if over != 0.0:
        low, high = _interval(drive, joint, span, spread + over, now)
    origin = (low + high) / 2.0 if now is None else now
    # An axis at rest whose place is only believed keeps nobody from retreating: the gap that
    # counts is then the one where it is believed to be.
    known = now is not None and not (span.estimated and span.moving)
    moves = span.moving and not span.free
    return low, high, asked_low, asked_high, origin, float(known), float(moves)


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
