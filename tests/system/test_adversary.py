"""Hostile commands through all ways in, shortly; `benchmarks.adversary` is long."""

import subprocess
import sys

import pytest

from oracles.clearance import PlatformClearance

OPEN = {"left.gripper": 300.0, "right.gripper": 300.0}
AXES = ("left.x", "left.y", "left.z", "right.x", "right.y", "right.z", "probe.x", "probe.y")
HOME = {**dict.fromkeys(AXES, 0.0), **OPEN, "table.rotation": 0.0}


@pytest.fixture(scope="module")
def platform(repository):
    return PlatformClearance(repository / "config" / "scenes" / "fiberstation.toml")


def test_the_oracle_knows_what_the_drawing_says(platform):
    near = platform.nearest(HOME)
    assert set(near.bodies) == {"plate", "probe_chip"}
    assert near.distance_um == pytest.approx(400.0)
    assert near.spare_um == pytest.approx(395.0)


@pytest.mark.parametrize("turn_deg", [0.0, 2.0])
def test_the_oracle_sees_what_comes_too_near_in_the_middle_of_a_way(platform, turn_deg):
    # The jaws go past the clip of the plate: they are far enough from it at both ends.
    start = HOME | {"left.z": -1460.0, "left.x": -3000.0}
    end = HOME | {"left.z": -1460.0, "left.x": 4000.0, "table.rotation": turn_deg}
    middle = HOME | {"left.z": -1480.0}
    ends = min(platform.nearest(start).spare_um, platform.nearest(end).spare_um)
    on_way = platform.nearest_on_way(HOME, middle).spare_um
    assert on_way == pytest.approx(platform.nearest(middle).spare_um, abs=0.2)
    assert platform.nearest_on_way(start, end).spare_um <= ends + 0.2


def test_a_run_that_drives_into_the_plate_is_seen(platform):
    down = platform.nearest_on_way(HOME, HOME | {"left.z": -3000.0})
    assert down.spare_um == -5.0
    assert "left" in " ".join(down.bodies)


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_no_hostile_command_does_harm(repository):
    command = [sys.executable, "-m", "benchmarks.adversary", "--commands", "3000"]
    done = subprocess.run(
        command, cwd=repository, capture_output=True, text=True, timeout=280, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
