"""Axes of one MCS2 that keep to a line: what the gate lets pass, and what becomes of trouble.

The obstacle is a rectangle in the plane of two axes. Whether the stages kept clear of it is read
from the twin, which knows where they truly were, by a rule of its own: points, not boxes.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import pytest

import cosmic
from cosmic.frame.clock import WALL, RatedClock
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.verdict import ALLOWED, Reason, refuse
from cosmic.mico.api.application import MicoApplication
from cosmic.mico.api.mico import Mico
from cosmic.mico.core.collision.checker import NoCollisionModel
from cosmic.mico.hw.scu3d import Scu3dController
from cosmic.mico.hw.sim_scu3d import load_simulated_library as load_scu
from cosmic.mico.hw.sim_smaractctl import load_simulated_library
from cosmic.mico.hw.smaractctl import SmaractCtlController
from cosmic.twin.scene import Scene
from cosmic.twin.settings import shipped_settings
from unit.mico.rigs import settings, wait_until

X, Y, Z = "d0.c0", "d0.c1", "d0.c2"
TARGET = {X: 400.0, Y: 400.0}
BESIDE = (300.0, 400.0, 0.0, 80.0)
"""What stands beside the line from (0, 0) to (400, 400): x from, x to, y from, y to, in um."""


class Obstacle(NoCollisionModel):
    """Refuses every volume in which the two axes could be in the rectangle together."""

    available = True

    def __init__(self, rectangle=BESIDE):
        self.rectangle = rectangle
        self.asked = []

    def check(self, spans, *, advice=True):
        self.asked.append(spans)
        left, right, bottom, top = self.rectangle
        x, y = spans[X], spans[Y]
        if x.high < left or x.low > right or y.high < bottom or y.low > top:
            return ALLOWED
        return refuse(Reason.COLLISION, "the corner is in the way")


@dataclass
class Plane:
    rig: Mico
    application: MicoApplication
    scene: Scene
    library: object
    obstacle: Obstacle

    def start(self, targets=None):
        return self.rig.move(targets or TARGET, match_arrival=True, wait=False)

    def true_um(self):
        return [
            self.scene.stages[name].position(self.scene.clock.now_s()) for name in ("0.0", "0.1")
        ]

    def path_um(self):
        """Return where the two stages were since their last common start, 20,000 times a second."""
        stages = [self.scene.stages[name] for name in ("0.0", "0.1")]
        begin_s = min(stage.path.times_s[0] for stage in stages)
        end_s = max(stage.path.end_s for stage in stages)
        count = max(2, int((end_s - begin_s) * 2e4))
        times_s = [begin_s + k * (end_s - begin_s) / (count - 1) for k in range(count)]
        return [tuple(stage.path.at(each) for stage in stages) for each in times_s]

    def touched(self):
        left, right, bottom, top = self.obstacle.rectangle
        return any(left < x < right and bottom < y < top for x, y in self.path_um())

    def wait_until_under_way(self, least_um=20.0):
        wait_until(lambda: self.true_um()[0] > least_um)


@contextmanager
def plane(make: str = "mcs2", rectangle=BESIDE) -> Iterator[Plane]:
    scene = Scene.from_layout(
        "LLL", shipped_settings(), RatedClock(1.0), cold=False, channels=(1, 18)
    )
    library = (load_simulated_library if make == "mcs2" else load_scu)(scene=scene)
    kind = SmaractCtlController if make == "mcs2" else Scu3dController
    obstacle = Obstacle(rectangle)
    application = MicoApplication(
        kind(library, simulated=True),
        settings(("LLL",)),
        clock=scene.clock,
        policy=FailurePolicy(),
        checker=obstacle,
    )
    application.initialize()
    try:
        rig = Mico(application)
        wait_until(lambda: all(each.details.position is not None for each in rig))
        yield Plane(rig, application, scene, library, obstacle)
    finally:
        application.shut_down()


def test_a_path_that_is_refused_as_a_box_and_clear_as_a_line_is_gone_along_the_line():
    with plane() as here:
        assert here.rig.check(TARGET).reason is Reason.COLLISION
        with pytest.raises(cosmic.MoveRefused):
            here.rig.move(TARGET)
        reached = here.start().wait(20)
        assert reached == pytest.approx(TARGET, abs=1.0)
        assert not here.touched()
        assert max(abs(x - y) for x, y in here.path_um()) < 5.0


def test_the_box_is_asked_first_and_is_enough_where_it_is_clear():
    with plane(rectangle=(1000.0, 1100.0, 0.0, 80.0)) as here:
        before = len(here.obstacle.asked)
        assert here.start().wait(20) == pytest.approx(TARGET, abs=1.0)
        assert len(here.obstacle.asked) == before + 1
        assert max(abs(x - y) for x, y in here.path_um()) < 5.0


@pytest.mark.parametrize("rectangle", [(180.0, 220.0, 180.0, 220.0), (240.0, 300.0, 60.0, 200.0)])
def test_a_line_that_comes_too_near_to_something_is_refused_and_nothing_moves(rectangle):
    with plane(rectangle=rectangle) as here:
        with pytest.raises(cosmic.MoveRefused, match="corner"):
            here.start()
        assert here.true_um() == pytest.approx([0.0, 0.0], abs=1.0)
        assert not here.application.manager.gate.held()


def test_an_scu_never_goes_along_a_line():
    with plane("scu") as here, pytest.raises(cosmic.MoveRefused, match="corner"):
        here.start()


def test_others_see_the_whole_box_until_the_movement_is_over():
    with plane() as here:
        moving = here.start()
        here.wait_until_under_way()
        held = here.application.manager.gate.held()
        assert (held[X].high, held[Y].high) == pytest.approx((400.0, 400.0), abs=1.0)
        here.obstacle.asked.clear()
        here.rig[Z].check(10.0)
        assert here.obstacle.asked[-1][Y].high == pytest.approx(400.0, abs=1.0)
        moving.wait(20)
        assert not here.application.manager.gate.held()


def test_a_stop_on_the_way_stops_all():
    with plane() as here:
        moving = here.start()
        here.wait_until_under_way()
        here.rig.stop()
        assert isinstance(moving.exception(10), cosmic.StoppedError)
        stands = here.true_um()
        assert 0.0 < stands[0] < 390.0
        assert stands[1] == pytest.approx(stands[0], abs=60.0)
        assert not here.touched()


@pytest.mark.parametrize("axis", [X, Y])
def test_one_axis_that_is_stopped_stops_the_other(axis):
    with plane() as here:
        moving = here.start()
        here.wait_until_under_way()
        here.rig[axis].stop()
        assert isinstance(moving.exception(10), cosmic.MoveCancelled)
        stands = here.true_um()
        assert stands[1] == pytest.approx(stands[0], abs=60.0)
        assert not here.touched()


def test_one_axis_that_gets_another_target_stops_the_other():
    with plane() as here:
        moving = here.start()
        here.wait_until_under_way()
        with pytest.raises(cosmic.MoveRefused):
            here.rig[Y].move_to(0.0)
        assert not moving.done
        here.obstacle.rectangle = (9000.0, 9001.0, 9000.0, 9001.0)
        here.rig[Y].move_to(0.0)
        assert isinstance(moving.exception(10), cosmic.MoveCancelled)
        assert here.true_um()[0] < 390.0


@pytest.mark.parametrize("channel", [0, 1])
def test_an_axis_that_lags_behind_is_noticed_and_stops_all_before_the_margin_is_broken(channel):
    with plane() as here:
        here.library.faults.inject("lagging", device=0, channel=channel)
        error = here.start().exception(20)
        assert isinstance(error, cosmic.DeviceError)
        stands = here.true_um()
        assert max(stands) < 390.0
        assert abs(stands[0] - stands[1]) < 90.0
        assert not here.touched()


def test_an_axis_that_fails_stops_the_other():
    with plane() as here:
        here.library.faults.inject("end_stop", device=0, channel=1)
        assert isinstance(here.start().exception(20), cosmic.DeviceError)
        assert here.true_um()[0] < 390.0
        assert not here.touched()


def test_an_axis_that_cannot_start_keeps_the_other_from_starting():
    with plane() as here:
        here.library.faults.inject("overheated", device=0, channel=1)
        assert here.start().exception(20) is not None
        WALL.sleep(0.1)
        assert here.true_um() == pytest.approx([0.0, 0.0], abs=1.0)


def test_a_movement_after_a_line_goes_as_fast_as_before():
    with plane() as here:
        here.start().wait(20)
        stage = here.scene.stages["0.0"]
        here.rig[X].move_to(0.0)
        path = stage.path
        assert path.end_s - path.times_s[0] < 0.3
