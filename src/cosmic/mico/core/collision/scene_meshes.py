"""Triangle meshes of a scene: read from files, made for primitives, and judged.

trimesh is used here and in `scene_decompose`, nowhere else. It takes half a second to load, so
what nearly every scene consists of, boxes and binary STL, does without.
"""

import io
import itertools
import math
from typing import Final

import numpy as np

from cosmic.mico.core.collision.model import Floats, Indices

Mesh = tuple[Floats, Indices]

FORMATS: Final = (".stl", ".obj")
_SIDES: Final = 24
_VIEW_SIDES: Final = 48
_ROUNDING: Final = 1e-6  # STL keeps 24 bits: about 1e-7 of the largest coordinate
_TOLERANCE_UM: Final = 1e-3
_LARGEST: Final = 1e9  # in the unit of the file; what is larger is rubbish
_MERGED: Final = 1e-8  # in the unit of the file; vertices that differ by less are one
_STL_HEADER: Final = 84
_STL_FACET: Final = np.dtype(
    [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")]
)
# Corners count as binary numbers: bit 2 is x, bit 1 is y, bit 0 is z.
_BOX_FACES: Final = (
    *((1, 3, 0), (0, 3, 2), (4, 6, 5), (5, 6, 7)),
    *((4, 1, 0), (5, 1, 4), (2, 3, 7), (2, 7, 6)),
    *((2, 4, 0), (6, 4, 2), (1, 7, 3), (5, 7, 1)),
)


def parse_mesh(content: bytes, suffix: str) -> Mesh:
    """Return vertices, in the unit of the file, and faces of a mesh; equal vertices merged.

    Raises
    ------
    ValueError
        The content is no mesh of that format, or has no triangle.
    """
    vertices, faces = (
        _binary_stl(content) if _is_binary_stl(content, suffix) else _any_mesh(content, suffix)
    )
    if not len(faces):
        raise ValueError("no triangle in it")
    if not np.isfinite(vertices).all():
        raise ValueError("a vertex is not finite")
    if not np.abs(vertices).max() <= _LARGEST:
        raise ValueError(f"a coordinate is above {_LARGEST:g}")
    if not (faces.min() >= 0 and faces.max() < len(vertices)):
        raise ValueError("a face names a vertex that is not there")
    return _merged(vertices, faces)


def _is_binary_stl(content: bytes, suffix: str) -> bool:
    """Tell by the length: a text that begins like this one by chance has another."""
    if suffix != ".stl" or len(content) < _STL_HEADER:
        return False
    count = int.from_bytes(content[_STL_HEADER - 4 : _STL_HEADER], "little")
    return len(content) == _STL_HEADER + count * _STL_FACET.itemsize


def _binary_stl(content: bytes) -> Mesh:
    facets = np.frombuffer(content, _STL_FACET, offset=_STL_HEADER)
    vertices = facets["corners"].reshape(-1, 3).astype(np.float64)
    return vertices, np.arange(len(vertices), dtype=np.int32).reshape(-1, 3)


def _any_mesh(content: bytes, suffix: str) -> Mesh:
    import trimesh

    try:
        with np.errstate(all="ignore"):
            mesh = trimesh.load_mesh(io.BytesIO(content), file_type=suffix[1:], process=False)
    except (ValueError, KeyError, IndexError, TypeError, AttributeError, EOFError) as exc:
        raise ValueError(f"not a mesh: {exc}") from exc
    if not isinstance(mesh, trimesh.Trimesh):
        raise ValueError("no triangle in it")
    return np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces)


def _merged(vertices: Floats, faces: Indices) -> Mesh:
    """Return the mesh with each vertex that a face names once; equal ones are one."""
    used = np.flatnonzero(np.bincount(faces.reshape(-1)))
    rows = np.round(vertices[used] / _MERGED) + 0.0  # no -0.0 beside 0.0
    order = np.lexsort(rows.T)
    new = np.ones(len(rows), dtype=bool)
    new[1:] = (rows[order][1:] != rows[order][:-1]).any(axis=1)
    place = np.empty(len(vertices), dtype=np.int32)
    place[used[order]] = np.cumsum(new) - 1
    return _plain(vertices[used[order[new]]], place[faces])


def box_mesh(sides_um: tuple[float, float, float]) -> Mesh:
    """Return a box about the origin."""
    corners = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
    return _plain(corners * sides_um, _BOX_FACES)


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
    import trimesh

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
        return "faces are listed twice, or face both directions; remove duplicates, orient alike"
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
