"""The axes to move as coordinates, and how far two positions of them are apart."""

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Final

import numpy as np

from cosmic.mico.core.collision.kinematics import body_poses
from cosmic.mico.core.collision.model import JointKind, SceneModel
from cosmic.mico.core.planning.problem import Problem, limits_of

Point = tuple[float, ...]
"""One position for each axis to move, in its unit."""
Path = tuple[Point, ...]

DIGITS: Final = 4
"""Corners that the planner chooses are rounded to so many decimals, um or deg."""


class Space:
    """The axes to move, in the order of the scene, with limits and a metric.

    Notes
    -----
    The distance of two points is the root of the summed squares of the travel of all axes. A
    degree of a turning axis counts as the travel of the farthest point that it carries, so that
    all distances are um of a body.
    """

    def __init__(self, model: SceneModel, problem: Problem) -> None:
        self.axes = tuple(axis for axis in model.axes if axis in problem.goal)
        bounds = [limits_of(model, problem, axis) for axis in self.axes]
        self.low: Point = tuple(low for low, _ in bounds)
        self.high: Point = tuple(high for _, high in bounds)
        self.weights: Point = tuple(um_per_unit(model, axis) for axis in self.axes)
        self.start: Point = tuple(float(problem.start[axis]) for axis in self.axes)
        self.goal: Point = tuple(float(problem.goal[axis]) for axis in self.axes)
        self.diagonal = self.distance(self.low, self.high)

    def distance(self, one: Point, other: Point) -> float:
        """Return how far two points are apart, um."""
        return math.hypot(
            *(weight * (b - a) for weight, a, b in zip(self.weights, one, other, strict=True))
        )

    def length(self, path: Sequence[Point]) -> float:
        """Return the length of a path along its corners, um."""
        return sum(self.distance(one, other) for one, other in pairwise(path))

    def contains(self, point: Point) -> bool:
        """Return whether a point is within the limits."""
        return all(
            low <= value <= high
            for low, value, high in zip(self.low, point, self.high, strict=True)
        )

    def clipped(self, point: Point) -> Point:
        """Return the nearest point within the limits."""
        return tuple(
            min(max(value, low), high)
            for low, value, high in zip(self.low, point, self.high, strict=True)
        )

    def named(self, point: Point) -> Mapping[str, float]:
        """Return a point by name of axis."""
        return dict(zip(self.axes, point, strict=True))


def between(one: Point, other: Point, share: float) -> Point:
    """Return the point at `share` of the straight path; exactly the ends at 0 and 1."""
    if share in (0.0, 1.0):
        return other if share else one
    return tuple(a + share * (b - a) for a, b in zip(one, other, strict=True))


def um_per_unit(model: SceneModel, axis: str) -> float:
    """Return how far a unit of `axis` moves a body: 1 for sliding axes, um/deg for turning ones."""
    largest = 0.0
    for drive in model.drives:
        if drive.axis == axis:
            number = model.joint_number[drive.joint]
            if model.joints[number].kind is not JointKind.REVOLUTE:
                return 1.0
            largest = max(largest, abs(drive.factor) * _radius_um(model, number))
    return largest or 1.0


def _radius_um(model: SceneModel, number: int) -> float:
    """Return how far the farthest point that a turning joint carries is from its axis."""
    poses = body_poses(model, np.zeros(len(model.joints)))
    joint = model.joints[number]
    carried = {joint.child}
    for other in model.joints:
        if other.parent in carried:
            carried.add(other.child)
    pose = poses[model.body_number[joint.child]]
    direction = pose[:3, :3] @ joint.axis
    farthest = 0.0
    for piece in model.pieces:
        if piece.body in carried:
            body = poses[model.body_number[piece.body]]
            points = piece.vertices_um @ body[:3, :3].T + body[:3, 3] - pose[:3, 3]
            farthest = max(
                farthest, float(np.linalg.norm(np.cross(points, direction), axis=1).max())
            )
    return farthest
