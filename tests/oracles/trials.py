"""The gate against the oracles: how often it was right, wrong, or too careful."""

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from cosmic.mico.core.collision.checker import AxisSpan
from cosmic.mico.core.collision.model import SceneModel
from cosmic.mico.core.collision.sweep import Sweep

from . import boxes, jaws, poses
from .lines import Advancement, Replay, Timing

CLOSE_UM = 1e-6
"""What two ways of computing may differ by."""
FLOOR_UM = 1.0
"""Turning pieces may be refused when they come within the margin and this much."""


def at_rest(positions: Mapping[str, float]) -> dict[str, AxisSpan]:
    """Return spans of axes that stand."""
    return {axis: AxisSpan(value, value, value) for axis, value in positions.items()}


def spans_of(case: boxes.BoxCase, *, known: bool) -> dict[str, AxisSpan]:
    """Return the spans of a joint box; not `known`: nobody knows where it begins."""
    return {
        axis: AxisSpan(
            case.low[axis], case.high[axis], case.start[axis] if known else None, moving=True
        )
        for axis in case.low
    }


def jaw_trial(seed: int, count: int) -> Counter[str]:
    """Send a jaw past fibres and sheets."""
    found: Counter[str] = Counter()
    for move in jaws.moves(seed, count):
        length = float(np.linalg.norm(move.shift))
        spans = at_rest(move.start)
        spans["jaw.line"] = AxisSpan(0.0, length, 0.0, moving=True)
        clear = Sweep(move.model).check(spans).clear
        free = move.least_um > jaws.MARGIN_UM
        found["moves"] += 1
        found["free"] += free
        found["collides"] += move.least_um == 0.0
        found["tunnelled"] += clear and move.least_um < jaws.MARGIN_UM - CLOSE_UM
        found["refused though free"] += not clear and move.least_um > jaws.MARGIN_UM + CLOSE_UM
    return found


def box_trial(
    seed: int, count: int, *, turning: float, samples: int = 150, axes: tuple[int, int] = (2, 8)
) -> Counter[str]:
    """Ask for random joint boxes, and look for poses in them that are too close."""
    found: Counter[str] = Counter()
    rng = np.random.default_rng(seed)
    for case in boxes.cases(seed, count, turning=turning, axes=axes):
        least = case.exact_um() if case.slides else case.sampled_um(rng, samples)
        begins = case.gap_um(case.start)
        sweep = Sweep(case.model)
        for known in (True, False):
            answer = sweep.check(spans_of(case, known=known))
            # Where nothing can move, it is known where everything stands.
            inside = (known or case.still) and begins <= boxes.MARGIN_UM
            found["boxes"] += 1
            found["clear"] += answer.clear
            limit = min(begins, boxes.MARGIN_UM) if inside else boxes.MARGIN_UM
            found["unsound"] += answer.clear and least < limit - CLOSE_UM
            found["too careful"] += (
                not answer.clear
                and not inside
                and (least > boxes.MARGIN_UM + (CLOSE_UM if case.slides else FLOOR_UM))
            )
    return found


def retreat_trial(seed: int, count: int, *, turning: float, samples: int = 40) -> Counter[str]:
    """Begin inside the margin, or overlapping; what is allowed must not bring anything closer."""
    found: Counter[str] = Counter()
    rng = np.random.default_rng(seed)
    for case in boxes.cases(seed, count, turning=turning, axes=(1, 4)):
        begins = case.gap_um(case.start)
        if begins > boxes.MARGIN_UM:
            continue
        ends = {axis: float(rng.choice((case.low[axis], case.high[axis]))) for axis in case.low}
        spans = {
            axis: AxisSpan(
                min(end, case.start[axis]), max(end, case.start[axis]), case.start[axis], True
            )
            for axis, end in ends.items()
        }
        found["inside"] += 1
        if not Sweep(case.model).check(spans).clear:
            continue
        found["allowed"] += 1
        for _ in range(samples):
            pose = {
                axis: case.start[axis] + rng.random() * (end - case.start[axis])
                for axis, end in ends.items()
            }
            if case.gap_um(pose) < begins - CLOSE_UM:
                found["closer"] += 1
                break
    return found


