"""The shipped platform from the scripted API down to the stages of the twin."""

import gc
import math
import random
import sys
import threading
import weakref
from contextlib import suppress

import pytest

import cosmic
from cosmic.frame.clock import WALL
from cosmic.frame.errors import DeviceError, DeviceFault
from cosmic.mico.core.motion.positioner import Confidence, Status
from system.simulated_platform import platform, wait_until


def test_the_truth_of_the_twin_follows_what_was_asked():
    with platform() as (mico, _, scene):
        mico["left.x"].move_to(1234.5)
        mico["table.rotation"].move_to(-30.0)
        truth = scene.truth()
        assert truth["left.x"] == pytest.approx(1234.5, abs=1.0)
        assert truth["table.rotation"] == pytest.approx(-30.0, abs=0.01)
        assert mico["left.x"].position_um == pytest.approx(truth["left.x"], abs=0.2)
        assert truth["right.x"] == pytest.approx(0.0, abs=1.0)


def test_a_cold_platform_knows_nothing_until_it_is_initialised():
    with platform(rate=50.0, cold=True) as (mico, _, scene):
        sensors = [axis for axis in mico if axis.limits]
        assert all(axis.confidence is Confidence.UNKNOWN for axis in sensors)
        with pytest.raises(cosmic.MoveRefused) as refused:
            mico["left.x"].move_to(0.0)
        assert refused.value.verdict.reason == "POSITION_UNKNOWN"
        mico.initialise()
        assert all(axis.confidence is Confidence.KNOWN for axis in sensors)
        for axis in sensors:
            shown = axis.details.position
            assert shown == pytest.approx(0.0, abs=2.0)
            assert scene.truth()[axis.key] == pytest.approx(shown, abs=20.0)


def test_steps_move_the_truth_and_stay_an_estimate():
    with platform() as (mico, _, scene):
        before = scene.truth()["left.gripper"]
        mico["left.gripper"].steps(100, amplitude_v=100.0, frequency_hz=1000)
        moved = scene.truth()["left.gripper"] - before
        assert moved > 50.0
        assert mico["left.gripper"].position_um - before == pytest.approx(moved, rel=0.2)
        assert mico["left.gripper"].confidence is Confidence.ESTIMATED


@pytest.mark.parametrize("fault", ["lost_completed", "doubled_completed", "slow_answer"])
def test_trouble_with_answers_is_lived_with(fault):
    with platform(rate=5.0) as (mico, library, _):
        delay = {"delay_s": 0.05} if fault == "slow_answer" else {}
        library.faults.inject(fault, **delay)
        for target in (100.0, -50.0, 3.0):
            assert mico["left.x"].move_to(target) == pytest.approx(target, abs=1.0)
        assert mico["left.gripper"].steps(10) is not None


@pytest.mark.parametrize(
    ("fault", "expected"),
    [
        ("overheated", DeviceFault.OVERHEATED),
        ("hv_range", DeviceFault.HIGH_VOLTAGE),
        ("overridden", DeviceFault.OVERRIDDEN),
        ("sensor_lost", DeviceFault.NO_SENSOR),
        ("end_stop", DeviceFault.END_STOP),
    ],
)
def test_trouble_in_a_movement_fails_it_with_its_name_and_marks_the_axis(fault, expected):
    with platform(rate=2.0) as (mico, library, _):
        axis = mico["left.x"]
        movement = axis.move_to(5000.0, wait=False)
        wait_until(lambda: axis.position_um > 50.0)
        library.faults.inject(fault, device=0, channel=0)
        with pytest.raises(DeviceError, match=r"device 0|left\.x") as failed:
            movement.wait(5)
        assert failed.value.fault is expected
        assert axis.state is Status.ERROR
        assert axis.error
        assert math.isfinite(axis.position_um)
        library.faults.clear()
        assert mico["right.x"].move_to(10.0) == pytest.approx(10.0, abs=1.0)


def test_a_device_that_vanishes_in_motion_stops_everything_and_comes_back_by_rescan():
    with platform(rate=1.0) as (mico, library, _):
        manager = mico.application.manager
        movement = mico["left.x"].move_to(5000.0, wait=False)
        other = mico["right.x"].move_to(5000.0, wait=False)
        wait_until(lambda: mico["left.x"].position_um > 20.0)
        library.faults.inject("unplugged", device=0)
        with pytest.raises(cosmic.NotConnectedError):
            movement.wait(5)
        with pytest.raises(cosmic.StoppedError):
            other.wait(5)
        assert manager.latch.state.latched
        assert mico["left.x"].state is Status.UNKNOWN
        assert mico["left.x"].confidence is Confidence.UNKNOWN
        mico.rescan()
        assert any("device 0" in line for line in mico.missing)
        assert mico["right.x"].state is Status.OK
        library.faults.clear()
        mico.rescan()
        manager.reset_stop()
        assert mico.missing == ()
        assert mico["left.x"].state is Status.OK
        assert mico["right.x"].move_to(0.0) == pytest.approx(0.0, abs=1.0)


