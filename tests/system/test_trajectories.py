"""Trajectories on the twin: recorded, rehearsed, run, paused, broken and gone on with."""

import io
import runpy
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from threading import Event
from typing import Any

import pytest
from PySide6.QtCore import Qt
from typing_extensions import override

from cosmic.app.connect import connect
from cosmic.app.platform import build_platform
from cosmic.app.rig import Rig
from cosmic.frame.clock import WALL
from cosmic.frame.config import shipped_config_dir
from cosmic.frame.errors import (
    ConfigError,
    DeviceError,
    MoveCancelled,
    MoveRefused,
    NotAvailable,
    RecordingError,
    RecordingExistsError,
    StoppedError,
)
from cosmic.frame.failure import FailurePolicy
from cosmic.mico.api.mico import Mico
from cosmic.mico.api.trajectory_recording import TrajectoryRecording
from cosmic.mico.api.trajectory_start import AwayFromStartError
from cosmic.mico.api.trajectory_state import PlayProgress, PlayState
from cosmic.mico.core.motion.messages import MovementBegun
from cosmic.mico.core.trajectory.model import Trajectory, TrajectoryError
from cosmic.mico.core.trajectory.reader import parse
from cosmic.mico.core.trajectory.recorder import RecordedBegin, TrajectoryRecorder
from system.simulated_platform import platform, wait_until

HEAD = "cosmic-trajectory 1\nplatform any\n"


@pytest.fixture
def mico() -> Iterator[Mico]:
    """The twin without collision model, twenty times faster than real."""
    with platform(rate=20.0) as (api, _library, _scene):
        yield api


@pytest.fixture(scope="module")
def rig() -> Iterator[Rig]:
    with connect(applications=("mico",), rate=20.0) as found:
        yield found


def where(mico: Mico, *names: str) -> list[float]:
    positions = [mico[name].details.position for name in names]
    return [round(each, 1) for each in positions if each is not None]


def written(text: str) -> Trajectory:
    return parse(HEAD + text)


# Recording


def test_what_was_recorded_brings_the_axes_there_again(mico: Mico, tmp_path: Path) -> None:
    path = tmp_path / "a.trajectory"
    with mico.trajectories.record(path, title="Up and over") as recording:
        mico["left.z"].move_to(500.0)
        mico.move({"left.x": 200.0, "left.y": -300.0})
        mico["left.gripper"].steps(50)
        with mico["right.x"].jog(1) as jog:
            wait_until(lambda: (mico["right.x"].details.position or 0.0) > 30.0)
            jog.renew()
        jog.movement.exception(5.0)
        wait_until(lambda: recording.lines > 15)
    reached = where(mico, "left.x", "left.y", "left.z", "right.x")
    said = path.read_text(encoding="utf-8")
    assert "title Up and over" in said
    assert "    left.x to 200 um\n    left.y to -300 um\nend\n" in said
    assert "steps left.gripper 50 100 V 1000 Hz\n" in said
    assert "speed right.x 200 um/s\n" in said
    assert said.endswith("end of recording\n")
    trajectory = mico.trajectories.load(path)
    assert trajectory.timed
    mico.trajectories.run(trajectory, start="straight").wait(20.0)
    assert where(mico, "left.x", "left.y", "left.z", "right.x") == pytest.approx(reached, abs=1.0)


def test_movements_of_every_source_are_recorded_or_only_those_asked_for(
    mico: Mico, tmp_path: Path
) -> None:
    window = Mico(mico.application, "window")
    with mico.trajectories.record(tmp_path / "all.trajectory", timed=False):
        mico["left.x"].move_to(10.0)
        window["left.y"].move_to(20.0)
    with mico.trajectories.record(tmp_path / "one.trajectory", timed=False, sources=["window"]):
        mico["left.x"].move_to(30.0)
        window["left.y"].move_to(40.0)
    lines = (tmp_path / "all.trajectory").read_text(encoding="utf-8").splitlines()
    assert [each for each in lines if " to " in each] == ["left.x to 10 um", "left.y to 20 um"]
    lines = (tmp_path / "one.trajectory").read_text(encoding="utf-8").splitlines()
    assert [each for each in lines if " to " in each] == ["left.y to 40 um"]


