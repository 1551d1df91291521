"""An image that comes again and again is not taken for a new one."""

import gc
import weakref
from collections.abc import Callable
from typing import Any, cast

import numpy as np
import pytest

from cosmic.autonomy.handling import sight
from cosmic.autonomy.handling.sight import AFTER_FAILURE, RESTARTS, LastSeen, LiveImage
from cosmic.frame.clock import ManualClock
from cosmic.frame.errors import NotAvailable
from cosmic.frame.operation import Task
from cosmic.vico.core.image import CameraImage, Circumstances
from cosmic.vico.hw.interface import Frame, FrameStatus, PixelFormat


class FakeCamera:
    """Shows a noisy image each time; frozen, the same one with a new time."""

    name = "microscope"

    @property
    def problem(self) -> str:
        return "it was unplugged" if self.unplugged else ""

    def __init__(self, clock: ManualClock) -> None:
        self._clock = clock
        self._count = 0
        self.frozen = False
        self.thaws = True
        self.dark = False
        self.unplugged = False
        self.commands: list[str] = []
        self.listeners: list[Callable[[], object]] = []
        self._data = self._noise()

    def _noise(self) -> Any:
        self._count += 1
        return np.random.default_rng(self._count).integers(90, 160, (64, 64), dtype=np.uint8)

    def image_since(self, since_s: float) -> CameraImage | None:
        if self.unplugged:
            return None
        if not self.frozen:
            self._data = np.zeros((64, 64), np.uint8) if self.dark else self._noise()
        now_s = self._clock.now_s()
        data = self._data.copy()
        frame = Frame(data, 1, now_s, now_s, None, FrameStatus.COMPLETE, PixelFormat.MONO8)
        return CameraImage("microscope", frame, Circumstances())

    def latest(self) -> CameraImage | None:
        return self.image_since(0.0)

    def on_image(self, listener: Callable[[], object]) -> Callable[[], None]:
        self.listeners.append(listener)
        return lambda: self.listeners.remove(listener)

    def stop(self) -> Task:
        return self._done("stop")

    def start(self) -> Task:
        self.frozen = self.frozen and not self.thaws
        return self._done("start")

    def _done(self, what: str) -> Task:
        self.commands.append(what)
        task = Task(what)
        task.finish()
        return task


@pytest.fixture(autouse=True)
def _at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sight, "APART_WALL_S", 0.0)


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock()


@pytest.fixture
def wall(monkeypatch: pytest.MonkeyPatch) -> ManualClock:
    wall = ManualClock(auto_advance=True)
    monkeypatch.setattr(sight, "WALL", wall)
    return wall


@pytest.fixture
def camera(clock: ManualClock) -> FakeCamera:
    return FakeCamera(clock)


def wanted(camera: FakeCamera, clock: ManualClock, last: LastSeen) -> LiveImage:
    clock.advance(0.1)
    return LiveImage(cast("Any", camera), clock, last)


def test_an_image_that_was_used_is_freed_at_once(camera: FakeCamera, clock: ManualClock) -> None:
    # Left to the garbage collection, those of a campaign took 64 MB until nothing moved for long.
    last, came = LastSeen(), list[LiveImage]()
    one = wanted(camera, clock, last)
    gc.disable()
    try:
        one.add_callback(came.append)
        seen = weakref.ref(one)
        one.wait(5.0)
        del one
        came.clear()
        assert seen() is None
    finally:
        gc.enable()
    assert camera.listeners == []


def test_a_camera_that_works_is_left_alone(camera: FakeCamera, clock: ManualClock):
    last = LastSeen()
    assert wanted(camera, clock, last).wait(5.0) is not wanted(camera, clock, last).wait(5.0)
    assert camera.commands == []


def test_a_frozen_camera_is_begun_anew_and_gives_a_new_image(
    camera: FakeCamera, clock: ManualClock
):
    last = LastSeen()
    before = wanted(camera, clock, last).wait(5.0)
    camera.frozen = True
    after = wanted(camera, clock, last).wait(5.0)
    assert camera.commands == ["stop", "start"]
    assert not np.array_equal(before.data, after.data)


def test_one_that_stays_frozen_is_abandoned_and_says_what_to_look_at(
    camera: FakeCamera, clock: ManualClock
):
    last = LastSeen()
    wanted(camera, clock, last).wait(5.0)
    camera.frozen, camera.thaws = True, False
    with pytest.raises(NotAvailable, match=r"same image again and again.*cable"):
        wanted(camera, clock, last).wait(5.0)
    assert camera.commands == ["stop", "start"] * RESTARTS


def test_a_camera_that_was_unplugged_is_given_up_soon_and_at_once_the_next_time(
    camera: FakeCamera, clock: ManualClock, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(sight, "LOST_WALL_S", 0.0)
    last, camera.unplugged = LastSeen(), True
    for restarts in (RESTARTS, RESTARTS + AFTER_FAILURE):
        with pytest.raises(NotAvailable, match=r"no image of microscope: it was unplugged"):
            wanted(camera, clock, last).wait(5.0)
        assert camera.commands == ["stop", "start"] * restarts
    camera.unplugged = False
    wanted(camera, clock, last).wait(5.0)
    assert not last.given_up


def lost_for_long(camera: FakeCamera, wall: ManualClock) -> LastSeen:
    """Return what was seen of a camera that was unplugged long ago, by the clock of the wall."""
    last, camera.unplugged = LastSeen(), True
    assert not last.stays_lost(camera.problem)
    wall.advance(sight.GIVE_UP_WALL_S + 1.0)
    return last


def test_one_that_is_known_to_be_lost_for_long_is_given_up_as_soon_as_an_image_is_wanted(
    camera: FakeCamera, clock: ManualClock, wall: ManualClock
):
    last = lost_for_long(camera, wall)
    began_s = wall.now_s()
    with pytest.raises(NotAvailable, match=r"no image of microscope: it was unplugged"):
        wanted(camera, clock, last).wait(20.0)
    assert camera.commands == ["stop", "start"] * AFTER_FAILURE
    assert wall.now_s() - began_s < 0.3 * sight.GIVE_UP_WALL_S


def test_one_that_came_back_meanwhile_counts_as_lost_anew(
    camera: FakeCamera, clock: ManualClock, wall: ManualClock
):
    last = lost_for_long(camera, wall)
    camera.unplugged = False
    wanted(camera, clock, last).wait(5.0)
    camera.unplugged = True
    assert not last.stays_lost(camera.problem)


def test_images_without_any_light_are_not_taken_for_a_frozen_camera(
    camera: FakeCamera, clock: ManualClock
):
    last, camera.dark = LastSeen(), True
    wanted(camera, clock, last).wait(5.0)
    wanted(camera, clock, last).wait(5.0)
    assert camera.commands == []


def test_an_image_that_is_no_longer_wanted_leaves_the_camera_running(
    camera: FakeCamera, clock: ManualClock
):
    last = LastSeen()
    wanted(camera, clock, last).wait(5.0)
    camera.frozen, camera.thaws = True, False
    image = wanted(camera, clock, last)
    while "stop" not in camera.commands:
        assert not image.done
    image.cancel()
    assert image.done
    assert camera.commands[-1] == "start"
