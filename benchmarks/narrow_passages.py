"""Paths through narrow windows: how often the search alone finds one, how fast and how short.

One arm, three axes, has to pass a wall through a window, two walls with windows on opposite
sides, or a bore as long as itself; two arms, six axes, pass the window of one wall one after the
other. The gap is what is left on each side of an arm in its window. Each problem is searched with
several seeds, for so many questions to the gate at most: their number does not depend on the
machine. A gate that has not seen it checks what was found again.
"""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from typing_extensions import override

from benchmarks.figures import Figure, main, percentile
from cosmic.mico.core.collision.checker import AxisSpan
from cosmic.mico.core.collision.model import (
    Drive,
    Joint,
    JointKind,
    SceneModel,
    Shape,
    WatchedPair,
    pair_of,
)
from cosmic.mico.core.collision.sweep import Sweep
from cosmic.mico.core.planning.boxes import Boxes, Effort
from cosmic.mico.core.planning.planner import CHECKS_SEARCHED
from cosmic.mico.core.planning.problem import Problem
from cosmic.mico.core.planning.rrt_connect import MOST_LEGS, search
from cosmic.mico.core.planning.simplify import shorten
from cosmic.mico.core.planning.space import Path, Space

NAME = "narrow_passages"
QUESTIONS: Final = 15_000
"""About two seconds of a search."""
SEEDS: Final = 16
HALF_UM: Final = 100.0
"""Half the width and height of an arm."""
LENGTH_UM: Final = 1000.0
TRAVEL_UM: Final = 3000.0
MARGIN_UM: Final = 5.0
WAYS: Final = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
Box = tuple[float, float, float, float, float, float]
"""Lowest and highest x, y and z, um."""
FACES: Final = np.array(
    [
        *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]),
        *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
    ],
    dtype=np.int32,
)


@dataclass(frozen=True)
class Passage:
    """A scene with a problem in it."""

    name: str
    model: SceneModel
    problem: Problem


def wall(x: float, thick: float, window: tuple[float, float], half: float) -> list[Box]:
    """Return four boxes that leave a square window at (y, z), all else blocked."""
    y, z = window
    far = 2.0 * TRAVEL_UM
    return [
        (x, x + thick, -far, y - half, -far, far),
        (x, x + thick, y + half, far, -far, far),
        (x, x + thick, y - half, y + half, -far, z - half),
        (x, x + thick, y - half, y + half, z + half, far),
    ]


def shape(name: str, body: str, box: Box) -> Shape:
    """Return a box as a piece."""
    axes = (box[:2], box[2:4], box[4:])
    corners = np.array([[x, y, z] for x in axes[0] for y in axes[1] for z in axes[2]])
    return Shape(name, body, corners, FACES)


def scene(walls: Sequence[Box], arms: Sequence[str]) -> SceneModel:
    """Return arms on three stages each, and walls that stand."""
    joints: list[Joint] = []
    drives: list[Drive] = []
    pieces = [shape(f"wall {number}", "base", box) for number, box in enumerate(walls)]
    for arm in arms:
        parent = "base"
        for letter, way in WAYS.items():
            child = f"{arm}_{letter}"
            joints.append(
                Joint(
                    child, JointKind.PRISMATIC, parent, child, np.eye(4), np.array(way),
                    -2.0 * TRAVEL_UM, 2.0 * TRAVEL_UM,
                )
            )  # fmt: skip
            drives.append(Drive(f"{arm}.{letter}", child, 1.0, 0.0, overshoot=1.0))
            parent = child
        half, end = HALF_UM, LENGTH_UM / 2.0
        pieces.append(shape(arm, parent, (-end, end, -half, half, -half, half)))
    bodies = ["base", *(f"{arm}_z" for arm in arms)]
    pairs = [pair_of(a, b) for number, a in enumerate(bodies) for b in bodies[number + 1 :]]
    return SceneModel(
        name="narrow",
        bodies=("base", *(each.child for each in joints)),
        joints=tuple(joints),
        pieces=tuple(pieces),
        views=(),
        drives=tuple(drives),
        pairs=tuple(WatchedPair(pair, MARGIN_UM) for pair in pairs),
    )


