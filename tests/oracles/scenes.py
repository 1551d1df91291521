"""Scenes put together in code, and bumpy bodies in place of smooth ones.

Only the plain data of the scene comes from the program; nothing of the collision gate.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import combinations, product

import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from cosmic.mico.core.collision.model import (
    Drive,
    Joint,
    JointKind,
    SceneModel,
    Shape,
    WatchedPair,
    pair_of,
)

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


def hull_shape(name: str, body: str, points: np.ndarray) -> Shape:
    """Return the convex hull of points as a closed mesh with outward faces."""
    points = np.asarray(points, dtype=float)
    hull = ConvexHull(points)
    used, flat = np.unique(hull.simplices, return_inverse=True)
    faces = flat.reshape(-1, 3)
    vertices = points[used]
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = (normals * hull.equations[:, :3]).sum(axis=1) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    return Shape(name, body, vertices, faces.astype(np.int32))


def box_points(low: Iterable[float], high: Iterable[float]) -> np.ndarray:
    """Return the corners of an aligned box."""
    return np.array(list(product(*zip(low, high, strict=True))), dtype=float)


def blob_points(rng: np.random.Generator, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return the vertices of a bumpy mesh of 20 000 triangles that fills a box."""
    grid = np.arange(10_000) + 0.5
    polar, turn = np.arccos(1.0 - 2.0 * grid / len(grid)), math.pi * (1.0 + 5.0**0.5) * grid
    points = np.column_stack(
        (np.cos(turn) * np.sin(polar), np.sin(turn) * np.sin(polar), np.cos(polar))
    )
    bumps = rng.normal(size=(40, 3))
    bumps /= np.linalg.norm(bumps, axis=1, keepdims=True)
    height = 1.0 + 0.1 * np.exp(-20.0 * (1.0 - points @ bumps.T)).sum(axis=1)
    points *= (height * (1.0 + 0.06 * rng.normal(size=len(points))))[:, np.newaxis]
    span = points.max(axis=0) - points.min(axis=0)
    return low + (points - points.min(axis=0)) / span * (high - low)


@dataclass
class Builder:
    """Collects what a scene is made of."""

    bodies: list[str] = field(default_factory=lambda: ["base"])
    joints: list[Joint] = field(default_factory=list)
    pieces: list[Shape] = field(default_factory=list)
    drives: list[Drive] = field(default_factory=list)

    def body(
        self,
        name: str,
        parent: str,
        way: Sequence[float],
        *,
        axis: str,
        turns: bool = False,
        travel: tuple[float, float] = (-6000.0, 6000.0),
        place: Sequence[float] = (0.0, 0.0, 0.0),
        turned: Rotation | None = None,
        factor: float = 1.0,
        overshoot: float = 0.0,
    ) -> None:
        """Add a body that moves against its parent, driven by an axis."""
        origin = np.eye(4)
        origin[:3, 3] = place
        if turned is not None:
            origin[:3, :3] = turned.as_matrix()
        kind = JointKind.REVOLUTE if turns else JointKind.PRISMATIC
        self.bodies.append(name)
        self.joints.append(
            Joint(f"{name}_joint", kind, parent, name, origin, np.array(way, float), *travel)
        )
        scale = factor * (math.radians(1.0) if turns else 1.0)
        self.drives.append(Drive(axis, f"{name}_joint", scale, 0.0, overshoot=overshoot))

    def piece(self, body: str, points: np.ndarray) -> None:
        """Add the hull of points, in the frame of the body."""
        self.pieces.append(hull_shape(f"{body}_{len(self.pieces)}", body, points))

    def box(self, body: str, low: Sequence[float], high: Sequence[float]) -> None:
        """Add an aligned box."""
        self.piece(body, box_points(low, high))

    def model(
        self,
        pairs: Iterable[tuple[str, str]] | None = None,
        margin_um: float = 5.0,
        allowed: Iterable[frozenset[str]] = (),
    ) -> SceneModel:
        """Return the scene; without `pairs` everything is watched but neighbours."""
        skipped = set(allowed) | {frozenset((j.parent, j.child)) for j in self.joints}
        if pairs is None:
            pairs = [two for two in combinations(self.bodies, 2) if frozenset(two) not in skipped]
        return SceneModel(
            name="made up",
            bodies=tuple(self.bodies),
            joints=tuple(self.joints),
            pieces=tuple(self.pieces),
            views=(),
            drives=tuple(self.drives),
            pairs=tuple(WatchedPair(pair_of(*pair), margin_um) for pair in pairs),
        )


def blobs(model: SceneModel, seed: int = 1) -> SceneModel:
    """Return a scene with the hull of a bumpy mesh in place of every piece."""
    rng = np.random.default_rng(seed)
    pieces = []
    for piece in model.pieces:
        low, high = piece.vertices_um.min(axis=0), piece.vertices_um.max(axis=0)
        points = blob_points(rng, low, high)
        pieces.append(hull_shape(piece.name, piece.body, points))
    return SceneModel(
        name="blobs",
        bodies=model.bodies,
        joints=model.joints,
        pieces=tuple(pieces),
        views=(),
        drives=model.drives,
        pairs=model.pairs,
    )
