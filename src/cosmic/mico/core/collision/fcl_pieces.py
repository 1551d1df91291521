"""Distances between convex pieces: the one place where python-fcl is called.

Only `fcl.distance` between two `BVHModel` is used: the other calls of python-fcl give wrong
answers, end the process, or both. Its answer is taken as a hint where to look. That two pieces
are apart is concluded from their vertices alone, which must lie on either side of the plane that
the hint names; what cannot be verified so counts as touching.
"""

import math
from dataclasses import dataclass
from typing import Final

import fcl
import numpy as np

from cosmic.mico.core.collision.model import Floats, Shape

TRUST_UM: Final = 1e-3
"""How much the distance told and the one verified may differ before the first is distrusted."""
ORTHONORMAL: Final = 1e-9

_IDENTITY: Final = np.eye(3)
_REQUEST: Final = fcl.DistanceRequest(enable_nearest_points=True)


@dataclass(frozen=True, slots=True)
class Separation:
    """How two pieces stand to each other.

    Attributes
    ----------
    gap_um : float
        Verified distance along `normal`; 0 where they touch, overlap, or nothing is sure.
    normal : tuple of float
        Unit vector from the first to the second; all zero where there is no gap.
    first_um, second_um : tuple of float
        The points nearest to each other, in world coordinates.
    """

    gap_um: float
    normal: tuple[float, float, float]
    first_um: tuple[float, float, float]
    second_um: tuple[float, float, float]


class ConvexPiece:
    """A convex piece that can be put anywhere; one thread.

    Parameters
    ----------
    shape : Shape
        Convex and closed; checked by the loader of the scene.
    """

    def __init__(self, shape: Shape) -> None:
        self._shape = shape
        self._vertices = np.ascontiguousarray(shape.vertices_um)
        self._across = np.ascontiguousarray(self._vertices.T)
        self.fcl_object = _collision_object(shape)
        self._rotation: Floats = _IDENTITY
        self._place_um: Floats = np.zeros(3)

    def put(self, rotation: Floats, place_um: Floats) -> None:
        """Put the piece somewhere; `rotation` must be orthonormal, everything finite.

        Raises
        ------
        ValueError
            It is not: python-fcl would take it and call the place free.
        """
        if not math.isfinite(place_um[0] + place_um[1] + place_um[2]):
            raise ValueError("a pose is not finite")
        if rotation is not self._rotation:
            if not np.abs(rotation @ rotation.T - _IDENTITY).max() <= ORTHONORMAL:
                raise ValueError("a rotation is not orthonormal")
            self._rotation = rotation
            self.fcl_object.setRotation(rotation)
        self._place_um = place_um
        self.fcl_object.setTranslation(place_um)

    def world_um(self) -> Floats:
        """Return the vertices, shape (3, n), where the piece stands."""
        return np.asarray(self._rotation @ self._across + self._place_um[:, np.newaxis])

    def support(self, direction: Floats) -> float:
        """Return how far the piece reaches along `direction`, in world coordinates."""
        return float((direction @ self._rotation @ self._across).max() + direction @ self._place_um)

    def normals(self) -> Floats:
        """Return the outward unit normals of all faces, shape (m, 3), in world coordinates."""
        corners = self._vertices[self._shape.faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        return np.asarray(normals @ self._rotation.T)

    def swept(self, shifts_um: Floats) -> "ConvexPiece":
        """Return the convex hull of the piece shifted by each of `shifts_um`, shape (n, 3)."""
        world = self._vertices @ self._rotation.T + self._place_um
        points = (world[np.newaxis, :, :] + shifts_um[:, np.newaxis, :]).reshape(-1, 3)
        # Imported here: it is seldom needed, and half of the time that the process takes to start.
        from scipy.spatial import ConvexHull

        hull = ConvexHull(points)
        used, faces = np.unique(hull.simplices, return_inverse=True)
        corners = np.array(faces.reshape(-1, 3), dtype=np.int32)
        return ConvexPiece(Shape(self._shape.name, self._shape.body, points[used], corners))


def gap_along(one: ConvexPiece, other: ConvexPiece, normal: Floats) -> float:
    """Return the verified gap from one piece to another along `normal`; negative where none."""
    return -other.support(-normal) - one.support(normal)


def separation(one: ConvexPiece, other: ConvexPiece) -> Separation:
    """Return how two pieces stand to each other."""
    result = fcl.DistanceResult()
    reported = fcl.distance(one.fcl_object, other.fcl_object, _REQUEST, result)
    here, there = result.nearest_points
    offset = there - here
    length = math.sqrt(offset @ offset)
    places = _point(here), _point(there)
    if not (reported > 0.0 and length > 0.0):
        return Separation(0.0, (0.0, 0.0, 0.0), *places)
    normal = offset / length
    gap = gap_along(one, other, normal)
    if not gap > 0.0 or not abs(gap - reported) <= TRUST_UM + 1e-6 * reported:
        # One inside the other looks like a distance to python-fcl.
        return Separation(0.0, (0.0, 0.0, 0.0), *places)
    return Separation(gap, _point(normal), *places)


def overlaps(one: ConvexPiece, other: ConvexPiece) -> list[tuple[float, Floats]]:
    """Return how far two pieces overlap along the normal of each face, from one to the other."""
    normals = np.concatenate((one.normals(), -other.normals()))
    return [(-gap_along(one, other, normal), normal) for normal in normals]


def _collision_object(shape: Shape) -> fcl.CollisionObject:
    vertices = np.ascontiguousarray(shape.vertices_um, dtype=np.float64)
    faces = np.ascontiguousarray(shape.faces, dtype=np.int32)
    # python-fcl checks nothing: a face beyond the vertices ends the process.
    whole = len(vertices) >= 4 and len(faces) >= 4 and np.isfinite(vertices).all()
    if not whole or not (faces.min() >= 0 and faces.max() < len(vertices)):
        raise ValueError(f"{shape.name} is not a closed mesh")
    geometry = fcl.BVHModel()
    geometry.beginModel(len(vertices), len(faces))
    geometry.addSubModel(vertices, faces)
    geometry.endModel()
    return fcl.CollisionObject(geometry, fcl.Transform())


def _point(vector: Floats) -> tuple[float, float, float]:
    x, y, z = vector.tolist()
    return x, y, z
