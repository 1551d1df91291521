"""GenTL features that the virtual producer's cameras have not; see tests/contract for the rest."""

import signal
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contract.cameras.harvesters import HarvestersRig
from cosmic.frame.clock import RatedClock
from cosmic.frame.errors import ConfigError, DeviceError, NotAvailable, NotConnectedError
from cosmic.vico.hw.harvesters import HarvestersCamera, HarvestersLibrary
from cosmic.vico.hw.interface import (
    Camera,
    CameraInfo,
    FrameStatus,
    PixelFormat,
    Roi,
    Trigger,
)
from unit.vico.hw.fake_node_map import Buffer, FakeGenTL, NodeError

INFO = CameraInfo(key="cam", vendor="V", model="M", serial="1")


@pytest.fixture
def device() -> FakeGenTL:
    return FakeGenTL()


@pytest.fixture
def closings() -> list[Camera]:
    return []


@pytest.fixture
def camera(device: FakeGenTL, closings: list[Camera]) -> Iterator[HarvestersCamera]:
    made = HarvestersCamera(INFO, device, RatedClock(), errors=(NodeError,), closed=closings.append)
    yield made
    made.close()
    assert closings == [made]


def image(frame_id: int) -> Buffer:
    return Buffer(frame_id, np.full((480, 640), 7, np.uint8), "Mono8")


def test_values_are_in_seconds_and_decibels(camera: HarvestersCamera, device: FakeGenTL) -> None:
    ranges = camera.ranges
    assert camera.settings.exposure_s == pytest.approx(0.01)
    assert ranges.exposure_s is not None and ranges.gain_db is not None
    assert (ranges.exposure_s.low, ranges.exposure_s.high) == pytest.approx((20e-6, 1.0))
    assert (ranges.gain_db.low, ranges.gain_db.high, ranges.gain_db.step) == (0.0, 24.0, 0.0)
    made = camera.configure(replace(camera.settings, exposure_s=0.02, gain_db=6.0))
    assert (made.exposure_s, made.gain_db) == (pytest.approx(0.02), 6.0)
    assert device.node_map.ExposureTime.value == pytest.approx(20_000.0)


def test_a_camera_does_not_choose_its_exposure(camera: HarvestersCamera, device: FakeGenTL) -> None:
    assert device.node_map.ExposureAuto.value == "Off"


def test_a_camera_that_wakes_up_in_a_strange_format_is_given_a_known_one(
    camera: HarvestersCamera, device: FakeGenTL
) -> None:
    assert device.node_map.PixelFormat.value == "Mono8"
    assert camera.ranges.pixel_formats == (
        PixelFormat.MONO8,
        PixelFormat.MONO12,
        PixelFormat.RGB8,
    )


def test_a_longer_exposure_comes_after_the_slower_rate_and_the_other_way_round(
    camera: HarvestersCamera, device: FakeGenTL
) -> None:
    nodes = device.node_map
    exposure, rate = nodes.ExposureTime, nodes.AcquisitionFrameRate
    device.order.clear()
    camera.configure(replace(camera.settings, exposure_s=0.4, rate_hz=2.0))
    assert device.order == [rate, exposure]
    device.order.clear()
    camera.configure(replace(camera.settings, exposure_s=0.01, rate_hz=50.0))
    assert device.order == [exposure, rate]


def test_a_roi_lies_on_the_steps_of_its_corner_and_its_size(
    camera: HarvestersCamera, device: FakeGenTL
) -> None:
    settings = camera.settings
    made = camera.configure(replace(settings, roi=Roi(88, 10, 320, 200)))
    assert made.roi == Roi(88, 10, 320, 200)
    for wrong in (Roi(4, 10, 320, 200), Roi(88, 11, 320, 200), Roi(88, 10, 321, 200)):
        with pytest.raises(ConfigError, match=r"multiple|steps"):
            camera.configure(replace(settings, roi=wrong))
    assert camera.settings.roi == made.roi
    whole = camera.configure(replace(settings, roi=Roi(0, 0, 640, 480)))
    assert whole.roi == Roi(0, 0, 640, 480)
    moved = camera.configure(replace(settings, roi=Roi(320, 0, 320, 200)))
    wider = camera.configure(replace(moved, roi=Roi(8, 0, 624, 200)))
    assert wider.roi == Roi(8, 0, 624, 200)


def test_both_binnings_go_together(camera: HarvestersCamera, device: FakeGenTL) -> None:
    made = camera.configure(replace(camera.settings, binning=2, roi=Roi(0, 0, 320, 240)))
    nodes = device.node_map
    assert made.binning == nodes.BinningHorizontal.value == nodes.BinningVertical.value == 2
    with pytest.raises(ConfigError, match="320"):
        camera.configure(replace(made, roi=Roi(0, 0, 336, 240)))


def test_a_software_trigger_reaches_the_camera(camera: HarvestersCamera, device: FakeGenTL) -> None:
    assert camera.ranges.triggers == (Trigger.FREE_RUN, Trigger.SOFTWARE, Trigger.HARDWARE)
    with pytest.raises(NotAvailable, match="software"):
        camera.trigger()
    camera.configure(replace(camera.settings, trigger=Trigger.SOFTWARE))
    camera.start()
    camera.trigger()
    assert device.node_map.TriggerSoftware.count == 1
    assert device.node_map.TriggerSource.value == "Software"
    camera.stop()
    assert (
        camera.configure(replace(camera.settings, trigger=Trigger.HARDWARE)).trigger
        is Trigger.HARDWARE
    )
    assert device.node_map.TriggerSource.value == "Line1"


