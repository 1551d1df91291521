"""What is special about IIDC cameras, over the stand-in for libdc1394."""

from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from contract.cameras.dc1394 import FIXED, SCALABLE, FakeDc1394, ScalableRig
from cosmic.frame.clock import WALL, ManualClock
from cosmic.frame.errors import ConfigError, DeviceError, DeviceFault, NotConnectedError
from cosmic.vico.hw import dc1394
from cosmic.vico.hw import dc1394_ctypes as dc
from cosmic.vico.hw.dc1394 import Dc1394Library, FrameCount
from cosmic.vico.hw.dc1394_ctypes import Dc1394Calls
from cosmic.vico.hw.interface import Camera, Frame, FrameStatus, PixelFormat, Roi, Trigger

needs_compiler = pytest.mark.skipif(bool(ScalableRig.missing()), reason=ScalableRig.missing())
SMALL = Roi(64, 32, 320, 240)


@pytest.fixture
def fake() -> Iterator[FakeDc1394]:
    with FakeDc1394() as made:
        yield made


@pytest.fixture
def library(fake: FakeDc1394) -> Iterator[Dc1394Library]:
    made = Dc1394Library(library=fake.library, shutter_unit_s=1e-4)
    yield made
    made.close()


@pytest.fixture
def camera(library: Dc1394Library) -> Iterator[Camera]:
    opened = library.open(SCALABLE)
    opened.configure(replace(opened.settings, roi=SMALL, rate_hz=60.0, exposure_s=0.005))
    yield opened
    opened.close()


def some(camera: Camera, count: int) -> list[Frame]:
    until_s, frames = WALL.now_s() + 10.0, []
    while len(frames) < count:
        assert WALL.now_s() < until_s
        frame = camera.receive(0.5)
        if frame is not None:
            frames.append(frame)
    return frames


def failure(camera: Camera) -> DeviceError:
    until_s = WALL.now_s() + 10.0
    while WALL.now_s() < until_s:
        try:
            camera.receive(0.1)
        except DeviceError as exc:
            return exc
    raise AssertionError("no error came")


def test_a_missing_library_is_named_with_its_package() -> None:
    with pytest.raises(NotConnectedError, match="libdc1394-25"):
        dc.load_library("libdc1394-that-is-not-there.so")


def test_a_library_that_lacks_a_function_is_refused_by_its_name() -> None:
    with pytest.raises(NotConnectedError, match="dc1394_new"):
        Dc1394Library(library=SimpleNamespace())


@needs_compiler
def test_a_status_says_who_what_and_why(fake: FakeDc1394) -> None:
    error = Dc1394Calls(fake.library).error("camera K: dc1394_capture_setup", -8)
    assert (error.code, error.fault) == (-8, DeviceFault.STATE)
    for part in ("camera K", "dc1394_capture_setup", "bandwidth", "-8", "lower the rate"):
        assert part in str(error)
    assert Dc1394Calls(fake.library).error("x", -39).fault is DeviceFault.OTHER


@needs_compiler
def test_cameras_are_distinguished_by_their_guid(library: Dc1394Library) -> None:
    found = {info.key: info.model for info in library.cameras()}
    assert found == {SCALABLE: "XCD-U100 (stand-in)", FIXED: "Fixed (stand-in)"}


@needs_compiler
def test_two_cameras_run_at_once(library: Dc1394Library, camera: Camera) -> None:
    other = library.open(FIXED)
    camera.start()
    other.start()
    ours, theirs = some(camera, 2), some(other, 2)
    assert ours[-1].data.shape == (240, 320)
    assert theirs[-1].data.shape == (768, 1024)
    other.close()


@needs_compiler
def test_the_image_is_the_one_that_the_camera_sent(camera: Camera) -> None:
    camera.start()
    first, second = some(camera, 2)
    rows, columns = np.ogrid[:240, :320]
    assert np.array_equal(first.data, (rows + columns) % 256)
    assert np.array_equal(second.data, (rows + columns + 1) % 256)


@needs_compiler
def test_sixteen_bit_come_with_the_high_byte_first_and_are_put_right(camera: Camera) -> None:
    camera.configure(replace(camera.settings, pixel_format=PixelFormat.MONO16))
    camera.start()
    rows, columns = np.ogrid[:240, :320]
    assert np.array_equal(some(camera, 1)[0].data, rows + columns)


@needs_compiler
def test_lines_with_a_gap_between_are_put_together(library: Dc1394Library) -> None:
    camera = library.open(FIXED)
    camera.start()
    rows, columns = np.ogrid[:768, :1024]
    assert np.array_equal(some(camera, 1)[0].data, (rows + columns) % 256)
    camera.close()


@needs_compiler
def test_the_largest_fixed_mode_without_colour_is_chosen(
    fake: FakeDc1394, library: Dc1394Library
) -> None:
    camera = library.open(FIXED)
    assert camera.info.sensor_px == (1024, 768)
    assert camera.ranges.pixel_formats == (PixelFormat.MONO8, PixelFormat.MONO16)
    assert fake.library.fake_mode(1) == dc.DC1394_VIDEO_MODE_1024x768_MONO8
    camera.close()


