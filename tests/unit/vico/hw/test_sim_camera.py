"""The simulated cameras: their times, their buffers, their troubles, and what they show."""

import threading
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from cosmic.frame.clock import ManualClock, RatedClock
from cosmic.frame.errors import ConfigError, DeviceError, DeviceFault, NotConnectedError
from cosmic.twin.optics.drawing import Drawing
from cosmic.twin.scene import Scene
from cosmic.twin.settings import shipped_settings
from cosmic.vico.core.image import CameraImage, Circumstances
from cosmic.vico.hw.interface import (
    CameraSettings,
    Frame,
    FrameStatus,
    PixelFormat,
    Roi,
    Trigger,
)
from cosmic.vico.hw.sim_camera import (
    BUFFERS,
    DrawnFrame,
    SimulatedCamera,
    SimulatedCameraLibrary,
)

SMALL = Roi(640, 500, 160, 120)
PERIOD_S = 1.0 / 15.0
LATENCY_S = 0.02 + 0.030 * 120 / 1200 + 0.005
"""Exposure, read-out of a tenth of the rows, transfer."""


class Stand:
    """Simulated cameras whose time a test moves."""

    def __init__(self, seed: int = 0) -> None:
        self.clock = ManualClock()
        self.clock.advance(10.0)
        self.scene = Scene.from_settings(shipped_settings(), self.clock)
        self.library = SimulatedCameraLibrary(self.scene, self.clock, seed)
        self.faults = self.library.faults

    def open(self, **changes: object) -> SimulatedCamera:
        camera = self.library.open("Sim1")
        camera.configure(replace(camera.settings, **{"roi": SMALL, **changes}))  # type: ignore[arg-type]
        return camera

    def after(self, camera: SimulatedCamera, duration_s: float) -> list[Frame]:
        """Return the frames that come in the next time."""
        self.clock.advance(duration_s)
        return list(self.waiting(camera))

    @staticmethod
    def waiting(camera: SimulatedCamera) -> Iterator[Frame]:
        while (frame := camera.receive(0.0)) is not None:
            yield frame


@pytest.fixture
def stand() -> Iterator[Stand]:
    made = Stand()
    yield made
    made.library.close()


# --- times ------------------------------------------------------------------------------------


def test_frames_come_at_their_rate_after_exposure_read_out_and_transfer(stand: Stand) -> None:
    camera = stand.open()
    camera.start()
    assert not stand.after(camera, LATENCY_S - 1e-6)
    assert [frame.frame_id for frame in stand.after(camera, 2e-6)] == [0]
    frames = stand.after(camera, 10 * PERIOD_S)
    assert [frame.frame_id for frame in frames] == list(range(1, 11))
    exposed_s = np.array([frame.exposed_s for frame in frames])
    assert np.allclose(exposed_s, 10.0 + PERIOD_S * np.arange(1, 11))
    assert np.allclose([frame.time_s for frame in frames], exposed_s + LATENCY_S)


def test_the_cameras_own_clock_is_ahead_and_runs_a_little_fast(stand: Stand) -> None:
    camera = stand.open(rate_hz=0.5)
    camera.start()
    frames = [stand.after(camera, 2.0)[0] for _ in range(5)]
    ahead_s = np.array([frame.device_ns * 1e-9 - frame.exposed_s for frame in frames])  # type: ignore[operator]
    assert np.all(ahead_s > 1000.0)
    assert np.allclose(np.diff(ahead_s), 35e-6 * 2.0, rtol=0.01)


def test_fewer_rows_are_read_faster(stand: Stand) -> None:
    camera = stand.open()
    assert camera.ranges.rate_hz is not None
    assert camera.ranges.rate_hz.high == 120.0
    camera.configure(replace(camera.settings, rate_hz=100.0, exposure_s=0.002))
    whole = camera.configure(replace(camera.settings, roi=Roi(0, 0, 1600, 1200)))
    assert whole.rate_hz == 15.0
    with pytest.raises(ConfigError, match="15 Hz"):
        camera.configure(replace(whole, rate_hz=30.0))
    binned = camera.configure(replace(whole, binning=2, roi=Roi(0, 0, 800, 600)))
    assert camera.configure(replace(binned, rate_hz=30.0)).rate_hz == 30.0


def test_a_change_while_it_runs_counts_from_the_next_exposure_on(stand: Stand) -> None:
    camera = stand.open(rate_hz=10.0)
    camera.start()
    stand.clock.advance(0.305)
    camera.configure(replace(camera.settings, rate_hz=20.0, exposure_s=0.001))
    frames = stand.after(camera, 0.2)
    assert np.allclose(
        [frame.exposed_s - 10.0 for frame in frames],
        [0.0, 0.1, 0.2, 0.3, 0.35, 0.4, 0.45, 0.5][: len(frames)],
    )
    assert len(frames) >= 7
    brightness = [float(frame.data.mean()) for frame in frames]
    assert min(brightness[:4]) > 3.0 * max(brightness[4:])


