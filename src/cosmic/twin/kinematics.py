"""Where the parts of the platform truly are: the twin's own reading of the URDF.

Written apart from the collision gate's kinematics, so that each can be checked by the other.
Lengths are micrometres; angles of stages are degrees.
"""

import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from cosmic.frame.arrays import Floats
from cosmic.frame.errors import ConfigError

Point = tuple[float, float, float]

UM_PER_M: Final = 1e6
_NOWHERE: Final = np.eye(4)
_KINDS: Final = ("fixed", "prismatic", "revolute", "continuous")


@dataclass(frozen=True, slots=True)
class Drive:
    """Which stage moves a joint, and how far for one unit of its own way."""

    stage: str
    factor: float = 1.0


@dataclass(frozen=True, slots=True)
class Joint:
    """One joint of the URDF; lengths in um.

    Attributes
    ----------
    offset : ndarray, shape (4, 4), float64
        `parent_from_child` while the joint stands at zero.
    axis : ndarray, shape (3,), float64
        Unit vector in the child's frame.
    drive : Drive or None
        None: it does not move.
    """

    name: str
    kind: str
    parent: str
    offset: Floats
    axis: Floats
    drive: Drive | None

    def parent_from_child(self, values: Mapping[str, float]) -> Floats:
        """Return where the child is, shape (4, 4), um, with the stages at `values`."""
        if self.drive is None:
            return self.offset
        travel = self.drive.factor * values[self.drive.stage]
        motion = np.eye(4)
        if self.kind == "prismatic":
            motion[:3, 3] = travel * self.axis
        else:
            motion[:3, :3] = _turn(self.axis, math.radians(travel))
        return np.asarray(self.offset @ motion)


@dataclass(frozen=True, slots=True)
class Slide:
    """A point that linear stages carry about: `origin` and a vector for each unit of each stage."""

    origin: Point
    directions: tuple[tuple[str, Point], ...]

    def at(self, values: Mapping[str, float]) -> Point:
        """Return where the point is in the world, um, with the stages at `values`."""
        x, y, z = self.origin
        for stage, (dx, dy, dz) in self.directions:
            value = values[stage]
            x, y, z = x + value * dx, y + value * dy, z + value * dz
        return x, y, z


class Skeleton:
    """The joints of the platform.

    Parameters
    ----------
    path : Path
        The URDF file, in metres and radians.
    drives : mapping of str to Drive
        By name of the joint.

    Raises
    ------
    ConfigError
        The file is missing or no URDF, or a drive names a joint that is not in it.
    """

    def __init__(self, path: Path, drives: Mapping[str, Drive]) -> None:
        self._path = path
        self._joint_of = dict(_joints(path, drives))
        known = {joint.name for joint in self._joint_of.values()}
        missing = [name for name in drives if name not in known]
        if missing:
            raise ConfigError(f"{path}: there is no joint {missing[0]!r}, which a stage drives")
        self._posed: dict[str, tuple[list[float], Floats]] = {}
        self._chains: dict[str, list[Joint]] = {}

    def pose(self, link: str, values: Mapping[str, float]) -> Floats:
        """Return `world_from_link`, shape (4, 4), um, with the stages at `values`; not to write."""
        chain = self._chain(link)
        led = [values[each.drive.stage] for each in chain if each.drive is not None]
        before, pose = self._posed.get(link, ([], _NOWHERE))
        if pose is _NOWHERE or led != before:
            pose = np.eye(4)
            for joint in chain:
                pose = pose @ joint.parent_from_child(values)
            pose.flags.writeable = False
            self._posed[link] = led, pose
        return pose

    def fixed(self, link: str) -> bool:
        """Whether a link is the one that all joints start from."""
        return link not in self._joint_of

    def is_firm_on(self, link: str, other: str) -> bool:
        """Whether a link is another one, or is firmly joined to it."""
        while link != other:
            joint = self._joint_of.get(link)
            if joint is None or joint.drive is not None or joint.kind != "fixed":
                return False
            link = joint.parent
        return True

    @property
    def turning(self) -> frozenset[str]:
        """The links that a stage turns."""
        return frozenset(
            link
            for link in self._joint_of
            if any(each.drive and each.kind != "prismatic" for each in self._chain(link))
        )

    def slide(self, link: str, point_um: Point = (0.0, 0.0, 0.0)) -> Slide:
        """Return how the point `point_um` of `link` follows the stages.

        Raises
        ------
        ConfigError
            A stage turns the link; only what slides can be a tool here.
        """
        pose = np.eye(4)
        directions: list[tuple[str, Point]] = []
        for joint in self._chain(link):
            pose = pose @ joint.offset
            if joint.drive is None:
                continue
            if joint.kind != "prismatic":
                raise ConfigError(f"{self._path}: joint {joint.name} turns {link}, a tool")
            carried = joint.drive.factor * (pose[:3, :3] @ joint.axis)
            directions.append((joint.drive.stage, _point(carried)))
        return Slide(_point(pose @ np.array([*point_um, 1.0])), tuple(directions))

    def turn(self, link: str) -> Floats:
        """Return how a sliding link is turned in the world, shape (3, 3)."""
        return np.asarray(self.pose(link, _Zeros())[:3, :3])

    def direction(self, link: str, axis: Point) -> Point:
        """Return a direction of a sliding link in the world."""
        return _point(self.turn(link) @ np.array(axis))

    def _chain(self, link: str) -> list[Joint]:
        """Return the joints from the root to `link`."""
        if link in self._chains:
            return self._chains[link]
        if link not in self._joint_of:
            raise ConfigError(f"{self._path}: there is no link {link!r} on a joint")
        found = link
        chain: list[Joint] = []
        while link in self._joint_of:
            if len(chain) > len(self._joint_of):
                raise ConfigError(f"{self._path}: the joints above {link!r} form a ring")
            joint = self._joint_of[link]
            chain.append(joint)
            link = joint.parent
        self._chains[found] = chain[::-1]
        return self._chains[found]


