"""Ways round what is in the way on the shipped scene: how many, how fast, how long, how safe.

Problems are drawn at random: start and goal are free, the box of the straight way is not. Those
of three axes move one arm past whatever stands about; those of six move both. Every plan is
checked again by a gate that has not seen it, and by poses all over its boxes.
"""

import random
import statistics
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.figures import Figure, main, percentile
from cosmic.mico.core.collision.checker import AxisSpan, Spans
from cosmic.mico.core.collision.model import SceneModel
from cosmic.mico.core.collision.scene_loader import load_scene
from cosmic.mico.core.collision.sweep import Sweep
from cosmic.mico.core.planning.boxes import Boxes, Effort
from cosmic.mico.core.planning.planner import CHECKS_SEARCHED, plan_path
from cosmic.mico.core.planning.problem import NoPath, Plan, Problem
from cosmic.mico.core.planning.rrt_connect import MOST_LEGS, search
from cosmic.mico.core.planning.simplify import shorten
from cosmic.mico.core.planning.space import Space

NAME = "planning"
SCENE = Path(__file__).resolve().parents[1] / "config" / "scenes" / "fiberstation.toml"
ARMS = (("left.x", "left.y", "left.z"), ("right.x", "right.y", "right.z"))
LIFTS = ("left.z", "right.z")
STANDING = (*ARMS[0], *ARMS[1], "probe.x", "probe.y", "table.rotation")
WALK = 200
LOOKS = 24
"""Poses looked at on a straight line; thin bodies between two of them make no problem here."""
POSES = 200
"""Poses looked at in the boxes of a plan."""


@dataclass(frozen=True)
class Run:
    """One problem and what came of it."""

    problem: Problem
    found: Plan | NoPath
    took_s: float
    cpu_s: float


def standing(
    model: SceneModel, place: Mapping[str, float], moving: Sequence[str]
) -> dict[str, AxisSpan]:
    """Return the question whether everything can stand at `place`; jaws may be anywhere."""
    spans = {axis: AxisSpan(*model.travel(axis)) for axis in model.axes}
    for axis, value in place.items():
        spans[axis] = AxisSpan(value - 1e-3, value + 1e-3, moving=axis in moving)
    return spans


def moved(
    sweep: Sweep, place: Mapping[str, float], goal: Mapping[str, float]
) -> dict[str, AxisSpan]:
    """Return the question whether some axes can go from `place` to `goal` in any order."""
    spans = standing(sweep.model, place, ())
    for axis, target in goal.items():
        low, high = sorted((place[axis], target))
        spans[axis] = AxisSpan(low, high, moving=True)
    return spans


def climbs(
    sweep: Sweep, place: dict[str, float], axes: Sequence[str], rng: random.Random
) -> dict[str, float] | None:
    """Return the place, with the axes parked, that a walk on clear legs of one axis reaches.

    It prefers to go up and home. None where it does not get there.
    """
    park = {axis: sweep.model.park[axis] for axis in axes}
    for _ in range(WALK):
        left = [axis for axis in axes if place[axis] != park[axis]]
        if not left:
            return place
        axis = rng.choice([axis for axis in left if axis in LIFTS] or left)
        target = park[axis]
        if not sweep.check(moved(sweep, place, {axis: target})).clear:
            axis = rng.choice(axes)
            target = round(rng.uniform(*sweep.model.travel(axis)), 3)
            if not sweep.check(moved(sweep, place, {axis: target})).clear:
                continue
        place = {**place, axis: target}
    return None


def at_work(model: SceneModel, rng: random.Random) -> dict[str, float]:
    """Return a random place with the arms low and reaching inwards, where they meet each other."""
    place = {axis: rng.uniform(*model.travel(axis)) for axis in STANDING}
    for (x, _, z), inwards in zip(ARMS, (1.0, -1.0), strict=True):
        place[x] = inwards * rng.uniform(2000.0, 6000.0)
        place[z] = rng.uniform(-1500.0, 1500.0)
    return {axis: round(value, 3) for axis, value in place.items()}


def line_is_blocked(
    sweep: Sweep, start: Mapping[str, float], goal: Mapping[str, float], axes: Sequence[str]
) -> bool:
    """Return whether some pose on the straight line is too close to something."""
    for number in range(1, LOOKS):
        share = number / LOOKS
        place = {
            axis: start[axis] + share * (goal[axis] - start[axis]) if axis in axes else value
            for axis, value in start.items()
        }
        if not sweep.check(standing(sweep.model, place, axes)).clear:
            return True
    return False


def problems(model: SceneModel, count: int, seed: int, *, six: bool) -> Iterator[Problem]:
    """Yield problems whose straight line is blocked though there is a way: a walk has found it."""
    rng, sweep = random.Random(seed), Sweep(model)
    while count:
        axes = (*ARMS[0], *ARMS[1]) if six else rng.choice(ARMS)
        start, other = at_work(model, rng), at_work(model, rng)
        end = {**start, **{axis: other[axis] for axis in axes}}
        goal = {axis: end[axis] for axis in axes}
        if not sweep.check(standing(model, start, STANDING)).clear:
            continue
        if not sweep.check(standing(model, end, axes)).clear:
            continue
        if not line_is_blocked(sweep, start, end, axes):
            continue
        # Both ends are joined by way of one and the same place.
        if climbs(sweep, start, axes, rng) is None or climbs(sweep, end, axes, rng) is None:
            continue
        count -= 1
        others = {axis: AxisSpan(*model.travel(axis)) for axis in model.axes if axis not in start}
        yield Problem(start, goal, others=others, budget_s=5.0 if six else 2.0, seed=count)


