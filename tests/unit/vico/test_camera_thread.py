"""What a camera's thread makes of frames that are not what the camera says of itself."""

import itertools
import logging
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from threading import Event
from typing import Any

import numpy as np
import pytest
from typing_extensions import override

from contract.station_rig import wait_until
from cosmic.frame.clock import WALL
from cosmic.frame.errors import NotAvailable
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.heartbeat import STALL_S
from cosmic.testing.cameras import CameraContract
from cosmic.vico.core.camera_thread import CameraThread
from cosmic.vico.core.image import CameraImage, Circumstances
from cosmic.vico.hw.base_camera import BaseCamera
from cosmic.vico.hw.interface import (
    CameraInfo,
    CameraRanges,
    CameraSettings,
    Frame,
    PixelFormat,
    Pixels,
    Range,
    Roi,
)
from cosmic.vico.hw.sim_camera import DrawnFrame

WIDTH, HEIGHT = 64, 48
FORMATS = (PixelFormat.MONO8, PixelFormat.MONO12, PixelFormat.RGB8)
GREY = np.zeros((HEIGHT, WIDTH), np.uint8)


class OddCamera(BaseCamera):
    """Gives `data` as its images, or what `draw` draws, whatever its settings say."""

    def __init__(self) -> None:
        info = CameraInfo("odd", "ACME", "Odd", "SN-7", sensor_px=(WIDTH, HEIGHT))
        super().__init__(info, WALL, closed=None)
        self.data: Any = GREY
        self.pixel_format = PixelFormat.MONO8
        self.ahead_s = 0.0
        self.draw: Callable[[], Pixels] | None = None
        self._numbers = itertools.count()
        self._in_force = CameraSettings(0.001, 0.0, 100.0, Roi(0, 0, WIDTH, HEIGHT))
        self._opened((WIDTH, HEIGHT))

    @override
    def _read(self) -> CameraSettings:
        return self._in_force

    @override
    def _read_ranges(self) -> CameraRanges:
        sizes = (Range(WIDTH, WIDTH), Range(HEIGHT, HEIGHT))
        return CameraRanges(None, None, None, *sizes, pixel_formats=FORMATS)

    @override
    def _write(self, asked: CameraSettings, present: CameraSettings | None) -> None:
        self._in_force = asked

    @override
    def _begin(self) -> None:
        self._numbers = itertools.count()

    @override
    def _fetch(self, wait_s: float) -> Frame | None:
        if self._stopping.wait(0.01):
            return None
        now_s = WALL.now_s()
        exposed_s = now_s + self.ahead_s
        if self.draw is not None:
            size_px = WIDTH, HEIGHT
            return DrawnFrame(self.draw, next(self._numbers), now_s, now_s, size_px=size_px)
        return Frame(
            self.data, next(self._numbers), now_s, exposed_s, pixel_format=self.pixel_format
        )

    @override
    def _end(self) -> None: ...

    @override
    def _release(self) -> None: ...


@dataclass
class Bench:
    camera: OddCamera
    thread: CameraThread
    images: list[CameraImage]


@pytest.fixture
def bench() -> Iterator[Bench]:
    camera, images = OddCamera(), list[CameraImage]()
    thread = CameraThread(
        "Microscope",
        lambda: camera,
        lambda opened: opened.settings,
        lambda _frame, _settings: Circumstances(),
        FailurePolicy(),
    )
    thread.subscribe(images.append)
    thread.start()
    assert wait_until(lambda: images)
    yield Bench(camera, thread, images)
    thread.request_end()
    assert thread.join()