def test_stop_passes_a_device_thread_that_hangs_in_the_library():
    with platform(rate=1.0) as (mico, library, scene):
        running = mico["left.y"].move_to(5000.0, wait=False)
        wait_until(lambda: mico["left.y"].position_um > 20.0)
        library.faults.inject("blocked_call", device=0, channel=0, delay_s=1.0)
        stuck = mico["left.x"].move_to(100.0, wait=False)
        WALL.sleep(0.05)
        began = WALL.now_s()
        mico.application.manager.stop("test")
        assert WALL.now_s() - began < 0.5
        WALL.sleep(0.02)
        at = scene.truth()["left.y"]
        WALL.sleep(0.2)
        assert scene.truth()["left.y"] == pytest.approx(at, abs=1.0)
        for movement in (running, stuck):
            with pytest.raises(cosmic.StoppedError):
                movement.wait(5)
        WALL.sleep(0.05)
        assert scene.truth()["left.x"] < 90.0, "the blocked call must have been stopped again"


def test_a_stop_that_hangs_in_one_device_does_not_keep_the_others_moving(monkeypatch):
    with platform(rate=1.0) as (mico, _, scene):
        controller = mico.application.manager.controller
        stop, stopping = controller.stop, threading.get_ident()

        def hangs_here(channel):
            if channel.device == 0 and threading.get_ident() == stopping:
                WALL.sleep(0.5)
            stop(channel)

        monkeypatch.setattr(controller, "stop", hangs_here)
        running = mico["right.y"].move_to(5000.0, wait=False)
        wait_until(lambda: mico["right.y"].position_um > 20.0)
        stood = {}

        def look():
            WALL.sleep(0.2)
            stood["at"] = scene.truth()["right.y"]

        watcher = threading.Thread(target=look)
        watcher.start()
        mico.application.manager.stop("test")
        watcher.join()
        assert scene.truth()["right.y"] == pytest.approx(stood["at"], abs=0.5)
        with pytest.raises(cosmic.StoppedError):
            running.wait(5)


def test_nothing_is_left_moving_by_a_jog_that_is_forgotten():
    with platform(rate=1.0) as (mico, _, scene):
        mico["left.x"].jog(1, speed=500.0)
        WALL.sleep(0.6)
        at = scene.truth()["left.x"]
        assert 20.0 < at < 300.0
        WALL.sleep(0.2)
        assert scene.truth()["left.x"] == pytest.approx(at, abs=1.0)


def test_a_jog_moves_at_the_speed_asked():
    with platform(rate=1.0) as (mico, _, scene):
        began, start = WALL.now_s(), scene.truth()["left.x"]
        with mico["left.x"].jog(1, speed=400.0) as jog:
            while WALL.now_s() - began < 1.0:
                jog.renew()
                WALL.sleep(0.02)
            way, took = scene.truth()["left.x"] - start, WALL.now_s() - began
        assert way / took == pytest.approx(400.0, rel=0.35)


def test_closing_releases_the_hold_and_leaves_nothing_moving():
    with platform(rate=1.0) as (mico, _, scene):
        mico["left.x"].move_to(5000.0, wait=False)
        wait_until(lambda: mico["left.x"].position_um > 20.0)
        mico.application.shut_down()
        at = scene.truth()["left.x"]
        WALL.sleep(0.2)
        assert at < 4000.0
        assert scene.truth()["left.x"] == pytest.approx(at, abs=1.0)


def test_a_closed_platform_says_so_at_once_and_writes_nothing(tmp_path, monkeypatch):
    with cosmic.connect(rate=1.0) as rig:
        camera = rig.vico.camera()
        camera.next_image()
        waited = camera.await_image(since_s=1e9)
    monkeypatch.setitem(sys.modules, "cosmic.app.procedures", None)  # what takes long to load
    began_s = WALL.now_s()
    assert "closed" in str(waited.exception(20.0))
    for ask in (
        camera.next_image,
        camera.triggered_image,
        lambda: camera.await_image(since_s=1e9).wait(20.0),
        lambda: rig.campaign("quick", tmp_path / "after"),
        rig.calibrate,
    ):
        with pytest.raises(cosmic.NotAvailable, match="closed"):
            ask()
    assert WALL.now_s() - began_s < 3.0
    assert not list(tmp_path.iterdir())


def test_a_closed_platform_leaves_nothing_in_memory():
    kept = []
    for _ in range(2):
        with cosmic.connect() as rig:
            rig.vico.camera().start().wait(20.0)
            rig.daqco.start()
            rig.vico.snap()
            applications = (rig.mico.application, rig.daqco.application, rig.vico.application)
            kept += [weakref.ref(each) for each in applications]
        del rig, applications
    gc.collect()
    assert [each() for each in kept] == [None] * 6


def test_random_commands_never_leave_the_limits_and_never_hang():
    rng = random.Random(4)
    with platform(rate=50.0) as (mico, _, scene):
        axes = list(mico)
        for _ in range(150):
            axis = rng.choice(axes)
            with suppress(cosmic.CosmicError):
                if axis.limits is None:
                    axis.steps(rng.randint(-50, 50), wait=False)
                elif rng.random() < 0.5:
                    low, high = axis.limits
                    axis.move_to(rng.uniform(1.2 * low, 1.2 * high), wait=False)
                else:
                    axis.move_by(rng.uniform(-500, 500), wait=False)
            for other in axes:
                if other.limits is not None:
                    low, high = other.limits
                    assert low - 1.0 <= scene.truth()[other.key] <= high + 1.0
        wait_until(lambda: all(axis.state is not Status.BUSY for axis in axes), 20)
        assert not mico.application.manager.gate.held()
