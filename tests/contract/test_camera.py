"""Our cameras, which `contract.cameras` lists, under the suite for all, and what else they do."""

import importlib
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from math import inf, nan

import numpy as np
import pytest

from contract.cameras import CameraRig, Can
from cosmic.frame.clock import WALL
from cosmic.frame.errors import (
    ConfigError,
    DeviceError,
    DeviceFault,
    NotAvailable,
)
from cosmic.testing.cameras import CameraContract
from cosmic.vico.hw.interface import (
    Camera,
    CameraCounters,
    CameraLibrary,
    CameraSettings,
    Frame,
    FrameStatus,
    PixelFormat,
    Range,
    Roi,
    Trigger,
)

BACKENDS = ("simulated", "aravis", "opencv", "harvesters", "dc1394")


def _rigs() -> list[type[CameraRig]]:
    modules = [importlib.import_module(f"contract.cameras.{each}") for each in BACKENDS]
    return [rig for module in modules for rig in module.RIGS]


RIGS = _rigs()


def with_all(what: Can) -> pytest.MarkDecorator:
    """Run a test on the cameras that can do something; that it is refused is tested elsewhere."""
    return on([each for each in RIGS if what in each.can])


def on(rigs: list[type[CameraRig]]) -> pytest.MarkDecorator:
    """Run a test on these cameras alone."""
    ids = [each.name for each in rigs]
    return pytest.mark.parametrize("rig", rigs, ids=ids, indirect=True, scope="module")


@pytest.fixture(scope="module", params=RIGS, ids=lambda each: each.name)
def rig(request: pytest.FixtureRequest) -> Iterator[CameraRig]:
    kind: type[CameraRig] = request.param
    if kind.missing():
        pytest.skip(kind.missing())
    with kind() as made:
        yield made
        made.library.close()
        made.library.close()


@pytest.fixture
def camera(rig: CameraRig) -> Iterator[Camera]:
    with rig.opened() as opened:
        yield opened


def taken(rig: CameraRig, camera: Camera, count: int) -> list[Frame]:
    """Return the next frames that are complete."""
    frames: list[Frame] = []
    end_s = WALL.now_s() + rig.timeout_s + 2.0 * count / rig.rate_hz
    while len(frames) < count:
        assert WALL.now_s() < end_s, f"{len(frames)} of {count} frames came; {camera.counters}"
        frame = camera.receive(0.5)
        if frame is not None and frame.status is FrameStatus.COMPLETE:
            frames.append(frame)
    return frames


class TestEveryCamera(CameraContract):
    """The suite that other packages import, for each of ours."""

    @pytest.fixture(autouse=True)
    def of(self, rig: CameraRig) -> None:
        self._rig = rig

    def key(self, library: CameraLibrary) -> str:
        return self._rig.key

    @pytest.fixture
    def library(self, rig: CameraRig) -> CameraLibrary:
        return rig.library

    @pytest.fixture
    def camera(self, rig: CameraRig) -> Iterator[Camera]:
        with rig.opened() as opened:
            yield opened


# --- which cameras there are ------------------------------------------------------------------


def test_listing_goes_on_while_a_camera_takes_images(rig: CameraRig, camera: Camera) -> None:
    camera.start()
    taken(rig, camera, 1)
    assert rig.key in [info.key for info in rig.library.cameras()]
    taken(rig, camera, 1)


# --- frames -----------------------------------------------------------------------------------


def test_a_frame_has_the_shape_and_the_numbers_of_its_settings(
    rig: CameraRig, camera: Camera
) -> None:
    for pixel_format in camera.ranges.pixel_formats:
        settings = camera.configure(replace(camera.settings, pixel_format=pixel_format))
        assert settings.pixel_format is pixel_format
        camera.start()
        frame = taken(rig, camera, 1)[0]
        camera.stop()
        assert frame.pixel_format is pixel_format
        layers = (3,) if pixel_format is PixelFormat.RGB8 else ()
        assert frame.data.shape == (settings.roi.height_px, settings.roi.width_px, *layers)
        wide = pixel_format not in (PixelFormat.MONO8, PixelFormat.RGB8)
        assert frame.data.dtype == (np.uint16 if wide else np.uint8)
        most = {PixelFormat.MONO10: 1023, PixelFormat.MONO12: 4095}.get(pixel_format, 65535)
        assert frame.data.max() <= most


