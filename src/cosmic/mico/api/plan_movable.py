"""`PlanMovable`: an axis as plans of bluesky move it."""

import inspect
import math
from abc import abstractmethod
from collections.abc import Callable, Mapping
from typing import Any, Final, Literal

from typing_extensions import override

from cosmic.frame.arguments import checked_class
from cosmic.frame.clock import WALL
from cosmic.frame.errors import CosmicError, DeviceTimeout, refusal
from cosmic.frame.events import Unsubscribe
from cosmic.frame.plan_shape import (
    DataKeys,
    Readings,
    configure,
    number_key,
    plain_name,
    text_key,
    unix_now_s,
    unix_of_wall_s,
)
from cosmic.frame.plan_signal import PlanSignal
from cosmic.frame.verdict import MoveVerdict
from cosmic.mico.api.axis_numbers import Number, as_number, as_whole
from cosmic.mico.api.move_status import MoveStatus, refused
from cosmic.mico.core.motion.movement import Movement
from cosmic.mico.core.motion.positioner import PositionerState

IN_FORCE_S: Final = 1.0
# How far from a target an axis still counts as standing at it: more than the noise of any sensor.
STANDS_AT: Final = {"um": 1.0, "deg": 0.1}


@checked_class
class PlanMovable(PlanSignal):
    """Movable, Readable, Subscribable, Configurable, Locatable, Stoppable and Checkable.

    Without bluesky. Plans can monitor it, and suspenders watch its position. What is abstract here
    is what all of that is made of.
    """

    parent: None = None
    _asked: tuple[float, MoveStatus] | None = None

    @property
    @abstractmethod
    def key(self) -> str:
        """What `rig.mico`, the platform file and verdicts call it, such as "left.x"."""

    @property
    def name(self) -> str:
        """Name in documents of bluesky, which forbid the dot, and in EPICS, such as "left_x"."""
        return plain_name(self.key)

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

    @property
    @abstractmethod
    def closed_loop_frequency_hz(self) -> int | None:
        """What limits the speed of movements to a position."""

    @abstractmethod
    def set_closed_loop_frequency(self, frequency_hz: Number) -> None:
        """Limit the speed of movements to a position."""

    @abstractmethod
    def _on_state(self, callback: Callable[[PositionerState], object]) -> Unsubscribe:
        """Call `callback(state)` after each change."""

    def check_value(self, value: Number) -> None:
        """Raise `MoveRefused` where `move_to(value)` would; for bluesky's check_limits."""
        verdict = self.check(value)
        if not verdict.allowed:
            raise refusal(verdict)

    def set(self, value: Number) -> MoveStatus:
        """Start to move to `value` and return a bluesky status; a refusal is how it fails."""
        state = self.details
        what = f"{state.name} to {value}"
        try:
            target = as_number(value, state.unit, state.name) + state.zero
            status = MoveStatus(what, self.move_to(value, wait=False))
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
        self.halt()

    def locate(self) -> dict[str, float | None]:
        """Return where it is and where a plan last sent it, as bluesky's Location.

        The setpoint is where it is, once something else has moved it.
        """
        state = self.details
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
        state = self.details
        here = state.shown_position
        when_s = unix_of_wall_s(state.read_wall_s) if here is not None else unix_now_s()
        return {
            self.name: {"value": math.nan if here is None else here, "timestamp": when_s},
        }

    def describe(self) -> DataKeys:
        """Return what `read` returns, in bluesky's terms."""
        return {self.name: number_key(self._source, self.details.unit)}

    def read_configuration(self) -> Readings:
        """Return zero, soft limits, how well the position is known, and what limits the speed."""
        state, now_s = self.details, unix_now_s()
        low, high = state.shown_limits or (math.nan, math.nan)
        frequency_hz = self.closed_loop_frequency_hz
        values = {
            "zero": state.zero,
            "low_limit": low,
            "high_limit": high,
            "confidence": str(state.confidence),
            "frequency_hz": math.nan if frequency_hz is None else frequency_hz,
        }
        return {
            f"{self.name}_{key}": {"value": value, "timestamp": now_s}
            for key, value in values.items()
        }

    def describe_configuration(self) -> DataKeys:
        """Return what `read_configuration` returns, in bluesky's terms."""
        unit, source = self.details.unit, self._source
        keys: DataKeys = {
            f"{self.name}_{key}": number_key(source, unit)
            for key in ("zero", "low_limit", "high_limit")
        }
        return {
            **keys,
            f"{self.name}_confidence": text_key(source),
            f"{self.name}_frequency_hz": number_key(source, "Hz"),
        }

    def configure(self, settings: Mapping[str, Any]) -> tuple[Readings, Readings]:
        """Change `frequency_hz`, which limits the speed; return the settings before and after.

        Raises
        ------
        ConfigError
            Something else is to be changed.
        MoveRefused
            The frequency is not one that the axis takes.
        DeviceTimeout
            It is not in force within a second.
        """
        return configure(self, settings, {"frequency_hz": self._set_frequency})

    def _set_frequency(self, frequency_hz: Number) -> None:
        self.set_closed_loop_frequency(frequency_hz)
        wanted, until_s = as_whole(frequency_hz, "Hz", self.details.name), WALL.now_s() + IN_FORCE_S
        while self.closed_loop_frequency_hz != wanted:
            if WALL.now_s() > until_s:
                raise DeviceTimeout(f"{self.details.name}: {wanted} Hz is not in force yet")
            WALL.sleep(0.005)

    @property
    def hints(self) -> dict[str, list[str]]:
        """Which of its readings a plot shows."""
        return {"fields": [self.name]}

    @property
    def _source(self) -> str:
        return f"{self.controller}:{self.details.name}"

    # What a plan or a script follows

    @override
    def get(self) -> float:
        """Return the position; NaN before the first."""
        here = self.details.shown_position
        return math.nan if here is None else here

    @override
    def subscribe(
        self, function: Callable[..., object], event_type: object = None, run: bool = True
    ) -> Unsubscribe:
        """Call ``function(state)`` after each change; returns the function that ends it.

        It is called in the device's thread and must return at once; a position in motion is read
        about 20 times a second. A function that takes ``value``, ``timestamp`` and ``obj`` by
        name, as those of bluesky do, is called with these, and where `run` at once.
        """
        if not _takes_values(function):
            return self._on_state(function)
        return super().subscribe(function, event_type, run)

    @override
    def _on_news(self, listener: Callable[[], object]) -> Unsubscribe:
        return self._on_state(lambda _state: listener())


def _takes_values(function: Callable[..., object]) -> bool:
    try:
        inspect.signature(function).bind(value=0.0, timestamp=0.0, obj=None)
    except (TypeError, ValueError):  # what is written in C has no signature
        return False
    return True
