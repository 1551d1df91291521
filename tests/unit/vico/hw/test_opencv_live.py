"""USB cameras through OpenCV, over a stand-in for the device: no real one was at hand."""

import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import pytest

from cosmic.frame.clock import RatedClock
from cosmic.frame.errors import ConfigError, DeviceError, NotConnectedError
from cosmic.vico.hw.interface import Camera, PixelFormat, VideoSource
from cosmic.vico.hw.opencv import OpenCvLibrary
from unit.vico.hw.fake_capture import FakeDevice


@pytest.fixture
def sysfs(tmp_path: Path) -> Path:
    for number, index, name in ((2, 0, "HD Webcam"), (3, 1, "HD Webcam"), (10, 0, "Microscope")):
        folder = tmp_path / "class" / f"video{number}"
        (folder / "device").mkdir(parents=True)
        (folder / "index").write_text(f"{index}\n")
        (folder / "name").write_text(f"{name}\n")
    return tmp_path / "class"


@pytest.fixture
def device() -> FakeDevice:
    return FakeDevice()


@pytest.fixture
def camera(sysfs: Path, device: FakeDevice) -> Iterator[Camera]:
    library = OpenCvLibrary(RatedClock(), sysfs=sysfs, make_capture=device.make)
    yield library.open("video2")
    library.close()


def test_linux_lists_a_camera_once_and_not_its_metadata(sysfs: Path) -> None:
    found = OpenCvLibrary(sysfs=sysfs).cameras()
    assert [(each.key, each.model) for each in found] == [
        ("video2", "HD Webcam"),
        ("video10", "Microscope"),
    ]


def test_a_device_that_is_not_there_is_not_tried(sysfs: Path, device: FakeDevice) -> None:
    library = OpenCvLibrary(sysfs=sysfs, make_capture=device.make)
    with pytest.raises(NotConnectedError, match=r"'video7'.*video2, video10"):
        library.open("video7")


def test_a_device_that_another_program_has_says_so(sysfs: Path, device: FakeDevice) -> None:
    device.unplug()
    library = OpenCvLibrary(sysfs=sysfs, make_capture=device.make)
    with pytest.raises(NotConnectedError, match=r"video2.*no other program"):
        library.open("video2")


def test_images_from_before_the_start_are_left_out(camera: Camera, device: FakeDevice) -> None:
    camera.start()
    received = threading.Event()
    frames = []

    def receive() -> None:
        frames.append(camera.receive(10.0))
        received.set()

    waiting = threading.Thread(target=receive)
    waiting.start()
    while not received.wait(0.02):
        if not device.ready:
            device.take()
    waiting.join()
    frame = frames[0]
    assert frame is not None
    assert frame.data.max() > 4  # one was read to open it, and three more lay in the driver
    assert frame.frame_id == 0
    assert frame.device_ns is not None
    assert frame.pixel_format is PixelFormat.RGB8
    assert frame.exposed_s < frame.time_s - camera.settings.exposure_s


def test_a_stop_ends_the_wait_for_a_device(camera: Camera) -> None:
    camera.start()
    waiting = threading.Thread(target=camera.receive, args=(30.0,))
    waiting.start()
    camera.stop()
    waiting.join(5.0)
    assert not waiting.is_alive()


def test_an_unplugged_device_ends_the_reception(camera: Camera, device: FakeDevice) -> None:
    camera.start()
    device.unplug()
    for _ in range(2):  # nothing more comes from it
        with pytest.raises(DeviceError, match="video2 is gone"):
            camera.receive(5.0)


def test_exposure_is_taken_over_and_read_back(camera: Camera, device: FakeDevice) -> None:
    assert device.values[cv2.CAP_PROP_AUTO_EXPOSURE] == 1.0
    assert camera.settings.exposure_s == pytest.approx(0.01)
    made = camera.configure(replace(camera.settings, exposure_s=0.02, rate_hz=15.0))
    assert device.values[cv2.CAP_PROP_EXPOSURE] == 200.0
    assert (made.exposure_s, made.rate_hz) == (pytest.approx(0.02), 15.0)


@pytest.mark.parametrize(
    ("prop", "what"), [(cv2.CAP_PROP_EXPOSURE, "exposure"), (cv2.CAP_PROP_FPS, "rate")]
)
def test_a_value_that_nothing_came_of_is_refused(
    camera: Camera, device: FakeDevice, prop: int, what: str
) -> None:
    before = camera.settings
    device.stubborn.add(prop)
    _expect_refusal(camera, device, what)
    assert camera.settings == before


@pytest.mark.parametrize(
    ("prop", "what", "most"),
    [(cv2.CAP_PROP_EXPOSURE, "exposure", 150.0), (cv2.CAP_PROP_FPS, "rate", 35.0)],
)
def test_a_value_that_the_device_clips_is_put_back(
    camera: Camera, device: FakeDevice, prop: int, what: str, most: float
) -> None:
    before = camera.settings
    device.most[prop] = most
    _expect_refusal(camera, device, what)
    assert camera.settings == before


def _expect_refusal(camera: Camera, device: FakeDevice, what: str) -> None:
    with pytest.raises(ConfigError, match=what):
        camera.configure(replace(camera.settings, exposure_s=0.02, rate_hz=40.0))
    assert device.values[cv2.CAP_PROP_FPS] == 30.0
    assert device.values[cv2.CAP_PROP_EXPOSURE] == 100.0


def test_a_device_without_exposure_says_that_it_has_none(sysfs: Path) -> None:
    device = FakeDevice(exposure=-1.0)
    library = OpenCvLibrary(RatedClock(), sysfs=sysfs, make_capture=device.make)
    camera = library.open("video2")
    assert camera.ranges.exposure_s is None
    with pytest.raises(ConfigError, match="exposure"):
        camera.configure(replace(camera.settings, exposure_s=0.01))
    library.close()


def test_the_size_that_is_asked_reaches_the_device(sysfs: Path, device: FakeDevice) -> None:
    source = VideoSource("video2", size_px=(1280, 720))
    library = OpenCvLibrary(sysfs=sysfs, sources=[source], make_capture=device.make)
    library.open("video2")
    library.close()
    assert device.values[cv2.CAP_PROP_FRAME_WIDTH] == 1280.0
