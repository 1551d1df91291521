"""Convex pieces of a concave mesh, made once and offline; needs the extra `decompose`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import trimesh

from cosmic.frame.errors import ConfigError, NotAvailable, needs_extra
from cosmic.mico.core.collision.model import Floats
from cosmic.mico.core.collision.scene_meshes import FORMATS, mesh_faults, parse_mesh, volume_um3

_LARGEST_BYTES: Final = 256 * 1024 * 1024


@dataclass(frozen=True)
class Decomposition:
    """What was made of a mesh.

    Attributes
    ----------
    files : tuple of Path
        One STL file a piece, in the unit of the mesh.
    volume_error : float
        How much larger the pieces are together than the mesh, as a part of its volume; negative:
        they are smaller, so part of the body is not guarded.
    uncovered : float
        How far a corner of the mesh lies outside all pieces at most, in the unit of the mesh.
    """

    files: tuple[Path, ...]
    volume_error: float
    uncovered: float


def decompose_mesh(mesh: Path, out_dir: Path, *, most_pieces: int = 16) -> Decomposition:
    """Write convex pieces of `mesh` into `out_dir`, as `name_1.stl` and so on.

    Raises
    ------
    ConfigError
        The mesh cannot be read, is open or inside out, or the pieces cannot be written.
    NotAvailable
        The library that does it is not installed.
    """
    whole = _read(mesh)
    try:
        import vhacdx
    except ImportError as exc:
        raise NotAvailable(needs_extra("Decomposing a body", "decompose")) from exc
    faces = np.column_stack((np.full(len(whole.faces), 3), whole.faces)).reshape(-1)
    parts = vhacdx.compute_vhacd(
        np.asarray(whole.vertices), faces.astype(np.uint32), maxConvexHulls=most_pieces
    )
    hulls = [trimesh.convex.convex_hull(np.asarray(vertices)) for vertices, _ in parts]
    files = tuple(out_dir / f"{mesh.stem}_{number + 1}.stl" for number in range(len(hulls)))
    try:
        out_dir.mkdir(parents=True, exist_ok=True)
        for file, hull in zip(files, hulls, strict=True):
            file.write_bytes(trimesh.exchange.stl.export_stl(hull))
    except OSError as exc:
        raise ConfigError(f"{out_dir}: cannot be written: {exc.strerror or exc}") from exc
    volume = sum(abs(float(hull.volume)) for hull in hulls)
    error = volume / float(whole.volume) - 1.0
    return Decomposition(files, error, _uncovered(np.asarray(whole.vertices), hulls))


def _read(mesh: Path) -> trimesh.Trimesh:
    if mesh.suffix.lower() not in FORMATS:
        raise ConfigError(f"{mesh}: name an {' or '.join(FORMATS)} file")
    try:
        if mesh.stat().st_size > _LARGEST_BYTES:
            raise ConfigError(f"{mesh}: larger than {_LARGEST_BYTES} bytes; simplify it first")
        vertices, faces = parse_mesh(mesh.read_bytes(), mesh.suffix.lower())
    except OSError as exc:
        raise ConfigError(f"{mesh}: cannot be read: {exc.strerror or exc}") from exc
    except ValueError as exc:
        raise ConfigError(f"{mesh}: {exc}") from exc
    # Judged in steps of a thousandth of its size, so that the unit of the file does not matter.
    size = float(np.ptp(vertices, axis=0).max())
    faults = mesh_faults(vertices * (1e4 / size) if size > 0.0 else vertices, faces)
    broken = [fault for fault in faults if "not convex" not in fault]
    if broken or not volume_um3(vertices, faces) > 0.0:
        raise ConfigError(f"{mesh}: {'; '.join(broken) or 'it has no volume'}")
    return trimesh.Trimesh(vertices, faces, process=False)


def _uncovered(vertices: Floats, hulls: list[trimesh.Trimesh]) -> float:
    """Return how far a corner lies outside the piece that is nearest to covering it."""
    least = np.full(len(vertices), np.inf)
    for hull in hulls:
        planes = np.einsum("ij,ij->i", hull.face_normals, hull.triangles[:, 0])
        out = (vertices @ hull.face_normals.T - planes).max(axis=1)
        least = np.minimum(least, out)
    return float(max(0.0, least.max()))
