"""Movements of one axis, and of several with speeds of their own, seen exactly.

Where the bodies are comes from `kinematics`; how far apart they are from `convex`, or, for plain
conservative advancement, from fcl, which is asked without the program.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise

import fcl
import numpy as np
from scipy.spatial.transform import Rotation

from cosmic.mico.core.collision.model import JointKind, SceneModel

from .convex import distance
from .kinematics import joint_values, place, world_pieces

TOLERANCE_UM = 0.1
"""Conservative advancement steps at least this far, and may pass the margin by as much."""


class Pairs:
    """All pairs of pieces that are watched, by number."""

    def __init__(self, model: SceneModel) -> None:
        owner = [piece.body for piece in model.pieces]
        rows = [
            (one, other, pair.margin_um)
            for pair in model.pairs
            for one, body in enumerate(owner)
            if body == pair.bodies[0]
            for other, second in enumerate(owner)
            if second == pair.bodies[1]
        ]
        self.one = np.array([row[0] for row in rows])
        self.other = np.array([row[1] for row in rows])
        self.margin = np.array([row[2] for row in rows])

    def near(self, low: np.ndarray, high: np.ndarray) -> Iterator[tuple[int, int, float]]:
        """Yield the pairs whose boxes, shape (pieces, 3), come within the margin."""
        apart = np.maximum(low[self.other] - high[self.one], low[self.one] - high[self.other]).max(
            axis=1
        )
        for row in np.flatnonzero(apart <= self.margin):
            yield int(self.one[row]), int(self.other[row]), float(self.margin[row])


def carried(model: SceneModel, axis: str) -> dict[str, str]:
    """Return which joint of `axis` carries each body that it moves."""
    found: dict[str, str] = {}
    own = {drive.joint for drive in model.drives if drive.axis == axis}
    for joint in model.joints:
        if joint.name in own:
            found[joint.child] = joint.name
        elif joint.parent in found:
            found[joint.child] = found[joint.parent]
    return found


@dataclass(frozen=True)
class Timing:
    """When one axis sets out, how far it goes, how fast."""

    delay_s: float
    way_um: float
    speed_um_s: float

    def at(self, when_s: float) -> float:
        """Return how far it has come."""
        gone = max(0.0, when_s - self.delay_s) * self.speed_um_s
        return math.copysign(min(gone, abs(self.way_um)), self.way_um)

    @property
    def end_s(self) -> float:
        """When it is there."""
        return self.delay_s + abs(self.way_um) / self.speed_um_s


class Replay:
    """Sliding axes with speeds of their own: between two events everything runs straight."""

    def __init__(self, model: SceneModel) -> None:
        self._model = model
        self._pairs = Pairs(model)
        zero = world_pieces(model, {})
        self._ways = {
            axis: np.array(
                [(b[0] - a[0]) for a, b in zip(zero, world_pieces(model, {axis: 1.0}), strict=True)]
            )
            for axis in model.axes
        }

    def worst_um(self, start: Mapping[str, float], timings: Mapping[str, Timing]) -> float:
        """Return the least distance beyond the margin at any time; negative: too close."""
        world = world_pieces(self._model, start)
        low0 = np.array([points.min(axis=0) for points in world])
        high0 = np.array([points.max(axis=0) for points in world])
        events = sorted(
            {0.0, *(t.delay_s for t in timings.values())} | {t.end_s for t in timings.values()}
        )
        shifts = [
            sum(self._ways[axis] * timing.at(when) for axis, timing in timings.items())
            for when in events
        ]
        worst = math.inf
        for here, there in pairwise(shifts):
            low, high = low0 + np.minimum(here, there), high0 + np.maximum(here, there)
            moved = np.abs(there - here).max(axis=1) > 0.0
            for one, other, margin in self._pairs.near(low, high):
                if moved[one] or moved[other]:
                    begin, end = here[other] - here[one], there[other] - there[one]
                    swept = np.vstack((world[other] + begin, world[other] + end))
                    worst = min(worst, distance(world[one], swept) - margin)
        return worst


class Advancement:
    """Plain conservative advancement: go on by the gap, as often as it takes."""

    def __init__(self, model: SceneModel) -> None:
        self._model = model
        self._pairs = Pairs(model)
        self._objects = [fcl_mesh(piece.vertices_um, piece.faces) for piece in model.pieces]
        self._request = fcl.DistanceRequest()

    def clear(self, start: Mapping[str, float], axis: str, way: float) -> bool:
        """Return whether one axis can go `way` (um or degrees) from `start`."""
        model = self._model
        poses = place(model, joint_values(model, start))
        riders = carried(model, axis)
        drive = {drive.joint: drive.factor for drive in model.drives if drive.axis == axis}
        world = [p.vertices_um @ poses[p.body][0].T + poses[p.body][1] for p in model.pieces]
        motions = [
            _Motion(model, poses, riders.get(piece.body), drive, points, way)
            for piece, points in zip(model.pieces, world, strict=True)
        ]
        low = np.array([p.min(axis=0) - m.reach for p, m in zip(world, motions, strict=True)])
        high = np.array([p.max(axis=0) + m.reach for p, m in zip(world, motions, strict=True)])
        for one, other, margin in self._pairs.near(low, high):
            speed = motions[one].speed + motions[other].speed
            same = motions[one].joint == motions[other].joint
            if same or speed == 0.0:
                continue
            if not self._pair_clear((one, other), motions, poses, speed, margin):
                return False
        return True

    def _pair_clear(
        self,
        pair: tuple[int, int],
        motions: list["_Motion"],
        poses: Mapping[str, tuple[np.ndarray, np.ndarray]],
        speed: float,
        margin: float,
    ) -> bool:
        share = 0.0
        while True:
            for number in pair:
                body = self._model.pieces[number].body
                rotation, origin = motions[number].carry(*poses[body], share)
                self._objects[number].setRotation(np.ascontiguousarray(rotation))
                self._objects[number].setTranslation(np.ascontiguousarray(origin))
            gap = fcl.distance(
                self._objects[pair[0]], self._objects[pair[1]], self._request, fcl.DistanceResult()
            )
            if gap <= margin:
                return False
            if share >= 1.0:
                return True
            share = min(1.0, share + (gap - margin + TOLERANCE_UM) / speed)


class _Motion:
    """How one axis carries a piece; `share` runs from 0 to 1."""

    def __init__(
        self,
        model: SceneModel,
        poses: Mapping[str, tuple[np.ndarray, np.ndarray]],
        joint: str | None,
        factors: Mapping[str, float],
        points: np.ndarray,
        way: float,
    ) -> None:
        self.joint, self.speed, self.turns = joint, 0.0, False
        self.reach: np.ndarray = np.zeros(3)
        if joint is None:
            return
        described = model.joints[model.joint_number[joint]]
        rotation, self._centre = poses[described.child]
        self._axis = rotation @ described.axis
        self._way = way * factors[joint]
        self.turns = described.kind is JointKind.REVOLUTE
        self.speed, self.reach = abs(self._way), np.abs(self._way * self._axis)
        if self.turns:
            arms = points - self._centre
            radius = float(np.linalg.norm(np.cross(arms, self._axis), axis=1).max())
            self.speed, self.reach = radius * abs(self._way), np.full(3, 2.0 * radius)

    def carry(
        self, rotation: np.ndarray, origin: np.ndarray, share: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return rotation and place after that share of the way."""
        if self.joint is None:
            return rotation, origin
        if not self.turns:
            return rotation, origin + share * self._way * self._axis
        turn = Rotation.from_rotvec(share * self._way * self._axis).as_matrix()
        return turn @ rotation, self._centre + turn @ (origin - self._centre)


def fcl_mesh(vertices: np.ndarray, faces: np.ndarray) -> fcl.CollisionObject:
    """Return a mesh of triangles as fcl wants it."""
    geometry = fcl.BVHModel()
    geometry.beginModel(len(vertices), len(faces))
    geometry.addSubModel(np.ascontiguousarray(vertices), np.ascontiguousarray(faces))
    geometry.endModel()
    return fcl.CollisionObject(geometry, fcl.Transform())