def passages(gap_um: float) -> Iterator[Passage]:
    """Yield the problems with one gap."""
    half = HALF_UM + MARGIN_UM + gap_um
    one = wall(-100.0, 200.0, (700.0, -400.0), half)
    two = [*wall(-900.0, 200.0, (800.0, 0.0), half), *wall(700.0, 200.0, (-800.0, 300.0), half)]
    bore = wall(-500.0, 1000.0, (700.0, -400.0), half)
    start, goal = (-2000.0, -300.0, 500.0), (2000.0, -200.0, 600.0)
    for name, walls in (("window", one), ("two windows", two), ("bore", bore)):
        yield Passage(name, scene(walls, ["left"]), problem({"left": start}, {"left": goal}))
    starts = {"left": start, "right": (-2000.0, 400.0, 500.0)}
    goals = {"left": goal, "right": (2000.0, 700.0, 600.0)}
    wide = wall(-100.0, 200.0, (700.0, -400.0), 2.0 * half)
    yield Passage("two arms", scene(wide, ["left", "right"]), problem(starts, goals))


def problem(
    starts: dict[str, tuple[float, float, float]], goals: dict[str, tuple[float, float, float]]
) -> Problem:
    """Return the problem to bring arms from one place to another."""
    named = [
        {
            f"{arm}.{letter}": value
            for arm, at in each.items()
            for letter, value in zip("xyz", at, strict=True)
        }
        for each in (starts, goals)
    ]
    limits = dict.fromkeys(named[0], (-TRAVEL_UM, TRAVEL_UM))
    return Problem(named[0], named[1], limits)


class Questions(Effort):
    """Is over after a number of questions, whatever time it is."""

    def __init__(self) -> None:
        super().__init__(budget_s=1.0)
        self.most = QUESTIONS

    @property
    @override
    def spent(self) -> bool:
        return self.checks >= self.most


def is_safe(passage: Passage, boxes: Boxes, path: Path) -> bool:
    """Return whether a fresh gate passes every leg of a path."""
    sweep = Sweep(passage.model)
    for corner, following in pairwise(path):
        here = corner
        for there in boxes.edge(corner, following, MOST_LEGS) or (following,):
            spans = {
                axis: AxisSpan(min(a, b), max(a, b), a, moving=a != b)
                for axis, a, b in zip(boxes.space.axes, here, there, strict=True)
            }
            if not sweep.check(spans).clear:
                return False
            here = there
    return True


def figures_of(name: str, passage: Passage, seeds: int) -> list[Figure]:
    """Return the figures of one problem."""
    cpu_ms: list[float] = []
    asked: list[float] = []
    ratios: list[float] = []
    unsafe = 0
    for seed in range(seeds):
        space = Space(passage.model, passage.problem)
        effort = Questions()
        boxes = Boxes(Sweep(passage.model), passage.problem, space, effort)
        began_s = time.process_time()
        corners = search(boxes, space.start, space.goal, seed)
        cpu_ms.append(1e3 * (time.process_time() - began_s))
        asked.append(float(effort.checks))
        if corners is None:
            continue
        effort.most = effort.checks + 2 * CHECKS_SEARCHED
        raw = (space.start, *corners)
        path = shorten(boxes, raw, seed, MOST_LEGS, CHECKS_SEARCHED)
        ratios.append(space.length(path) / space.distance(space.start, space.goal))
        unsafe += not is_safe(passage, boxes, path)
    unsolved = 100.0 * (1 - len(ratios) / seeds)
    return [
        Figure(NAME, f"{name}: not solved", unsolved, "%"),
        Figure(NAME, f"{name}: not safe", float(unsafe), "", 0.0),
        Figure(NAME, f"{name}: questions, p50", percentile(asked, 50), ""),
        Figure(NAME, f"{name}: CPU time, p50", percentile(cpu_ms, 50), "ms"),
        Figure(NAME, f"{name}: length, p50", percentile(ratios, 50) if ratios else np.nan, ""),
    ]


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of one run."""
    figures: list[Figure] = []
    for gap_um in (400.0,) if quick else (400.0, 200.0, 100.0):
        for passage in passages(gap_um):
            name = f"{passage.name}, gap {gap_um:.0f} um"
            figures += figures_of(name, passage, 2 if quick else SEEDS)
    return figures


if __name__ == "__main__":
    main(__doc__, measure)
