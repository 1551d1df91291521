"""What every camera has of its base, over a driver that does what it is told."""

import threading
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from typing_extensions import override

from cosmic.frame.clock import WALL
from cosmic.frame.errors import (
    ConfigError,
    DeviceError,
    DeviceFault,
    NotAvailable,
    NotConnectedError,
)
from cosmic.vico.hw.base_camera import BaseCamera, BaseCameraLibrary
from cosmic.vico.hw.interface import (
    CameraCounters,
    CameraInfo,
    CameraRanges,
    CameraSettings,
    Frame,
    FrameStatus,
    Range,
    Roi,
)

INFO = CameraInfo(key="K", vendor="V", model="M", serial="1")


class ScriptedCamera(BaseCamera):
    """Gives the frames that a test puts in, and fails when the test says so."""

    quiet_s = 0.02

    def __init__(self, library: "ScriptedLibrary") -> None:
        super().__init__(INFO, WALL, closed=library._forget)
        self.frames: list[Frame | DeviceError] = []
        self.written: list[CameraSettings] = []
        self.refused: DeviceError | None = None
        self.gone = ""
        self.calls: list[str] = []
        self._in_force = CameraSettings(0.01, 0.0, 10.0, Roi(0, 0, 4, 3))
        self._opened((4, 3))

    @override
    def _read(self) -> CameraSettings:
        return self._in_force

    @override
    def _read_ranges(self) -> CameraRanges:
        sizes = (Range(1, 4, 1), Range(1, 3, 1))
        return CameraRanges(Range(1e-3, 1.0), Range(0.0, 12.0), Range(1.0, 50.0), *sizes)

    @override
    def _write(self, asked: CameraSettings, present: CameraSettings | None) -> None:
        self.written.append(asked)
        self._in_force = asked
        if self.refused is not None and present is not None:
            raise self.refused

    @override
    def _begin(self) -> None:
        self.calls.append("begin")

    @override
    def _fetch(self, wait_s: float) -> Frame | None:
        if not self.frames:
            self._stopping.wait(wait_s)
            return None
        found = self.frames.pop(0)
        if isinstance(found, DeviceError):
            raise found
        return found

    @override
    def _end(self) -> None:
        self.calls.append("end")
        if self.gone:
            raise DeviceError("nobody heard it")

    @override
    def _release(self) -> None:
        self.calls.append("release")

    @override
    def _loss(self) -> str:
        return self.gone


class ScriptedLibrary(BaseCameraLibrary[ScriptedCamera]):
    name = "scripted"

    @override
    def cameras(self) -> tuple[CameraInfo, ...]:
        return (INFO,)

    @override
    def _open(self, key: str) -> ScriptedCamera:
        if key != INFO.key:
            raise self._not_there(key, [INFO.key], "Plug it in")
        return ScriptedCamera(self)

    @override
    def _shut(self) -> None:
        """Nothing is held."""


@pytest.fixture
def library() -> Iterator[ScriptedLibrary]:
    made = ScriptedLibrary()
    yield made
    made.close()


@pytest.fixture
def camera(library: ScriptedLibrary) -> ScriptedCamera:
    return library.open("K")


def frame(number: int, status: FrameStatus = FrameStatus.COMPLETE) -> Frame:
    return Frame(np.zeros((3, 4), np.uint8), number, 0.0, 0.0, status=status)


def test_frames_are_counted_by_their_numbers_and_their_state(camera: ScriptedCamera) -> None:
    camera.start()
    camera.frames = [frame(0), frame(3), frame(4, FrameStatus.INCOMPLETE), frame(5)]
    while camera.receive(0.0) is not None:
        pass
    assert camera.counters == CameraCounters(completed=3, failed=1, lost=2)
    camera.stop()
    camera.start()
    assert camera.counters == CameraCounters()


def test_a_value_that_the_camera_refuses_puts_back_what_was(camera: ScriptedCamera) -> None:
    before = camera.settings
    camera.refused = DeviceError("not that", fault=DeviceFault.PARAMETER)
    with pytest.raises(ConfigError, match="not that"):
        camera.configure(replace(before, gain_db=3.0))
    assert camera.settings == before
    assert camera.written[-1] == before


def test_a_camera_that_fails_while_it_is_set_is_not_said_to_refuse(camera: ScriptedCamera) -> None:
    camera.refused = DeviceError("cable", fault=DeviceFault.COMMUNICATION)
    with pytest.raises(DeviceError, match="cable"):
        camera.configure(replace(camera.settings, gain_db=3.0))


def test_settings_out_of_range_never_reach_the_driver(camera: ScriptedCamera) -> None:
    for wrong in ({"gain_db": 13.0}, {"exposure_s": 0.2}, {"roi": Roi(1, 0, 4, 3)}):
        with pytest.raises(ConfigError):
            camera.configure(replace(camera.settings, **wrong))
    assert not camera.written


def test_a_failure_is_raised_again_until_the_camera_is_closed(camera: ScriptedCamera) -> None:
    camera.start()
    camera.frames = [DeviceError("cable"), frame(0)]
    for attempt in (lambda: camera.receive(1.0), lambda: camera.receive(1.0), camera.start):
        with pytest.raises(DeviceError, match="cable"):
            attempt()
    camera.close()
    assert camera.calls == ["begin", "end", "release"]


def test_a_quiet_camera_is_asked_and_closed_when_it_is_gone(camera: ScriptedCamera) -> None:
    camera.start()
    assert camera.receive(0.1) is None
    camera.gone = "it was unplugged"
    with pytest.raises(NotConnectedError, match="K is gone: it was unplugged"):
        camera.receive(5.0)
    camera.stop()  # that nobody hears it is no error


def test_a_stop_ends_a_long_wait_at_once(camera: ScriptedCamera) -> None:
    camera.start()
    got: list[Frame | None] = []
    waiting = threading.Thread(target=lambda: got.append(camera.receive(60.0)))
    waiting.start()
    camera.stop()
    waiting.join(10.0)
    assert got == [None]


def test_a_camera_that_runs_cannot_be_started(camera: ScriptedCamera) -> None:
    camera.start()
    with pytest.raises(DeviceError, match="already") as caught:
        camera.start()
    assert caught.value.fault is DeviceFault.STATE


def test_a_camera_without_a_software_trigger_says_so(camera: ScriptedCamera) -> None:
    with pytest.raises(NotAvailable, match="no software trigger"):
        camera.trigger()


def test_a_library_closes_what_is_open_and_opens_nothing_more(
    library: ScriptedLibrary, camera: ScriptedCamera
) -> None:
    other = library.open("K")
    other.close()
    camera.start()
    library.close()
    assert camera.calls == ["begin", "end", "release"]
    assert other.calls == ["release"]
    with pytest.raises(NotConnectedError, match="closed"):
        library.open("K")


def test_a_camera_that_is_not_there_is_named_with_those_that_are(library: ScriptedLibrary) -> None:
    with pytest.raises(NotConnectedError, match=r"'X'; it finds: K\. Plug it in"):
        library.open("X")
