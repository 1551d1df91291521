"""The whole simulated platform with its scene: nothing is brought closer than its margin."""

import logging
import os
import signal
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import pytest

import cosmic
from cosmic.autonomy.handling.plate_obstacles import plate_obstacles
from cosmic.frame.clock import WALL
from cosmic.mico.core.collision.callback import CollisionCallbackBase, Response
from cosmic.mico.core.collision.helper_link import GateProcess
from unit.mico.rigs import wait_until

MARGIN_UM = 5.0


@pytest.fixture
def rig() -> Iterator[cosmic.Rig]:
    with cosmic.connect(rate=20.0, applications=("mico",)) as rig:
        yield rig


def gap_um(rig: cosmic.Rig, *bodies: str) -> float:
    """How far apart two groups of bodies are now, by the gate's own measure."""
    nearest = rig.mico.clearance()
    assert set(nearest.bodies) <= set(bodies) or not bodies, nearest
    return nearest.distance_um


def process_of(rig: cosmic.Rig) -> GateProcess:
    process = rig.mico.application.collision._process  # type: ignore[union-attr]
    assert isinstance(process, GateProcess)
    return process


def test_a_refused_move_says_which_bodies_where_and_what_to_do(rig: cosmic.Rig) -> None:
    with pytest.raises(cosmic.CollisionError) as refused:
        rig.mico["left.z"].move_to(-3000.0)
    verdict = refused.value.verdict
    assert verdict.reason is cosmic.Reason.COLLISION
    assert verdict.axis == "left.z"
    assert "plate" in verdict.bodies
    assert verdict.place_um is not None
    assert abs(verdict.place_um[2]) < 10.0, "the plate's surface is at 0"
    assert dict(verdict.pose)["left.z"] < -1490.0
    for word in ("left.z", "plate", "margin", "may go to"):
        assert word in verdict.text
    assert rig.mico["left.z"].position_um == pytest.approx(0.0, abs=1.0), "nothing moved"


def test_the_travel_that_is_said_to_be_free_is_free(rig: cosmic.Rig) -> None:
    verdict = rig.mico.check({"left.z": -3000.0})
    assert verdict.limit is not None
    assert rig.mico.check({"left.z": verdict.limit + 0.5}).allowed
    reached = rig.mico["left.z"].move_to(verdict.limit + 0.5)
    assert reached is not None
    assert MARGIN_UM - 1.0 < gap_um(rig) < MARGIN_UM + 4.0


def test_a_grasp_may_touch_the_plate_but_not_the_clip_on_it(rig: cosmic.Rig) -> None:
    down = {"left.z": -1495.0}
    rig.mico.move({"left.x": -1156.0, "left.y": 2320.0, "table.rotation": 154.8})
    with rig.mico.collision.contact("grasp"):
        verdict = rig.mico.check(down)
        assert verdict.reason is cosmic.Reason.COLLISION
        assert "plate_clip" in verdict.bodies
        with pytest.raises(cosmic.CollisionError):
            rig.mico.move(down)
        rig.mico.move({"table.rotation": 100.0})
        assert rig.mico.check(down).allowed
        rig.mico.move(down)
        assert not rig.mico.check({"table.rotation": 154.8}).allowed, "nor may it turn into a jaw"


def test_what_stands_on_the_plate_is_known_by_its_outline(rig: cosmic.Rig) -> None:
    (clip,) = plate_obstacles(rig.mico)
    assert clip.min(axis=0) == pytest.approx([10e3, -4e3])
    assert clip.max(axis=0) == pytest.approx([12e3, 4e3])


def test_a_cold_platform_initialises_without_a_refusal(caplog: pytest.LogCaptureFixture) -> None:
    connected = cosmic.connect(rate=20.0, cold=True, applications=("mico",))
    with caplog.at_level(logging.WARNING), connected as rig:
        assert not rig.mico.check({"left.x": 10.0}).allowed
        with pytest.raises(cosmic.NotAvailable):
            rig.mico.clearance()
        rig.mico.initialise()
        assert gap_um(rig) > MARGIN_UM
    assert "refused" not in caplog.text


