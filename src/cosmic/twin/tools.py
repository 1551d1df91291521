"""The grippers as the fibres meet them, and the file that says where everything is."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from cosmic.twin.kinematics import Drive, Point, Skeleton, Slide
from cosmic.twin.settings import TwinSettings


@dataclass(frozen=True, slots=True)
class Tool:
    """A gripper at one moment.

    Attributes
    ----------
    hold : (float, float, float)
        Middle between the jaws at their tip, where a fibre leaves them, um, world.
    forward : (float, float)
        Unit vector in the plane, from the jaws outwards.
    gap_um : float
    """

    name: str
    hold: Point
    forward: tuple[float, float]
    gap_um: float


class Gripper:
    """The jaws of one gripper as points that stages carry."""

    def __init__(
        self, skeleton: Skeleton, stage: str, jaws: tuple[str, str], hold_height_um: float
    ) -> None:
        self.slides: tuple[Slide, Slide] = (skeleton.slide(jaws[0]), skeleton.slide(jaws[1]))
        x, y, _ = skeleton.direction(jaws[0], (1.0, 0.0, 0.0))
        self._forward = x, y
        self._stage = stage
        self._height = hold_height_um

    def jaws_at(self, values: Mapping[str, float]) -> tuple[Point, Point]:
        """Return the inner lower edges of both jaws' tips."""
        return self.slides[0].at(values), self.slides[1].at(values)

    def tool(self, name: str, values: Mapping[str, float]) -> Tool:
        """Return the gripper with the stages at `values`."""
        (ax, ay, az), (bx, by, bz) = self.jaws_at(values)
        middle = (ax + bx) / 2.0, (ay + by) / 2.0, (az + bz) / 2.0 + self._height
        return Tool(name, middle, self._forward, values[self._stage])


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
