"""What the gate remembers for speed is bounded: a platform that never rests fills no memory."""

import random
import tracemalloc
from itertools import combinations

from benchmarks.planning import SCENE

from cosmic.mico.core.collision.checker import AxisSpan
from cosmic.mico.core.collision.scene_loader import load_scene
from cosmic.mico.core.collision.sweep import Sweep


def test_movements_of_ever_other_axes_at_once_do_not_fill_the_memory() -> None:
    model = load_scene(SCENE)
    sweep = Sweep(model)
    axes = [axis for axis in model.axes if not axis.endswith("gripper")]
    sets = [chosen for count in (2, 3, 4) for chosen in combinations(axes, count)]
    random.Random(1).shuffle(sets)

    def check_all(some: list[tuple[str, ...]]) -> None:
        for moving in some:
            sweep.check(
                {
                    axis: AxisSpan(0.0, 10.0 * (axis in moving), 0.0, moving=axis in moving)
                    for axis in model.axes
                }
            )

    tracemalloc.start()
    try:
        check_all(sets[:80])
        before, _ = tracemalloc.get_traced_memory()
        check_all(sets[80:])
        after, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert len(sets) > 200
    assert after - before < 5e6  # 70 MB where all are kept