def boxes(found: Plan) -> Iterator[dict[str, tuple[float, float]]]:
    """Yield where each axis is at the beginning and the end of each leg."""
    here = dict(found.start)
    for leg in found.segments:
        there = {**here, **leg.targets}
        yield {axis: (here[axis], there[axis]) for axis in here}
        here = there


def is_safe(model: SceneModel, run: Run, rng: random.Random) -> bool:
    """Return whether a fresh gate passes all legs, and no pose in their boxes is too close."""
    assert isinstance(run.found, Plan)
    sweep = Sweep(model)
    legs = list(boxes(run.found))
    for leg in legs:
        spans: Spans = {
            **run.problem.others,
            **{
                axis: AxisSpan(min(ends), max(ends), ends[0], moving=ends[0] != ends[1])
                for axis, ends in leg.items()
            },
        }
        if not sweep.check(spans).clear:
            return False
    for _ in range(POSES):
        leg = rng.choice(legs)
        pose = {axis: rng.choice((rng.uniform(*ends), *ends)) for axis, ends in leg.items()}
        pose |= {
            axis: rng.uniform(span.low, span.high) for axis, span in run.problem.others.items()
        }
        near = sweep.nearest(pose)
        if near is None or not near.distance_um > near.margin_um:
            return False
    return True


def solve(model: SceneModel, count: int, *, six: bool) -> list[Run]:
    """Solve blocked problems, one gate for all."""
    sweep, runs = Sweep(model), []
    for problem in problems(model, count, 6 if six else 3, six=six):
        began_s, began_cpu_s = time.perf_counter(), time.process_time()
        found = plan_path(sweep, problem)
        took_s, cpu_s = time.perf_counter() - began_s, time.process_time() - began_cpu_s
        runs.append(Run(problem, found, took_s, cpu_s))
    return runs


def searched(model: SceneModel, runs: Sequence[Run]) -> tuple[list[float], list[float]]:
    """Solve the problems by the search alone; return CPU times, ms, and lengths to straight."""
    sweep = Sweep(model)
    cpu_ms: list[float] = []
    ratios: list[float] = []
    for run in runs:
        space = Space(model, run.problem)
        boxes = Boxes(sweep, run.problem, space, Effort(run.problem.budget_s))
        if not (boxes.free(space.start) and boxes.free(space.goal)):
            continue
        began_s = time.process_time()
        corners = search(boxes, space.start, space.goal, run.problem.seed)
        if corners is not None:
            way = (space.start, *corners)
            way = shorten(boxes, way, run.problem.seed, MOST_LEGS, CHECKS_SEARCHED)
            ratios.append(space.length(way) / space.distance(space.start, space.goal))
        cpu_ms.append(1e3 * (time.process_time() - began_s))
    return cpu_ms, ratios


def search_figures(name: str, model: SceneModel, runs: Sequence[Run]) -> list[Figure]:
    """Return the figures of the search alone."""
    cpu_ms, ratios = searched(model, runs)
    unsolved = 100.0 * (1 - len(ratios) / len(cpu_ms))
    return [
        Figure(NAME, f"{name}: search alone, not solved", unsolved, "%"),
        Figure(NAME, f"{name}: search alone, CPU time, p50", percentile(cpu_ms, 50), "ms"),
        Figure(NAME, f"{name}: search alone, CPU time, p95", percentile(cpu_ms, 95), "ms"),
        Figure(NAME, f"{name}: search alone, length, p50", statistics.median(ratios), ""),
    ]


def figures_of(name: str, runs: Sequence[Run], safe: int, limit_ms: float) -> list[Figure]:
    """Return the figures of one kind of problem."""
    solved = [run.found for run in runs if isinstance(run.found, Plan)]
    times_ms = [1e3 * run.took_s for run in runs]
    cpu_ms = [1e3 * run.cpu_s for run in runs]
    ratios = [each.length / each.straight_length for each in solved]
    before = [each.found_length / each.straight_length for each in solved]
    legs = [float(len(each.segments)) for each in solved]
    searched = 100.0 * sum(each.method == "search" for each in solved) / len(solved)
    return [
        Figure(NAME, f"{name}: not solved", 100.0 * (1 - len(solved) / len(runs)), "%", 2.0),
        Figure(NAME, f"{name}: plans not safe", float(len(solved) - safe), "", 0.0),
        Figure(NAME, f"{name}: time, p50", percentile(times_ms, 50), "ms"),
        Figure(NAME, f"{name}: time, p95", percentile(times_ms, 95), "ms", limit_ms),
        Figure(NAME, f"{name}: time, worst", max(times_ms), "ms"),
        Figure(NAME, f"{name}: CPU time, p50", percentile(cpu_ms, 50), "ms"),
        Figure(NAME, f"{name}: CPU time, p95", percentile(cpu_ms, 95), "ms"),
        Figure(NAME, f"{name}: length to straight, p50", statistics.median(ratios), "", 1.2),
        Figure(NAME, f"{name}: length to straight, p95", percentile(ratios, 95), ""),
        Figure(NAME, f"{name}: the same before cutting, p50", statistics.median(before), ""),
        Figure(NAME, f"{name}: legs, p50", statistics.median(legs), ""),
        Figure(NAME, f"{name}: legs, most", max(legs), ""),
        Figure(NAME, f"{name}: needed a search", searched, "%"),
    ]


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of one run."""
    model, count = load_scene(SCENE), 2 if quick else 100
    figures: list[Figure] = []
    for name, six, limit_ms in (("3 axes", False, 100.0), ("6 axes", True, 1000.0)):
        runs, rng = solve(model, count, six=six), random.Random(1)
        safe = sum(is_safe(model, run, rng) for run in runs if isinstance(run.found, Plan))
        figures += figures_of(name, runs, safe, limit_ms)
        figures += search_figures(name, model, runs)
    return figures


if __name__ == "__main__":
    main(__doc__, measure)