def test_a_recording_relative_to_a_pose_serves_another_place(mico: Mico, tmp_path: Path) -> None:
    path = tmp_path / "a.trajectory"
    mico.poses.teach("fibre", ["left.x", "left.y"])
    with mico.trajectories.record(path, relative_to="fibre"):
        mico["left.x"].move_to(100.0)
        mico["left.z"].move_to(50.0)
    mico.move({"left.x": 1000.0, "left.y": 70.0, "left.z": 0.0})
    mico.poses.teach("fibre", ["left.x", "left.y"])
    mico.trajectories.run(path).wait(10.0)
    assert where(mico, "left.x", "left.y", "left.z") == pytest.approx([1100.0, 70.0, 50.0], abs=1.0)


def test_one_recording_at_a_time_and_no_file_is_overwritten_unasked(
    mico: Mico, tmp_path: Path
) -> None:
    path = tmp_path / "a.trajectory"
    with mico.trajectories.record(path), pytest.raises(NotAvailable, match="being recorded"):
        mico.trajectories.record(tmp_path / "b.trajectory")
    with pytest.raises(RecordingExistsError):
        mico.trajectories.record(path)
    mico.trajectories.record(path, overwrite=True).stop()
    with pytest.raises(RecordingError, match="does not exist"):
        mico.trajectories.record(tmp_path / "none" / "a.trajectory")
    assert mico.trajectories.recording is None


@pytest.mark.parametrize("title", ["a\x07b", "x" * 600, "a # b", "\udc80"])
def test_a_title_that_nobody_could_read_again_is_refused_before_anything_is_recorded(
    mico: Mico, tmp_path: Path, title: str
) -> None:
    with pytest.raises(RecordingError, match="title"):
        mico.trajectories.record(tmp_path / "a.trajectory", title=title)
    assert not list(tmp_path.iterdir())


def test_what_cannot_be_saved_leaves_the_file_that_was_there(mico: Mico, tmp_path: Path) -> None:
    path = tmp_path / "a.trajectory"
    mico.trajectories.save(written("left.x to 5 um\n"), path)
    before = path.read_text(encoding="utf-8")
    bad = replace(written("left.x to 5 um\n"), title="\udc80")
    with pytest.raises(RecordingError):
        mico.trajectories.save(bad, path, overwrite=True)
    with pytest.raises(RecordingError):
        mico.trajectories.save(bad, tmp_path / "b.trajectory")
    assert [each.name for each in tmp_path.iterdir()] == [path.name]
    assert path.read_text(encoding="utf-8") == before


class FullDisk(io.FileIO):
    """A file on a disk that is full after some bytes."""

    room = 400

    @override
    def write(self, data: Any) -> int:
        left = self.room - self.tell()
        if left <= 0:
            raise OSError(28, "No space left on device")
        return super().write(bytes(data)[:left]) or 0


@pytest.mark.defects
def test_a_full_disk_is_reported_and_keeps_the_lines_written_before(
    mico: Mico, tmp_path: Path
) -> None:
    path = tmp_path / "a.trajectory"
    recorder = TrajectoryRecorder(
        mico,
        path,
        Trajectory("any", (), recorded="today"),
        FailurePolicy(),
        open_file=lambda where, _mode: FullDisk(where, "wb"),
    )
    recording = TrajectoryRecording(recorder)
    for number in range(20):
        mico["left.x"].move_to(float(number))
    wait_until(lambda: recording.error is not None)
    recording.stop()
    assert "Is the disk full" in str(recording.error)
    assert not recording.recording
    said = path.read_text(encoding="utf-8")
    assert said.endswith("um\n")
    assert len(said.splitlines()) == recording.lines
    with pytest.raises(TrajectoryError, match="cut off"):
        mico.trajectories.load(path)
    assert len(mico.trajectories.load(path, cut_off=True).statements) > 3