class _Zeros(dict[str, float]):
    """All stages at zero."""

    def __missing__(self, key: str) -> float:
        return 0.0


def _joints(path: Path, drives: Mapping[str, Drive]) -> list[tuple[str, Joint]]:
    try:
        root = ET.parse(path).getroot()
    except OSError as exc:
        raise ConfigError(f"{path}: cannot be read: {exc.strerror or exc}") from exc
    except ET.ParseError as exc:
        raise ConfigError(f"{path}: not valid XML: {exc}") from exc
    try:
        return [_joint(path, element, drives) for element in root.iter("joint")]
    except (AttributeError, KeyError, ValueError) as exc:
        raise ConfigError(f"{path}: a joint is not written as URDF has it: {exc}") from exc


def _joint(path: Path, element: ET.Element, drives: Mapping[str, Drive]) -> tuple[str, Joint]:
    name, kind = element.attrib["name"], element.attrib["type"]
    if kind not in _KINDS:
        raise ConfigError(f"{path}: joint {name}: the twin knows no {kind} joints")
    origin, axis = element.find("origin"), element.find("axis")
    offset = np.eye(4)
    if origin is not None:
        offset[:3, :3] = from_rpy(*_numbers(origin.get("rpy", "0 0 0")))
        offset[:3, 3] = np.array(_numbers(origin.get("xyz", "0 0 0"))) * UM_PER_M
    vector = np.array(_numbers("1 0 0" if axis is None else axis.attrib["xyz"]))
    length = float(np.linalg.norm(vector))
    if not 0.0 < length < math.inf:
        raise ConfigError(f"{path}: joint {name}: its axis has no direction")
    drive = drives.get(name)
    if drive is not None and kind == "fixed":
        raise ConfigError(f"{path}: joint {name} is fixed; no stage can drive it")
    parent = _link(element, "parent")
    return _link(element, "child"), Joint(name, kind, parent, offset, vector / length, drive)


def _link(element: ET.Element, which: str) -> str:
    found = element.find(which)
    if found is None:
        raise ValueError(f"{element.attrib['name']} has no {which}")
    return found.attrib["link"]


def _numbers(text: str) -> Point:
    x, y, z = (float(word) for word in text.split())
    return x, y, z


def _point(vector: Floats) -> Point:
    return float(vector[0]), float(vector[1]), float(vector[2])


def from_rpy(roll: float, pitch: float, yaw: float) -> Floats:
    """Return the rotation of URDF's fixed-axis angles: about x, then y, then z."""
    x, y, z = np.eye(3)
    return np.asarray(_turn(z, yaw) @ _turn(y, pitch) @ _turn(x, roll))


def _turn(axis: Floats, angle_rad: float) -> Floats:
    """Return the rotation about `axis` as its quaternion has it."""
    w = math.cos(angle_rad / 2.0)
    x, y, z = math.sin(angle_rad / 2.0) * axis
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
