"""How near the bodies of a platform truly are: its files read a second time, and exact distances.

Nothing here comes from the program or from a collision library. Lengths are in um, except in the
URDF itself.
"""

import math
import struct
import tomllib
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from .convex import distance

UM = 1e6
ROUND = 192  # corners of a cylinder's rim: inside the true one by 2 um at a radius of 15 mm


def _numbers(text: str | None, default: str) -> np.ndarray:
    return np.array([float(each) for each in (text or default).split()])


def _pose(element: ET.Element | None) -> tuple[Rotation, np.ndarray]:
    origin = None if element is None else element.find("origin")
    if origin is None:
        return Rotation.identity(), np.zeros(3)
    turn = Rotation.from_euler("xyz", _numbers(origin.get("rpy"), "0 0 0"))
    return turn, _numbers(origin.get("xyz"), "0 0 0") * UM


def _stl(path: Path) -> np.ndarray:
    data = path.read_bytes()
    (count,) = struct.unpack_from("<I", data, 80)
    facet = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    facets = np.frombuffer(data, dtype=facet, count=count, offset=84)
    return np.unique(facets["corners"].reshape(-1, 3).astype(float), axis=0)


def _points(geometry: ET.Element, folder: Path) -> np.ndarray:
    box, cylinder, mesh = (geometry.find(kind) for kind in ("box", "cylinder", "mesh"))
    if box is not None:
        half = _numbers(box.get("size"), "0 0 0") / 2.0
        signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        return signs * half * UM
    if cylinder is not None:
        radius, length = float(cylinder.get("radius", 0)), float(cylinder.get("length", 0))
        turn = 2.0 * math.pi * np.arange(ROUND) / ROUND
        rim = np.column_stack((radius * np.cos(turn), radius * np.sin(turn), np.zeros(ROUND)))
        up = np.array([0.0, 0.0, length / 2.0])
        return np.vstack((rim - up, rim + up)) * UM
    assert mesh is not None
    points = _stl(folder / mesh.get("filename", "")) * _numbers(mesh.get("scale"), "1 1 1")
    return points[ConvexHull(points).vertices] * UM


@dataclass(frozen=True)
class Near:
    """Two bodies at one moment: how far apart, and what they must keep."""

    bodies: tuple[str, str]
    distance_um: float
    margin_um: float

    @property
    def spare_um(self) -> float:
        """How much nearer they might come."""
        return self.distance_um - self.margin_um


@dataclass(frozen=True)
class _Joint:
    name: str
    kind: str
    parent: str
    child: str
    turn: Rotation
    origin: np.ndarray
    axis: np.ndarray


