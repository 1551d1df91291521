"""Jaws that are far away are left out of looks, and nothing changes by that."""

import math
import random

import pytest

from cosmic.twin.kinematics import Slide
from cosmic.twin.probe_to_jaws import ProbeToJaws
from unit.twin.force_bench import FIBRE, Bench, Heard, settings

PROBE = Slide((0.0, 900.0, 100.0), (("p.x", (1.0, 0.0, 0.0)), ("p.y", (0.0, 1.0, 0.0))))
JAW = Slide((0.0, 0.0, 0.0), (("j.x", (0.0, 0.8, 0.6)), ("j.gripper", (0.0, -0.5, 0.0))))
STAGES = ("p.x", "p.y", "j.x", "j.gripper")


def nearest_um(values: dict[str, float]) -> float:
    """Return how far the two points are apart along the axis where that is most."""
    return max(abs(a - b) for a, b in zip(PROBE.at(values), JAW.at(values), strict=True))


@pytest.mark.parametrize("seed", range(20))
def test_no_less_is_left_than_there_is(seed: int) -> None:
    chance = random.Random(seed)
    clear, values = ProbeToJaws([PROBE, JAW], ["j.gripper"]), dict.fromkeys(STAGES, 0.0)
    clear.begin(values, 0.0, nearest_um(values))
    for _ in range(30):
        values = {name: at + chance.gauss(0.0, 5.0) for name, at in values.items()}
        left_um = clear.after_um(values, 0.0, 0.0)
        assert left_um <= nearest_um(values)
        clear.pass_by()
        assert clear.left_um == left_um and clear.before() == (values, 0.0)


def test_drift_counts_and_what_is_not_known_is_nothing() -> None:
    clear, values = ProbeToJaws([PROBE, JAW], []), dict.fromkeys(STAGES, 0.0)
    assert clear.left_um == 0.0 and not clear.passed
    clear.begin(values, 1.0, 50.0)
    assert clear.after_um(values, 3.0, 2.0) == 50.0 - 2.0 * 2.0 * 2.0
    clear.pass_by()
    assert clear.passed
    clear.end()
    assert clear.left_um == 0.0 and not clear.passed


def journey(bench: Bench) -> list[float]:
    """Bring empty jaws to the probe from afar and away again; return forces on the way."""
    bench.go(left_x=4200.0).go(left_z=-810.0)
    forces = []
    for place in (-4700.0, -4880.0, -4884.9, -4885.2, -4888.0, -4880.0, -4500.0, -4886.0):
        forces.append(bench.go(200.0, probe_y=place).force_un)
    return forces


def test_jaws_are_met_alike_whether_other_bodies_are_watched_or_not() -> None:
    lying = settings(FIBRE.model_copy(update={"held_by": "", "x_um": 9000.0}))
    truth = Heard()
    watched, alone = journey(Bench(lying, truth=truth)), journey(Bench(lying))
    assert watched == pytest.approx(alone, rel=1e-9, abs=1e-9)
    assert max(watched) > 1.0 and math.isclose(min(watched), 0.0, abs_tol=1e-9)
    assert truth.names.count("touched") == 2
