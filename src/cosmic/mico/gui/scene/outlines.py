"""Outlines of bodies as seen along an axis: convex hulls of their shapes, kept while they slide."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from PySide6.QtCore import QPointF
from PySide6.QtGui import QPolygonF

from cosmic.mico.core.collision.model import Floats
from cosmic.mico.gui.scene.meshes import BodyMesh

TOP: Final = (0, 1, 2)
"""Right, up and towards the eye as numbers of the world's axes, seen from above."""
FRONT: Final = (0, 2, 1)
SIDE: Final = (1, 2, 0)
Plane = tuple[int, int, int]


def eye(plane: Plane) -> float:
    """Return on which side the eye is: from the front one looks along y, else against the axis."""
    return -1.0 if plane == FRONT else 1.0


def hull(points: Floats) -> Floats:
    """Return the corners of the convex hull of points in a plane, shape (n, 2), in order.

    Andrew's monotone chain; flat and single points need no case of their own.
    """
    ordered = np.unique(points, axis=0)
    if len(ordered) < 3:
        return ordered
    return np.array(_half(ordered)[:-1] + _half(ordered[::-1])[:-1])


def _half(ordered: Floats) -> list[tuple[float, float]]:
    chain: list[tuple[float, float]] = []
    for x, y in ordered.tolist():
        while len(chain) >= 2:
            (ax, ay), (bx, by) = chain[-2], chain[-1]
            if (bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0.0:
                break
            chain.pop()
        chain.append((x, y))
    return chain


@dataclass(frozen=True, eq=False)
class Outline:
    """A shape as seen.

    Attributes
    ----------
    shape_mm : QPolygonF
        Its corners in the plane, mm, where the body has not slid.
    shift_mm : tuple of float
        How far it has.
    farthest_mm, nearest_mm : float
        From where to where it reaches towards the eye.
    """

    body: str
    shape_mm: QPolygonF
    shift_mm: tuple[float, float]
    colour: tuple[float, float, float, float]
    farthest_mm: float
    nearest_mm: float


class Outlines:
    """Makes outlines; a body that did not turn since is only shifted."""

    def __init__(self) -> None:
        self._known: dict[tuple[str, int, Plane], tuple[bytes, QPolygonF, float, float]] = {}

    def clear(self) -> None:
        """Forget all bodies."""
        self._known = {}

    def of(self, mesh: BodyMesh, pose: Floats, plane: Plane) -> list[Outline]:
        """Return the outlines of the shapes of a body at `pose` (mm) as seen along a plane."""
        towards = eye(plane)
        shift_mm = float(pose[plane[0], 3]), float(pose[plane[1], 3])
        away = towards * pose[plane[2], 3]
        turn = pose[:3, :3]
        key = np.round(turn, 9).tobytes()
        found = []
        for number, part in enumerate(mesh.parts):
            known = self._known.get((mesh.body, number, plane))
            if known is None or known[0] != key:
                seen = part.vertices_mm @ turn.T
                corners = hull(np.round(seen[:, list(plane[:2])], 6))
                depth = towards * seen[:, plane[2]]
                shape = QPolygonF([QPointF(x, y) for x, y in corners.tolist()])
                known = (key, shape, float(depth.min()), float(depth.max()))
                self._known[mesh.body, number, plane] = known
            far, near = known[2] + away, known[3] + away
            found.append(Outline(mesh.body, known[1], shift_mm, part.colour, far, near))
        return found
