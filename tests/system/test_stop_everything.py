"""Whatever moves the platform: a tenth of a second after a stop everything stands.

Each routine that can move an axis is a row of `ROUTINES`; a new one needs a row here. What counts
is where the stages of the twin truly were, not what the program believes.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Final

import pytest

from cosmic.frame.clock import WALL
from cosmic.mico.api.mico import Mico
from cosmic.mico.api.planned_path import PlannedPath
from cosmic.mico.api.stepwise import StepwiseMove
from cosmic.mico.core.trajectory.reader import parse
from cosmic.testing.virtual_gamepad import VirtualGamepad
from cosmic.twin.scene import Scene
from system.simulated_platform import platform, wait_until

LIMIT_S: Final = 0.1
LOOK_S: Final = 0.2
"""How long everything is looked at after that."""
CREEP_UM: Final = 0.05
FAR: Final = 3000.0

Keep = Callable[[], None]
"""Goes on doing what the routine's hand would do: hold a key, push a stick."""


def nothing() -> None:
    """Hold nothing."""


def one_axis(mico: Mico) -> Keep:
    mico["left.x"].move_to(FAR, wait=False)
    return nothing


def in_parts(mico: Mico) -> Keep:
    StepwiseMove(mico["left.x"], FAR, 20.0)
    return nothing


def steps(mico: Mico) -> Keep:
    mico["left.gripper"].steps(900, frequency_hz=100, wait=False)
    return nothing


def calibration(mico: Mico) -> Keep:
    mico["left.x"].calibrate(wait=False)
    return nothing


def reference(mico: Mico) -> Keep:
    mico["left.x"].reference(wait=False)
    return nothing


def end_stop(mico: Mico) -> Keep:
    mico["left.x"].move_to_end_stop("forward", wait=False)
    return nothing


def group(mico: Mico) -> Keep:
    mico.move({"left.x": FAR, "right.x": FAR, "probe.x": FAR}, wait=False)
    return nothing


def matched(mico: Mico) -> Keep:
    mico.move({"left.x": FAR, "right.x": FAR / 3}, wait=False, match_arrival=True)
    return nothing


def linked(mico: Mico) -> Keep:
    mico.link("left.x", "right.x", -1.0)
    mico["left.x"].move_to(FAR, wait=False)
    return nothing


def way(mico: Mico) -> Keep:
    parts = ({"left.x": 30.0}, {"left.x": FAR, "left.y": FAR}, {"left.x": 0.0})
    found = PlannedPath(
        start={"left.x": 0.0}, waypoints=parts, method="", length=0, straight_length=0, duration_s=0
    )
    mico.follow(found, wait=False)
    return nothing


def initialisation(mico: Mico) -> Keep:
    mico.initialise(wait=False)
    return nothing


def undo(mico: Mico) -> Keep:
    axis = mico["left.x"]
    axis.set_closed_loop_frequency(18500)
    axis.move_to(2000.0)
    wait_until(lambda: bool(mico.undo_entries))
    axis.set_closed_loop_frequency(300)
    mico.undo(wait=False)
    return nothing


def jog(mico: Mico) -> Keep:
    return mico["left.x"].jog(1, 500.0).renew


def steering(mico: Mico) -> Keep:
    commander = mico["left.x"].commander
    order = commander.steer(0, 500.0, dead_man_s=0.1)
    return lambda: commander.steer_on(order, 500.0)


def pose(mico: Mico) -> Keep:
    place = mico["left.x"].details.position
    mico["left.x"].set_closed_loop_frequency(18500)
    mico["left.x"].move_to((place or 0.0) + 1500.0)
    mico.poses.teach("far", ["left.x"])
    mico["left.x"].move_by(-1500.0)
    mico["left.x"].set_closed_loop_frequency(300)
    mico.poses.go("far", wait=False)
    return nothing


def trajectory(mico: Mico) -> Keep:
    text = "cosmic-trajectory 1\nplatform any\nleft.x to 3000 um\nleft.x to 0 um\n"
    mico.trajectories.run(parse(text), wait=False)
    return nothing


