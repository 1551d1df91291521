"""Which body lies under the cursor: a line of sight against boxes, then triangles, in numpy."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from cosmic.mico.core.collision.model import Floats
from cosmic.mico.gui.scene.meshes import BodyMesh


@dataclass(frozen=True, eq=False)
class Ray:
    """A line of sight in the world, mm; the direction is a unit vector."""

    origin_mm: Floats
    direction: Floats


def pick(
    meshes: Mapping[str, BodyMesh],
    poses: Mapping[str, Floats],
    ray: Ray,
    hidden: Collection[str] = (),
) -> str:
    """Return the body that the ray meets first; empty when it meets none.

    Parameters
    ----------
    poses : mapping of ndarray, shape (4, 4), mm
        `world_from_body` of the bodies.
    hidden : collection of str
        Bodies that are looked through.
    """
    local = {body: _in_body(ray, poses[body]) for body in meshes if body not in hidden}
    enters = {body: _enters_box(own, *meshes[body].bounds_mm) for body, own in local.items()}
    nearest, found = np.inf, ""
    for body in sorted(enters, key=enters.__getitem__):
        if enters[body] >= nearest:
            break
        distance = _meets(local[body], meshes[body])
        if distance < nearest:
            nearest, found = distance, body
    return found


def _in_body(ray: Ray, pose: Floats) -> Ray:
    turn = pose[:3, :3]
    return Ray((ray.origin_mm - pose[:3, 3]) @ turn, ray.direction @ turn)


def _enters_box(ray: Ray, low: Floats, high: Floats) -> float:
    """Return the distance at which the ray enters a box; infinite when it misses."""
    slope = np.where(np.abs(ray.direction) < 1e-15, 1e-15, ray.direction)
    ends = np.stack([(low - ray.origin_mm) / slope, (high - ray.origin_mm) / slope])
    enter, leave = float(ends.min(axis=0).max()), float(ends.max(axis=0).min())
    return max(enter, 0.0) if enter <= leave and leave >= 0.0 else float("inf")


def _meets(ray: Ray, mesh: BodyMesh) -> float:
    """Return the distance to the nearest triangle (Moeller and Trumbore); infinite when none."""
    first, second, across = mesh.edges
    away = ray.origin_mm - mesh.corners_mm[:, 0]
    x, y, z = ray.direction
    turned = away @ np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])  # away x direction
    with np.errstate(divide="ignore", invalid="ignore"):
        size = -1.0 / (across @ ray.direction)
        u = np.einsum("ij,ij->i", second, turned) * size
        v = -np.einsum("ij,ij->i", first, turned) * size
        distance = np.einsum("ij,ij->i", away, across) * size
        inside = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (distance > 0.0)
    hits = distance[inside]
    return float(hits.min()) if len(hits) else float("inf")
