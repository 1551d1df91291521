"""Groups and linked axes on the twin: what its stages truly did."""

from collections.abc import Iterator

import pytest

import cosmic
from cosmic.frame.clock import WALL
from cosmic.mico.api.mico import Mico
from cosmic.twin.scene import Scene
from system.simulated_platform import platform, wait_until

SPEED_HZ = 500
STEP_UM = 1.5
"""What the twin's stages go with one step: 500 Hz are 0.75 mm/s."""
LAST_UM = 5.5
"""The slow end of a move, and where it may come to rest."""


@pytest.fixture(scope="module")
def twin() -> Iterator[tuple[Mico, Scene]]:
    with platform(rate=1.0) as (mico, _library, scene):
        for axis in mico:
            if axis.limits is not None:
                axis.set_closed_loop_frequency(SPEED_HZ)
        yield mico, scene


def apart(scene: Scene, from_s: float, to_s: float, ratio: float = 1.0) -> float:
    """Return by how much `right.x - ratio * left.x` changed at most."""
    left, right = scene.stages["left.x"], scene.stages["right.x"]
    times_s = [from_s + (to_s - from_s) * n / 500 for n in range(501)]
    gaps = [right.position_then(t) - ratio * left.position_then(t) for t in times_s]
    return max(abs(gap - gaps[0]) for gap in gaps)


def arrivals_s(scene: Scene, *names: str) -> list[float]:
    return [scene.stages[name].path.end_s for name in names]


def test_two_grippers_keep_their_distance_while_they_move(twin: tuple[Mico, Scene]) -> None:
    mico, scene = twin
    mico.link("left.x", "right.x")
    try:
        for distance in (200.0, -200.0):
            began_s = scene.clock.now_s()
            group = mico.move_by({"left.x": distance}, wait=False)
            group.wait(5)
            skew_ms = group.start_skew_ms
            assert skew_ms is not None
            # What the one has ahead of the other; the two arrive a little apart as well.
            allowed_um = SPEED_HZ * STEP_UM * (1e-3 * skew_ms + 5e-3) + 1.0
            assert apart(scene, began_s, scene.clock.now_s()) <= allowed_um
            assert allowed_um < 50.0
    finally:
        mico.unlink("left.x")


def test_the_distance_is_the_same_after_many_moves(twin: tuple[Mico, Scene]) -> None:
    mico, scene = twin
    before = mico["right.x"].details.position, mico["left.x"].details.position
    began_s = scene.clock.now_s()
    mico.link("left.x", "right.x")
    try:
        for _ in range(6):
            mico["left.x"].move_by(7.3)
            mico["right.x"].move_by(-7.3)
    finally:
        mico.unlink("right.x")
    assert None not in before
    now = mico["right.x"].details.position, mico["left.x"].details.position
    assert now == pytest.approx(before, abs=0.5)
    left, right = scene.stages["left.x"], scene.stages["right.x"]
    gaps = [right.position_then(t) - left.position_then(t) for t in (began_s, scene.clock.now_s())]
    assert gaps[1] == pytest.approx(gaps[0], abs=0.5)


def test_matched_axes_arrive_together_and_others_do_not(twin: tuple[Mico, Scene]) -> None:
    mico, scene = twin
    names = ("left.x", "left.y", "right.z")
    here = {name: mico[name].details.position or 0.0 for name in names}
    ways = dict(zip(names, (300.0, 150.0, 60.0), strict=True))
    began_s = scene.clock.now_s()
    mico.move_by(ways, match_arrival=True)
    ends_s = arrivals_s(scene, *names)
    took_s = max(ends_s) - began_s
    # 10 to 20 ms of settling, and speeds in whole hertz.
    assert max(ends_s) - min(ends_s) < 0.06 * took_s + 0.03
    mico.move(here)
    ends_s = arrivals_s(scene, *names)
    assert max(ends_s) - min(ends_s) > 0.3 * took_s


def test_the_path_of_matched_axes_is_nearly_straight(twin: tuple[Mico, Scene]) -> None:
    mico, scene = twin
    began_s = scene.clock.now_s()
    stages = scene.stages["left.x"], scene.stages["right.y"]
    start = [stage.position_then(began_s) for stage in stages]
    group = mico.move_by({"left.x": 200.0, "right.y": 100.0}, wait=False, match_arrival=True)
    group.wait(5)
    times_s = [began_s + n * 5e-3 for n in range(round((scene.clock.now_s() - began_s) / 5e-3))]
    off = [
        abs((a.position_then(t) - start[0]) - 2.0 * (b.position_then(t) - start[1]))
        for t in times_s
        for a, b in [stages]
    ]
    late_um = SPEED_HZ * STEP_UM * 1e-3 * (group.start_skew_ms or 0.0)
    # The shorter way slows down later than half the longer one: some 20 um are left of the line.
    assert max(off) < 25.0 + 2.0 * late_um
    mico.move_by({"left.x": -200.0, "right.y": -100.0})


def test_a_cable_pulled_in_the_middle_stops_the_axes_of_the_other_devices() -> None:
    with platform(rate=1.0) as (mico, library, scene):
        for name in ("left.x", "right.x"):
            mico[name].set_closed_loop_frequency(SPEED_HZ)
        mico.link("left.x", "right.x")
        movement = mico["left.x"].move_to(3000.0, wait=False)
        wait_until(lambda: (mico["left.x"].details.position or 0.0) > 20.0)
        library.faults.inject("unplugged", device=1)
        assert isinstance(movement.exception(5), cosmic.CosmicError)
        now_s = scene.clock.now_s()
        wait_until(lambda: scene.clock.now_s() > now_s + 0.2)
        left = scene.stages["left.x"]
        assert left.position_then(now_s + 0.2) == pytest.approx(
            left.position_then(now_s + 0.05), abs=0.05
        )


def test_an_end_stop_before_one_stops_the_other(twin: tuple[Mico, Scene]) -> None:
    mico, scene = twin
    stage = scene.stages["right.x"]
    stage.obstruct(stage.position(scene.clock.now_s()) + 60.0, 1)
    mico.link("left.x", "right.x")
    start = mico["left.x"].details.position or 0.0
    try:
        with pytest.raises(cosmic.DeviceError, match="end stop"):
            mico["left.x"].move_by(400.0)
        stood = mico["left.x"].details.position
        assert stood is not None
        assert 40.0 < stood - start < 250.0
    finally:
        stage.clear_obstruction()
        mico.unlink("left.x")


def test_a_cold_platform_is_initialised_and_a_second_time_skips_what_is_known() -> None:
    with platform(rate=20.0, cold=True) as (mico, _library, _scene):
        mico.initialise()
        assert {str(axis.confidence) for axis in mico} == {"known", "estimated"}
        began_s = WALL.now_s()
        mico.initialise(skip_known=True)
        assert WALL.now_s() - began_s < 5.0
        where = [axis.details.position for axis in mico if axis.limits is not None]
        assert where == pytest.approx([0.0] * len(where), abs=1.0)