def test_on_a_fast_clock_frames_come_faster_by_the_wall() -> None:
    clock = RatedClock(20.0)
    library = SimulatedCameraLibrary(Scene.from_settings(shipped_settings(), clock), clock)
    camera = library.open("Sim1")
    camera.configure(replace(camera.settings, roi=SMALL))
    camera.start()
    frames = [camera.receive(5.0) for _ in range(20)]
    library.close()
    assert [frame.frame_id for frame in frames if frame is not None] == list(range(20))


def test_a_waiting_receiver_wakes_when_a_test_moves_the_time(stand: Stand) -> None:
    camera = stand.open()
    camera.start()
    got: list[Frame | None] = []
    waiting = threading.Thread(target=lambda: got.append(camera.receive(10.0)), daemon=True)
    waiting.start()
    stand.clock.advance(LATENCY_S + 1e-6)
    waiting.join(5.0)
    assert got[0] is not None


# --- buffers and triggers -------------------------------------------------------------------------


def test_the_size_of_a_frame_is_known_without_a_wait_for_its_pixels() -> None:
    def draw() -> Drawing:
        raise AssertionError("somebody waited for the pixels")

    frame = DrawnFrame(draw, 1, 2.0, 2.0, size_px=(40, 30))
    image = CameraImage("top", frame, Circumstances())
    assert image.size_px == (40, 30)
    assert not frame.ready
    corrected = replace(frame, data=np.zeros((20, 10), np.uint8))  # as a background is taken off
    assert (corrected.size_px, corrected.frame_id, corrected.ready) == ((10, 20), 1, True)


def test_frames_that_nobody_receives_are_counted_and_not_drawn(stand: Stand) -> None:
    camera = stand.open()
    camera.start()
    stand.clock.advance(100.0)
    assert camera.counters.underrun == 1500 + 1 - BUFFERS
    frames = list(stand.waiting(camera))
    assert [frame.frame_id for frame in frames] == list(range(BUFFERS))
    (late, *_) = stand.after(camera, 2 * PERIOD_S)
    assert late.frame_id == 1501
    assert camera.counters.lost == 1501 - BUFFERS


def test_triggers_that_come_too_fast_wait_for_the_exposure_before(stand: Stand) -> None:
    camera = stand.open(trigger=Trigger.SOFTWARE)
    camera.start()
    assert not stand.after(camera, 10.0)
    for _ in range(3):
        camera.trigger()
    exposed_s = [frame.exposed_s for frame in stand.after(camera, 1.0)]
    assert np.allclose(exposed_s, [20.0, 20.02, 20.04])
    for _ in range(BUFFERS + 2):
        camera.trigger()
    assert camera.counters.underrun == 2


def test_a_trigger_before_the_start_is_refused(stand: Stand) -> None:
    camera = stand.open(trigger=Trigger.SOFTWARE)
    with pytest.raises(DeviceError) as caught:
        camera.trigger()
    assert caught.value.fault is DeviceFault.STATE


# --- what is seen ---------------------------------------------------------------------------------


def test_a_frame_shows_the_middle_of_its_exposure(stand: Stand) -> None:
    camera = stand.open(exposure_s=0.01)
    camera.start()
    (frame,) = stand.after(camera, 0.2)[:1]
    assert stand.scene.optics is not None
    there = stand.scene.optics.render(10.005, exposure_s=0.01, roi=SMALL)
    assert np.array_equal(frame.data, there)


def test_light_that_goes_out_is_seen_in_the_frames_after(stand: Stand) -> None:
    camera = stand.open()
    camera.start()
    assert stand.scene.light is not None
    stand.scene.light.set_percent(0.0, 10.0 + 2.5 * PERIOD_S)
    bright = [float(frame.data.mean()) for frame in stand.after(camera, 6 * PERIOD_S)]
    assert min(bright[:3]) > 100.0
    assert max(bright[3:]) < 10.0


def test_the_second_camera_is_another_view(stand: Stand) -> None:
    infos = stand.library.cameras()
    assert [info.key for info in infos] == ["Sim1", "Sim2"]
    assert all(info.simulated and info.sensor_px == (1600, 1200) for info in infos)
    assert infos[0].serial != infos[1].serial
    cameras = [stand.library.open(info.key) for info in infos]
    for camera in cameras:
        camera.start()
    stand.clock.advance(0.1)
    frames = [camera.receive(0.0) for camera in cameras]
    assert not np.array_equal(frames[0].data, frames[1].data)  # type: ignore[union-attr]


def test_sixteen_bits_and_binning_reach_the_image(stand: Stand) -> None:
    camera = stand.open(binning=2, roi=Roi(0, 0, 800, 600), pixel_format=PixelFormat.MONO16)
    camera.start()
    (frame,) = stand.after(camera, 0.1)[:1]
    assert frame.data.shape == (600, 800)
    assert frame.data.dtype == np.uint16
    assert frame.data.mean() > 20_000


def test_a_scene_of_bare_stages_has_no_cameras() -> None:
    clock = ManualClock()
    with pytest.raises(ValueError, match="bare stages"):
        SimulatedCameraLibrary(Scene.from_layout("LLL", shipped_settings(), clock), clock)


