"""The joint box of a movement: all values that all joints may have until it is over."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosmic.mico.core.collision.answer import AxisSpan, Spans
from cosmic.mico.core.collision.model import Drive, Floats, Joint, JointKind, SceneModel

Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class MotionBox:
    """Intervals of joint values; arrays of shape (joints,), um or rad.

    Attributes
    ----------
    low, high
        All places, with overshoot.
    asked_low, asked_high
        The same without overshoot.
    origin
        Where everything stands, as far as it is known; else the middle of the interval.
    origin_known
        False for joints whose axis is somewhere in its interval.
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
    count = len(model.joints)
    low, high = np.zeros(count), np.zeros(count)
    asked_low, asked_high, origin = np.zeros(count), np.zeros(count), np.zeros(count)
    known, moving = np.ones(count, dtype=bool), np.zeros(count, dtype=bool)
    for axis, span in spans.items():
        _check(axis, span, model)
    for drive in model.drives:
        number = model.joint_number[drive.joint]
        joint = model.joints[number]
        span = spans.get(drive.axis, _ANYWHERE)
        asked, wide = _intervals(drive, span)
        now = None if span.now is None else drive.offset + drive.factor * span.now
        asked_low[number], asked_high[number] = _within(asked, joint, now)
        low[number], high[number] = _within(wide, joint, now)
        known[number] = now is not None and not span.estimated
        origin[number] = (low[number] + high[number]) / 2.0 if now is None else now
        moving[number] = span.moving and not span.free
    if not (np.isfinite(low).all() and np.isfinite(high).all()):
        raise SpanError("a joint without end has no interval")
    return MotionBox(low, high, asked_low, asked_high, origin, known, moving)


_ANYWHERE = AxisSpan(-math.inf, math.inf)


def _check(axis: str, span: AxisSpan, model: SceneModel) -> None:
    now = 0.0 if span.now is None else span.now
    if not (span.low <= span.high and math.isfinite(now)):
        raise SpanError(f"{axis}: {span.low} to {span.high} at {span.now} is no interval")
    if axis not in model.axes and span.moving and not span.free:
        raise SpanError(f"{axis} moves nothing in the scene {model.name}; describe its bodies")


def _intervals(drive: Drive, span: AxisSpan) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the interval asked for and the one with overshoot, as joint values."""
    spread = drive.uncertainty if span.estimated else 0.0
    over = drive.overshoot if span.moving else 0.0
    asked = _joint(drive, span.low - spread, span.high + spread)
    return asked, _joint(drive, span.low - spread - over, span.high + spread + over)


def _joint(drive: Drive, low: float, high: float) -> tuple[float, float]:
    one, other = drive.offset + drive.factor * low, drive.offset + drive.factor * high
    return (one, other) if one <= other else (other, one)


def _within(interval: tuple[float, float], joint: Joint, now: float | None) -> tuple[float, float]:
    """Return the part of an interval between the hard stops, which nothing goes beyond.

    A reading a little beyond a stop moves the stop.
    """
    low, high = joint.low, joint.high
    if joint.kind is JointKind.REVOLUTE and not math.isfinite(high - low):
        low, high = -math.pi, math.pi
        if math.isfinite(interval[0] + interval[1]):
            return interval
    if now is not None:
        low, high = min(low, now), max(high, now)
    inside = max(interval[0], low), min(interval[1], high)
    if inside[0] <= inside[1]:
        return inside
    raise SpanError(f"{joint.name}: {interval[0]:g} to {interval[1]:g} lies beyond its hard stops")


def axis_positions(model: SceneModel, values: Floats) -> Mapping[str, float]:
    """Return the position of every axis, in its unit, at joint `values`."""
    positions: dict[str, float] = {}
    for drive in model.drives:
        value = float(values[model.joint_number[drive.joint]])
        positions.setdefault(drive.axis, (value - drive.offset) / drive.factor)
    return positions