class PlatformClearance:
    """The watched pairs of a scene; `nearest` tells how near they are.

    Parameters
    ----------
    scene : path
        The scene's TOML, which names URDF and SRDF.
    """

    def __init__(self, scene: Path) -> None:
        facts = tomllib.loads(scene.read_text(encoding="utf-8"))
        robot = ET.parse(scene.parent / facts["urdf"]).getroot()
        self._joints = self._read_joints(robot)
        self._drives = [
            (each["axis"], each["joint"], float(each.get("factor", 1.0)), each.get("offset", 0.0))
            for each in facts["drive"]
        ]
        rotary = {joint.name for joint in self._joints if joint.kind in ("revolute", "continuous")}
        self._rotary = {axis for axis, joint, *_ in self._drives if joint in rotary}
        self._bodies: list[str] = []
        self._pieces: list[np.ndarray] = []
        for link in robot.findall("link"):
            for collision in link.findall("collision"):
                turn, origin = _pose(collision)
                geometry = collision.find("geometry")
                assert geometry is not None
                self._bodies.append(link.get("name", ""))
                self._pieces.append(turn.apply(_points(geometry, scene.parent)) + origin)
        self._read_pairs(facts, scene.parent)
        self.reach_um = 60_000.0  # no corner is farther from the turning axis of the table

    def _read_joints(self, robot: ET.Element) -> list[_Joint]:
        joints = []
        for each in robot.findall("joint"):
            turn, origin = _pose(each)
            axis = each.find("axis")
            along = _numbers(None if axis is None else axis.get("xyz"), "1 0 0")
            parent, child = each.find("parent"), each.find("child")
            assert parent is not None
            assert child is not None
            joints.append(
                _Joint(
                    each.get("name", ""),
                    each.get("type", ""),
                    parent.get("link", ""),
                    child.get("link", ""),
                    turn,
                    origin,
                    along / np.linalg.norm(along),
                )
            )
        return joints

    def _read_pairs(self, facts: Mapping[str, object], folder: Path) -> None:
        srdf = ET.parse(folder / str(facts["srdf"])).getroot()
        allowed = {
            frozenset((each.get("link1", ""), each.get("link2", "")))
            for each in srdf.findall("disable_collisions")
        }
        own = {
            frozenset(each["bodies"]): float(each["margin_um"])
            for each in facts.get("pair", [])  # type: ignore[attr-defined]
        }
        driven = {joint.child for joint in self._joints if joint.kind != "fixed"}
        firm = self._firm_groups(driven)
        self._pairs, self._margins = [], []
        for one, other in combinations(range(len(self._pieces)), 2):
            bodies = frozenset((self._bodies[one], self._bodies[other]))
            if len(bodies) == 1 or bodies in allowed or len({firm[body] for body in bodies}) == 1:
                continue
            self._pairs.append((one, other))
            self._margins.append(own.get(bodies, float(facts["margin_um"])))  # type: ignore[arg-type]
        self._one = np.array([one for one, _ in self._pairs])
        self._other = np.array([other for _, other in self._pairs])
        self._margin = np.array(self._margins)

    def _firm_groups(self, driven: set[str]) -> dict[str, str]:
        """Return for each body the one that it is screwed to, and that moves by a joint."""
        above = {joint.child: joint for joint in self._joints}
        bodies = set(above) | {joint.parent for joint in self._joints}

        def root(body: str) -> str:
            while body in above and body not in driven:
                body = above[body].parent
            return body

        return {body: root(body) for body in bodies}

    def _world(self, positions: Mapping[str, float]) -> list[np.ndarray]:
        values: dict[str, float] = {}
        for axis, joint, factor, offset in self._drives:
            value = factor * positions[axis] + offset
            values[joint] = math.radians(value) if axis in self._rotary else value
        children = {joint.child for joint in self._joints}
        stands = {
            joint.parent: (Rotation.identity(), np.zeros(3))
            for joint in self._joints
            if joint.parent not in children
        }
        left = list(self._joints)
        while left:
            joint = next(each for each in left if each.parent in stands)
            left.remove(joint)
            turn, origin = stands[joint.parent]
            origin, turn = turn.apply(joint.origin) + origin, turn * joint.turn
            value = values.get(joint.name, 0.0)
            if joint.kind == "prismatic":
                origin = origin + turn.apply(value * joint.axis)
            elif joint.kind != "fixed":
                turn = turn * Rotation.from_rotvec(value * joint.axis)
            stands[joint.child] = (turn, origin)
        return [
            points @ stands[body][0].as_matrix().T + stands[body][1]
            for body, points in zip(self._bodies, self._pieces, strict=True)
        ]

    def nearest(self, positions: Mapping[str, float], *, beyond_um: float = 1000.0) -> Near:
        """Return the pair with the least to spare; boxes do for what is farther than `beyond_um`.

        Parameters
        ----------
        positions : mapping of float
            Where each axis truly stands, um or degrees.
        """
        world = self._world(positions)
        low = np.array([points.min(axis=0) for points in world])
        high = np.array([points.max(axis=0) for points in world])
        apart = np.maximum(low[self._other] - high[self._one], low[self._one] - high[self._other])
        gaps = np.linalg.norm(np.maximum(apart, 0.0), axis=1)
        best = None
        for number in np.argsort(gaps - self._margin):
            spare = gaps[number] - self._margin[number]
            if best is not None and spare >= best.spare_um:
                break
            one, other = self._pairs[number]
            gap = float(gaps[number])
            if spare < beyond_um:
                gap = distance(world[one], world[other])
            bodies = self._bodies[one], self._bodies[other]
            found = Near(bodies, gap, float(self._margin[number]))
            if best is None or found.spare_um < best.spare_um:
                best = found
        assert best is not None
        return best

    def speed_um_s(self, speeds: Mapping[str, float]) -> float:
        """Return how fast two bodies can approach at most at these speeds of the axes."""
        return sum(
            abs(speed) * (math.radians(1.0) * self.reach_um if axis in self._rotary else 1.0)
            for axis, speed in speeds.items()
        )
