"""The way to the collision gate's own process and back, beside the pure gate in this process.

Every movement of one axis by up to 10 mm is put to each of them in turn, so that they meet the
same machine. The bare way is a question of the same size that costs the process nothing, put
again and again: between long checks, other programs on the machine would be measured.
"""

import random
import time
from collections.abc import Callable
from pathlib import Path

from benchmarks.figures import Figure, main, percentile
from cosmic.mico.core.collision.checker import AxisSpan, Spans, pack_spans
from cosmic.mico.core.collision.collision_manager import CollisionManager
from cosmic.mico.core.collision.helper_link import GateProcess
from cosmic.mico.core.collision.model import SceneModel
from cosmic.mico.core.collision.scene_loader import load_scene
from cosmic.mico.core.collision.sweep import Sweep

NAME = "gate_process"
SCENE = Path(__file__).resolve().parents[1] / "config" / "scenes" / "fiberstation.toml"
FARTHEST_UM = 10_000.0
# A function of two arguments that answers at once, called with the scene and the question.
BARE = {"bare": "operator:is_"}


def moves(model: SceneModel, count: int) -> list[Spans]:
    """Return movements of one axis each, from random poses near the park pose."""
    rng = random.Random(3)
    found: list[Spans] = []
    for _ in range(count):
        spans: dict[str, AxisSpan] = {}
        for axis in model.axes:
            low, high = model.travel(axis)
            park = model.park.get(axis, (low + high) / 2.0)
            place = min(max(park + rng.uniform(-0.1, 0.1) * (high - low), low), high)
            spans[axis] = AxisSpan(place, place, place)
        axis = rng.choice(model.axes)
        low, high = model.travel(axis)
        here = spans[axis].low
        end = min(max(here + rng.uniform(-FARTHEST_UM, FARTHEST_UM), low), high)
        spans[axis] = AxisSpan(min(here, end), max(here, end), here, moving=True)
        found.append(spans)
    return found


def timed(question: Callable[[], object]) -> float:
    """Return how long a question takes, in ms."""
    began_s = time.perf_counter()
    question()
    return 1e3 * (time.perf_counter() - began_s)


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of one run."""
    model = load_scene(SCENE)
    pure, gate = Sweep(model), GateProcess(model, handlers=BARE)
    manager = CollisionManager(model, process=gate)
    began_s = time.perf_counter()
    gate.start()
    start_s = time.perf_counter() - began_s
    questions = moves(model, 20 if quick else 2000)
    alone, there, judged, refused = [], [], [], []
    try:
        bare = [
            timed(lambda spans=spans: gate.ask("bare", (pack_spans(spans), ())))
            for spans in questions * (1 if quick else 5)
        ]
        for spans in questions:
            alone.append(timed(lambda spans=spans: pure.check(spans)))
            there.append(timed(lambda spans=spans: gate.check(spans)))
            clear = gate.check(spans).clear
            (judged if clear else refused).append(timed(lambda spans=spans: manager.check(spans)))
    finally:
        gate.close()
    added = [one - other for one, other in zip(there, alone, strict=True)]
    found = [
        Figure(NAME, "bare way, p50", percentile(bare, 50), "ms"),
        Figure(NAME, "bare way, p99", percentile(bare, 99), "ms", 0.3),
        Figure(NAME, "pure gate, p50", percentile(alone, 50), "ms"),
        Figure(NAME, "pure gate, p99", percentile(alone, 99), "ms"),
        Figure(NAME, "in its process, p50", percentile(there, 50), "ms"),
        Figure(NAME, "in its process, p99", percentile(there, 99), "ms"),
        Figure(NAME, "added by the process, p50", percentile(added, 50), "ms"),
        Figure(
            NAME, "in its process / pure, p50", percentile(there, 50) / percentile(alone, 50), ""
        ),
        Figure(NAME, "start until it can be asked", start_s, "s"),
    ]
    for name, times in (("allowed", judged), ("refused, with the free way", refused)):
        if times:
            found += [
                Figure(NAME, f"CollisionManager, {name}, p50", percentile(times, 50), "ms"),
                Figure(NAME, f"CollisionManager, {name}, p99", percentile(times, 99), "ms"),
            ]
    return found


if __name__ == "__main__":
    main(__doc__, measure)
