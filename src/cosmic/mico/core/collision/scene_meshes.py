"""Triangle meshes of a scene: read from files, made for primitives, and judged.

trimesh is used here and in `scene_decompose`, nowhere else.
"""

import io
import math
from typing import Final

import numpy as np
import trimesh

from cosmic.mico.core.collision.model import Floats, Indices

Mesh = tuple[Floats, Indices]

FORMATS: Final = (".stl", ".obj")
_SIDES: Final = 24
_VIEW_SIDES: Final = 48
_ROUNDING: Final = 1e-6  # STL keeps 24 bits: about 1e-7 of the largest coordinate
_TOLERANCE_UM: Final = 1e-3
_LARGEST: Final = 1e9  # in the unit of the file; what is larger is rubbish


def parse_mesh(content: bytes, suffix: str) -> Mesh:
    """Return vertices, in the unit of the file, and faces of a mesh; equal vertices merged.

    Raises
    ------
    ValueError
        The content is no mesh of that format, or has no triangle.
    """
    try:
        with np.errstate(all="ignore"):
            mesh = trimesh.load_mesh(io.BytesIO(content), file_type=suffix[1:], process=False)
    except (ValueError, KeyError, IndexError, TypeError, AttributeError, EOFError) as exc:
        raise ValueError(f"not a mesh: {exc}") from exc
    if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
        raise ValueError("no triangle in it")
    vertices = np.asarray(mesh.vertices, dtype=np.float64)
    faces = np.asarray(mesh.faces)
    if not np.isfinite(vertices).all():
        raise ValueError("a vertex is not finite")
    if not np.abs(vertices).max() <= _LARGEST:
        raise ValueError(f"a coordinate is above {_LARGEST:g}")
    if not (faces.min() >= 0 and faces.max() < len(vertices)):
        raise ValueError("a face names a vertex that is not there")
    whole = trimesh.Trimesh(vertices, faces, process=False)
    whole.merge_vertices(merge_tex=True, merge_norm=True)
    return _plain(whole.vertices, whole.faces)


def box_mesh(sides_um: tuple[float, float, float]) -> Mesh:
    """Return a box about the origin."""
    box = trimesh.creation.box(extents=sides_um)
    return _plain(box.vertices, box.faces)


def cylinder_mesh(radius_um: float, length_um: float, *, around: bool) -> Mesh:
    """Return a prism along z about the origin; `around` a cylinder, never inside it, or in it."""
    sides = _SIDES if around else _VIEW_SIDES
    radius = radius_um / math.cos(math.pi / sides) if around else radius_um
    angles = 2.0 * math.pi * np.arange(sides) / sides
    ring = np.column_stack((radius * np.cos(angles), radius * np.sin(angles)))
    half = np.full((sides, 1), length_um / 2.0)
    vertices = np.vstack((np.hstack((ring, -half)), np.hstack((ring, half))))
    here = np.arange(sides)
    after = (here + 1) % sides
    walls = np.vstack(
        (
            np.column_stack((here, after, after + sides)),
            np.column_stack((here, after + sides, here + sides)),
        )
    )
    middle = np.arange(1, sides - 1)
    zeros = np.zeros_like(middle)
    bottom = np.column_stack((zeros, middle + 1, middle))
    top = np.column_stack((zeros, middle, middle + 1)) + sides
    return _plain(vertices, np.vstack((walls, bottom, top)))


def sphere_mesh(radius_um: float, *, around: bool) -> Mesh:
    """Return a polyhedron about the origin; `around` a sphere, never inside it, or in it."""
    ball = trimesh.creation.icosphere(subdivisions=2, radius=1.0)
    reach = np.einsum("ij,ij->i", ball.face_normals, ball.triangles_center).min() if around else 1.0
    return _plain(ball.vertices * (radius_um / float(reach)), ball.faces)


def mesh_faults(vertices_um: Floats, faces: Indices) -> list[str]:
    """Return why a mesh is no convex closed body, in the words for whoever made it."""
    if (flat := _flat_faces(vertices_um, faces)) > 0:
        return [f"{flat} of its {len(faces)} faces have no area; repair the mesh"]
    if fault := _edge_fault(faces):
        return [fault]
    if not abs(volume_um3(vertices_um, faces)) > 1e-9 * _extent(vertices_um) ** 3:
        return ["it has no volume; a body needs a thickness"]
    if volume_um3(vertices_um, faces) < 0.0:
        return ["it is inside out; flip its faces, counter-clockwise seen from outside"]
    behind = _worst_dent(vertices_um, faces)
    if behind > 0.0:
        return [
            f"it is not convex, by {behind:.3g} um; make convex pieces of it with "
            "'cosmic scene decompose' and list each as a <collision>"
        ]
    return []


def volume_um3(vertices_um: Floats, faces: Indices) -> float:
    """Return the volume that the faces enclose; negative when they look inwards."""
    corners = vertices_um[faces] - vertices_um.mean(axis=0)
    return float(
        np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    )


def _plain(vertices: object, faces: object) -> Mesh:
    return (
        np.ascontiguousarray(vertices, dtype=np.float64),
        np.ascontiguousarray(faces, dtype=np.int32),
    )


def _extent(vertices_um: Floats) -> float:
    return float(np.ptp(vertices_um, axis=0).max())


def _crosses(vertices_um: Floats, faces: Indices) -> Floats:
    corners = vertices_um[faces]
    return np.asarray(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))


def _flat_faces(vertices_um: Floats, faces: Indices) -> int:
    doubled_area = np.linalg.norm(_crosses(vertices_um, faces), axis=1)
    return int((doubled_area <= 1e-15 * _extent(vertices_um) ** 2).sum())


def _edge_fault(faces: Indices) -> str:
    """Each edge must belong to two faces, that run along it in opposite directions."""
    starts = faces.reshape(-1).astype(np.int64)
    ends = np.roll(faces, -1, axis=1).reshape(-1).astype(np.int64)
    count = int(faces.max()) + 1
    edges, counts = np.unique(starts * count + ends, return_counts=True)
    if (counts > 1).any():
        return "faces stand there twice, or look both ways; remove duplicates, orient them alike"
    back = (edges % count) * count + edges // count
    missing = int((~np.isin(edges, back)).sum())
    return (
        f"it is open: {missing} edges belong to one face only; close the holes" if missing else ""
    )


def _worst_dent(vertices_um: Floats, faces: Indices) -> float:
    """Return how far a vertex lies outside the plane of a face, 0 within the tolerance."""
    crosses = _crosses(vertices_um, faces)
    doubled_area = np.linalg.norm(crosses, axis=1)
    normals = crosses / doubled_area[:, np.newaxis]
    corners = vertices_um[faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    # The plane of a sliver is only known as well as its narrow side allows.
    steep = np.maximum(1.0, _extent(vertices_um) * longest / doubled_area)
    size = float(np.abs(vertices_um).max())
    allowed = _TOLERANCE_UM + _ROUNDING * _extent(vertices_um) + 1e-7 * size * steep
    planes = np.einsum("ij,ij->i", normals, corners[:, 0])
    worst = 0.0
    chunk = max(1, 2_000_000 // len(vertices_um))
    for start in range(0, len(faces), chunk):
        part = slice(start, start + chunk)
        out = (normals[part] @ vertices_um.T - planes[part, np.newaxis]).max(axis=1)
        beyond = out > allowed[part]
        worst = max(worst, float(out[beyond].max(initial=0.0)))
    return worst