class Lossy:
    """Axes at the end of a line on which messages are lost."""

    def __init__(self, mico: Mico) -> None:
        self._mico = mico
        self.clock = mico.clock
        self.states = mico.states
        self.follow_recorded = mico.follow_recorded
        self.missed = 0


def test_what_is_lost_on_the_way_is_marked_in_the_recording_which_goes_on(
    mico: Mico, tmp_path: Path
) -> None:
    path, axes = tmp_path / "a.trajectory", Lossy(mico)
    head = Trajectory("any", (), recorded="today")
    with TrajectoryRecording(TrajectoryRecorder(axes, path, head, FailurePolicy())) as recording:
        mico["left.x"].move_to(30.0)
        axes.missed = 2
        mico["left.x"].move_to(10.0)
    said = path.read_text(encoding="utf-8")
    assert recording.missed == 2
    assert recording.error is None
    assert said.count("2 messages from the station were lost before here") == 1
    assert "left.x to 10 um" in said
    assert mico.trajectories.load(path).statements


def test_a_recording_goes_on_over_a_rescan_and_ends_with_the_platform(tmp_path: Path) -> None:
    path = tmp_path / "a.trajectory"
    with platform(rate=20.0) as (mico, _library, _scene):
        mico.trajectories.record(path)
        mico["left.x"].move_to(10.0)
        mico.rescan()
        mico["left.x"].move_to(20.0)
    said = path.read_text(encoding="utf-8")
    assert "left.x to 10 um" in said
    assert "left.x to 20 um" in said
    assert said.endswith("end of recording\n")


# Running


def test_lines_are_reported_with_progress_and_time_left(mico: Mico) -> None:
    reports: list[PlayProgress] = []
    player = mico.trajectories.run(
        written("left.x to 500 um\nwait 1 s\nleft.x by -100 um\n"), reports.append
    )
    assert player.state is PlayState.ENDED
    assert where(mico, "left.x") == pytest.approx([400.0], abs=1.0)
    lines = [each.line for each in reports]
    assert lines == sorted(lines)
    assert set(lines) >= {3, 4, 5}
    left = [each.left_s for each in reports if each.left_s is not None]
    assert left == sorted(left, reverse=True)
    assert left[0] > 1.0
    assert left[-1] == 0.0
    assert reports[-1].fraction == 1.0


def test_away_from_the_start_it_refuses_or_goes_there(mico: Mico) -> None:
    trajectory = written("start left.x 300 um\nleft.x by 50 um\n")
    with pytest.raises(AwayFromStartError, match=r"left.x at 0.0 µm instead of 300.0") as caught:
        mico.trajectories.run(trajectory)
    assert caught.value.targets == {"left.x": 300.0}
    assert where(mico, "left.x") == [0.0]
    mico.trajectories.run(trajectory, start="straight")
    assert where(mico, "left.x") == pytest.approx([350.0], abs=1.0)


def test_it_pauses_after_the_line_steps_and_goes_on(mico: Mico) -> None:
    player = mico.trajectories.prepare(
        written("left.x to 500 um\nleft.y to 100 um\nleft.x to 0 um\nleft.y to 0 um\n")
    )
    player.step()
    assert player.wait_for_pause(5.0)
    assert (player.state, player.line) == (PlayState.PAUSED, 4)
    assert where(mico, "left.x", "left.y") == pytest.approx([500.0, 0.0], abs=1.0)
    player.step()
    assert player.wait_for_pause(5.0)
    assert where(mico, "left.x", "left.y") == pytest.approx([500.0, 100.0], abs=1.0)
    player.resume()
    player.pause()
    assert player.wait_for_pause(5.0)
    assert player.state is PlayState.PAUSED
    player.resume()
    player.wait(5.0)
    assert where(mico, "left.x", "left.y") == pytest.approx([0.0, 0.0], abs=1.0)
    with pytest.raises(NotAvailable, match="ended"):
        player.resume()