def advancement_trial(model: SceneModel, seed: int, count: int) -> Counter[str]:
    """Compare movements of one axis, every fourth of them turning, with plain advancement."""
    found: Counter[str] = Counter()
    rng = np.random.default_rng(seed)
    sweep, plain = Sweep(model), Advancement(model)
    for number, start in enumerate(poses.starts(sweep, seed, count)):
        axis = str(rng.choice(poses.straight_axes(model)))
        way = float(rng.choice((-1.0, 1.0))) * float(rng.choice((50.0, 1000.0, 10_000.0)))
        if number % 4 == 0:
            axis, way = "table.rotation", float(rng.uniform(-90.0, 90.0))
        way = poses.within(model, start, axis, way)
        clear = sweep.check(poses.spans(start, {axis: way})).clear
        free = plain.clear(start, axis, way)
        found["moves"] += 1
        found["free"] += free
        found["clear though not free"] += clear and not free
        # Plain advancement may pass the margin by its tolerance.
        found["refused though free"] += free and not clear
    return found


def two_arm_trial(model: SceneModel, seed: int, count: int, replays: int = 4) -> Counter[str]:
    """Let both arms go at once and replay what is clear with any speeds and delays."""
    found: Counter[str] = Counter()
    rng = np.random.default_rng(seed)
    between = [p for p in model.pairs if {b.split("_")[0] for b in p.bodies} == {"left", "right"}]
    only = replace(model, pairs=tuple(between))
    sweep, arms, replay = Sweep(model), Sweep(only), Replay(model)
    while found["cases"] < count:
        start = poses.face_to_face(rng, model)
        apart, nearest = arms.nearest(start), sweep.nearest(start)
        if not (apart and nearest and apart.distance_um < 400.0):
            continue
        if nearest.distance_um <= nearest.margin_um:
            continue
        found["cases"] += 1
        moves = {
            axis: poses.within(model, start, axis, float(rng.uniform(-1.0, 1.0)) * size)
            for size in [float(rng.choice((100.0, 500.0, 2000.0)))]
            for arm in ("left", "right")
            for axis in rng.choice([f"{arm}.{k}" for k in "xyz"], rng.integers(1, 4), False)
        }
        if not sweep.check(poses.spans(start, moves)).clear:
            continue
        found["clear"] += 1
        for _ in range(replays):
            timings = {
                axis: Timing(float(rng.uniform(0, 1)), way, float(10 ** rng.uniform(2, 4)))
                for axis, way in moves.items()
            }
            worst = replay.worst_um(start, timings)
            found["replays"] += 1
            found["replays that pass near"] += worst < math.inf
            found["replays that collide"] += worst < -CLOSE_UM
    return found


def widest_trial(seed: int, count: int, *, turning: float, samples: int = 150) -> Counter[str]:
    """Widen boxes until they are just clear, and look there for poses that are too close."""
    found: Counter[str] = Counter()
    rng = np.random.default_rng(seed)
    for case in boxes.cases(seed, count, turning=turning, axes=(1, 3)):
        if case.gap_um(case.start) <= boxes.MARGIN_UM:
            continue
        sweep = Sweep(case.model)
        clear, not_clear = 0.0, 1.0
        while not_clear < 1e3 and sweep.check(spans_of(case.shrunk(not_clear), known=False)).clear:
            clear, not_clear = not_clear, 1.5 * not_clear
        if not case.shrunk(not_clear).within_travel:
            continue
        for _ in range(12):
            middle = (clear + not_clear) / 2.0
            if sweep.check(spans_of(case.shrunk(middle), known=False)).clear:
                clear = middle
            else:
                not_clear = middle
        found["boxes"] += 1
        found["unsound"] += case.shrunk(clear).sampled_um(rng, samples) < boxes.MARGIN_UM - CLOSE_UM
        wider = case.shrunk(not_clear)
        found["seen too close just beyond"] += (
            wider.sampled_um(rng, samples) < boxes.MARGIN_UM + FLOOR_UM
        )
    return found