def test_what_the_camera_itself_refuses_is_put_back(
    camera: HarvestersCamera, device: FakeGenTL
) -> None:
    before = camera.settings
    device.broken.add(device.node_map.Gain)
    with pytest.raises(ConfigError, match=r"cam: configure: value 3"):
        camera.configure(replace(before, exposure_s=0.02, gain_db=3.0))
    device.broken.clear()
    assert camera.settings == before
    assert device.node_map.ExposureTime.value == pytest.approx(10_000.0)


def test_a_frame_outlives_its_buffer(camera: HarvestersCamera, device: FakeGenTL) -> None:
    buffer = image(12)
    device.buffers.append(buffer)
    camera.start()
    frame = camera.receive(0.0)
    assert frame is not None
    assert buffer.queued == 1
    assert np.all(frame.data == 7)
    assert (frame.frame_id, frame.device_ns) == (0, 5_000)


def test_a_colour_in_the_wrong_order_is_turned_round(
    camera: HarvestersCamera, device: FakeGenTL
) -> None:
    blue_green_red = np.zeros((480, 640, 3), np.uint8)
    blue_green_red[:] = (1, 2, 3)
    device.buffers.append(Buffer(0, blue_green_red, "BGR8", timestamp_ns=None))
    camera.start()
    frame = camera.receive(0.0)
    assert frame is not None
    assert frame.data[5, 6].tolist() == [3, 2, 1]
    assert frame.device_ns is None


@pytest.mark.parametrize(
    ("code", "red_row", "red_column"),
    [("BayerRG8", 0, 0), ("BayerGR8", 0, 1), ("BayerGB8", 1, 0), ("BayerBG8", 1, 1)],
)
def test_colours_are_made_of_a_raw_mosaic(
    camera: HarvestersCamera, device: FakeGenTL, code: str, red_row: int, red_column: int
) -> None:
    mosaic = np.full((480, 640), 40, np.uint8)
    mosaic[red_row::2, red_column::2] = 200
    mosaic[1 - red_row :: 2, 1 - red_column :: 2] = 90
    device.buffers.append(Buffer(0, mosaic, code))
    camera.start()
    frame = camera.receive(0.0)
    assert frame is not None
    assert frame.pixel_format is PixelFormat.RGB8
    assert frame.data.shape == (480, 640, 3)
    assert frame.data[100, 200].tolist() == [200, 40, 90]


def test_gaps_in_the_numbers_are_counted_also_where_they_begin_anew(
    camera: HarvestersCamera, device: FakeGenTL
) -> None:
    device.buffers += [image(number) for number in (65530, 65533, 65535, 1, 2)]
    camera.start()
    ids = [frame.frame_id for _ in range(5) if (frame := camera.receive(0.0)) is not None]
    assert ids == [0, 3, 5, 6, 7]
    assert (camera.counters.completed, camera.counters.lost) == (5, 3)


def test_a_frame_with_parts_missing_is_counted_and_not_taken_for_good(
    camera: HarvestersCamera, device: FakeGenTL, monkeypatch: pytest.MonkeyPatch
) -> None:
    camera.start()
    device.buffers.append(image(1))
    camera.receive(0.0)

    def incomplete(*, timeout: float) -> None:
        camera.count_incomplete()

    with monkeypatch.context() as patch:
        patch.setattr(device, "try_fetch", incomplete)
        frame = camera.receive(0.0)
    assert frame is not None
    assert (frame.status, frame.frame_id) == (FrameStatus.INCOMPLETE, 1)
    device.buffers.append(image(3))
    after = camera.receive(0.0)
    assert after is not None and after.frame_id == 2
    assert (camera.counters.failed, camera.counters.lost) == (1, 0)


def test_a_camera_that_fails_ends_the_reception(
    camera: HarvestersCamera, device: FakeGenTL
) -> None:
    camera.start()
    device.buffers.append(NodeError("cable"))
    with pytest.raises(DeviceError, match="cam is gone: cable"):
        camera.receive(1.0)
    camera.close()
    assert not device.running


def test_a_camera_that_goes_silent_ends_the_reception(
    camera: HarvestersCamera, device: FakeGenTL
) -> None:
    camera.start()
    assert camera.receive(0.0) is None
    device.there = False
    with pytest.raises(DeviceError, match="does not answer"):
        camera.receive(5.0)


# --- the library ------------------------------------------------------------------------------


def test_without_the_package_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "harvesters", None)
    with pytest.raises(NotConnectedError, match="gentl"):
        HarvestersLibrary(producers=["any.cti"])


def test_a_producer_that_is_not_there_is_named(tmp_path: Path) -> None:
    pytest.importorskip("harvesters")
    with pytest.raises(NotConnectedError, match=r"none\.cti"):
        HarvestersLibrary(producers=[tmp_path / "none.cti"])


def test_ctrl_c_stays_as_it_was_and_a_camera_opens_only_once() -> None:
    if HarvestersRig.missing():
        pytest.skip(HarvestersRig.missing())
    before = signal.getsignal(signal.SIGINT)
    with HarvestersRig() as rig, rig.opened() as camera:
        assert signal.getsignal(signal.SIGINT) is before
        with pytest.raises(NotConnectedError, match=camera.info.key):
            rig.library.open(camera.info.key)