def test_what_was_moved_during_a_pause_is_noticed(mico: Mico) -> None:
    player = mico.trajectories.prepare(
        written("left.x to 500 um\nleft.y to 100 um\nleft.x to 0 um\n")
    )
    player.step()
    player.wait_for_pause(5.0)
    mico["left.x"].move_to(800.0)
    with pytest.raises(AwayFromStartError, match=r"goes on: left\.x at "):
        player.resume()
    player.resume("straight")
    player.wait(5.0)
    assert where(mico, "left.x", "left.y") == pytest.approx([0.0, 100.0], abs=1.0)


def test_a_wait_is_interrupted_by_a_pause_and_goes_on_where_it_was(mico: Mico) -> None:
    player = mico.trajectories.run(written("wait 12 s\nleft.x to 5 um\n"), wait=False)
    wait_until(lambda: player.line == 3)
    player.pause()
    assert player.wait_for_pause(1.0)
    player.resume()
    with pytest.raises(DeviceError):  # it is not over at once
        player.wait(0.05)
    player.wait(5.0)
    assert where(mico, "left.x") == pytest.approx([5.0], abs=1.0)


def test_it_loops_where_it_ends_where_it_begins(mico: Mico) -> None:
    reports: list[PlayProgress] = []
    player = mico.trajectories.run(
        written("left.x by 200 um\nleft.x by -200 um\n"), reports.append, loops=3
    )
    assert player.state is PlayState.ENDED
    assert {each.loop for each in reports} == {1, 2, 3}
    assert where(mico, "left.x") == pytest.approx([0.0], abs=1.0)
    with pytest.raises(AwayFromStartError, match="does not end where it begins"):
        mico.trajectories.run(written("left.x by 200 um\n"), loops=2)
    assert where(mico, "left.x") == pytest.approx([0.0], abs=1.0)
    mico.trajectories.run(written("left.x by 200 um\n"), loops=2, start="straight")
    assert where(mico, "left.x") == pytest.approx([200.0], abs=1.0)


def test_speeds_hold_for_the_run_and_come_back_after_it(mico: Mico) -> None:
    text = "speed left.x 750 um/s\nleft.x to 3000 um\n"
    clock = mico.application.manager.clock
    took = {}
    for factor in (4.0, 1.0):
        mico["left.x"].move_to(0.0)
        began_s = clock.now_s()
        mico.trajectories.run(written(text), speed=factor)
        took[factor] = clock.now_s() - began_s
    assert took[1.0] > 3.9
    assert took[4.0] < 0.75 * took[1.0]
    began_s = clock.now_s()
    mico["left.x"].move_to(0.0)
    assert clock.now_s() - began_s < 0.6 * took[1.0]
    with pytest.raises(NotAvailable):
        mico.trajectories.run(written(text), speed=float("nan"))


def test_times_are_kept_and_scale_with_the_speed(mico: Mico) -> None:
    clock = mico.application.manager.clock

    def took(**options: Any) -> float:
        began_s = clock.now_s()
        mico.trajectories.run(written("left.x to 5 um\nt=6 s left.x to 0 um\n"), **options)
        return clock.now_s() - began_s

    assert took() >= 6.0
    assert took(speed=2.0) < 6.0
    assert took(timed=False) < 5.0


def test_neither_a_pause_nor_the_path_to_the_start_takes_time_of_the_trajectory(mico: Mico) -> None:
    clock = mico.application.manager.clock
    text = "start left.x 0 um\nt=1 s left.x to 5 um\nt=61 s left.x to 0 um\n"
    player = mico.trajectories.prepare(written(text))
    player.resume()
    wait_until(lambda: player.line == 5)
    player.pause()
    assert player.wait_for_pause(1.0)
    WALL.sleep(2.5)  # 50 s there
    player.speed = 4.0
    began_s = clock.now_s()
    player.resume()
    player.wait(10.0)
    assert clock.now_s() - began_s > 8.0
    axis = mico["left.x"]
    axis.move_to(2000.0)
    axis.set_closed_loop_frequency(75)  # so that the way back takes 20 s
    lines: dict[str, float] = {}
    player = mico.trajectories.prepare(written(text))
    player.subscribe(lambda how: lines.setdefault(how.text, clock.now_s()) and None)
    player.resume("straight")
    player.wait(10.0)
    axis.set_closed_loop_frequency(5000)
    assert clock.now_s() - lines["line 4: t=1 s left.x to 5 um"] > 50.0


