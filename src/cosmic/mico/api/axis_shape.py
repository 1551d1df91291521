"""The shape that bluesky expects of an axis: what `Axis` and `AxisMovable` share."""

import math
from abc import abstractmethod
from typing import Final, Literal, Protocol

from typing_extensions import override

from cosmic.frame.arguments import checked_class
from cosmic.frame.errors import CosmicError, refusal
from cosmic.frame.plan_shape import (
    DataKeys,
    Readings,
    number_key,
    plain_name,
    text_key,
    unix_now_s,
    unix_of_wall_s,
)
from cosmic.frame.verdict import MoveVerdict
from cosmic.mico.api.entry import Number, as_number
from cosmic.mico.api.move_status import MoveStatus, refused
from cosmic.mico.core.motion.movement import Movement
from cosmic.mico.core.motion.positioner import PositionerState

# How far from a target an axis still counts as standing at it: more than the noise of any sensor.
STANDS_AT: Final = {"um": 1.0, "deg": 0.1}


class PlanAxis(Protocol):
    """What of an axis its shape is made of."""

    @property
    @abstractmethod
    def details(self) -> PositionerState:
        """Everything known of it."""

    @property
    @abstractmethod
    def controller(self) -> str:
        """Name of the library that drives it."""

    @abstractmethod
    def check(self, position: Number, *, consent: bool = False) -> MoveVerdict:
        """Return the gate's answer to `move_to(position)`, without moving."""

    @abstractmethod
    def move_to(self, position: Number, *, wait: Literal[False], consent: bool = False) -> Movement:
        """Begin to move to `position`."""

    @abstractmethod
    def halt(self) -> None:
        """Stop it."""


@checked_class
class AxisShape:
    """Movable, Readable, Configurable, Locatable, Stoppable and Checkable, without bluesky."""

    parent: None = None
    _asked: tuple[float, MoveStatus] | None = None

    @property
    @abstractmethod
    def name(self) -> str:
        """Name of the axis, such as "left.x"."""

    @property
    @abstractmethod
    def _axis(self) -> PlanAxis:
        """What moves."""

    @property
    def _now(self) -> PositionerState:
        return self._axis.details

    def check_value(self, value: Number) -> None:
        """Raise `MoveRefused` where `move_to(value)` would; for bluesky's check_limits."""
        verdict = self._axis.check(value)
        if not verdict.allowed:
            raise refusal(verdict)

    def set(self, value: Number) -> MoveStatus:
        """Start to move to `value` and return a bluesky status; a refusal is how it fails."""
        state = self._now
        what = f"{state.name} to {value}"
        try:
            target = as_number(value, state.unit, state.name) + state.zero
            status = MoveStatus(what, self._axis.move_to(value, wait=False))
        except CosmicError as exc:
            return refused(what, exc)
        self._asked = target, status
        return status

    def stop(self, success: bool = False) -> None:
        """Stop this axis, as `halt` does.

        What `set` began fails with `MoveCancelled`. With `success`, which bluesky says of a stop
        that belongs to the plan, such as a pause, it ends well.
        """
        if success is True and self._asked is not None:  # whatever it is, this stops
            self._asked[1].finish()
        self._axis.halt()

    def locate(self) -> dict[str, float | None]:
        """Return where it is and where a plan last sent it, as bluesky's Location.

        The setpoint is where it is, once something else has moved it.
        """
        state = self._now
        here, setpoint = state.shown_position, state.shown_position
        if self._asked is not None:
            target, status = self._asked
            near = state.position is not None and (
                abs(state.position - target) <= STANDS_AT[state.unit]
            )
            if not status.done or (status.success and near):
                setpoint = target - state.zero
        return {"setpoint": setpoint, "readback": here}

    def read(self) -> Readings:
        """Return the position as a bluesky reading; NaN before the first."""
        state = self._now
        here = state.shown_position
        when_s = unix_of_wall_s(state.read_wall_s) if here is not None else unix_now_s()
        return {
            self.name: {"value": math.nan if here is None else here, "timestamp": when_s},
        }

    def describe(self) -> DataKeys:
        """Return what `read` returns, in bluesky's terms."""
        return {self.name: number_key(self._source, self._now.unit)}

    def read_configuration(self) -> Readings:
        """Return the user's zero, the soft limits and how well the position is known."""
        state, now_s = self._now, unix_now_s()
        low, high = state.shown_limits or (math.nan, math.nan)
        values = {
            "zero": state.zero,
            "low_limit": low,
            "high_limit": high,
            "confidence": str(state.confidence),
        }
        return {
            f"{self.name}_{key}": {"value": value, "timestamp": now_s}
            for key, value in values.items()
        }

    def describe_configuration(self) -> DataKeys:
        """Return what `read_configuration` returns, in bluesky's terms."""
        unit, source = self._now.unit, self._source
        keys: DataKeys = {
            f"{self.name}_{key}": number_key(source, unit)
            for key in ("zero", "low_limit", "high_limit")
        }
        return {**keys, f"{self.name}_confidence": text_key(source)}

    @property
    def hints(self) -> dict[str, list[str]]:
        """Which of its readings a plot shows."""
        return {"fields": [self.name]}

    @property
    def _source(self) -> str:
        return f"{self._axis.controller}:{self._now.name}"


@checked_class
class AxisMovable(AxisShape):
    """An axis for bluesky's RunEngine, whose documents forbid the dot in a name: "left_x"."""

    def __init__(self, axis: PlanAxis) -> None:
        self._moved = axis

    @override
    def __repr__(self) -> str:
        return f"<AxisMovable {self.name}>"

    @property
    @override
    def name(self) -> str:
        """Name of the axis without the dot, such as "left_x"."""
        return plain_name(self._now.name)

    @property
    @override
    def _axis(self) -> PlanAxis:
        return self._moved

    def check(self, position: Number, *, consent: bool = False) -> MoveVerdict:
        """Return the gate's answer to a move to `position`, without moving."""
        return self._moved.check(position, consent=consent)