def test_an_initialisation_that_was_stopped_half_way_can_be_begun_again() -> None:
    with cosmic.connect(rate=10.0, cold=True, applications=("mico",)) as rig:
        task = rig.mico.initialise(wait=False)
        wait_until(lambda: task.progress.fraction > 0.15, 20.0)
        rig.stop("the test wants it")
        with pytest.raises(cosmic.CosmicError):
            task.wait(10.0)
        rig.reset_stop()
        rig.mico.initialise()
        assert rig.mico.check({"left.x": 10.0}).allowed


def test_long_runs_are_checked_by_all_they_can_sweep(rig: cosmic.Rig) -> None:
    left_z = rig.mico["left.z"]
    with pytest.raises(cosmic.CollisionError):
        left_z.move_to_end_stop("backward")
    with pytest.raises(cosmic.CollisionError):
        left_z.calibrate()
    left_z.reference()  # its safe direction leads up
    left_z.move_to_end_stop("forward")


def test_a_jog_slows_down_and_ends_at_the_margin(rig: cosmic.Rig) -> None:
    left_z = rig.mico["left.z"]
    left_z.move_to(-1300.0)
    jog = left_z.jog(-1, speed=200.0)
    places: list[tuple[float, float]] = []
    ended_s = WALL.now_s() + 20.0
    while not jog.movement.done and WALL.now_s() < ended_s:
        jog.renew()
        position = left_z.position_um
        assert position is not None
        places.append((WALL.now_s(), position))
        wait_until(lambda: True)
    assert jog.movement.done, "it goes on for ever"
    with pytest.raises(cosmic.CollisionError):
        jog.movement.wait(1.0)
    wait_until(lambda: left_z.state == "OK")
    assert MARGIN_UM - 1.5 < gap_um(rig) < MARGIN_UM + 6.0


def test_a_body_left_inside_its_margin_can_only_retreat(rig: cosmic.Rig) -> None:
    with rig.mico.collision.contact("grasp"):
        rig.mico["left.z"].move_to(-1498.0)
    assert gap_um(rig) < MARGIN_UM
    assert not rig.mico.check({"left.z": -1498.5}).allowed
    assert rig.mico.check({"left.z": 0.0}).allowed
    assert rig.mico.check({"left.x": 100.0}).allowed, "along the plate it comes no closer"
    assert rig.mico.check({"right.x": 100.0}).allowed, "it is none of the right one's business"


def test_an_axis_left_inside_its_margin_jogs_and_moves_out_and_no_jog_brings_it_closer(
    rig: cosmic.Rig,
) -> None:
    left_z = rig.mico["left.z"]
    left_z.collision_detection = False
    left_z.move_to(-1502.0)  # into the plate by 2 um
    left_z.collision_detection = True
    with pytest.raises(cosmic.CollisionError):
        left_z.jog(-1, speed=5.0).movement.wait(5.0)
    with left_z.jog(1, speed=40.0) as jog:
        until_s = WALL.now_s() + 10.0
        while not jog.done and WALL.now_s() < until_s and left_z.position_um < -1499.0:
            jog.renew()
            wait_until(lambda: True)
    assert isinstance(jog.movement.exception(2.0), cosmic.MoveCancelled), "let go, not refused"
    here = left_z.position_um
    assert here > -1500.0
    with pytest.raises(cosmic.CollisionError):
        left_z.move_by(-0.5)
    assert left_z.move_by(1.0) > here
    left_z.move_to(0.0)


