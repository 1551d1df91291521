"""How near the bodies of a platform truly are: its files read a second time, and exact distances.

Nothing here comes from the program or from a collision library. Lengths are in um, except in the
URDF itself.
"""

import math
import struct
import tomllib
import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from .convex import distance

UM = 1e6
GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0
REACH_UM = 20_000.0  # of what turns with the table, from its axis: the plate's corners and clip
FINEST_UM = 1.0
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


@dataclass(frozen=True, eq=False)
class _Joint:
    name: str
    kind: str
    parent: str
    child: str
    turn: np.ndarray
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
        self._joints = self._outwards(self._read_joints(robot))
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
        self._begins = np.cumsum([0] + [len(points) for points in self._pieces[:-1]])
        self._read_pairs(facts, scene.parent)
        self._shared: dict[tuple[int, tuple[float, ...]], float] = {}

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
                    turn.as_matrix(),
                    origin,
                    along / np.linalg.norm(along),
                )
            )
        return joints

    @staticmethod
    def _outwards(joints: list[_Joint]) -> list[_Joint]:
        """Return them so that each comes after the one that carries it."""
        children = {joint.child for joint in joints}
        known = {joint.parent for joint in joints} - children
        found: list[_Joint] = []
        while len(found) < len(joints):
            joint = next(each for each in joints if each not in found and each.parent in known)
            found.append(joint)
            known.add(joint.child)
        return found

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
        self._between = [
            self._axes_of(self._bodies[one]) ^ self._axes_of(self._bodies[other])
            for one, other in self._pairs
        ]

    def _axes_of(self, body: str) -> frozenset[str]:
        """Return the axes that carry a body."""
        above = {joint.child: joint for joint in self._joints}
        found: set[str] = set()
        while body in above:
            found |= {axis for axis, name, *_ in self._drives if name == above[body].name}
            body = above[body].parent
        return frozenset(found)

    def _firm_groups(self, driven: set[str]) -> dict[str, str]:
        """Return for each body the one that it is screwed to, and that moves by a joint."""
        above = {joint.child: joint for joint in self._joints}
        bodies = set(above) | {joint.parent for joint in self._joints}

        def root(body: str) -> str:
            while body in above and body not in driven:
                body = above[body].parent
            return body

        return {body: root(body) for body in bodies}

    def _stands(self, positions: Mapping[str, float]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Return turn and origin of each body that hangs at a joint."""
        values: dict[str, float] = {}
        for axis, joint, factor, offset in self._drives:
            value = factor * positions[axis] + offset
            values[joint] = math.radians(value) if axis in self._rotary else value
        still = (np.eye(3), np.zeros(3))
        stands: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        for joint in self._joints:
            turn, origin = stands.setdefault(joint.parent, still)
            origin, turn = turn @ joint.origin + origin, turn @ joint.turn
            value = values.get(joint.name, 0.0)
            if value and joint.kind == "prismatic":
                origin = origin + turn @ (value * joint.axis)
            elif value and joint.kind != "fixed":
                turn = turn @ Rotation.from_rotvec(value * joint.axis).as_matrix()
            stands[joint.child] = (turn, origin)
        return stands

    def _world(self, positions: Mapping[str, float], *pieces: int) -> list[np.ndarray]:
        """Return the corners of these pieces, of all with none."""
        stands = self._stands(positions)
        return [
            self._pieces[piece] @ stands[self._bodies[piece]][0].T + stands[self._bodies[piece]][1]
            for piece in pieces or range(len(self._pieces))
        ]

    def nearest(self, positions: Mapping[str, float]) -> Near:
        """Return the pair with the least to spare while the axes stand; see `nearest_on_way`."""
        return self.nearest_on_way(positions, positions)

    def nearest_on_way(
        self, start: Mapping[str, float], end: Mapping[str, float], *, beyond_um: float = 30.0
    ) -> Near:
        """Return the pair with the least to spare while all axes go evenly from `start` to `end`.

        Exact to 0.1 um for pairs with less than `beyond_um` to spare; others may be farther
        apart than is said.

        Parameters
        ----------
        start, end : mapping of float
            Where each axis truly stands, um or degrees; a turn of a few degrees at most.
        """
        first, last = self._world(start), self._world(end)
        turn = max((abs(end[axis] - start[axis]) for axis in self._rotary), default=0.0)
        bulge = math.radians(turn) ** 2 / 8.0 * REACH_UM
        corners = np.stack((np.concatenate(first), np.concatenate(last)))
        low = np.minimum.reduceat(corners.min(0), self._begins)
        high = np.maximum.reduceat(corners.max(0), self._begins)
        apart = np.maximum(low[self._other] - high[self._one], low[self._one] - high[self._other])
        gaps = np.linalg.norm(np.maximum(apart, 0.0), axis=1) - bulge
        best = Near(("", ""), math.inf, 0.0)
        for number in np.argsort(gaps - self._margin):
            gap, margin = float(gaps[number]), float(self._margin[number])
            if gap - margin >= best.spare_um:
                break
            one, other = self._pairs[number]
            if gap - margin < beyond_um:
                gap = self._least(int(number), start, end, first, last)
            if gap - margin < best.spare_um:
                best = Near((self._bodies[one], self._bodies[other]), gap, margin)
        return best

    def _least(
        self,
        number: int,
        start: Mapping[str, float],
        end: Mapping[str, float],
        first: list[np.ndarray],
        last: list[np.ndarray],
    ) -> float:
        one, other = self._pairs[number]
        moving = {axis for axis in self._between[number] if start[axis] != end[axis]}
        if not moving:
            # Not asked anew while two stand to each other as before.
            key = (number, tuple(start[axis] for axis in sorted(self._between[number])))
            if key not in self._shared:
                if len(self._shared) > 10_000:
                    self._shared.clear()
                self._shared[key] = distance(first[one], first[other])
            return self._shared[key]
        if moving & self._rotary:
            return self._least_turning(number, start, end)
        shift = (last[one][0] - first[one][0]) - (last[other][0] - first[other][0])
        return least_of_convex(
            lambda part: distance(first[one] + part * shift, first[other]),
            float(np.linalg.norm(shift)),
        )

    def _least_turning(
        self, number: int, start: Mapping[str, float], end: Mapping[str, float]
    ) -> float:
        """Look so often that no corner goes more than `FINEST_UM` in between."""
        between = self._between[number]
        way = sum(
            abs(end[axis] - start[axis])
            * (math.radians(1.0) * REACH_UM if axis in self._rotary else 1.0)
            for axis in between
        )
        one, other = self._pairs[number]
        at, least = 0.0, math.inf
        margin = float(self._margin[number])
        while True:
            positions = {axis: start[axis] + at * (end[axis] - start[axis]) for axis in start}
            gap = distance(*self._world(positions, one, other))
            least = min(least, gap)
            if at >= 1.0 or gap < margin - FINEST_UM:  # that is enough to be told
                return least
            at = min(1.0, at + max(gap - margin, FINEST_UM) / way)


def least_of_convex(of: Callable[[float], float], slope: float) -> float:
    """Return the least of a convex function between 0 and 1 that rises by at most `slope`."""
    low, high = 0.0, 1.0
    inner = low + (high - low) * (1.0 - GOLDEN), low + (high - low) * GOLDEN
    values = [of(inner[0]), of(inner[1])]
    least = min(of(0.0), of(1.0), *values)
    while slope * (high - low) > 0.1:
        if values[0] < values[1]:
            high, inner = inner[1], (inner[1] - (inner[1] - low) * GOLDEN, inner[0])
            values = [of(inner[0]), values[0]]
        else:
            low, inner = inner[0], (inner[1], inner[0] + (high - inner[0]) * GOLDEN)
            values = [values[1], of(inner[1])]
        least = min(least, *values)
    return least