def test_frames_are_read_only_and_never_written_to_again(rig: CameraRig, camera: Camera) -> None:
    camera.start()
    frames = taken(rig, camera, 3)
    before = [frame.data.copy() for frame in frames]
    taken(rig, camera, 30)  # more than a pool of buffers holds
    camera.stop()
    camera.close()
    for frame, copy in zip(frames, before, strict=True):
        assert not frame.data.flags.writeable
        with pytest.raises(ValueError):
            frame.data[0, 0] = 1
        assert np.array_equal(frame.data, copy)
    assert not np.shares_memory(frames[0].data, frames[1].data)


def test_frame_numbers_rise_by_one_and_gaps_are_counted(rig: CameraRig, camera: Camera) -> None:
    camera.start()
    frames = taken(rig, camera, 12)
    counters = camera.counters
    gaps = np.diff([frame.frame_id for frame in frames]) - 1
    assert gaps.min() >= 0
    assert gaps.sum() <= counters.lost + counters.failed
    assert counters.completed >= 12


def test_times_are_the_platforms_and_an_exposure_lies_before_its_frame(
    rig: CameraRig, camera: Camera
) -> None:
    before_s = rig.clock.now_s()
    camera.start()
    frames = taken(rig, camera, 8)
    now_s = rig.clock.now_s()
    exposure_s = camera.settings.exposure_s if Can.EXPOSURE in rig.can else 0.0
    for frame in frames:
        assert before_s <= frame.time_s <= now_s
        assert frame.exposed_s <= frame.time_s - 0.99 * exposure_s
        assert frame.exposed_s >= before_s - 1.0
    assert all(np.diff([frame.time_s for frame in frames]) >= 0.0)
    assert all(np.diff([frame.exposed_s for frame in frames]) >= 0.0)


def test_a_frame_that_had_to_wait_is_not_said_to_be_newer_than_it_is(
    rig: CameraRig, camera: Camera
) -> None:
    camera.start()
    last = taken(rig, camera, 3)[-1]
    threading.Event().wait(6.0 / rig.rate_hz)  # nobody receives for six periods
    late = taken(rig, camera, 1)[0]
    steps = late.frame_id - last.frame_id
    assert late.exposed_s <= last.time_s + steps * 1.1 / rig.rate_hz


def test_a_new_start_counts_anew(rig: CameraRig, camera: Camera) -> None:
    camera.start()
    first = taken(rig, camera, 10)[0].frame_id
    camera.stop()
    camera.start()
    again = taken(rig, camera, 1)[0].frame_id
    counters = camera.counters
    assert max(first, again) <= 5  # a bus may lose the first few
    assert 1 <= counters.completed < 10


def test_a_camera_that_takes_images_cannot_be_started(rig: CameraRig, camera: Camera) -> None:
    camera.start()
    number = taken(rig, camera, 2)[-1].frame_id
    with pytest.raises(DeviceError) as caught:
        camera.start()
    assert caught.value.fault is DeviceFault.STATE
    assert taken(rig, camera, 1)[0].frame_id > number  # and it goes on as it was


def test_stopping_and_starting_again_and_again_leaves_nothing_behind(
    rig: CameraRig, camera: Camera
) -> None:
    camera.start()
    taken(rig, camera, 1)
    threads = threading.active_count()
    for _ in range(4):
        camera.stop()
        camera.start()
        taken(rig, camera, 1)
    end_s = WALL.now_s() + 2.0  # a server in this process may need a moment
    while threading.active_count() > threads and WALL.now_s() < end_s:
        camera.receive(0.02)
    assert threading.active_count() <= threads


@on([each for each in RIGS if Can.SOFTWARE_TRIGGER in each.can or each.quiet_rate_hz])
def test_a_receive_waits_no_longer_than_its_timeout(rig: CameraRig, camera: Camera) -> None:
    quiet = rig.quiet(camera.settings)
    assert quiet is not None
    camera.configure(quiet)
    camera.start()
    camera.receive(0.0)
    before_s = WALL.now_s()
    assert camera.receive(0.1) is None
    assert 0.09 <= WALL.now_s() - before_s < 2.0