def gamepad(mico: Mico) -> Keep:
    pad = VirtualGamepad()
    pad.__enter__()
    mico.teleoperation.start(pad.key, "left assembly")
    wait_until(lambda: str(mico.teleoperation.state.phase) == "armed")

    def hold() -> None:
        pad.push("left_x", 1.0)

    hold.end = lambda: (mico.teleoperation.stop(), pad.__exit__(None, None, None))  # type: ignore[attr-defined]
    return hold


ROUTINES: Final[tuple[Callable[[Mico], Keep], ...]] = (
    one_axis,
    in_parts,
    steps,
    calibration,
    reference,
    end_stop,
    group,
    matched,
    linked,
    way,
    initialisation,
    undo,
    jog,
    steering,
    pose,
    trajectory,
    gamepad,
)


@dataclass(frozen=True)
class Site:
    """The platform in real time, and the truth about it."""

    mico: Mico
    scene: Scene

    def moving(self) -> bool:
        now_s = self.scene.clock.now_s()
        return any(stage.leg_then(now_s)[0] > 0.0 for stage in self.scene.stages.values())

    def wandered(self, from_s: float, to_s: float) -> dict[str, float]:
        """Return how far each stage went between two moments, where that is more than creep."""
        count = 40
        times_s = [from_s + (to_s - from_s) * n / count for n in range(count + 1)]
        found: dict[str, float] = {}
        for name, stage in self.scene.stages.items():
            places = [stage.position_then(each) for each in times_s]
            if max(places) - min(places) > CREEP_UM:
                found[name] = max(places) - min(places)
        return found


@pytest.fixture(scope="module")
def shared() -> Iterator[Site]:
    with platform(rate=1.0) as (mico, _library, scene):
        yield Site(mico, scene)


@pytest.fixture
def site(shared: Site) -> Iterator[Site]:
    """The platform at rest in its start pose, its axes slow."""
    mico = shared.mico
    for axis in mico:
        if axis.limits is not None:
            axis.set_closed_loop_frequency(18500)
    wait_until(lambda: not shared.moving())
    start = {axis.key: 0.0 for axis in mico if axis.limits is not None}
    mico.move(start)
    for name in start:
        mico[name].set_closed_loop_frequency(300)
    mico.application.undo.forget_all()
    yield shared
    mico.application.manager.reset_stop()
    wait_until(lambda: not any(axis.details.in_motion for axis in mico))
    mico.unlink("left.x")  # links change at rest only
    running = mico.application.running_task
    wait_until(lambda: running is None or running.done)


@pytest.mark.parametrize("begin", ROUTINES, ids=lambda routine: routine.__name__)
def test_nothing_moves_a_tenth_of_a_second_after_a_stop(
    site: Site, begin: Callable[[Mico], Keep]
) -> None:
    keep: Any = begin(site.mico)
    try:
        began_s = WALL.now_s()

        def under_way() -> bool:
            keep()
            return site.moving() and WALL.now_s() > began_s + 0.05

        wait_until(under_way)
        site.mico.application.manager.stop("test")
        stopped_s = site.scene.clock.now_s()
        end_s = stopped_s + LIMIT_S + LOOK_S

        def looked_long_enough() -> bool:
            keep()
            return site.scene.clock.now_s() > end_s

        wait_until(looked_long_enough)
        assert not site.wandered(stopped_s + LIMIT_S, end_s)
    finally:
        getattr(keep, "end", nothing)()


def test_the_test_would_see_a_stage_that_moves_on(site: Site) -> None:
    site.mico["left.x"].move_to(FAR, wait=False)
    wait_until(site.moving)
    now_s = site.scene.clock.now_s()
    wait_until(lambda: site.scene.clock.now_s() > now_s + 0.05)
    assert "left.x" in site.wandered(now_s, now_s + 0.05)
    site.mico["left.x"].halt()