WRONG = {
    "shape (48, 32), uint8, Mono8": np.zeros((HEIGHT, WIDTH // 2), np.uint8),
    "shape (64, 48), uint8, Mono8": np.zeros((WIDTH, HEIGHT), np.uint8),
    "shape (48, 64, 3), uint8, Mono8": np.zeros((HEIGHT, WIDTH, 3), np.uint8),
    "shape (48, 64), uint16, Mono8": np.zeros((HEIGHT, WIDTH), np.uint16),
    "shape (48, 64), float64, Mono8": np.zeros((HEIGHT, WIDTH)),
    "shape (0,), float64, Mono8": np.zeros(0),
    "no array but str, Mono8": "abc",
}


@pytest.mark.parametrize("came", WRONG)
def test_an_image_other_than_the_settings_say_is_refused_and_the_next_ones_come(
    came: str, bench: Bench, caplog: pytest.LogCaptureFixture
) -> None:
    seen = len(bench.images)
    bench.camera.data = WRONG[came]
    assert wait_until(lambda: bench.thread.problem)
    said = bench.thread.problem
    assert said.startswith("Microscope (ACME Odd, SN-7): ")
    assert f"an image of {came} came" in said
    assert "its settings say shape (48, 64), uint8, Mono8" in said
    with pytest.raises(NotAvailable, match="its settings say"):
        bench.thread.next_image(WALL.now_s(), 0.1)
    assert bench.thread.running
    bench.camera.data = GREY
    assert wait_until(lambda: not bench.thread.problem)
    assert all(each.data is GREY for each in bench.images)
    assert len(bench.images) > seen
    assert max(each.lost_before for each in bench.images) > 0, "they are told as lost"
    told = [each for each in caplog.records if each.levelno >= logging.ERROR]
    assert len(told) == 1


def test_an_image_of_another_format_is_refused(bench: Bench) -> None:
    bench.camera.pixel_format = PixelFormat.MONO12
    assert wait_until(lambda: "uint8, Mono12 came" in bench.thread.problem)


def test_a_camera_that_is_started_anew_has_no_problem(bench: Bench) -> None:
    bench.camera.data = "abc"
    assert wait_until(lambda: bench.thread.problem)
    bench.thread.stop_images().wait(5.0)
    bench.camera.data = GREY
    bench.thread.start_images().wait(5.0)
    assert not bench.thread.problem


@pytest.mark.parametrize("came", WRONG)
def test_the_suite_for_cameras_catches_it(came: str) -> None:
    camera = OddCamera()
    camera.data = WRONG[came]
    with pytest.raises(AssertionError):
        Suite().test_a_frame_has_shape_and_type_of_its_settings_in_each_format(camera)


def test_the_suite_for_cameras_catches_one_format_for_all() -> None:
    with pytest.raises(AssertionError):
        Suite().test_a_frame_has_shape_and_type_of_its_settings_in_each_format(OddCamera())


class Suite(CameraContract):
    """The suite, called by hand."""

    __test__ = False

    @override
    def make_library(self) -> Any:
        raise NotImplementedError


@pytest.mark.parametrize("ahead_s", [math.nan, math.inf, -math.inf, 1.0e9])
def test_an_image_of_no_time_or_of_the_future_is_refused_with_the_reason(
    ahead_s: float, bench: Bench
) -> None:
    bench.camera.ahead_s = ahead_s
    assert wait_until(lambda: bench.thread.problem)
    with pytest.raises(NotAvailable, match=r"that was exposed at .* s\. It is refused"):
        bench.thread.next_image(WALL.now_s(), 0.1)
    bench.camera.ahead_s = 0.0
    assert wait_until(lambda: not bench.thread.problem)


@pytest.mark.parametrize("method", ["_fetch", "_begin", "_end"])
def test_a_driver_that_hangs_is_named_and_nobody_waits_for_it(
    method: str, bench: Bench, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    hung, released = Event(), Event()
    whole = getattr(bench.camera, method)

    def hangs(*arguments: object) -> object:
        hung.set()
        released.wait(10.0)
        return whole(*arguments)

    monkeypatch.setattr(bench.camera, method, hangs)
    thread = bench.thread
    if method != "_fetch":
        thread.stop_images()
        thread.start_images()
    try:
        assert hung.wait(5.0)
        waiting = thread.configure(bench.camera.settings)
        thread.heartbeat.look(0.5)
        assert not thread.problem
        thread.heartbeat.look(STALL_S)
        assert "Microscope: its driver has not returned from a call for 5 s" in thread.problem
        assert not thread.running
        for task in (waiting, thread.stop_images()):
            with pytest.raises(NotAvailable, match=r"does not return|has not returned"):
                task.wait(1.0)
        with pytest.raises(NotAvailable, match="has not returned"):
            thread.next_image(WALL.now_s(), 0.1)
        thread.heartbeat.look(STALL_S)
    finally:
        released.set()
    assert wait_until(lambda: thread.heartbeat.look(0.0) or not thread.problem)
    thread.start_images().wait(5.0)
    assert thread.next_image(WALL.now_s(), 5.0) is not None
    assert len([each for each in caplog.records if each.levelno >= logging.ERROR]) == 1


@pytest.mark.parametrize("how", ["looked at", "stopped"])
def test_an_image_that_a_busy_computer_draws_late_is_no_driver_that_hangs(
    how: str, bench: Bench
) -> None:
    begun, drawn = Event(), Event()

    def draw() -> Pixels:
        begun.set()
        drawn.wait(10.0)
        return GREY

    thread = bench.thread
    bench.camera.draw = draw
    assert wait_until(lambda: isinstance(thread.last and thread.last.frame, DrawnFrame))
    stopping = thread.stop_images() if how == "stopped" else None
    assert wait_until(lambda: (stopping or thread.newest) and begun.is_set())
    try:
        thread.heartbeat.look(0.5)
        for _ in range(4):
            thread.heartbeat.look(STALL_S)
        assert not thread.problem
        waiting = thread.start_images()
    finally:
        drawn.set()
    waiting.wait(5.0)
    assert stopping is None or stopping.done


def test_a_camera_that_gives_nothing_and_returns_does_not_hang(bench: Bench) -> None:
    bench.thread.stop_images().wait(5.0)
    for _ in range(20):
        WALL.sleep(0.06)
        bench.thread.heartbeat.look(STALL_S)
        assert not bench.thread.problem
