"""What the collision gate knows of the platform: bodies, joints, convex pieces, pairs.

Plain frozen data without a vendor library, so that it can be sent to another process. Lengths are
micrometres, joint angles radians; transforms read right to left (`parent_from_child`).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int32]
BodyPair = tuple[str, str]


def pair_of(one: str, other: str) -> BodyPair:
    """Return the pair of two bodies in the order in which pairs are kept."""
    return (one, other) if one <= other else (other, one)


class JointKind(StrEnum):
    """How a body can move against its parent."""

    FIXED = "fixed"
    PRISMATIC = "prismatic"
    REVOLUTE = "revolute"


@dataclass(frozen=True, eq=False)
class Shape:
    """A closed triangle mesh that belongs to a body: a convex piece, or something to be drawn.

    Attributes
    ----------
    vertices_um : ndarray, shape (n, 3), float64, um
        In the frame of the body.
    faces : ndarray, shape (m, 3), int32
        Vertex numbers, counter-clockwise seen from outside.
    colour : tuple of float
        Red, green, blue, opacity, each 0 to 1; for shapes that are drawn.
    """

    name: str
    body: str
    vertices_um: Floats
    faces: Indices
    colour: tuple[float, float, float, float] = (0.7, 0.7, 0.7, 1.0)


@dataclass(frozen=True, eq=False)
class Joint:
    """Joins `child` to `parent`; at value 0 the child stands at `parent_from_child`.

    Attributes
    ----------
    parent_from_child : ndarray, shape (4, 4), float64, um
    axis : ndarray, shape (3,), float64
        Unit vector in the frame of the child: the way of a prismatic, the axis of a revolute
        joint.
    low, high : float
        Hard limits, um or rad; infinite where it turns for ever.
    """

    name: str
    kind: JointKind
    parent: str
    child: str
    parent_from_child: Floats
    axis: Floats
    low: float = 0.0
    high: float = 0.0


@dataclass(frozen=True)
class Drive:
    """Which axis moves a joint: joint value = `offset` + `factor` * position of the axis.

    An axis may drive several joints, as a gripper drives two jaws.

    Attributes
    ----------
    factor : float
        um/um, or rad/deg for a rotary axis; with the sign.
    offset : float
        um or rad: value of the joint where the axis reads 0.
    overshoot : float
        How far the axis may run beyond where it is sent, in its unit (um or deg).
    uncertainty : float
        How far it may be from where it is believed to be while its position is only estimated,
        in its unit; infinite: anywhere in its travel.
    """

    axis: str
    joint: str
    factor: float
    offset: float
    overshoot: float = 0.0
    uncertainty: float = float("inf")


@dataclass(frozen=True)
class WatchedPair:
    """Two bodies that must keep a distance."""

    bodies: BodyPair
    margin_um: float


@dataclass(frozen=True)
class AllowedPair:
    """Two bodies that are not watched, and why."""

    bodies: BodyPair
    reason: str


@dataclass(frozen=True)
class Contact:
    """An operation during which some pairs may touch, such as closing a gripper on a fibre."""

    name: str
    pairs: tuple[BodyPair, ...]
    reason: str


@dataclass(frozen=True, eq=False)
class ToolFrame:
    """Where the working point of a tool is, and which way it looks.

    Attributes
    ----------
    body_from_tool : ndarray, shape (4, 4), float64, um
        Its origin is the tool centre point.
    """

    name: str
    body: str
    body_from_tool: Floats


@dataclass(frozen=True, eq=False)
class SceneModel:
    """Everything the gate, the planner and the 3D view need to know.

    Attributes
    ----------
    bodies : tuple of str
        Names, parents before their children; the first is the root and stands still.
    joints : tuple of Joint
        One for every body but the root, in the order of `bodies[1:]`.
    pieces : tuple of Shape
        Convex collision pieces; a body without any is never in the way.
    views : tuple of Shape
        What is drawn.
    park : mapping of float
        Position of axes, in their unit, where nothing is in anybody's way.
    detour_height : mapping of float
        Position of lifting axes, in their unit, at which the others travel freely.
    tools : tuple of ToolFrame
        What has a working point.
    plate : str
        The body on which samples lie; empty: none is named.
    """

    name: str
    bodies: tuple[str, ...]
    joints: tuple[Joint, ...]
    pieces: tuple[Shape, ...]
    views: tuple[Shape, ...]
    drives: tuple[Drive, ...]
    pairs: tuple[WatchedPair, ...]
    allowed: tuple[AllowedPair, ...] = ()
    contacts: tuple[Contact, ...] = ()
    park: Mapping[str, float] = field(default_factory=dict)
    detour_height: Mapping[str, float] = field(default_factory=dict)
    tools: tuple[ToolFrame, ...] = ()
    plate: str = ""

    @cached_property
    def axes(self) -> tuple[str, ...]:
        """Names of the axes that move something here."""
        return tuple(dict.fromkeys(drive.axis for drive in self.drives))

    @cached_property
    def joint_number(self) -> Mapping[str, int]:
        """Place of each joint in `joints`, and so in a vector of joint values."""
        return {joint.name: number for number, joint in enumerate(self.joints)}

    @cached_property
    def body_number(self) -> Mapping[str, int]:
        """Place of each body in `bodies`."""
        return {name: number for number, name in enumerate(self.bodies)}

    def carried(self, axis: str) -> frozenset[str]:
        """Return the bodies that an axis moves."""
        driven = {drive.joint for drive in self.drives if drive.axis == axis}
        bodies: set[str] = set()
        for joint in self.joints:  # parents come before their children
            if joint.name in driven or joint.parent in bodies:
                bodies.add(joint.child)
        return frozenset(bodies)

    def travel(self, axis: str) -> tuple[float, float]:
        """Return the hard limits of an axis in its unit, those of all its joints together.

        Raises
        ------
        KeyError
            Nothing here is moved by it.
        """
        lows, highs = [], []
        for drive in self.drives:
            if drive.axis == axis:
                joint = self.joints[self.joint_number[drive.joint]]
                ends = sorted(
                    (end - drive.offset) / drive.factor for end in (joint.low, joint.high)
                )
                lows.append(ends[0])
                highs.append(ends[1])
        if not lows:
            raise KeyError(axis)
        return max(lows), min(highs)

    def joint_values(self, positions: Mapping[str, float]) -> Floats:
        """Return the value of every joint, shape (joints,), with the axes at `positions`.

        Axes that are not named stand at 0.
        """
        values = np.zeros(len(self.joints))
        for drive in self.drives:
            position = positions.get(drive.axis, 0.0)
            values[self.joint_number[drive.joint]] = drive.offset + drive.factor * position
        return values
