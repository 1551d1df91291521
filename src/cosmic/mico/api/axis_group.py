"""Several axes that a plan moves as one: ``rig.mico.group("left.x", "left.y")``."""

from collections.abc import Callable, Iterable, Mapping, Sequence, Sized
from typing import Any, TypeVar

from typing_extensions import override

from cosmic.frame.arguments import checked_class
from cosmic.frame.errors import ConfigError, CosmicError, NotAvailable, refusal
from cosmic.frame.plan_shape import DataKeys, Readings, plain_name
from cosmic.frame.verdict import MoveVerdict
from cosmic.mico.api.axis_numbers import Number
from cosmic.mico.api.group_movement import GroupMovement
from cosmic.mico.api.move_status import MoveStatus, refused
from cosmic.mico.api.plan_movable import PlanMovable

T = TypeVar("T")

AxisValues = Mapping[str, Number] | Sequence[Number]
"""Targets by axis name, with or without the dot, or in the order of the group's axes."""


class GroupPosition(dict[str, float | None]):
    """Where the axes of a group are, by name; what is added to it are distances."""

    def __add__(self, distances: AxisValues) -> "GroupPosition":
        if isinstance(distances, Mapping):
            by = {plain_name(name): value for name, value in distances.items()}
        else:
            by = dict(zip(self, distances, strict=True))
        return GroupPosition({name: self._moved(name, by.get(name, 0.0)) for name in self})

    def _moved(self, name: str, distance: Number) -> float:
        here = self[name]
        if here is None:
            raise NotAvailable(f"{name}: its position is unknown; reference it first")
        return here + float(distance)


@checked_class
class AxisGroup:
    """Axes that the gate decides together and that start together, in the shape of bluesky.

    Movable, Readable, Configurable, Locatable, Stoppable and Checkable. A target is a mapping by
    axis name, or a sequence in the order of `axes`. Its readings have the names of its axes; those
    of a group with a name of its own begin with that name, so that a plan may read it beside its
    axes. Any thread.
    """

    parent: None = None

    def __init__(
        self,
        axes: Mapping[str, PlanMovable],
        move: Callable[[Mapping[str, Number]], GroupMovement],
        check: Callable[[Mapping[str, Number]], MoveVerdict],
        name: str = "",
    ) -> None:
        if not axes:
            raise ConfigError("a group needs an axis at least")
        self._of = dict(axes)
        self._axes = tuple(axes.values())
        self._name = plain_name(name) or "_and_".join(axis.name for axis in self._axes)
        self._prefix = f"{self._name}_" if name else ""
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

    def check_value(self, value: AxisValues) -> None:
        """Raise `MoveRefused` where `set(value)` would fail with it; nothing moves.

        Raises
        ------
        ConfigError
            `value` does not fit the axes.
        """
        verdict = self._check(self._targets(value))
        if not verdict.allowed:
            raise refusal(verdict)

    def set(self, value: AxisValues) -> MoveStatus:
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

    def locate(self) -> dict[str, GroupPosition]:
        """Return where the axes are, by name, as bluesky's Location."""
        found = {axis.name: axis.locate() for axis in self._axes}
        return {
            what: GroupPosition({name: where[what] for name, where in found.items()})
            for what in ("setpoint", "readback")
        }

    def read(self) -> Readings:
        """Return the positions of all axes."""
        return self._named(axis.read() for axis in self._axes)

    def describe(self) -> DataKeys:
        """Return what `read` returns, in bluesky's terms."""
        return self._named(axis.describe() for axis in self._axes)

    def read_configuration(self) -> Readings:
        """Return what `Axis.read_configuration` returns, of all axes."""
        return self._named(axis.read_configuration() for axis in self._axes)

    def describe_configuration(self) -> DataKeys:
        """Return what `read_configuration` returns, in bluesky's terms."""
        return self._named(axis.describe_configuration() for axis in self._axes)

    def configure(self, settings: Mapping[str, Any]) -> tuple[Readings, Readings]:
        """Change settings of its axes, such as `left_x_frequency_hz`, as `Axis.configure` does."""
        of: dict[str, dict[str, Any]] = {axis.name: {} for axis in self._axes}
        for key, value in settings.items():
            plain = key.removeprefix(self._prefix)
            owner = next((name for name in of if plain.startswith(f"{name}_")), None)
            if owner is None:
                raise ConfigError(f"{self._name}: {key} cannot be set; begin with {', '.join(of)}")
            of[owner][plain] = value
        before = self.read_configuration()
        for axis in self._axes:
            axis.configure(of[axis.name])
        return before, self.read_configuration()

    @property
    def hints(self) -> dict[str, list[str]]:
        """Which of its readings a plot shows: the positions."""
        return {"fields": [f"{self._prefix}{axis.name}" for axis in self._axes]}

    def _named(self, found: Iterable[Mapping[str, T]]) -> dict[str, T]:
        return {f"{self._prefix}{key}": value for each in found for key, value in each.items()}

    def _targets(self, value: AxisValues) -> dict[str, Number]:
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
