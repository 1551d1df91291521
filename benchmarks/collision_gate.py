"""CPU time of the pure collision gate, and of other ways to judge the same movements.

Start places are random, in half of them something is near; movements are random, free and
blocked. The other ways only look at places along the movement, so none of them is safe. They get
the poses for nothing; their time is what their library takes.
"""

import importlib
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import fcl
import numpy as np
import trimesh
from tests.oracles import poses
from tests.oracles.kinematics import joint_values, place
from tests.oracles.lines import Pairs, fcl_mesh
from tests.oracles.scenes import blobs

from benchmarks.figures import Figure, main, percentile
from cosmic.mico.core.collision.model import SceneModel, Shape
from cosmic.mico.core.collision.scene_loader import load_scene
from cosmic.mico.core.collision.sweep import Sweep

NAME = "collision gate"
SCENE = Path(__file__).resolve().parents[1] / "config" / "scenes" / "fiberstation.toml"
STEP_UM = 5.0
LIMITS_MS = {
    "convex": {
        "10 mm, one axis": 1.0,
        "50 um jog": 0.5,
        "table +-90 deg": 20.0,
        "two arms, three axes each": 20.0,
    },
    "hulls": {
        "10 mm, one axis": 2.0,
        "50 um jog": 0.5,
        "table +-90 deg": 20.0,
        "two arms, three axes each": 20.0,
    },
}
Move = tuple[poses.Position, poses.Moves]
Stands = list[tuple[np.ndarray, np.ndarray]]


def cpu_s(what: Callable[[], Any]) -> float:
    """Return the CPU time of a call."""
    began = time.process_time_ns()
    what()
    return (time.process_time_ns() - began) / 1e9


def gate_figures(name: str, model: SceneModel, count: int) -> tuple[list[Figure], list[Move]]:
    """Return the times of the gate, and the movements of one axis that were asked."""
    sweep, rng = Sweep(model), np.random.default_rng(2)
    times: dict[str, list[float]] = {}
    clear: dict[str, int] = {}
    lines: list[Move] = []
    for start in poses.starts(sweep, 1, count):
        for kind, moves in poses.moves_from(rng, model, start):
            spans = poses.spans(start, moves)
            times.setdefault(kind, []).append(1e3 * cpu_s(lambda s=spans: sweep.check(s)))
            clear[kind] = clear.get(kind, 0) + sweep.check(spans).clear
            if kind == "10 mm, one axis":
                lines.append((start, moves))
    found = []
    for kind, values in times.items():
        what = f"{name}, {kind}"
        stretch = 0.1 if (name, kind) == ("convex", "10 mm, one axis") else None
        found += [
            Figure(NAME, f"{what}: clear", 100.0 * clear[kind] / len(values), "%"),
            Figure(NAME, f"{what}: p50", percentile(values, 50), "ms", stretch),
            Figure(NAME, f"{what}: p95", percentile(values, 95), "ms"),
            Figure(NAME, f"{what}: p99", percentile(values, 99), "ms", LIMITS_MS[name][kind]),
            Figure(NAME, f"{what}: max", max(values), "ms"),
        ]
    return found, lines


def stands(model: SceneModel, move: Move) -> Iterator[Stands]:
    """Yield where all pieces stand, every 5 um along a movement of one axis."""
    start, moves = move
    ((axis, way),) = moves.items()
    here = place(model, joint_values(model, start))
    there = place(model, joint_values(model, {**start, axis: start[axis] + way}))
    for share in np.linspace(0.0, 1.0, int(abs(way) / STEP_UM) + 2):
        between = {
            body: (turn, (1.0 - share) * origin + share * there[body][1])
            for body, (turn, origin) in here.items()
        }
        yield [between[piece.body] for piece in model.pieces]


class Sampled:
    """What the other ways share: pairs of which one piece moves, and an end when they touch."""

    def __init__(self, model: SceneModel) -> None:
        self.model, self.pairs = model, Pairs(model)
        self.objects = [self.make(piece) for piece in model.pieces]

    def make(self, shape: Shape) -> Any:
        """Return a piece in the way of the library."""
        return fcl_mesh(shape.vertices_um, shape.faces)

    def time_s(self, move: Move) -> float:
        """Return the CPU time of judging a movement, without that for the poses."""
        spent = 0.0
        for stand in stands(self.model, move):
            began = time.process_time_ns()
            touches = self.touches(stand)
            spent += (time.process_time_ns() - began) / 1e9
            if touches:
                break
        return spent

    def put(self, stand: Stands) -> None:
        """Put all pieces somewhere."""
        for one, (turn, origin) in zip(self.objects, stand, strict=True):
            one.setRotation(np.ascontiguousarray(turn))
            one.setTranslation(np.ascontiguousarray(origin))

    def touches(self, stand: Stands) -> bool:
        """Return whether a pair meets."""
        raise NotImplementedError


class PairList(Sampled):
    """Every watched pair asked with fcl.collide."""

    def touches(self, stand: Stands) -> bool:
        """Return whether a pair meets."""
        self.put(stand)
        request = fcl.CollisionRequest()
        return any(
            fcl.collide(self.objects[one], self.objects[other], request, fcl.CollisionResult())
            for one, other in zip(self.pairs.one, self.pairs.other, strict=True)
        )


