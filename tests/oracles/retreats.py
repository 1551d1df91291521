"""Movements that begin inside one margin or several: which must be allowed, and which must not.

A body counts by the nearest of its pieces. Distances are those of `convex`.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from cosmic.mico.core.collision.checker import AxisSpan
from cosmic.mico.core.collision.model import SceneModel
from cosmic.mico.core.collision.sweep import Sweep

from .convex import distance
from .kinematics import world_pieces
from .scenes import Builder, X, Y, Z, box_points

MARGIN_UM = 5.0
SURE_UM = 0.02
FLOOR_UM = (SURE_UM, 1.0)
"""How near its margin a pair that slides, or turns, can be told to be outside of it."""
LENGTHS = (0.3, 4.0, 60.0, 700.0)
SAMPLES = 12


@dataclass(frozen=True)
class Corner:
    """A tool beside walls of several pieces, nearer than the margin to one of them at least."""

    model: SceneModel
    start: dict[str, float]

    def gaps_um(self, positions: dict[str, float]) -> np.ndarray:
        """Return the distance of each watched pair of bodies."""
        pieces = world_pieces(self.model, positions)
        of_body: dict[str, list[np.ndarray]] = {}
        for shape, points in zip(self.model.pieces, pieces, strict=True):
            of_body.setdefault(shape.body, []).append(points)
        return np.array(
            [
                min(distance(a, b) for a in of_body[one] for b in of_body[other])
                for one, other in (pair.bodies for pair in self.model.pairs)
            ]
        )

    def along(self, axis: str, way: float) -> np.ndarray:
        """Return the distances on the way, shape (samples, pairs)."""
        shares = np.concatenate(([0.0, 1e-3, 1e-2], np.linspace(0.0, 1.0, SAMPLES)[1:]))
        return np.array([self.gaps_um({**self.start, axis: way * share}) for share in shares])

    def spans(self, axis: str, way: float) -> dict[str, AxisSpan]:
        """Return the question for one axis that goes `way`."""
        rest = {name: AxisSpan(at, at, at) for name, at in self.start.items()}
        rest[axis] = AxisSpan(min(0.0, way), max(0.0, way), 0.0, moving=True)
        return rest


def corners(seed: int, count: int, *, turning: bool) -> Iterator[Corner]:
    """Yield random cases."""
    rng = np.random.default_rng(seed)
    while count:
        case = _corner(rng, turning=turning)
        nearest = case.gaps_um(case.start).min()
        if 0.0 < nearest <= MARGIN_UM:
            count -= 1
            yield case


def _corner(rng: np.random.Generator, *, turning: bool) -> Corner:
    build = Builder()
    parent = "base"
    if turning:
        build.body(
            "turner", parent, Z, axis="r", turns=True, travel=(-3.0, 3.0), place=(-900, 0, 0)
        )
        parent = "turner"
    for name, way in (("tool_x", X), ("tool_y", Y), ("tool", Z)):
        build.body(name, parent, way, axis=name[-1] if name != "tool" else "z")
        parent = name
    tool = _chunk(rng)
    build.piece("tool", tool)
    for wall in ("one", "two"):
        build.body(wall, "base", X, axis=wall)
    here = world_pieces(build.model([("tool", "one")]), {})[0]
    for number in range(int(rng.integers(2, 5))):
        way = rng.normal(size=3)
        way /= np.linalg.norm(way)
        gap = float(rng.choice((rng.uniform(0.3, 4.8), rng.uniform(5.2, 9.0), 40.0)))
        build.piece("one" if number % 2 else "two", _beside(here, _chunk(rng), way, gap))
    names = [(one, two) for one, two in (("one", "tool"), ("two", "tool"))]
    model = build.model(names, MARGIN_UM)
    return Corner(model, {drive.axis: 0.0 for drive in model.drives})


def _chunk(rng: np.random.Generator) -> np.ndarray:
    size = np.array([(300.0, 300.0, 300.0), (40.0, 60.0, 800.0), (900.0, 900.0, 60.0)])
    chosen = size[int(rng.integers(3))]
    if rng.random() < 0.5:
        return box_points(-chosen / 2.0, chosen / 2.0)
    return rng.normal(size=(8, 3)) * chosen / 3.0


def _beside(here: np.ndarray, points: np.ndarray, way: np.ndarray, gap_um: float) -> np.ndarray:
    points = points - points.mean(axis=0) + here.mean(axis=0)
    near, far = 0.0, 5000.0
    for _ in range(45):
        middle = (near + far) / 2.0
        near, far = (
            (near, middle) if distance(here, points + middle * way) > gap_um else (middle, far)
        )
    return points + far * way


def trial(seed: int, count: int, *, turning: bool) -> Counter[str]:
    """Move every axis both ways by several lengths; count what the gate says to it."""
    found: Counter[str] = Counter()
    for case in corners(seed, count, turning=turning):
        sweep = Sweep(case.model)
        begin = case.gaps_um(case.start)
        inside = begin <= MARGIN_UM
        found["several inside"] += int(inside.sum() > 1)
        for axis in ("x", "y", "z", *(["r"] if turning else [])):
            scale = np.degrees(1.0 / 900.0) if axis == "r" else 1.0
            for way in (sign * length * scale for length in LENGTHS for sign in (1.0, -1.0)):
                gaps = case.along(axis, way)
                clear = sweep.check(case.spans(axis, way)).clear
                closer = (gaps[:, inside].min(axis=0) < begin[inside] - SURE_UM).any()
                enters = (gaps[:, ~inside] < MARGIN_UM - SURE_UM).any()
                grows = (np.diff(gaps[:, inside], axis=0) >= -1e-9).all() and (
                    gaps[-1, inside] > begin[inside] + SURE_UM
                ).all()
                keeps = (gaps[:, ~inside] > MARGIN_UM + FLOOR_UM[axis == "r"]).all()
                kind = "turns " if axis == "r" else ""
                if closer or enters:
                    found[kind + "harmful"] += 1
                    found[kind + "harmful and allowed"] += int(clear)
                elif grows and keeps:
                    found[kind + "retreat"] += 1
                    found[kind + "retreat refused"] += int(not clear)
    return found