def test_a_stop_wakes_whoever_waits(rig: CameraRig, camera: Camera) -> None:
    quiet = rig.quiet(camera.settings)
    if quiet is not None:
        camera.configure(quiet)
    camera.start()
    got: list[Frame | None] = []

    def until_the_end() -> None:
        while not got or got[-1] is not None:
            got.append(camera.receive(30.0))

    waiting = threading.Thread(target=until_the_end, daemon=True)
    waiting.start()
    waiting.join(0.1)  # it waits by now, or soon: either way the stop must end it
    before_s = WALL.now_s()
    camera.stop()
    waiting.join(5.0)
    assert not waiting.is_alive()
    assert WALL.now_s() - before_s < 2.0
    assert got[-1] is None


@on([each for each in RIGS if each.two])
def test_two_cameras_run_at_once(rig: CameraRig, camera: Camera) -> None:
    with rig.opened(rig.other_key) as other:
        camera.start()
        other.start()
        for _ in range(3):
            ours, theirs = taken(rig, camera, 2), taken(rig, other, 2)
        camera.stop()
        assert taken(rig, other, 2)[-1].frame_id > theirs[-1].frame_id > 0
        assert not np.shares_memory(ours[0].data, theirs[0].data)
        assert camera.info.key != other.info.key


# --- settings ---------------------------------------------------------------------------------


def test_a_camera_says_what_it_can_and_what_it_cannot(rig: CameraRig, camera: Camera) -> None:
    ranges, settings = camera.ranges, camera.settings
    assert (ranges.exposure_s is not None) == (Can.EXPOSURE in rig.can)
    assert (ranges.gain_db is not None) == (Can.GAIN in rig.can)
    assert (ranges.rate_hz is not None) == (Can.RATE in rig.can)
    assert (len(ranges.binnings) > 1) == (Can.BINNING in rig.can)
    assert (Trigger.SOFTWARE in ranges.triggers) == (Can.SOFTWARE_TRIGGER in rig.can)
    assert settings.pixel_format in ranges.pixel_formats
    assert settings.binning in ranges.binnings
    assert settings.trigger in ranges.triggers
    assert ranges.width_px.low <= settings.roi.width_px <= ranges.width_px.high
    assert ranges.height_px.low <= settings.roi.height_px <= ranges.height_px.high


def between(allowed: Range | None) -> float:
    assert allowed is not None
    value = allowed.low + 0.3 * (allowed.high - allowed.low)
    if allowed.step:
        value = allowed.low + allowed.step * round((value - allowed.low) / allowed.step)
    return value


def test_values_are_read_back_from_the_camera(rig: CameraRig, camera: Camera) -> None:
    before = camera.settings
    wanted = before
    if Can.GAIN in rig.can:
        wanted = replace(wanted, gain_db=between(camera.ranges.gain_db))
    if Can.RATE in rig.can:
        wanted = replace(wanted, rate_hz=rig.rate_hz / 2.0)
    if Can.EXPOSURE in rig.can:
        wanted = replace(wanted, exposure_s=0.3 / rig.rate_hz)
    made = camera.configure(wanted)
    assert made == camera.settings
    assert made.exposure_s == pytest.approx(wanted.exposure_s, rel=0.05)
    assert made.gain_db == pytest.approx(wanted.gain_db, rel=0.05, abs=0.1)
    assert made.rate_hz == pytest.approx(wanted.rate_hz, rel=0.05)
    back = camera.configure(before)
    assert back.exposure_s == pytest.approx(before.exposure_s, rel=0.05)


@with_all(Can.ROI)
def test_a_part_of_the_sensor_is_read_where_it_was_asked(rig: CameraRig, camera: Camera) -> None:
    ranges = camera.ranges
    width, height = int(between(ranges.width_px)), int(between(ranges.height_px))
    roi = Roi(x_px=0, y_px=0, width_px=width, height_px=height)
    assert camera.configure(replace(camera.settings, roi=roi)).roi == roi
    camera.start()
    assert taken(rig, camera, 1)[0].data.shape[:2] == (height, width)
    camera.stop()
    whole = Roi(0, 0, *camera.info.sensor_px)
    assert camera.configure(replace(camera.settings, roi=whole)).roi == whole