class Filtered(Sampled):
    """Boxes first, then fcl.distance for the pairs whose boxes come within the margin."""

    def __init__(self, model: SceneModel) -> None:
        super().__init__(model)
        self._request = fcl.DistanceRequest()

    def touches(self, stand: Stands) -> bool:
        """Return whether a pair comes within the margin."""
        boxes = [
            ((world := piece.vertices_um @ turn.T + origin).min(axis=0), world.max(axis=0))
            for piece, (turn, origin) in zip(self.model.pieces, stand, strict=True)
        ]
        low, high = (np.array(side) for side in zip(*boxes, strict=True))
        for one, other, margin in self.pairs.near(low, high):
            for number in (one, other):
                self.objects[number].setRotation(np.ascontiguousarray(stand[number][0]))
                self.objects[number].setTranslation(np.ascontiguousarray(stand[number][1]))
            first, second = self.objects[one], self.objects[other]
            if fcl.distance(first, second, self._request, fcl.DistanceResult()) <= margin:
                return True
        return False


class Trimesh(Sampled):
    """trimesh's manager, with the list of allowed pairs applied to the names it tells."""

    def __init__(self, model: SceneModel) -> None:
        super().__init__(model)
        self._manager = trimesh.collision.CollisionManager()
        for number, piece in enumerate(model.pieces):
            mesh = trimesh.Trimesh(piece.vertices_um, piece.faces, process=False)
            self._manager.add_object(str(number), mesh)
        self._watched = {
            frozenset((str(one), str(other)))
            for one, other in zip(self.pairs.one, self.pairs.other, strict=True)
        }

    def touches(self, stand: Stands) -> bool:
        """Return whether a watched pair meets."""
        for number, (turn, origin) in enumerate(stand):
            matrix = np.eye(4)
            matrix[:3, :3], matrix[:3, 3] = turn, origin
            self._manager.set_transform(str(number), matrix)
        _, names = self._manager.in_collision_internal(return_names=True)
        return any(frozenset(two) in self._watched for two in names)


class Coal(Sampled):
    """Every watched pair asked with coal, on convex hulls."""

    def __init__(self, model: SceneModel) -> None:
        self._coal = importlib.import_module("coal")
        super().__init__(model)

    def make(self, shape: Shape) -> Any:
        """Return a convex hull as coal wants it."""
        points = self._coal.StdVec_Vec3s()
        for vertex in shape.vertices_um:
            points.append(vertex)
        return self._coal.Convex.convexHull(points, False, None)

    def touches(self, stand: Stands) -> bool:
        """Return whether a pair meets."""
        coal = self._coal
        where = [coal.Transform3s(turn, origin) for turn, origin in stand]
        request = coal.CollisionRequest()
        return any(
            coal.collide(
                self.objects[one],
                where[one],
                self.objects[other],
                where[other],
                request,
                coal.CollisionResult(),
            )
            for one, other in zip(self.pairs.one, self.pairs.other, strict=True)
        )


class Bullet(Sampled):
    """Every watched pair asked with pybullet for points closer than the margin."""

    def __init__(self, model: SceneModel) -> None:
        self._bullet = importlib.import_module("pybullet")
        self._client = self._bullet.connect(self._bullet.DIRECT)
        super().__init__(model)

    def make(self, shape: Shape) -> Any:
        """Return a body; millimetres, for pybullet's tolerances are those of metres."""
        shape = self._bullet.createCollisionShape(
            self._bullet.GEOM_MESH, vertices=(shape.vertices_um / 1e3).tolist()
        )
        return self._bullet.createMultiBody(0.0, shape)

    def touches(self, stand: Stands) -> bool:
        """Return whether a pair comes within its margin."""
        for one, (turn, origin) in zip(self.objects, stand, strict=True):
            matrix = np.eye(4)
            matrix[:3, :3] = turn
            w, x, y, z = trimesh.transformations.quaternion_from_matrix(matrix)
            self._bullet.resetBasePositionAndOrientation(one, (origin / 1e3).tolist(), (x, y, z, w))
        return any(
            self._bullet.getClosestPoints(self.objects[one], self.objects[other], margin / 1e3)
            for one, other, margin in zip(
                self.pairs.one, self.pairs.other, self.pairs.margin, strict=True
            )
        )


WAYS: tuple[tuple[str, type[Sampled]], ...] = (
    ("boxes and fcl.distance", Filtered),
    ("plain pair list, fcl.collide", PairList),
    ("trimesh's CollisionManager", Trimesh),
    ("coal, pair list", Coal),
    ("pybullet, pair list", Bullet),
)


def ratio_figures(model: SceneModel, lines: list[Move]) -> list[Figure]:
    """Return how many times longer sampling takes in the median than the gate."""
    sweep = Sweep(model)
    own = []
    for start, moves in lines:
        spans = poses.spans(start, moves)
        own.append(1e3 * cpu_s(lambda s=spans: sweep.check(s)))
    mine = percentile(own, 50)
    found = [Figure(NAME, "the same movements, gate: p50", mine, "ms")]
    for name, way in WAYS:
        try:
            sampled = way(model)
        except ImportError:
            found.append(Figure(NAME, f"sampled at 5 um, {name}: not installed", 0.0, ""))
            continue
        middle = percentile([1e3 * sampled.time_s(move) for move in lines], 50)
        found += [
            Figure(NAME, f"sampled at 5 um, {name}: p50", middle, "ms"),
            Figure(NAME, f"sampled at 5 um, {name}: p50 to gate", middle / mine, ""),
        ]
    return found


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of one run."""
    model = load_scene(SCENE)
    count = 6 if quick else 1500
    found, lines = gate_figures("convex", model, count)
    found += gate_figures("hulls", blobs(model), count)[0]
    return found + ratio_figures(model, lines[: 1 if quick else 10])


if __name__ == "__main__":
    main(__doc__, measure)
