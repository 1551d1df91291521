"""Several axes that a plan moves as one: ``rig.mico.group("left.x", "left.y")``."""

from collections.abc import Callable, Mapping, Sequence, Sized

from typing_extensions import override

from cosmic.frame.arguments import checked_class
from cosmic.frame.errors import ConfigError, CosmicError, refusal
from cosmic.frame.plan_shape import DataKeys, Readings, plain_name
from cosmic.frame.verdict import MoveVerdict
from cosmic.mico.api.axis_shape import AxisMovable
from cosmic.mico.api.entry import Number
from cosmic.mico.api.group import GroupMovement
from cosmic.mico.api.move_status import MoveStatus, refused

Place = Mapping[str, Number] | Sequence[Number]
"""Targets by axis name, with or without the dot, or in the order of the group's axes."""


@checked_class
class AxisGroup:
    """Axes that the gate decides together and that start together, in the shape of bluesky.

    Movable, Readable, Configurable, Locatable, Stoppable and Checkable. A target is a mapping by
    axis name, or a sequence in the order of `axes`. Any thread.
    """

    parent: None = None

    def __init__(
        self,
        axes: Mapping[str, AxisMovable],
        move: Callable[[Mapping[str, Number]], GroupMovement],
        check: Callable[[Mapping[str, Number]], MoveVerdict],
        name: str = "",
    ) -> None:
        if not axes:
            raise ConfigError("a group needs an axis at least")
        self._of = dict(axes)
        self._axes = tuple(axes.values())
        self._name = plain_name(name) or "_and_".join(axis.name for axis in self._axes)
        self._move, self._check = move, check
        self._asked: MoveStatus | None = None

    @override
    def __repr__(self) -> str:
        return f"<AxisGroup {self._name}>"

    @property
    def name(self) -> str:
        """Name of the group; the names of its axes where it was given none."""
        return self._name

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the axes, in the order in which a sequence of targets is read."""
        return tuple(self._of)

    def check_value(self, value: Place) -> None:
        """Raise `MoveRefused` where `set(value)` would fail with it; nothing moves.

        Raises
        ------
        ConfigError
            `value` does not fit the axes.
        """
        verdict = self._check(self._targets(value))
        if not verdict.allowed:
            raise refusal(verdict)

    def set(self, value: Place) -> MoveStatus:
        """Start to move to `value` and return a bluesky status; a refusal is how it fails."""
        what = f"{self._name} to {value}"
        try:
            self._asked = MoveStatus(what, self._move(self._targets(value)))
        except CosmicError as exc:
            return refused(what, exc)
        return self._asked

    def stop(self, success: bool = False) -> None:
        """Stop every axis of the group; otherwise as `Axis.stop`."""
        if success is True and self._asked is not None:  # whatever it is, this stops
            self._asked.finish()
        for axis in self._axes:
            axis.stop(success=success)

    def locate(self) -> dict[str, dict[str, float | None]]:
        """Return where the axes are, by name, as bluesky's Location."""
        found = {axis.name: axis.locate() for axis in self._axes}
        return {
            what: {name: where[what] for name, where in found.items()}
            for what in ("setpoint", "readback")
        }

    def read(self) -> Readings:
        """Return the positions of all axes."""
        return {key: value for axis in self._axes for key, value in axis.read().items()}

    def describe(self) -> DataKeys:
        """Return what `read` returns, in bluesky's terms."""
        return {key: value for axis in self._axes for key, value in axis.describe().items()}

    def read_configuration(self) -> Readings:
        """Return what `Axis.read_configuration` returns, of all axes."""
        return {
            key: value for axis in self._axes for key, value in axis.read_configuration().items()
        }

    def describe_configuration(self) -> DataKeys:
        """Return what `read_configuration` returns, in bluesky's terms."""
        return {
            key: value
            for axis in self._axes
            for key, value in axis.describe_configuration().items()
        }

    @property
    def hints(self) -> dict[str, list[str]]:
        """Which of its readings a plot shows: the positions."""
        return {"fields": [axis.name for axis in self._axes]}

    def _targets(self, value: Place) -> dict[str, Number]:
        if isinstance(value, Mapping):
            known = {plain_name(name): name for name in self._of}
            unknown = [name for name in value if plain_name(name) not in known]
            if unknown or not value:
                raise ConfigError(f"{self._name} has {list(self._of)}, not {unknown or 'nothing'}")
            return {known[plain_name(name)]: target for name, target in value.items()}
        sized = isinstance(value, Sized) and not isinstance(value, str | bytes)
        if not sized or len(value) != len(self._of):
            text = f"value {value!r} is not {len(self._of)} numbers, for {list(self._of)}"
            raise ConfigError(f"{self._name}: {text}")
        return dict(zip(self._of, value, strict=True))
