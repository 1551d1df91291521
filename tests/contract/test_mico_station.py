"""MiCo is the same for a program in its own process and for one at the end of a line."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QPushButton
from pytestqt.qtbot import QtBot

from contract.mico_rig import (
    HostedMico,
    hosted_mico,
    reachable,
    remote_mico,
    transport_to,
    wait_for,
)
from contract.station_rig import connected_in_memory
from cosmic.frame.clock import WALL
from cosmic.frame.declaration import command
from cosmic.frame.errors import (
    LimitError,
    MoveCancelled,
    MoveRefused,
    NotAvailable,
    StoppedError,
    UnknownAxisError,
)
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.caller import Access, Caller
from cosmic.frame.network.client_side_connection import ClientSideConnection
from cosmic.frame.network.errors import CallRefused, StationAway
from cosmic.frame.network.host import Host
from cosmic.frame.network.station import Station
from cosmic.frame.network.transport import Receiver, Rule, Subscription
from cosmic.frame.operation import Progress
from cosmic.frame.threads import declare_gui_thread
from cosmic.frame.verdict import Reason
from cosmic.mico.api.axis import Axis
from cosmic.mico.api.client import MicoClient
from cosmic.mico.api.mico import Mico, mico_of
from cosmic.mico.api.planned_path import PlannedPath
from cosmic.mico.api.stepwise import StepwiseMove
from cosmic.mico.api.trajectory_start import AwayFromStartError
from cosmic.mico.api.trajectory_state import PlayProgress, PlayState
from cosmic.mico.core.motion.orders import Jog, MoveTo, Steer
from cosmic.mico.core.motion.positioner import Confidence, Status
from cosmic.mico.core.motion.stop_latch import StopState
from cosmic.mico.core.teleoperation.state import TeleoperationPhase
from unit.mico.hand_input import HandInput

SLOW_HZ = 10
HEAD = "cosmic-trajectory 1\nplatform FiberStation\n"


@pytest.fixture(scope="module")
def station() -> Iterator[HostedMico]:
    with hosted_mico() as made:
        yield made


@pytest.fixture
def hosted(station: HostedMico, request: pytest.FixtureRequest) -> Iterator[HostedMico]:
    station.begin_anew()
    if "zenoh" in request.node.name:
        with reachable(station) as listening:
            yield listening
    else:
        yield station


@pytest.fixture(params=["local", "memory", "zenoh"])
def mico(hosted: HostedMico, request: pytest.FixtureRequest) -> Iterator[Mico]:
    """The same thing for a script, wherever it runs."""
    if request.param == "local":
        yield hosted.mico
    else:
        with remote_mico(hosted, request.param) as (mico, _, _):
            yield mico


@pytest.fixture(params=["memory", "zenoh"])
def how(request: pytest.FixtureRequest) -> str:
    kind: str = request.param
    return kind


# --- a script neither knows nor cares where MiCo runs ------------------------------------------


def test_axes_say_what_they_are(mico: Mico) -> None:
    assert mico.names[:3] == ["left.x", "left.y", "left.z"]
    assert len(mico) == 11
    assert mico.simulated
    assert not mico.missing
    axis = mico["left.x"]
    assert (axis.unit, axis.kind, axis.confidence) == ("um", "linear", Confidence.KNOWN)
    assert axis.limits == (-5500.0, 5500.0)
    assert axis.state is Status.OK
    assert mico["table.rotation"].angle_deg is not None
    assert mico["left.gripper"].confidence is Confidence.ESTIMATED
    with pytest.raises(UnknownAxisError, match=r"left\.q"):
        mico["left.q"]


def test_a_move_returns_where_the_axis_stands_and_the_axis_says_the_same(mico: Mico) -> None:
    axis = mico["left.x"]
    assert axis.move_to(120.0) == pytest.approx(120.0, abs=1.0)
    assert axis.position_um == pytest.approx(120.0, abs=1.0)
    assert not axis.details.in_motion
    assert axis.move_by("-0.02 mm") == pytest.approx(100.0, abs=1.0)
    movement = axis.move_to(0.0, wait=False)
    assert movement.wait(10.0) == pytest.approx(0.0, abs=1.0)
    assert movement.success
    assert axis.locate()["readback"] == pytest.approx(0.0, abs=1.0)


def test_the_estimate_of_an_axis_without_sensor_can_be_set_and_says_how_sure_it_is(
    mico: Mico,
) -> None:
    axis = mico["left.gripper"]
    axis.set_estimate("0.2 mm", std_um=4.0)
    assert (axis.position_um, axis.position_std_um) == (200.0, 4.0)
    axis.steps(100, frequency_hz=5000)
    assert axis.position_um == pytest.approx(300.0)
    assert axis.position_std_um == pytest.approx(14.0)
    with pytest.raises(LimitError, match="end stop"):
        axis.set_estimate(2000.0)
    with pytest.raises(LimitError, match="Make fewer steps"):
        axis.steps(-900)


def test_axes_move_together_or_not_at_all(mico: Mico) -> None:
    reached = mico.move({"left.x": 30.0, "right.x": -30.0})
    assert reached == pytest.approx({"left.x": 30.0, "right.x": -30.0}, abs=1.0)
    with pytest.raises(LimitError):
        mico.move({"left.x": 40.0, "right.x": 90_000.0})
    assert mico["left.x"].position_um == pytest.approx(30.0, abs=1.0)
    group = mico.move_by({"left.x": 10.0, "right.x": 10.0}, wait=False)
    assert group.wait(10.0) == pytest.approx({"left.x": 40.0, "right.x": -20.0}, abs=1.0)
    assert group.start_skew_ms is not None


def test_a_refusal_has_its_verdict(mico: Mico) -> None:
    with pytest.raises(LimitError) as caught:
        mico["left.x"].move_to(9_000.0)
    verdict = caught.value.verdict
    assert (verdict.reason, verdict.axis, verdict.limit) == (Reason.LIMIT, "left.x", 5500.0)
    assert mico.check({"left.x": 9_000.0}).reason is Reason.LIMIT
    assert mico.check({"left.x": 100.0}).allowed
    with pytest.raises(MoveRefused) as senseless:
        mico["left.x"].move_to(float("nan"))
    assert senseless.value.verdict.reason is Reason.NOT_FINITE
    with pytest.raises(MoveRefused):
        mico["left.gripper"].move_to(10.0)


def test_a_cancelled_movement_ends_where_it_is(mico: Mico) -> None:
    axis = mico["left.x"]
    axis.set_closed_loop_frequency(SLOW_HZ)
    movement = axis.move_to(5_000.0, wait=False)
    wait_for(lambda: axis.details.in_motion)
    movement.cancel()
    with pytest.raises(MoveCancelled):
        movement.wait(5.0)
    assert axis.position_um is not None
    assert axis.position_um < 4_000.0


def test_a_jog_goes_on_while_it_is_renewed_and_ends_at_once(mico: Mico) -> None:
    axis = mico["left.x"]
    # Where other programs keep the cores from this one for 0.25 s, the axis stops as it should.
    tries = (_held_for_longer_than_the_dead_man(axis) for _ in range(30))
    assert next((held for held, renewed in tries if renewed), False)
    assert axis.position_um is not None
    assert axis.position_um > 20.0


def _held_for_longer_than_the_dead_man(axis: Axis) -> tuple[bool, bool]:
    """Return whether the jog was held, and whether it was renewed all the time."""
    with axis.jog(1, 50.0) as jog:
        renewed_s = began_s = WALL.now_s()
        pause_s = 0.0
        # On a busy computer the time of the platform waits: so the way counts too.
        while not ((WALL.now_s() > began_s + 0.4 and (axis.position_um or 0.0) > 20.0) or jog.done):
            jog.renew()
            pause_s = max(pause_s, WALL.now_s() - renewed_s)
            renewed_s = WALL.now_s()
            WALL.sleep(0.02)
        held, pause_s = not jog.done, max(pause_s, WALL.now_s() - renewed_s)
    jog.movement.exception(5.0)
    return held, pause_s < 0.1


def test_a_jog_that_nobody_renews_ends_by_itself(mico: Mico) -> None:
    jog = mico["left.x"].jog(1)
    wait_for(lambda: jog.done, 3.0)


def test_a_steered_axis_follows_the_input_and_ends_without_it(mico: Mico) -> None:
    axis = mico["left.x"]
    hand = axis.steer(5.0, dead_man_s=0.5)
    until_s = WALL.now_s() + 0.7
    while WALL.now_s() < until_s:
        hand.renew(5.0)
        WALL.sleep(0.01)
    assert not hand.done
    hand.movement.exception(3.0)  # nobody renews it any more
    assert 5.0 < (axis.position_um or 0.0) < 1_000.0


def steered_for(hand: HandInput, axis: Axis, push: float) -> None:
    """Push until the axis has gone some way in that direction, and let go."""
    before = axis.position_um or 0.0
    hand.axes["left_x"] = push
    wait_for(lambda: push * ((axis.position_um or 0.0) - before) > 5.0)
    hand.axes["left_x"] = 0.0
    wait_for(lambda: not axis.details.in_motion, 3.0)


def test_an_input_device_steers_the_axes_wherever_they_are(mico: Mico) -> None:
    hand, axis, steering = HandInput(quiet_s=None), mico["left.x"], mico.teleoperation
    hand.axes = {"left_x": 0.0, "left_y": 0.0, "right_y": 0.0}
    steering.start(hand, "left assembly")
    try:
        wait_for(lambda: steering.state.phase is TeleoperationPhase.ARMED)
        for push in (1.0, -1.0):
            steered_for(hand, axis, push)
        hand.axes["left_x"] = 1.0
        wait_for(lambda: axis.details.in_motion)
        hand.go_on.clear()  # it hangs: the dead man notices, at the station too
        wait_for(lambda: not axis.details.in_motion, 3.0)
        hand.axes["left_x"] = 0.0
        hand.go_on.set()
        mico.stop("seen")
        wait_for(lambda: steering.state.phase is TeleoperationPhase.STOPPED)
        assert "seen" in steering.state.reason
    finally:
        hand.go_on.set()
        steering.stop()


def test_the_signals_of_a_commander_report_what_became_of_movements(mico: Mico) -> None:
    axis = mico["left.x"]
    ended: list[object] = []
    refused: list[object] = []
    states: list[object] = []
    direct = Qt.ConnectionType.DirectConnection
    axis.commander.movement_ended.connect(ended.append, direct)
    axis.commander.movement_refused.connect(refused.append, direct)
    axis.commander.state_changed.connect(states.append, direct)
    axis.move_to(12.0)
    with pytest.raises(LimitError):
        axis.move_to(9_000.0)
    wait_for(lambda: ended and refused and states)
    assert [str(getattr(each, "reason", "")) for each in refused] == [str(Reason.LIMIT)]


def test_who_follows_the_stop_hears_of_each(mico: Mico) -> None:
    heard: list[StopState] = []
    end = mico.follow_stop(heard.append)
    mico.stop("one")
    wait_for(lambda: heard)
    mico.reset_stop()
    wait_for(lambda: not heard[-1].latched)
    end()
    mico.stop("two")
    mico.reset_stop()
    assert [each.reason and "one" in each.reason for each in heard] == [True, None]


def test_a_stop_stays_until_it_is_reset(mico: Mico) -> None:
    axis = mico["left.x"]
    axis.set_closed_loop_frequency(SLOW_HZ)
    movement = axis.move_to(5_000.0, wait=False)
    wait_for(lambda: axis.details.in_motion)
    mico.stop("stop from a script")
    assert "stop from a script" in (mico.stop_state.reason or "")
    with pytest.raises(StoppedError):
        movement.wait(5.0)
    with pytest.raises(StoppedError):
        axis.move_to(0.0)
    mico.reset_stop()
    assert not mico.stop_state.latched
    axis.set_closed_loop_frequency(5000)
    axis.move_to(0.0)


def test_steps_zero_links_and_undo(mico: Mico) -> None:
    gripper, left = mico["left.gripper"], mico["left.x"]
    before = gripper.position_um or 0.0
    assert (gripper.steps(100) or 0.0) > before
    left.move_to(50.0)
    left.set_zero()
    assert left.position_um == pytest.approx(0.0, abs=1.0)
    left.clear_zero()
    assert left.position_um == pytest.approx(50.0, abs=1.0)
    mico.link("left.x", "right.x")
    assert left.linked_to == {"right.x": 1.0}
    left.move_by(10.0)
    assert mico["right.x"].position_um == pytest.approx(10.0, abs=1.0)
    assert mico.unlink("right.x")
    assert not mico.links
    assert {entry.group for entry in mico.undo_entries[:2]} == {"Left assembly", "Right assembly"}
    mico.undo("Left assembly")
    assert left.position_um == pytest.approx(50.0, abs=1.0)


def test_poses_paths_and_collisions(mico: Mico) -> None:
    mico.poses.teach("there", ["left.x"])
    assert "there" in mico.poses
    mico["left.x"].move_to(80.0)
    mico.poses.go("there")
    assert mico["left.x"].position_um == pytest.approx(0.0, abs=1.0)
    mico.poses.remove("there")
    assert "there" not in mico.poses
    way = mico.plan_path({"left.x": 60.0})
    mico.follow(way)
    assert mico["left.x"].position_um == pytest.approx(60.0, abs=1.0)
    assert mico.clearance().distance_um > 0.0
    mico.collision.take_out("left.x")
    assert mico.collision.unwatched == {"left.x"}
    assert not mico["left.x"].collision_detection
    mico.collision.take_in("left.x")
    assert not mico.collision.unwatched
    with mico.collision.contact("grasp"):
        assert mico.collision.allowed_contacts == {"grasp"}
    assert not mico.collision.allowed_contacts


def test_a_trajectory_is_rehearsed_against_the_scene(mico: Mico) -> None:
    assert "left_jaw_a" in mico.collision.scene.bodies
    assert mico.check({"left.z": -5_000.0}).reason is Reason.COLLISION
    into_the_plate = mico.trajectories.parse(f"{HEAD}left.z to -5000 um\n")
    found = mico.trajectories.rehearse(into_the_plate)
    assert not found.allowed
    assert "plate" in str(found.verdict)
    assert mico.trajectories.rehearse(mico.trajectories.parse(f"{HEAD}left.x to 50 um\n")).allowed


def test_the_initialisation_reports_how_far_it_is(mico: Mico) -> None:
    progress: list[Progress] = []
    mico.initialise(progress.append, skip_known=True)
    assert progress[-1].done
    assert not progress[-1].error


def test_a_trajectory_runs_pauses_and_goes_on(mico: Mico, tmp_path: Path) -> None:
    path = tmp_path / "way.traj"
    with mico.trajectories.record(path, timed=False):
        mico["left.x"].move_to(40.0)
        mico["left.x"].move_to(20.0)
    mico["left.x"].move_to(0.0)
    player = mico.trajectories.run(path, start="straight")
    assert player.state == "ended"
    assert mico["left.x"].position_um == pytest.approx(20.0, abs=1.0)


def test_a_trajectory_is_stepped_watched_and_goes_on_where_it_failed(mico: Mico) -> None:
    text = f"{HEAD}left.x to 30 um\n# a comment\nleft.y to 40 um\nleft.x to 5000 um\n"
    player = mico.trajectories.prepare(mico.trajectories.parse(text), speed=0.5)
    told: list[PlayProgress] = []
    player.subscribe(told.append)
    assert (player.state, player.line, player.speed) == (PlayState.READY, 0, 0.5)
    player.step()
    assert player.wait_for_pause(10.0)
    assert (player.state, player.line) == (PlayState.PAUSED, 5)
    assert mico["left.x"].position_um == pytest.approx(30.0, abs=1.0)
    assert player.rehearsal is not None
    assert player.rehearsal.allowed
    mico["left.x"].move_to(0.0)
    with pytest.raises(AwayFromStartError, match=r"left\.x at") as away:
        player.resume()
    assert away.value.targets["left.x"] == pytest.approx(30.0, abs=1.0)
    player.speed, player.loops = 10.0, 1
    mico.stop("test")
    with pytest.raises(StoppedError):
        player.resume("straight")
        player.wait(10.0)
    assert player.failure is not None
    mico.reset_stop()
    player.resume("straight")
    player.wait(10.0)
    assert mico["left.x"].position_um == pytest.approx(5000.0, abs=1.0)
    wait_for(lambda: told[-1].state is PlayState.ENDED)
    assert {each.state for each in told} >= {PlayState.READY, PlayState.PAUSED}
    assert mico.trajectories.player is not None
    assert mico.trajectories.player.trajectory.lines == tuple(text.splitlines())


def test_what_another_program_plays_is_seen_and_can_be_paused(hosted: HostedMico) -> None:
    text = f"{HEAD}wait 200 s\nleft.x to 30 um\n"
    player = hosted.mico.trajectories.run(hosted.mico.trajectories.parse(text), wait=False)
    with remote_mico(hosted, "memory", takes_lease=False) as (mico, _, _):
        wait_for(lambda: mico.trajectories.player is not None)
        seen = mico.trajectories.player
        assert seen is not None
        assert seen.trajectory.lines == player.trajectory.lines
        seen.pause()
        assert player.wait_for_pause(10.0)
        assert seen.wait_for_pause(10.0)
        with pytest.raises((MoveRefused, CallRefused)):
            seen.resume()
        seen.cancel()
        wait_for(lambda: player.state is PlayState.CANCELLED)


def test_a_long_trajectory_travels_in_pieces(hosted: HostedMico, how: str) -> None:
    lines = [f"left.x to {each % 50} um" for each in range(2500)]
    text = HEAD + "\n".join(lines) + "\n"
    with remote_mico(hosted, how) as (mico, _, _):
        player = mico.trajectories.prepare(mico.trajectories.parse(text))
        assert player.text() == text
        assert hosted.mico.trajectories.player is not None
        assert hosted.mico.trajectories.player.trajectory.lines == tuple(text.splitlines())


def test_a_long_move_is_made_in_parts(mico: Mico) -> None:
    series = StepwiseMove(mico["left.x"], 80.0, 30.0)
    assert series.planned == 3
    series.movement.wait(10.0)
    assert mico["left.x"].position_um == pytest.approx(80.0, abs=1.0)


# --- a command is added in one place ----------------------------------------------------------


class MicoWithBell(Mico):
    """MiCo with one command more: this is all that it takes."""

    @command(moves=True)
    def ring(self, axis: str, times: int = 1) -> str:
        return f"{axis}: {'ding ' * times}{self[axis].unit}"


def test_a_new_command_of_mico_is_called_by_script_window_and_station(
    hosted: HostedMico, qtbot: QtBot
) -> None:
    home = MicoWithBell(hosted.application)
    assert home.ring("left.x", 2) == "left.x: ding ding um"
    station = Station("bells", FailurePolicy())
    host = Host("mico", home)
    with ExitStack() as stack:
        stack.callback(lambda: hosted.application.manager.lease.join(hosted.station.lease))
        stack.callback(host.close)
        station.host("mico", host)
        client = stack.enter_context(connected_in_memory(station))
        application = MicoClient(client, FailurePolicy(), kind=MicoWithBell)
        stack.callback(application.shut_down)
        application.initialize()
        mico = mico_of(application, "window")
        assert isinstance(mico, MicoWithBell)
        with pytest.raises(MoveRefused):
            mico.ring("left.x")
        client.take_lease()
        assert mico.ring("left.x") == "left.x: ding um"
        button, answers = QPushButton("Ring"), []
        qtbot.addWidget(button)
        button.clicked.connect(
            lambda: mico.carry_out(lambda: mico.ring("left.x"), lambda *how: answers.append(how))
        )
        stack.callback(declare_gui_thread())
        button.click()
        wait_for(lambda: answers)
        assert answers == [("left.x: ding um", None)]


# --- who may move ------------------------------------------------------------------------------


def test_without_the_lease_nothing_moves_remotely(hosted: HostedMico, how: str) -> None:
    with remote_mico(hosted, how, takes_lease=False) as (mico, _, _):
        for move in (
            lambda: mico["left.x"].move_to(50.0),
            lambda: mico.move({"left.x": 50.0}),
            lambda: mico["left.x"].steps(10),
            lambda: mico["left.x"].jog(1).movement.wait(5.0),
            lambda: mico["left.x"].set_zero(),
            lambda: mico["left.x"].set_closed_loop_frequency(100),
            lambda: mico.link("left.x", "right.x"),
            lambda: mico.collision.take_out("left.x"),
            lambda: mico.poses.go("there"),
            mico.reset_stop,
        ):
            with pytest.raises((MoveRefused, NotAvailable)) as caught:
                move()
            if isinstance(caught.value, MoveRefused):
                assert caught.value.verdict.reason is Reason.NO_LEASE
        assert mico.check({"left.x": 50.0}).reason is Reason.NO_LEASE
        assert mico["left.x"].position_um == pytest.approx(0.0, abs=1.0)
    assert hosted.mico.check({"left.x": 50.0}).allowed


def test_while_another_holds_the_lease_the_station_itself_does_not_move(
    hosted: HostedMico, how: str
) -> None:
    with remote_mico(hosted, how) as (mico, _, _):
        for move in (
            lambda: hosted.mico["left.x"].move_to(50.0),
            lambda: hosted.mico.move({"left.x": 50.0}),
        ):
            with pytest.raises(MoveRefused, match="vision controls the platform now") as caught:
                move()
            assert caught.value.verdict.reason is Reason.NO_LEASE
        mico["left.x"].move_to(20.0)
    wait_for(lambda: hosted.station.lease.state.local)
    hosted.mico["left.x"].move_to(0.0)


def test_the_operator_takes_over_and_what_moved_remotely_stops(
    hosted: HostedMico, how: str
) -> None:
    with remote_mico(hosted, how) as (mico, _, transport):
        mico["left.x"].set_closed_loop_frequency(SLOW_HZ)
        movement = mico["left.x"].move_to(5_000.0, wait=False)
        wait_for(lambda: hosted.mico["left.x"].details.in_motion)
        hosted.station.lease.take_over()
        with pytest.raises((MoveCancelled, MoveRefused)):
            movement.wait(5.0)
        wait_for(lambda: not hosted.mico["left.x"].details.in_motion)
        assert (hosted.mico["left.x"].position_um or 0.0) < 4_000.0
        with pytest.raises(MoveRefused):
            mico["left.x"].move_to(0.0)
        with pytest.raises(MoveRefused):
            transport.take_lease()
        hosted.mico["left.x"].set_closed_loop_frequency(5000)
        hosted.mico["left.x"].move_to(0.0)


def test_the_station_stops_what_moves_remotely_by_itself(hosted: HostedMico) -> None:
    """The thread that moves looks at the dead man; nobody has to tell it."""
    caller, lease = Caller("vision", "a token"), hosted.station.lease
    lease.take(caller.name, caller.token)
    hosted.application.manager.device("left.x").set_frequency(0, SLOW_HZ)
    arguments = {"motion": MoveTo(5_000.0, "um"), "@": ("left.x",)}
    hosted.station.invoker("mico").invoke(caller, "axes.begin", arguments)
    wait_for(lambda: hosted.mico["left.x"].details.in_motion)
    lease.release(caller.token)
    wait_for(lambda: not hosted.mico["left.x"].details.in_motion)
    assert (hosted.mico["left.x"].position_um or 0.0) < 4_000.0


def test_what_the_station_carries_out_for_a_client_ends_with_its_lease(
    hosted: HostedMico, how: str
) -> None:
    with remote_mico(hosted, how) as (mico, _, transport):
        mico["left.x"].set_closed_loop_frequency(SLOW_HZ)
        waypoints = ({"left.x": 5_000.0}, {"left.x": 0.0})
        way = PlannedPath({"left.x": 0.0}, waypoints, "straight", 5_000.0, 5_000.0, 1.0)
        task = mico.follow(way, wait=False)
        wait_for(lambda: hosted.mico["left.x"].details.in_motion)
        transport.release_lease()
        with pytest.raises(MoveCancelled):
            task.wait(5.0)
        wait_for(lambda: not hosted.mico["left.x"].details.in_motion)
        assert (hosted.mico["left.x"].position_um or 0.0) < 4_000.0


@pytest.mark.parametrize("ended_by", ["lease", "line"])
def test_a_trajectory_ends_with_the_program_that_runs_it(
    hosted: HostedMico, how: str, ended_by: str
) -> None:
    text = f"{HEAD}left.x to 5000 um\nleft.x to 0 um\n"
    with remote_mico(hosted, how) as (mico, _, transport):
        mico["left.x"].set_closed_loop_frequency(SLOW_HZ)
        player = mico.trajectories.run(mico.trajectories.parse(text), wait=False)
        wait_for(lambda: hosted.mico["left.x"].details.in_motion)
        assert mico.moves_remotely
        if ended_by == "lease":
            transport.release_lease()
            with pytest.raises(MoveCancelled):
                player.wait(5.0)
        else:
            transport.close()
            with pytest.raises(NotAvailable):
                player.wait(5.0)
        there = hosted.mico.trajectories.player
        assert there is not None
        wait_for(lambda: there.done)
        wait_for(lambda: not hosted.mico["left.x"].details.in_motion)
        assert (hosted.mico["left.x"].position_um or 0.0) < 4_000.0


def test_going_to_a_pose_ends_with_the_program_that_began_it(hosted: HostedMico, how: str) -> None:
    hosted.mico["left.x"].move_to(4_500.0)
    hosted.mico.poses.teach("far", ["left.x"])
    hosted.mico["left.x"].move_to(0.0)
    with remote_mico(hosted, how) as (mico, _, transport):
        mico["left.x"].set_closed_loop_frequency(SLOW_HZ)
        task = mico.poses.go("far", wait=False)
        wait_for(lambda: hosted.mico["left.x"].details.in_motion)
        transport.release_lease()
        with pytest.raises(MoveCancelled):
            task.wait(5.0)
        wait_for(lambda: not hosted.mico["left.x"].details.in_motion)
        assert (hosted.mico["left.x"].position_um or 0.0) < 4_000.0


def test_what_a_program_has_begun_stops_when_it_closes_mico(hosted: HostedMico, how: str) -> None:
    with transport_to(hosted, how) as client:
        client.take_lease()
        application = MicoClient(client, FailurePolicy())
        application.initialize()
        axis = mico_of(application)["left.x"]
        axis.set_closed_loop_frequency(SLOW_HZ)
        movement = axis.move_to(5_000.0, wait=False)
        wait_for(lambda: hosted.mico["left.x"].details.in_motion)
        application.shut_down()
        assert not hosted.station.lease.state.local
        wait_for(lambda: not hosted.mico["left.x"].details.in_motion)
        assert (hosted.mico["left.x"].position_um or 0.0) < 4_000.0
        assert movement.exception(5.0) is not None


@pytest.mark.defects
def test_a_mistake_in_the_program_that_moves_stops_the_station(hosted: HostedMico) -> None:
    policy = FailurePolicy()
    with transport_to(hosted, "memory") as client:
        client.take_lease()
        application = MicoClient(client, policy)
        try:
            application.initialize()
            policy.report(ValueError("nothing moves"), "here")
            assert not hosted.application.manager.latch.state.latched
            axis = mico_of(application)["left.x"]
            axis.set_closed_loop_frequency(SLOW_HZ)
            axis.move_to(5_000.0, wait=False)
            wait_for(lambda: hosted.mico["left.x"].details.in_motion)
            policy.report(ValueError("a mistake"), "here")
            wait_for(lambda: hosted.application.manager.latch.state.latched)
        finally:
            application.shut_down()


def test_when_a_client_takes_the_lease_a_jog_of_the_station_ends(hosted: HostedMico) -> None:
    with transport_to(hosted, "memory") as client:
        jog = hosted.mico["left.x"].jog(1, 5.0)
        wait_for(lambda: hosted.mico["left.x"].details.in_motion)
        client.take_lease()
        until_s = WALL.now_s() + 3.0
        while not jog.done and WALL.now_s() < until_s:
            jog.renew()
            WALL.sleep(0.01)
        assert jog.done
        with pytest.raises(MoveRefused, match="vision controls"):
            jog.movement.wait(1.0)


def test_a_stop_and_a_halt_need_no_lease(hosted: HostedMico, how: str) -> None:
    with (
        remote_mico(hosted, how) as (holder, _, _),
        remote_mico(hosted, how, "viewer", takes_lease=False) as (_, viewer, transport),
    ):
        holder["left.x"].set_closed_loop_frequency(SLOW_HZ)
        movement = holder["left.x"].move_to(5_000.0, wait=False)
        wait_for(lambda: hosted.mico["left.x"].details.in_motion)
        viewer.api["left.x"].halt("seen from elsewhere")
        with pytest.raises(MoveCancelled, match="seen from elsewhere"):
            movement.wait(5.0)
        movement = holder["left.x"].move_to(5_000.0, wait=False)
        wait_for(lambda: hosted.mico["left.x"].details.in_motion)
        viewer.api.stop("smoke")
        with pytest.raises(StoppedError, match="smoke"):
            movement.wait(5.0)
        assert hosted.application.manager.latch.state.reason == "smoke (from viewer)"
        with pytest.raises(MoveRefused):
            viewer.api.reset_stop()
        holder.reset_stop()
        with pytest.raises(CallRefused):
            transport.call("mico", "manager")


def test_somebody_who_may_only_look_sees_and_stops_and_moves_nothing(hosted: HostedMico) -> None:
    with connected_in_memory(hosted.station, "viewer", Access.VIEW) as viewer:
        application = MicoClient(viewer, FailurePolicy())
        try:
            application.initialize()
            mico = mico_of(application)
            assert mico["left.x"].position_um is not None
            with pytest.raises((MoveRefused, CallRefused)):
                mico["left.x"].move_to(10.0)
            mico.stop("seen")
            assert hosted.application.manager.latch.state.latched
        finally:
            application.shut_down()


# --- what overtakes what -----------------------------------------------------------------------


def test_a_halt_that_overtakes_an_order_keeps_it_from_beginning(
    hosted: HostedMico, how: str
) -> None:
    with transport_to(hosted, how) as client:
        client.take_lease()
        client.call("mico", "axes.halt", {"#": 7, "@": ("left.x",)})
        order: dict[str, object] = {"motion": MoveTo(50.0, "um"), "@": ("left.x",)}
        with pytest.raises(MoveCancelled, match="halted before it started"):
            client.call("mico", "axes.begin", order | {"#": 7})
        together: Any = client.call(
            "mico", "begin_together", {"motions": {"left.x": MoveTo(50.0, "um")}, "#": 6}
        )
        assert "halted before they started" in str(together.result.wait(5.0).error)
        with pytest.raises(MoveCancelled, match="newer command"):
            client.call("mico", "axes.begin", order | {"#": 9, "follows": "3"})
    assert hosted.mico["left.x"].position_um == pytest.approx(0.0, abs=1.0)


BAD_ORDERS: list[dict[str, object]] = [
    {"motion": Jog(1, 100.0)},
    {"motion": MoveTo(50.0, "um"), "@": (5,)},
    {"motion": "everything"},
    {"motion": MoveTo(50.0, "um"), "#": 1.0},
    {"motion": MoveTo(50.0, "um"), "token": "x"},
]


def test_an_ill_typed_order_moves_nothing(hosted: HostedMico, how: str) -> None:
    with transport_to(hosted, how) as client:
        client.take_lease()
        nan, left = float("nan"), {"@": ("left.x",)}
        for bad in BAD_ORDERS:
            with pytest.raises(CallRefused):
                client.call("mico", "axes.begin", left | bad)
        for function, arguments in (
            ("axes.show_from", {"zero": nan} | left),
            ("axes.begin_jog", {"key": "3", "motion": Steer(1, 5.0, 1e9)} | left),
            ("add_link", {"first": "left.x", "second": "left.gripper", "ratio": 1.0}),
            ("add_link", {"first": "left.x", "second": "right.x", "ratio": nan}),
            ("poses.learn", {"name": "x", "axes": ["nowhere"]}),
            ("poses.learn", {"name": "a\nb"}),
            ("poses.begin", {"name": "nowhere"}),
            ("trajectories.begin_player", {"given": "never given"}),
            ("trajectories.players.begin", {"@": ("none",)}),
            ("begin_search", {"targets": {"left.x": 1.0}, "budget_s": 1e9}),
            ("axes.limit_frequency", {"frequency_hz": 0} | left),
            ("axes.halt", {"@": ("nowhere",)}),
        ):
            with pytest.raises((MoveRefused, NotAvailable, CallRefused, UnknownAxisError)):
                client.call("mico", function, arguments)
        client.call("mico", "stop", {"reason": "a\nforged line\x1b[31m" + 500 * "x"})
        reason = hosted.application.manager.latch.state.reason or ""
        assert reason.startswith("a forged line")
        assert len(reason) < 200
        client.call("mico", "reset_stop")
        begun: Any = client.call(
            "mico", "axes.begin_jog", {"key": "2", "motion": Jog(5, nan), **left}
        )
        assert begun.result.wait(5.0).error is not None
    assert hosted.mico["left.x"].position_um == pytest.approx(0.0, abs=1.0)


# --- what is told ------------------------------------------------------------------------------


class Deaf(ClientSideConnection):
    """Hears nothing of any topic."""

    def subscribe(self, topic: str, rule: Rule, receiver: Receiver) -> Subscription:
        del receiver
        return super().subscribe(topic, rule, lambda _: None)


def test_what_a_call_has_changed_is_known_when_it_returns(hosted: HostedMico) -> None:
    """Topics come when they come; a script must not have to wait for them."""
    with ExitStack() as stack:
        client = stack.enter_context(connected_in_memory(hosted.station, kind=Deaf))
        client.take_lease()
        application = MicoClient(client, FailurePolicy())
        stack.callback(application.shut_down)
        application.initialize()
        mico = mico_of(application)
        axis = mico["left.x"]
        axis.move_to(60.0)
        assert axis.position_um == pytest.approx(60.0, abs=1.0)
        mico.move({"left.x": 40.0, "right.x": 20.0})
        assert mico["right.x"].position_um == pytest.approx(20.0, abs=1.0)
        axis.set_zero()
        assert axis.position_um == pytest.approx(0.0, abs=1.0)
        axis.clear_zero()
        assert mico.undo_entries
        mico.stop("x")
        assert mico.stop_state.latched
        mico.reset_stop()
        assert not mico.stop_state.latched


def test_an_older_word_changes_nothing(hosted: HostedMico) -> None:
    with remote_mico(hosted, "memory", takes_lease=False) as (mico, _, _):
        axis = mico["left.x"]
        far, now = axis.far, axis.details
        assert far is not None
        read_s = hosted.mico["left.x"].details.read_wall_s
        far.move(1.0, 0.0, read_s + 100.0)
        assert axis.position_um == 1.0
        far.move(2.0, 0.0, read_s - 100.0)
        assert axis.position_um == pytest.approx(now.position, abs=1.0)


def test_who_commands_is_reported_and_positions_are_reported_seldom(
    hosted: HostedMico, how: str
) -> None:
    commands: list[object] = []
    positions: list[float] = []
    with remote_mico(hosted, how) as (mico, _, transport):
        heard = transport.subscribe("mico/commands", Rule.ALL, commands.append)
        seen = transport.subscribe(
            "mico/positions", Rule.ALL, lambda _: positions.append(WALL.now_s())
        )
        began_s = WALL.now_s()
        mico["left.x"].set_closed_loop_frequency(100)
        mico["left.x"].move_to(1_500.0)
        took_s = WALL.now_s() - began_s
        wait_for(lambda: commands)
        heard.close()
        seen.close()
    texts = [str(each) for each in commands]
    assert any("vision: left.x begin" in each and "MoveTo" in each for each in texts), texts
    assert 1 <= len(positions) <= 31 * took_s + 2


def test_what_is_done_at_the_station_is_seen_remotely(hosted: HostedMico, how: str) -> None:
    with remote_mico(hosted, how, takes_lease=False) as (mico, _, _):
        hosted.mico["left.x"].move_to(70.0)
        wait_for(lambda: abs((mico["left.x"].position_um or 0.0) - 70.0) < 1.0)
        hosted.mico.link("left.x", "right.x")
        wait_for(lambda: mico.links)
        refused: list[object] = []
        mico["left.x"].commander.movement_refused.connect(refused.append)
        with pytest.raises(MoveRefused):
            hosted.mico["left.y"].move_to(99_000.0)
        hosted.application.manager.stop("smoke")
        wait_for(lambda: mico.stop_state.reason == "smoke")
        with ThreadPoolExecutor(1) as pool:
            assert pool.submit(lambda: mico["left.x"].details).result(5.0).present


def test_a_station_that_is_away_leaves_axes_absent_and_moves_refused(hosted: HostedMico) -> None:
    with transport_to(hosted, "memory") as transport:
        application = MicoClient(transport, FailurePolicy())
        try:
            application.initialize()
            mico = mico_of(application)
            transport.close()
            wait_for(lambda: application.failure)
            assert mico["left.x"].state is Status.UNKNOWN
            assert "closed" in mico["left.x"].error
            with pytest.raises(StationAway):
                mico["left.x"].move_to(10.0)
            with pytest.raises(StationAway):
                mico.move({"left.x": 10.0})
            with pytest.raises(StationAway):
                mico.stop("x")
            assert mico.check({"left.x": 10.0}).reason is Reason.NO_ANSWER
            with pytest.raises(NotAvailable, match="closed"):
                mico.clearance()
        finally:
            application.shut_down()