def test_times_and_speeds_begin_anew_with_each_pass(mico: Mico) -> None:
    clock = mico.application.manager.clock
    begun: list[int | None] = []
    text = "t=0 s left.x to 30 um\nspeed left.x 30 um/s\nt=20 s left.x to 0 um\n"
    player = mico.trajectories.prepare(written(text), loops=2)
    end = mico.follow_recorded(
        lambda it: begun.append(it.frequency_hz) if isinstance(it, RecordedBegin) else None
    )
    for _ in range(3):
        player.step("straight")
        assert player.wait_for_pause(10.0)
    assert player.progress.loop == 2
    began_s = clock.now_s()
    player.resume()
    player.wait(10.0)
    end()
    assert clock.now_s() - began_s > 15.0
    assert begun == [None, 20, None, 20], "the first line of each pass at the usual speed"


def test_a_stop_ends_it_and_it_goes_on_at_that_line(mico: Mico) -> None:
    manager = mico.application.manager
    player = mico.trajectories.run(
        written(
            "together\nleft.x to 0 um\nleft.y to 50 um\nend\n"
            "speed left.x 500 um/s\nleft.x to 5000 um\n"
        ),
        wait=False,
    )
    wait_until(lambda: (mico["left.x"].details.position or 0.0) > 50.0)
    began_s = WALL.now_s()
    manager.stop("test")
    assert player.wait_for_pause(2.0)
    assert WALL.now_s() - began_s < 0.5
    stood = where(mico, "left.x")
    assert player.state is PlayState.FAILED
    assert isinstance(player.failure, StoppedError)
    assert str(player.failure).startswith("line 8: ")
    with pytest.raises(StoppedError):
        player.wait()
    WALL.sleep(0.1)
    assert where(mico, "left.x") == stood
    manager.reset_stop()
    player.resume()
    player.wait(10.0)
    assert where(mico, "left.x", "left.y") == pytest.approx([5000.0, 50.0], abs=1.0)


@pytest.mark.parametrize("text", ["wait 500 s\nleft.x to 5 um\n", "t=500 s left.x to 5 um\n"])
def test_a_stop_ends_a_wait_even_if_it_is_reset_at_once(mico: Mico, text: str) -> None:
    manager = mico.application.manager
    player = mico.trajectories.run(written(text), wait=False)
    wait_until(lambda: player.progress.text.startswith("line 3"))
    manager.latch.set("test")
    manager.latch.reset()
    with pytest.raises(StoppedError, match="line 3: "):
        player.wait(1.0)
    player.cancel()
    assert player.state is PlayState.CANCELLED


def test_cancelling_stops_its_axes_within_a_tenth_of_a_second(mico: Mico) -> None:
    player = mico.trajectories.run(
        written("speed left.x 100 um/s\nleft.x to 5000 um\n"), wait=False
    )
    wait_until(lambda: (mico["left.x"].details.position or 0.0) > 20.0)
    player.cancel()
    with pytest.raises(MoveCancelled, match="line 4"):
        player.wait(1.0)
    stood = where(mico, "left.x")
    WALL.sleep(0.1)
    assert where(mico, "left.x") == stood
    assert mico["left.x"].move_to(0.0) == pytest.approx(0.0, abs=1.0)


