"""A jaw of 50 x 100 um x 6 mm that moves past fibres and sheets of 10 um."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from cosmic.mico.core.collision.model import SceneModel

from .convex import distance, slab_distance, swept
from .scenes import Builder, X, Y, Z, box_points

JAW = np.array([50.0, 100.0, 6000.0])
KINDS = {
    "fibre across": (3000.0, 10.0, 10.0),
    "fibre along the jaw": (10.0, 10.0, 3000.0),
    "sheet normal x": (10.0, 3000.0, 3000.0),
    "sheet normal z": (3000.0, 3000.0, 10.0),
}
MARGIN_UM = 5.0
CLOSE_UM = 1e-6
"""What the two ways of computing may differ by."""


@dataclass(frozen=True)
class JawMove:
    """One movement of the jaw and what is exactly true of it.

    Attributes
    ----------
    least_um : float
        The smallest distance on the way; 0 where they meet.
    """

    kind: str
    model: SceneModel
    start: dict[str, float]
    shift: np.ndarray
    least_um: float
    start_um: float


def moves(seed: int, count: int) -> Iterator[JawMove]:
    """Yield movements of 10 mm along one axis or slanting, half of them passing near."""
    rng = np.random.default_rng(seed)
    kinds = list(KINDS)
    while count > 0:
        kind = kinds[int(rng.integers(len(kinds)))]
        move = _one(rng, kind)
        if move.start_um > MARGIN_UM:
            count -= 1
            yield move


def _one(rng: np.random.Generator, kind: str) -> JawMove:
    half = np.array(KINDS[kind]) / 2.0
    turned = bool(rng.random() < 0.5)
    slanting = bool(rng.random() < 0.3)
    turn = Rotation.from_rotvec([0.0, 0.0, rng.uniform(0.0, np.pi) if turned else 0.0])
    obstacle = box_points(-half, half) @ turn.as_matrix().T
    axis = int(rng.integers(3))
    shift = np.zeros(3)
    shift[axis] = 10_000.0 * rng.choice((-1.0, 1.0))
    if slanting:
        shift = rng.normal(size=3)
        shift *= 10_000.0 / np.linalg.norm(shift)
    # Half of the movements pass within some micrometres of touching.
    reach = np.abs(obstacle).max(axis=0) + JAW / 2.0
    aside = rng.uniform(-1.3, 1.3, 3) * reach
    if rng.random() < 0.5:
        other = int(rng.choice([k for k in range(3) if k != axis]))
        aside[other] = (reach[other] + rng.uniform(-30.0, 30.0)) * rng.choice((-1.0, 1.0))
    start = aside - shift * rng.uniform(0.1, 1.1)
    jaw = box_points(-JAW / 2.0, JAW / 2.0) + start
    if turned or slanting:
        whole = swept(jaw, shift[:, np.newaxis], np.zeros(1), np.ones(1))
        least = distance(whole, obstacle)
    else:
        corners = (start - JAW / 2.0, start + JAW / 2.0)
        least = slab_distance(corners, (-half, half), shift)
    positions = dict(zip(("jaw.x", "jaw.y", "jaw.z"), start.tolist(), strict=True))
    return JawMove(kind, _scene(obstacle, shift), positions, shift, least, distance(jaw, obstacle))


def _scene(obstacle: np.ndarray, shift: np.ndarray) -> SceneModel:
    """Return a jaw that moves along x, y, z and, last, along the movement: one axis a line."""
    build = Builder()
    build.piece("base", obstacle)
    parent, travel = "base", (-30e3, 30e3)
    for name, way in (("x", X), ("y", Y), ("z", Z)):
        build.body(name, parent, way, axis=f"jaw.{name}", travel=travel)
        parent = name
    way = shift / np.linalg.norm(shift)
    build.body("jaw", parent, way.tolist(), axis="jaw.line", travel=travel)
    build.box("jaw", (-JAW / 2.0).tolist(), (JAW / 2.0).tolist())
    return build.model([("base", "jaw")], MARGIN_UM)