def test_an_axis_out_of_collision_detection_moves_unchecked_until_it_is_taken_in(
    rig: cosmic.Rig, caplog: pytest.LogCaptureFixture
) -> None:
    left_x = rig.mico["left.x"]
    targets = {"left.x": 5400.0, "right.x": -5400.0}
    assert not rig.mico.check(targets).allowed
    with caplog.at_level(logging.INFO):
        left_x.collision_detection = False
        rig.mico["right.x"].collision_detection = False
    assert "left.x was taken out of collision detection" in caplog.text
    assert rig.mico.collision.unwatched == {"left.x", "right.x"}
    verdict = rig.mico.check(targets)
    assert verdict.allowed
    assert "left.x" in verdict.text
    assert not rig.mico.check({"left.z": -3000.0}).allowed, "the others are still checked"
    left_x.collision_detection = True
    rig.mico["right.x"].collision_detection = True
    assert not rig.mico.check(targets).allowed


def test_a_pair_can_have_a_response_of_its_own(rig: cosmic.Rig) -> None:
    class Shrugs(CollisionCallbackBase):
        def on_contact(self, approach: object, spans: object) -> Response:
            return Response.IGNORE

    verdict = rig.mico.check({"left.z": -1550.0})
    assert not verdict.allowed
    for jaw in ("left_jaw_a", "left_jaw_b"):
        rig.mico.collision.set_callback(jaw, "plate", Shrugs())
    assert rig.mico.check({"left.z": -1550.0}).allowed
    for jaw in ("left_jaw_a", "left_jaw_b"):
        rig.mico.collision.set_callback(jaw, "plate", None)
    assert not rig.mico.check({"left.z": -1550.0}).allowed
    with pytest.raises(cosmic.NotAvailable, match="no body 'nose'"):
        rig.mico.collision.set_callback("nose", "plate", Shrugs())


def test_without_the_gates_process_nothing_moves_and_it_comes_back(rig: cosmic.Rig) -> None:
    process = process_of(rig)
    assert process.pid is not None
    os.kill(process.pid, signal.SIGKILL)
    with pytest.raises(cosmic.MoveRefused) as refused:
        rig.mico["left.x"].move_to(100.0)
    assert refused.value.verdict.reason is cosmic.Reason.NO_ANSWER
    assert rig.mico["left.x"].position_um == pytest.approx(0.0, abs=1.0)
    wait_until(lambda: rig.mico.check({"left.x": 100.0}).allowed, 15.0)
    assert rig.mico["left.x"].move_to(100.0) == pytest.approx(100.0, abs=1.0)


def test_a_hundred_commands_at_once_are_all_answered(rig: cosmic.Rig) -> None:
    good, bad = {"left.x": 50.0}, {"left.z": -3000.0}
    with ThreadPoolExecutor(8) as pool:
        asked = [good if number % 2 else bad for number in range(100)]
        verdicts = list(pool.map(rig.mico.check, asked))
    assert [verdict.allowed for verdict in verdicts] == [number % 2 == 1 for number in range(100)]


def test_a_path_is_found_where_the_straight_one_collides(rig: cosmic.Rig) -> None:
    mico = rig.mico
    mico["left.x"].move_to(4000.0)
    mico["left.y"].move_to(-2000.0)
    mico["right.x"].move_to(-4500.0)
    targets = {"left.y": 2000.0}
    assert not mico.check(targets).allowed
    way = mico.plan_path(targets)
    assert way.length >= way.straight_length
    assert way.duration_s > 0.0
    assert mico["left.y"].position_um == pytest.approx(-2000.0, abs=1.0), "nothing moved yet"
    mico.follow(way)
    assert mico["left.y"].position_um == pytest.approx(2000.0, abs=1.0)
    assert mico["left.x"].position_um == pytest.approx(4000.0, abs=1.0)
    assert mico["left.z"].position_um == pytest.approx(0.0, abs=1.0)


def test_no_path_to_a_position_that_is_taken_says_what_is_there(rig: cosmic.Rig) -> None:
    with pytest.raises(cosmic.CollisionError) as refused:
        rig.mico.plan_path({"left.z": -3000.0})
    assert "plate" in refused.value.verdict.bodies
    with pytest.raises(cosmic.LimitError):
        rig.mico.plan_path({"left.z": 9000.0})
    with pytest.raises(cosmic.CosmicError):
        rig.mico.plan_path({"nobody": 1.0})