@pytest.mark.defects
def test_a_lost_device_stops_it_says_where_and_it_goes_on_after_the_repair() -> None:
    with platform(rate=20.0) as (mico, library, _scene):
        player = mico.trajectories.run(
            written("left.y to 50 um\ntogether\nleft.x to 5000 um\nright.x to 4000 um\nend\n"
                    "left.y to 0 um\n"),
            wait=False, speed=0.05,
        )  # fmt: skip
        wait_until(lambda: (mico["left.x"].details.position or 0.0) > 50.0, 10.0)
        library.faults.inject("unplugged", device=1)
        with pytest.raises(DeviceError, match=r"^line 4: right.x: .*\(device 1\)"):
            player.wait(10.0)
        library.faults.clear()
        mico.rescan()
        mico.application.manager.reset_stop()
        player.speed = 1.0
        player.resume()
        player.wait(20.0)
        assert where(mico, "left.x", "left.y", "right.x") == pytest.approx(
            [5000.0, 0.0, 4000.0], abs=1.0
        )


def test_of_steps_cut_short_the_rest_is_made(mico: Mico) -> None:
    asked: list[MovementBegun] = []
    device = mico.application.manager.device("left.gripper")
    device.movement_begun.connect(asked.append, Qt.ConnectionType.DirectConnection)
    player = mico.trajectories.run(written("steps left.gripper 900 100 V 50 Hz\n"), wait=False)
    wait_until(lambda: mico["left.gripper"].details.in_motion)
    WALL.sleep(0.1)
    mico["left.gripper"].halt()
    with pytest.raises(MoveCancelled, match="line 3"):
        player.wait(5.0)
    player.resume()
    player.wait(10.0)
    assert where(mico, "left.gripper") == pytest.approx([930.0], abs=30.0)
    assert 0 < asked[1].motion.steps < 900  # type: ignore[union-attr]


def test_one_trajectory_runs_at_a_time(mico: Mico) -> None:
    player = mico.trajectories.run(written("wait 500 s\n"), wait=False)
    with pytest.raises(NotAvailable, match="running"):
        mico.trajectories.run(written("wait 1 s\n"))
    with pytest.raises(NotAvailable, match="is running"):
        mico.initialise()
    player.cancel()
    with pytest.raises(MoveCancelled):
        player.wait(20.0)
    assert mico.trajectories.player is player


def test_one_that_is_cancelled_before_its_turn_has_ended(mico: Mico) -> None:
    before = mico.trajectories.run(written("wait 1 s\n"), wait=False)
    busy, go_on = Event(), Event()

    def keep_busy(progress: PlayProgress) -> None:
        if progress.state is PlayState.ENDED:
            busy.set()
            go_on.wait(20.0)

    before.subscribe(keep_busy)
    assert busy.wait(20.0)
    player = mico.trajectories.run(written("wait 500 s\n"), wait=False)
    player.cancel()
    with pytest.raises(MoveCancelled, match="before it started"):
        player.wait(5.0)
    assert player.state is PlayState.CANCELLED
    go_on.set()
    mico.trajectories.run(written("wait 1 s\n"))


def test_an_axis_that_draws_another_one_along_is_refused(mico: Mico) -> None:
    mico.link("left.x", "right.x")
    with pytest.raises(NotAvailable, match="unlink them first"):
        mico.trajectories.run(written("left.x to 50 um\n"))
    mico.trajectories.run(written("together\nleft.x to 50 um\nright.x to 50 um\nend\n"))
    assert where(mico, "left.x", "right.x") == pytest.approx([50.0, 50.0], abs=1.0)


def test_poses_are_kept_beside_the_platform_file(tmp_path: Path) -> None:
    folder = tmp_path / "mine"
    shutil.copytree(shipped_config_dir(), folder)
    platform = build_platform(folder, applications=("mico",))
    assert platform.mico is not None
    assert platform.mico.trajectories.poses.path == folder / "poses.toml"
    platform.shut_down()
    (folder / "poses.toml").write_text("[home]\nx = 'far'\n", encoding="utf-8")
    with pytest.raises(ConfigError, match=r"poses\.toml: home\.x"):
        build_platform(folder, applications=("mico",))


# With the collision model