@needs_compiler
def test_a_fixed_rate_is_the_next_one_below_what_is_asked(library: Dc1394Library) -> None:
    camera = library.open(FIXED)
    made = camera.configure(replace(camera.settings, rate_hz=29.0, exposure_s=0.01))
    assert made.rate_hz == 15.0
    camera.close()


@needs_compiler
def test_a_shutter_in_counts_needs_its_unit_given(fake: FakeDc1394) -> None:
    for unit_s, known in ((0.0, False), (2e-5, True)):
        library = Dc1394Library(library=fake.library, shutter_unit_s=unit_s)
        camera = library.open(FIXED)
        assert (camera.ranges.exposure_s is not None) == known
        if known:
            made = camera.configure(replace(camera.settings, exposure_s=0.00501))
            assert made.exposure_s == pytest.approx(0.005, abs=2e-5)
        library.close()


@needs_compiler
def test_a_rate_too_high_for_the_size_is_refused_with_the_most_there_is(camera: Camera) -> None:
    before = camera.settings
    with pytest.raises(ConfigError, match=r"takes .* to 135"):
        camera.configure(replace(before, roi=Roi(0, 0, 1600, 1200), rate_hz=200.0))
    assert camera.settings == before


@needs_compiler
def test_a_corrupt_frame_is_counted_and_never_good(fake: FakeDc1394, camera: Camera) -> None:
    camera.start()
    fake.library.fake_corrupt_next(0)
    bad, good = some(camera, 2)
    assert (bad.status, good.status) == (FrameStatus.INCOMPLETE, FrameStatus.COMPLETE)
    assert (camera.counters.failed, camera.counters.completed) == (1, 1)


@needs_compiler
def test_a_frame_lost_on_the_bus_is_recognised_by_the_time(
    fake: FakeDc1394, camera: Camera
) -> None:
    camera.start()
    some(camera, 1)
    fake.library.fake_skip(0, 10)
    after = some(camera, 1)[0]
    assert camera.counters.lost >= 8  # a loaded machine may lose more, and time the first late
    assert after.frame_id == 1 + camera.counters.lost


def test_frames_in_time_are_not_lost_and_late_ones_are_counted_by_periods() -> None:
    count = FrameCount()
    numbers = [count.number(us, 60.0) for us in (0, 16_667, 40_000, 50_000, 100_000)]
    assert numbers == [0, 1, 2, 3, 6]


@pytest.mark.parametrize("set_h", [3, -3])
def test_a_date_that_is_set_meanwhile_loses_no_frame(
    set_h: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    wall, period_us, set_us = ManualClock(), 16_667, set_h * 3_600_000_000
    monkeypatch.setattr(dc1394, "WALL", wall)
    count, numbers = FrameCount(), list[int]()
    for number in range(6):
        numbers.append(count.number(number * period_us + (set_us if number > 2 else 0), 60.0))
        wall.advance(period_us / 1e6)
    assert numbers == list(range(6))


def test_a_trigger_may_come_whenever_it_likes() -> None:
    count = FrameCount()
    assert [count.number(us, 0.0) for us in (0, 10_000_000)] == [0, 1]


def test_a_stop_on_purpose_loses_nothing() -> None:
    count = FrameCount()
    count.number(0, 60.0)
    count.pause()
    assert count.number(10_000_000, 60.0) == 1


@needs_compiler
def test_a_rate_changed_meanwhile_loses_no_number(camera: Camera) -> None:
    camera.start()
    some(camera, 2)
    camera.configure(replace(camera.settings, rate_hz=30.0))
    frames = some(camera, 2)
    assert frames[0].frame_id == 2


@needs_compiler
def test_a_camera_that_was_switched_off_and_on_is_noticed(fake: FakeDc1394, camera: Camera) -> None:
    camera.start()
    some(camera, 1)
    fake.library.fake_power_cycle(0)
    began_s = WALL.now_s()
    assert "switched off" in str(failure(camera))
    assert WALL.now_s() - began_s < 2.0
    with pytest.raises(DeviceError):
        camera.start()


@needs_compiler
def test_a_triggered_camera_that_is_quiet_is_not_gone(camera: Camera) -> None:
    camera.configure(replace(camera.settings, trigger=Trigger.SOFTWARE))
    camera.start()
    assert camera.receive(1.2) is None


@needs_compiler
def test_closing_the_library_closes_its_cameras(fake: FakeDc1394, library: Dc1394Library) -> None:
    camera = library.open(SCALABLE)
    camera.start()
    library.close()
    assert fake.library.fake_left_open() == 0
    with pytest.raises(DeviceError, match="closed"):
        camera.start()
    with pytest.raises(NotConnectedError, match="closed"):
        library.cameras()