@with_all(Can.BINNING)
def test_binning_makes_the_sensor_smaller(rig: CameraRig, camera: Camera) -> None:
    width, height = camera.info.sensor_px
    binning = max(each for each in camera.ranges.binnings if each <= 4)
    roi = Roi(0, 0, width // binning // 16 * 8, height // binning // 16 * 8)
    made = camera.configure(replace(camera.settings, binning=binning, roi=roi))
    assert (made.binning, made.roi) == (binning, roi)
    assert camera.ranges.width_px.high <= width // binning
    camera.start()
    assert taken(rig, camera, 1)[0].data.shape[:2] == (roi.height_px, roi.width_px)


def _roi(**changes: float) -> Callable[[Camera, CameraSettings], CameraSettings]:
    def change(_camera: Camera, old: CameraSettings) -> CameraSettings:
        return replace(old, roi=replace(old.roi, **changes))  # type: ignore[arg-type]

    return change


def _off_the_right(camera: Camera, old: CameraSettings) -> CameraSettings:
    x_px = camera.info.sensor_px[0] - old.roi.width_px + 8
    return replace(old, roi=replace(old.roi, x_px=x_px))


def _too_high(camera: Camera, old: CameraSettings) -> CameraSettings:
    return replace(old, roi=replace(old.roi, height_px=camera.info.sensor_px[1] + 8))


def _between_the_steps(camera: Camera, old: CameraSettings) -> CameraSettings:
    if camera.ranges.width_px.step <= 1.0:
        return replace(old, roi=replace(old.roi, width_px=0))
    return replace(old, roi=replace(old.roi, width_px=old.roi.width_px - 1))


def _longer_than_the_period(_camera: Camera, old: CameraSettings) -> CameraSettings:
    return replace(old, exposure_s=1.5 / old.rate_hz if old.rate_hz else 1e6)


def _strange_format(camera: Camera, old: CameraSettings) -> CameraSettings:
    strange = [each for each in PixelFormat if each not in camera.ranges.pixel_formats]
    return replace(old, pixel_format=strange[0]) if strange else old


def _strange_trigger(camera: Camera, old: CameraSettings) -> CameraSettings:
    strange = [each for each in Trigger if each not in camera.ranges.triggers]
    return replace(old, trigger=strange[0]) if strange else old


def _some_of_it_right(camera: Camera, old: CameraSettings) -> CameraSettings:
    wrong = replace(old, binning=77)
    if camera.ranges.exposure_s is None:
        return wrong
    return replace(wrong, exposure_s=old.exposure_s / 2.0)


def _with(**changes: float) -> Callable[[Camera, CameraSettings], CameraSettings]:
    return lambda _camera, old: replace(old, **changes)  # type: ignore[arg-type]


REFUSED: dict[str, Callable[[Camera, CameraSettings], CameraSettings]] = {
    **{f"exposure {value}": _with(exposure_s=value) for value in (nan, inf, -1.0, -inf, 1e9)},
    **{f"gain {value}": _with(gain_db=value) for value in (nan, inf, -inf, 1e9, -1e9)},
    **{f"rate {value}": _with(rate_hz=value) for value in (nan, inf, 0.0, -5.0, 1e12)},
    "ROI wider than the sensor": _roi(width_px=10**6),
    "ROI higher than the sensor": _too_high,
    "ROI off the right edge": _off_the_right,
    "ROI off the left edge": _roi(x_px=-8),
    "ROI above the sensor": _roi(y_px=-8),
    "ROI far away": _roi(y_px=10**6),
    "ROI without width": _roi(width_px=0),
    "ROI without height": _roi(height_px=0),
    "ROI of negative width": _roi(width_px=-64),
    "ROI between the steps": _between_the_steps,
    "ROI of NaN": _roi(width_px=nan),
    "exposure longer than the period": _longer_than_the_period,
    "binning 0": _with(binning=0),
    "binning 77": _with(binning=77),
    "pixel format that it has not": _strange_format,
    "trigger that it has not": _strange_trigger,
    "right exposure with wrong binning": _some_of_it_right,
}


def test_what_a_camera_cannot_take_is_refused_and_changes_nothing(
    rig: CameraRig, camera: Camera
) -> None:
    before = camera.settings
    taken_on = [name for name in REFUSED if _takes_on(camera, before, name)]
    assert not taken_on
    camera.start()
    taken(rig, camera, 1)


def _takes_on(camera: Camera, before: CameraSettings, name: str) -> bool:
    asked = REFUSED[name](camera, before)
    if asked == before:  # the camera has every format, or every trigger
        return False
    try:
        camera.configure(asked)
    except ConfigError as exc:
        assert len(str(exc)) > 20, name
        return camera.settings != before
    return True


def test_while_it_runs_exposure_gain_and_rate_may_change(rig: CameraRig, camera: Camera) -> None:
    camera.start()
    taken(rig, camera, 2)
    wanted = camera.settings
    if Can.EXPOSURE in rig.can:
        wanted = replace(wanted, exposure_s=wanted.exposure_s / 2.0)
    if Can.RATE in rig.can:
        wanted = replace(wanted, rate_hz=wanted.rate_hz / 1.25)
    if Can.GAIN in rig.can:
        wanted = replace(wanted, gain_db=between(camera.ranges.gain_db))
    made = camera.configure(wanted)
    assert made.exposure_s == pytest.approx(wanted.exposure_s, rel=0.05)
    taken(rig, camera, 2)


def test_while_it_runs_the_rest_must_stay(rig: CameraRig, camera: Camera) -> None:
    others: list[CameraSettings] = []
    before = camera.settings
    if Can.ROI in rig.can:
        low, high = camera.ranges.width_px.low, camera.ranges.height_px.low
        others.append(replace(before, roi=Roi(0, 0, int(low), int(high))))
    for pixel_format in camera.ranges.pixel_formats:
        if pixel_format is not before.pixel_format:
            others.append(replace(before, pixel_format=pixel_format))
    if Can.SOFTWARE_TRIGGER in rig.can:
        others.append(replace(before, trigger=Trigger.SOFTWARE))
    camera.start()
    taken(rig, camera, 1)
    for other in others:
        with pytest.raises(DeviceError) as caught:
            camera.configure(other)
        assert caught.value.fault is DeviceFault.BUSY
        assert camera.settings == before
    taken(rig, camera, 1)


# --- triggers ---------------------------------------------------------------------------------


def test_a_camera_that_runs_freely_takes_no_trigger(rig: CameraRig, camera: Camera) -> None:
    camera.start()
    with pytest.raises(NotAvailable):
        camera.trigger()


@with_all(Can.SOFTWARE_TRIGGER)
def test_one_software_trigger_gives_one_frame(rig: CameraRig, camera: Camera) -> None:
    camera.configure(replace(camera.settings, trigger=Trigger.SOFTWARE))
    camera.start()
    assert camera.receive(0.05) is None
    for _ in range(2):
        asked_s = rig.clock.now_s()
        camera.trigger()
        frame = camera.receive(rig.timeout_s)
        assert frame is not None
        assert frame.time_s >= asked_s
        assert camera.receive(0.1) is None


# --- a camera that goes -----------------------------------------------------------------------


def _failure(camera: Camera) -> DeviceError:
    end_s = WALL.now_s() + 10.0
    while WALL.now_s() < end_s:
        try:
            camera.receive(0.1)
        except DeviceError as exc:
            return exc
    raise AssertionError("no error came")


def _open_again(rig: CameraRig) -> Camera:
    end_s = WALL.now_s() + rig.timeout_s
    while True:
        try:
            camera = rig.library.open(rig.key)
            camera.configure(rig.plain(camera))
            return camera
        except DeviceError:
            if WALL.now_s() > end_s:
                raise


@with_all(Can.UNPLUG)
def test_a_camera_that_is_unplugged_says_so_and_can_be_opened_when_it_is_back(
    rig: CameraRig,
) -> None:
    with rig.opened() as camera:
        camera.start()
        taken(rig, camera, 2)
        rig.unplug()
        try:
            gone_s = WALL.now_s()
            failure = _failure(camera)
            assert WALL.now_s() - gone_s < 2.0
            assert len(str(failure)) > 20
            with pytest.raises(DeviceError):  # nothing more comes from it
                camera.receive(0.0)
            camera.stop()
            camera.close()
            with pytest.raises(DeviceError):
                rig.library.open(rig.key)
        finally:
            rig.plug_in()
    again = _open_again(rig)
    try:
        again.start()
        assert taken(rig, again, 1)[0].frame_id <= 5
        assert again.counters != CameraCounters()
    finally:
        again.close()
