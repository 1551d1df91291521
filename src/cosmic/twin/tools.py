"""The tools as the fibres meet them, and the skeleton of all that moves, read from its URDF."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cosmic.frame.arrays import Floats
from cosmic.twin.kinematics import Drive, Point, Skeleton, Slide
from cosmic.twin.settings import TwinSettings


class Tool(NamedTuple):
    """A gripper at one moment.

    Attributes
    ----------
    hold : (float, float, float)
        Middle between the jaws at their tip, where a fibre leaves them, um, world.
    forward : (float, float)
        Unit vector in the plane, from the jaws outwards.
    gap_um : float
    before_um : float
        The gap at the look before.
    """

    name: str
    hold: Point
    forward: tuple[float, float]
    gap_um: float
    before_um: float

    @property
    def towards(self) -> int:
        """+1 when the jaws point towards +x."""
        return 1 if self.forward[0] > 0.0 else -1


class Gripper:
    """The jaws of one gripper as points that stages carry."""

    def __init__(
        self, skeleton: Skeleton, stage: str, jaws: tuple[str, str], hold_height_um: float
    ) -> None:
        self.slides: tuple[Slide, Slide] = (skeleton.slide(jaws[0]), skeleton.slide(jaws[1]))
        x, y, _ = skeleton.direction(jaws[0], (1.0, 0.0, 0.0))
        self._forward = x, y
        self._stage = stage
        self._hold = _halfway(*self.slides, hold_height_um)

    def jaws_at(self, values: Mapping[str, float], offset: Point) -> tuple[Point, Point]:
        """Return the inner lower edges of both jaws' tips."""
        return added(self.slides[0].at(values), offset), added(self.slides[1].at(values), offset)

    def tool(
        self, name: str, values: Mapping[str, float], offset: Point, before_um: float | None = None
    ) -> Tool:
        """Return the gripper with the stages at `values`.

        Parameters
        ----------
        offset : (float, float, float)
            How far its tip is from where it is drawn.
        """
        gap = values[self._stage]
        before = gap if before_um is None else before_um
        x, y, z = self._hold.at(values)
        hold = x + offset[0], y + offset[1], z + offset[2]
        return Tool(name, hold, self._forward, gap, before)


def added(point: Point, offset: Point) -> Point:
    """Return a point moved by an offset."""
    return point[0] + offset[0], point[1] + offset[1], point[2] + offset[2]


def _halfway(first: Slide, second: Slide, higher_um: float) -> Slide:
    """Return the point between two, and higher; what the jaws do alike remains of their ways."""
    directions: dict[str, Floats] = {}
    for stage, share in (*first.directions, *second.directions):
        directions[stage] = directions.get(stage, np.zeros(3)) + 0.5 * np.array(share)
    x, y, z = 0.5 * (np.array(first.origin) + np.array(second.origin))
    kept = {stage: share for stage, share in directions.items() if np.abs(share).max() > 1e-12}
    return Slide(
        (float(x), float(y), float(z) + higher_um),
        tuple((stage, (float(w[0]), float(w[1]), float(w[2]))) for stage, w in kept.items()),
    )


def make_skeleton(settings: TwinSettings, folder: Path) -> Skeleton:
    """Read the geometry that `settings` names, from the folder of twin.toml.

    Raises
    ------
    ConfigError
        The URDF is missing, broken or does not fit the settings.
    """
    drives = {
        joint: Drive(each.stage, each.factor) for joint, each in settings.geometry.joints.items()
    }
    return Skeleton(folder / settings.geometry.urdf, drives)