def test_what_the_gate_refuses_in_the_rehearsal_moves_nothing(rig: Rig) -> None:
    mico = rig.mico
    text = "left.y to 100 um\nleft.x to 5000 um\nright.x to -5000 um\n"
    trajectory = mico.trajectories.parse("cosmic-trajectory 1\nplatform FiberStation\n" + text)
    found = mico.trajectories.rehearse(trajectory)
    assert not found.allowed
    assert found.line in (4, 5)
    before = where(mico, *mico.names)
    with pytest.raises(MoveRefused, match=rf"line {found.line}: ") as caught:
        mico.trajectories.run(trajectory)
    assert caught.value.verdict.bodies == found.verdict.bodies
    assert where(mico, *mico.names) == before


def test_the_rehearsal_promises_what_the_run_then_does(rig: Rig) -> None:
    mico = rig.mico
    trajectory = mico.trajectories.parse(
        "cosmic-trajectory 1\nplatform FiberStation\n"
        "start left.x 0 um, left.z 0 um\n"
        "left.z to 800 um\nspeed left.x 600 um/s\nleft.x to -1500 um\nwait 0.5 s\n"
        "speed left.x usual\ntogether\nleft.x to 0 um\nleft.z to 0 um\nend\n"
    )
    found = mico.trajectories.rehearse(trajectory)
    assert found.allowed
    assert found.clearance_um is not None
    assert found.clearance_um > 0.0
    clock = mico.application.manager.clock
    began_s = clock.now_s()
    player = mico.trajectories.run(trajectory)
    took_s = clock.now_s() - began_s
    assert found.duration_s <= took_s < 6.0 * found.duration_s  # the clock runs fast here
    assert player.rehearsal is not None
    assert player.rehearsal.end == {"left.z": 0.0, "left.x": 0.0}


def test_a_path_to_the_start_is_found_around_what_is_in_between(rig: Rig) -> None:
    mico = rig.mico
    trajectory = mico.trajectories.parse(
        "cosmic-trajectory 1\nplatform FiberStation\nstart left.z 300 um\nleft.z by 50 um\n"
    )
    mico.trajectories.run(trajectory, start="detour")
    assert where(mico, "left.z") == pytest.approx([350.0], abs=1.0)


def test_a_trajectory_serves_the_other_assembly(rig: Rig) -> None:
    mico = rig.mico
    trajectory = mico.trajectories.parse(
        "cosmic-trajectory 1\nplatform FiberStation\nleft.z to 200 um\nleft.x to -70 um\n"
    )
    mico.trajectories.run(mico.trajectories.mirror(trajectory))
    assert where(mico, "right.x", "right.z") == pytest.approx([70.0, 200.0], abs=1.0)


def test_poses_are_taught_and_gone_to(rig: Rig) -> None:
    mico = rig.mico
    pose = mico.poses.teach("here", "Left assembly")
    assert sorted(pose.positions) == ["left.x", "left.y", "left.z"]
    mico["left.y"].move_by(150.0)
    mico.poses.go("here")
    assert where(mico, "left.y") == pytest.approx([pose.positions["left.y"]], abs=1.0)
    mico["left.y"].move_by(150.0)
    mico.poses.go("here", detour=True)
    assert where(mico, "left.y") == pytest.approx([pose.positions["left.y"]], abs=1.0)
    assert mico.poses.path is None  # the shipped configuration is nobody's to change
    mico.poses.remove("here")
    assert "here" not in mico.poses


def test_the_example_records_repeats_and_reports_mistakes(
    capsys: pytest.CaptureFixture[str], repository: Path
) -> None:
    runpy.run_path(str(repository / "examples" / "record_and_repeat.py"), run_name="__main__")
    said = capsys.readouterr().out
    assert "relative to pose fibre: left.x, left.y, left.z" in said
    assert "rehearsed: allowed True, 4 statements" in said
    assert "repeated: left.x is at -300 um" in said
    assert "at the next fibre: left.x is at -800 um" in said
    assert "line 4: left.gripper has no sensor" in said