def test_closing_twice_does_not_take_the_camera_from_who_has_it_now(stand: Stand) -> None:
    first = stand.open()
    first.close()
    stand.open()
    first.close()
    with pytest.raises(NotConnectedError, match="another program"):
        stand.open()


# --- troubles -------------------------------------------------------------------------------------


def test_a_camera_unplugged_and_back_must_be_opened_anew(stand: Stand) -> None:
    camera = stand.open()
    camera.start()
    stand.faults.inject("unplugged", camera="Sim1")
    assert [info.key for info in stand.library.cameras()] == ["Sim2"]
    stand.faults.clear("unplugged")
    with pytest.raises(NotConnectedError, match="gone"):
        camera.receive(0.0)
    with pytest.raises(NotConnectedError):
        camera.start()
    with pytest.raises(NotConnectedError, match="another program"):
        stand.open()
    camera.close()
    again = stand.open()
    again.start()
    assert stand.after(again, 0.1)


def test_another_camera_goes_on_when_one_is_unplugged(stand: Stand) -> None:
    camera = stand.open()
    camera.start()
    stand.faults.inject("unplugged", camera="Sim2")
    assert stand.after(camera, 0.1)


def test_a_camera_that_another_program_has_is_listed_but_not_opened(stand: Stand) -> None:
    stand.faults.inject("taken")
    assert len(stand.library.cameras()) == 2
    with pytest.raises(NotConnectedError, match="another program") as caught:
        stand.library.open("Sim1")
    assert caught.value.fault is DeviceFault.BUSY


def test_incomplete_frames_are_counted_and_marked(stand: Stand) -> None:
    camera = stand.open()
    stand.faults.inject("incomplete", share=0.4)
    camera.start()
    frames = stand.after(camera, 14 * PERIOD_S)
    bad = [frame for frame in frames if frame.status is FrameStatus.INCOMPLETE]
    assert 1 <= len(bad) < len(frames)
    assert camera.counters.failed == len(bad)
    assert camera.counters.completed == len(frames) - len(bad)
    assert camera.counters.lost == 0
    assert all(not frame.data[100:].any() and frame.data[:60].all() for frame in bad)


def test_lost_frames_leave_gaps_that_the_seed_decides() -> None:
    def ids(seed: int) -> list[int]:
        stand = Stand(seed)
        camera = stand.open()
        stand.faults.inject("lost", camera="Sim1", share=0.3)
        camera.start()
        found = [frame.frame_id for frame in stand.after(camera, 15 * PERIOD_S)]
        assert camera.counters.lost == found[-1] + 1 - len(found) > 0
        stand.library.close()
        return found

    assert ids(1) == ids(1) != ids(2)


def test_a_frozen_camera_shows_the_same_image_with_new_numbers(stand: Stand) -> None:
    camera = stand.open()
    camera.start()
    before = stand.after(camera, 2 * PERIOD_S)[-1]
    stand.faults.inject("frozen")
    frozen = stand.after(camera, 3 * PERIOD_S)
    assert [frame.frame_id for frame in frozen] == [2, 3, 4]
    assert all(np.array_equal(frame.data, before.data) for frame in frozen)
    stand.faults.clear("frozen")
    assert not np.array_equal(stand.after(camera, PERIOD_S)[0].data, before.data)


def test_slow_frames_come_late_and_none_is_lost(stand: Stand) -> None:
    camera = stand.open()
    stand.faults.inject("slow")
    camera.start()
    assert not stand.after(camera, 0.5)
    frames = stand.after(camera, 0.5)
    assert [frame.frame_id for frame in frames] == list(range(len(frames)))
    assert all(frame.time_s - frame.exposed_s > 0.5 for frame in frames)


@pytest.mark.parametrize("wrong", [{"name": "melted"}, {"name": "lost", "share": 1.5}])
def test_a_fault_that_cannot_be_is_refused(stand: Stand, wrong: dict[str, object]) -> None:
    with pytest.raises(ValueError):
        stand.faults.inject(**wrong)  # type: ignore[arg-type]


def test_nan_is_no_exposure(stand: Stand) -> None:
    camera = stand.open()
    before: CameraSettings = camera.settings
    with pytest.raises(ConfigError):
        camera.configure(replace(before, exposure_s=float("nan")))
    assert camera.settings == before


def test_an_image_that_nobody_looks_at_is_not_drawn(
    stand: Stand, monkeypatch: pytest.MonkeyPatch
) -> None:
    camera = stand.open()
    camera.start()
    drawn: list[object] = []
    draw = stand.scene.optics.expose

    def counted(*args: Any, **how: Any) -> Any:
        drawn.append(args)
        return draw(*args, **how)

    monkeypatch.setattr(stand.scene.optics, "expose", counted)
    frames = stand.after(camera, 0.3)
    assert frames
    assert not drawn
    first, again = frames[0].data, frames[0].data
    assert first is again
    assert len(drawn) == 1
