"""Tools by name, moved in space: ``rig.mico.tools["left"]``."""

import math
from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from typing import Final, Protocol

import numpy as np
from typing_extensions import override

from cosmic.frame.arguments import checked_class
from cosmic.frame.errors import NotAvailable, UnknownToolError, refusal
from cosmic.frame.operation import wait_or_cancel
from cosmic.frame.verdict import MoveVerdict, Reason, refuse
from cosmic.mico.api.group_movement import GroupMovement
from cosmic.mico.api.news import SentMotion
from cosmic.mico.core.collision.model import SceneModel
from cosmic.mico.core.collision.tool_frames import (
    FrameName,
    Point,
    Travel,
    UnreachableError,
    axes_of,
    find_tool,
    frame_pose,
    solve,
    tool_pose,
)
from cosmic.mico.core.motion.orders import MoveTo
from cosmic.mico.core.motion.positioner import PositionerState


def _finite(name: str, numbers: Sequence[float]) -> Point:
    """Return three finite numbers; raises `MoveRefused`."""
    if len(numbers) == 3 and all(math.isfinite(each) for each in numbers):
        x_um, y_um, z_um = numbers
        return float(x_um), float(y_um), float(z_um)
    text = f"{name}: {numbers!r} is not a point: give x, y and z in um"
    raise refusal(refuse(Reason.NOT_FINITE, text))


SAME: Final = 1e-4
"""An axis that would go less, um or degrees, stays where it is."""


def travels(states: Mapping[str, PositionerState]) -> dict[str, Travel]:
    """Return what the axes that have limits can do."""
    return {
        state.name: Travel(state.unit, *state.limits, zero=state.zero)
        for state in states.values()
        if state.limits is not None
    }


class Axes(Protocol):
    """What tools need of `Mico`."""

    @property
    @abstractmethod
    def scene_model(self) -> SceneModel:
        """The scene, or `NotAvailable`."""

    @abstractmethod
    def states(self) -> dict[str, PositionerState]:
        """Return the state of every axis."""

    @abstractmethod
    def verdict_on(
        self, motions: Mapping[str, SentMotion], *, consent: bool = False
    ) -> MoveVerdict:
        """Return the gate's answer."""

    @abstractmethod
    def begin_together(
        self,
        motions: dict[str, SentMotion],
        *,
        consent: bool = False,
        linked: bool = True,
        match_arrival: bool = False,
        source: str = "script",
    ) -> GroupMovement:
        """Start motions together."""


@checked_class
class Tool:
    """One tool of the scene, whatever angle its manipulator stands at; any thread.

    Points and distances are x, y, z in um, in one of three frames as they stand now: the world, the
    plate (turned with it), or the tool itself. Only the working point is moved to; the tool turns
    where its axes turn it.
    """

    def __init__(self, axes: Axes, name: str, source: str) -> None:
        self._axes = axes
        self._source = source
        self.name = name

    @override
    def __repr__(self) -> str:
        return f"<tool {self.name}>"

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the axes that carry it."""
        model = self._axes.scene_model
        return axes_of(model, find_tool(model, self.name))

    def position(self, frame: FrameName = "world") -> Point:
        """Return where its working point is.

        Raises
        ------
        NotAvailable
            The position of an axis is not known, or there is no such frame.
        """
        model, at = self._axes.scene_model, self._positions()
        tool = find_tool(model, self.name)
        pose = np.linalg.solve(frame_pose(model, tool, frame, at), tool_pose(model, tool, at))
        x_um, y_um, z_um = pose[:3, 3].tolist()
        return x_um, y_um, z_um

    def targets(self, point_um: Sequence[float], frame: FrameName = "world") -> dict[str, float]:
        """Return where its axes stand with the working point there, in gate coordinates.

        Raises
        ------
        MoveRefused
            The point cannot be reached; the verdict says which axis lacks what.
        NotAvailable
            As `position`.
        """
        x_um, y_um, z_um = _finite(self.name, point_um)
        model, at = self._axes.scene_model, self._positions()
        tool = find_tool(model, self.name)
        pose = frame_pose(model, tool, frame, at)
        wanted = (pose @ [x_um, y_um, z_um, 1.0])[:3]
        try:
            return solve(model, tool, wanted.tolist(), at, travels(self._axes.states()))
        except UnreachableError as exc:
            raise refusal(exc.verdict) from None

    def check(self, point_um: Sequence[float], frame: FrameName = "world") -> MoveVerdict:
        """Return the gate's answer to going there, without moving."""
        return self._axes.verdict_on(self.motions(point_um, frame))

    def move_to(
        self,
        point_um: Sequence[float],
        frame: FrameName = "world",
        *,
        wait: bool = True,
        match_arrival: bool = False,
    ) -> GroupMovement:
        """Move the working point to a point, past the gate, and return the movement.

        Raises
        ------
        MoveRefused
            The point cannot be reached, or the gate says no.
        NotAvailable
            As `position`.
        """
        motions = self.motions(point_um, frame)
        moving = self._axes.begin_together(
            motions, match_arrival=match_arrival, source=self._source
        )
        if wait:
            wait_or_cancel(moving)
        return moving

    def move_by(
        self,
        distance_um: Sequence[float],
        frame: FrameName = "tool",
        *,
        wait: bool = True,
        match_arrival: bool = False,
    ) -> GroupMovement:
        """Move the working point along the axes of a frame; otherwise as `move_to`."""
        x_um, y_um, z_um = _finite(self.name, distance_um)
        here = self.position(frame)
        point = here[0] + x_um, here[1] + y_um, here[2] + z_um
        return self.move_to(point, frame, wait=wait, match_arrival=match_arrival)

    def motions(
        self, point_um: Sequence[float], frame: FrameName = "world"
    ) -> dict[str, SentMotion]:
        """Return what brings it there, in gate coordinates; raises as `targets`."""
        states = self._axes.states()
        return {
            axis: MoveTo(target, states[axis].unit)
            for axis, target in self.targets(point_um, frame).items()
            if abs(target - (states[axis].position or 0.0)) > SAME
        }

    def _positions(self) -> dict[str, float]:
        """Return where all axes of the scene stand that move the tool, or the plate."""
        model, states = self._axes.scene_model, self._axes.states()
        tool = find_tool(model, self.name)
        plate = [axis for axis in model.axes if model.plate in model.carried(axis)]
        found: dict[str, float] = {}
        for axis in (*axes_of(model, tool), *plate):
            state = states.get(axis)
            if state is None or state.position is None or state.confidence == "unknown":
                raise NotAvailable(
                    f"{self.name}: the position of {axis} is unknown; initialise the platform"
                )
            found[axis] = state.position
        return found


@checked_class
class Tools(Mapping[str, Tool]):
    """The tools of the scene by name; any thread."""

    def __init__(self, axes: Axes, source: str) -> None:
        self._axes = axes
        self._source = source

    @override
    def __getitem__(self, name: str) -> Tool:
        """Return a tool; raises `UnknownToolError`, a `CosmicError` and `KeyError`."""
        if name not in list(self):
            raise UnknownToolError(name, self)
        return Tool(self._axes, name, self._source)

    @override
    def __iter__(self) -> Iterator[str]:
        return iter([each.name for each in self._axes.scene_model.tools])

    @override
    def __len__(self) -> int:
        return len(self._axes.scene_model.tools)
