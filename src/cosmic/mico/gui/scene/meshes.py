"""What is drawn of each body: its view shapes merged into one mesh, in millimetres.

The model is in micrometres; a camera near bodies of 100 000 um runs out of depth precision, hence
millimetres from here on.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
import numpy.typing as npt

from cosmic.mico.core.collision.kinematics import body_poses
from cosmic.mico.core.collision.model import Floats, SceneModel, Shape

Bools = npt.NDArray[np.bool_]

_MM: Final = 1e-3
_CREASE: Final = float(np.cos(np.radians(35.0)))


def to_mm(lengths_um: npt.ArrayLike) -> Floats:
    """Return lengths or points given in um in mm."""
    return np.asarray(lengths_um, dtype=np.float64) * _MM


def poses_mm(model: SceneModel, positions: Mapping[str, float]) -> Floats:
    """Return `world_from_body` of every body, shape (bodies, 4, 4), mm, at axis positions."""
    poses = body_poses(model, model.joint_values(positions))
    poses[:, :3, 3] *= _MM
    return poses


@dataclass(frozen=True, eq=False)
class Part:
    """One view shape of a body.

    Attributes
    ----------
    vertices_mm : ndarray, shape (n, 3), float64, mm
        In the frame of the body.
    """

    vertices_mm: Floats
    colour: tuple[float, float, float, float]


@dataclass(frozen=True, eq=False)
class BodyMesh:
    """All view shapes of one body.

    Attributes
    ----------
    corners_mm : ndarray, shape (triangles, 3, 3), float64, mm
        In the frame of the body.
    colours : ndarray, shape (triangles, 4), float64
    """

    body: str
    parts: tuple[Part, ...]
    corners_mm: Floats
    colours: Floats

    @cached_property
    def vertices_mm(self) -> Floats:
        """Every vertex, shape (n, 3), mm, in the frame of the body."""
        return np.concatenate([part.vertices_mm for part in self.parts])

    @cached_property
    def bounds_mm(self) -> tuple[Floats, Floats]:
        """Lowest and highest corner of the box around it, in its own frame."""
        return self.vertices_mm.min(axis=0), self.vertices_mm.max(axis=0)

    @cached_property
    def edges(self) -> tuple[Floats, Floats, Floats]:
        """Two edges of every triangle and their product, each of shape (triangles, 3), mm."""
        first = self.corners_mm[:, 1] - self.corners_mm[:, 0]
        second = self.corners_mm[:, 2] - self.corners_mm[:, 0]
        return first, second, np.cross(first, second)

    @cached_property
    def glass(self) -> Bools:
        """Which triangles can be seen through, shape (triangles,)."""
        return np.asarray(self.colours[:, 3] < 0.999)

    @cached_property
    def normals(self) -> Floats:
        """Unit normals, shape (triangles, 3, 3): smooth over round surfaces, sharp at edges."""
        return corner_normals(self.corners_mm)


def body_meshes(model: SceneModel) -> dict[str, BodyMesh]:
    """Return the mesh of every body that can be drawn, in the order of the bodies.

    A body without view shapes is drawn by its collision pieces: what can be hit is never unseen.
    """
    views: dict[str, list[Shape]] = {body: [] for body in model.bodies}
    pieces: dict[str, list[Shape]] = {body: [] for body in model.bodies}
    for shapes, found in ((model.views, views), (model.pieces, pieces)):
        for shape in shapes:
            found[shape.body].append(shape)
    return {
        body: _merged(body, views[body] or pieces[body])
        for body in model.bodies
        if views[body] or pieces[body]
    }


def _merged(body: str, shapes: Sequence[Shape]) -> BodyMesh:
    parts = tuple(Part(to_mm(shape.vertices_um), shape.colour) for shape in shapes)
    pairs = list(zip(parts, shapes, strict=True))
    corners = np.concatenate([part.vertices_mm[shape.faces] for part, shape in pairs])
    colours = [np.tile(np.asarray(shape.colour), (len(shape.faces), 1)) for shape in shapes]
    return BodyMesh(body, parts, corners, np.concatenate(colours))


def corner_normals(corners_mm: Floats) -> Floats:
    """Return the normal at every corner of a mesh, shape (triangles, 3, 3).

    Triangles that meet at a vertex at less than 35 degrees share their normal there, weighted by
    area; others keep an edge between them.
    """
    count = len(corners_mm)
    edges = corners_mm[:, 1:] - corners_mm[:, :1]
    area = np.cross(edges[:, 0], edges[:, 1])
    unit = area / np.maximum(np.linalg.norm(area, axis=1, keepdims=True), 1e-30)
    keys = np.round(corners_mm.reshape(-1, 3), 6)
    _, vertex = np.unique(keys, axis=0, return_inverse=True)
    vertex = vertex.reshape(-1)
    order = np.argsort(vertex, kind="stable")
    sizes = np.bincount(vertex)
    starts = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    # Every pair of corners (one, other) at the same vertex, one row a pair.
    one = np.repeat(np.arange(3 * count), sizes[vertex])
    first = np.cumsum(sizes[vertex]) - sizes[vertex]
    step = np.arange(len(one)) - np.repeat(first, sizes[vertex])
    other = order[np.repeat(starts[vertex], sizes[vertex]) + step]
    near = np.einsum("ij,ij->i", unit[one // 3], unit[other // 3]) > _CREASE
    normals = np.zeros((3 * count, 3))
    for each in range(3):
        weights = area[other[near] // 3, each]
        normals[:, each] = np.bincount(one[near], weights=weights, minlength=3 * count)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    return normals.reshape(count, 3, 3)
