"""Hostile commands through all ways in, shortly; `benchmarks.adversary` is long."""

import math
import subprocess
import sys
from types import SimpleNamespace

import pytest
from benchmarks.adversary_attacks import OrderAttack
from benchmarks.adversary_watch import Track

from cosmic.mico.core.motion.messages import Order
from cosmic.mico.core.motion.orders import Calibrate, MoveTo, Reference
from cosmic.twin.settings import shipped_settings
from cosmic.twin.stage import Stage
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


@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.skipif(sys.platform == "win32", reason="processes are halted by SIGSTOP")
def test_a_computer_that_stands_still_lets_nothing_come_too_near(repository):
    command = [sys.executable, "-m", "benchmarks.adversary", "--minutes", "0.7", "--halt-s", "5"]
    done = subprocess.run(
        command, cwd=repository, capture_output=True, text=True, timeout=280, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.fixture
def stage():
    kind = shipped_settings().kinds["linear"]
    return Stage("left.z", kind, start=0.0, seed=1)


def _go(stage, at_s, target):
    route = stage.route(at_s)
    route.go(target, 1000.0)
    stage.follow(route, held_until_s=math.inf)


def test_the_oracle_still_knows_what_a_stage_has_forgotten(stage):
    track = Track(stage)
    _go(stage, 1.0, 5600.0)
    for number in range(200):
        _go(stage, 10.0 + 0.01 * number, 5000.0)
    assert stage.position_then(5.0) != pytest.approx(4000.0)
    assert track.position(5.0) == pytest.approx(4000.0)
    assert track.leg(5.0) == (pytest.approx(1000.0), pytest.approx(6.6))
    track.forget(10.005)
    assert track.position(10.005) == pytest.approx(5595.0)


def test_a_movement_planned_later_than_it_began_is_looked_at_anew(stage):
    # A process that is halted between reading the time and planning does that.
    track = Track(stage)
    assert track.look_until(2.0) == 2.0
    _go(stage, 1.5, 100.0)
    assert track.look_until(2.1) == 1.5
    assert track.look_until(2.2) == 2.2
    stage.halt(2.3, coast_s=0.0, within_s=0.0)
    assert track.look_until(2.4) == 2.4


def _platform_without_parts(submitted):
    addresses = {"left.x": (0, 0), "left.z": (0, 2), "probe.y": (2, 1), "table.rotation": (3, 0)}

    def device(name):
        number = addresses[name][0]

        def submit(order):
            submitted.append((number, order))

        return SimpleNamespace(submit=submit)

    axes = {
        name: SimpleNamespace(
            key=name,
            details=SimpleNamespace(address=SimpleNamespace(device=place[0], channel=place[1])),
        )
        for name, place in addresses.items()
    }
    devices = {axis.key: device(axis.key) for axis in axes.values()}
    manager = SimpleNamespace(
        device=devices.__getitem__,
        latch=SimpleNamespace(state=SimpleNamespace(epoch=0)),
    )

    class Mico(list):
        names = tuple(axes)
        application = SimpleNamespace(manager=manager)

        def __getitem__(self, name):
            return axes[name]

    return SimpleNamespace(mico=Mico(axes.values())), devices


def test_a_forged_run_over_the_whole_travel_is_nobody_s_right_but_on_the_axes_let_off():
    # A reference leads beyond the soft limits, and whoever has the lease may have it run.
    submitted = []
    rig, devices = _platform_without_parts(submitted)
    attack = OrderAttack(rig, 1)
    for _ in range(4000):
        devices["left.z"].submit(Order(2, MoveTo(0.0, "um"), "the holder's"))
        attack.act()
    assert attack.raw == []
    sweeps = [(n, o) for n, o in submitted if isinstance(o.motion, Calibrate | Reference)]
    rightful = [(n, o) for n, o in sweeps if o.token == "the holder's" and o.reservation is None]
    assert {(number, order.channel) for number, order in rightful} == {(2, 1), (3, 0)}
    assert len(sweeps) > 2 * len(rightful)
