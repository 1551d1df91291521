"""What platform.toml says about the tools that stages carry through the image."""

import math
from collections.abc import Collection, Sequence
from typing import Annotated, Self

from pydantic import Field, model_validator

from cosmic.frame.config import StrictModel, not_there

Pair = Annotated[tuple[float, float], Field(strict=False)]
Place = Annotated[tuple[float, float, float], Field(strict=False)]


class ToolSettings(StrictModel):
    """One ``[[vico.tool]]``: a gripper, or a probe.

    Attributes
    ----------
    x_axis, y_axis, z_axis : str
        Positioners that move it, each along its axis of the platform; no z: its height stays.
    gap_axis : str
        Positioner whose position is the gap between its jaws; empty: it has none, as a probe.
    tip_um : (float, float, float)
        Where the tip stands with all its axes at 0, on the platform; of a gripper the middle
        between the lower inner corners of its jaws.
    forward : (float, float)
        Direction on the platform from its body out over the tip; its length does not matter.
    width_um : float
        Of the probe, or of one jaw, from above.
    """

    name: str = Field(pattern=r"^[a-z][a-z0-9_]*$")
    title: str = ""
    x_axis: str = Field(min_length=1)
    y_axis: str = Field(min_length=1)
    z_axis: str = ""
    gap_axis: str = ""
    tip_um: Place
    forward: Pair
    width_um: float = Field(gt=0.0)

    @property
    def shown(self) -> str:
        """What the operator reads."""
        return self.title or self.name

    @property
    def axes(self) -> tuple[str, ...]:
        """Every positioner it has."""
        named = (self.x_axis, self.y_axis, self.z_axis, self.gap_axis)
        return tuple(each for each in named if each)

    @model_validator(mode="after")
    def _points_somewhere(self) -> Self:
        if not math.hypot(*self.forward) > 0.0:
            raise ValueError("forward: it points nowhere; give a direction, such as [1, 0]")
        if len(set(self.axes)) != len(self.axes):
            raise ValueError(f"one positioner has two parts in the tool {self.name!r}")
        return self


def tool_mistakes(tools: Sequence[ToolSettings], axes: Collection[str]) -> list[str]:
    """Return a line for every axis that a tool names and that is not there."""
    return [
        f"vico.tool[{index}]: {tool.name}: {not_there('positioner', axis, axes)}"
        for index, tool in enumerate(tools)
        for axis in tool.axes
        if axis not in axes
    ]
