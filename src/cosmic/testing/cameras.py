"""The contract of a `Camera`, as a suite for pytest.

A package that brings one derives from `CameraContract` and says how its library is made over a
fake::

    class TestMyCamera(CameraContract):
        def make_library(self) -> CameraLibrary:
            return MyLibrary(FakeDevice(WALL), WALL)
"""

import math
from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest

from cosmic.frame.clock import WALL
from cosmic.frame.errors import CosmicError, DeviceError, NotConnectedError
from cosmic.vico.hw.interface import Camera, CameraLibrary, Frame, FrameStatus, PixelFormat


class CameraContract:
    """What ViCo relies on in any camera.

    Attributes
    ----------
    first_image_s : float
        How long the first image may take, in wall time.
    """

    first_image_s: ClassVar[float] = 5.0

    @abstractmethod
    def make_library(self) -> CameraLibrary:
        """Return the library over its fake."""

    def key(self, library: CameraLibrary) -> str:
        """Return which camera is tested: the first one."""
        return library.cameras()[0].key

    @pytest.fixture
    def library(self) -> Iterator[CameraLibrary]:
        """The library; closed afterwards."""
        made = self.make_library()
        yield made
        made.close()

    @pytest.fixture
    def camera(self, library: CameraLibrary) -> Iterator[Camera]:
        """The camera, open; closed afterwards."""
        opened = library.open(self.key(library))
        yield opened
        opened.close()

    def frames(self, camera: Camera, count: int) -> list[Frame]:
        """Return the next frames that are complete."""
        found: list[Frame] = []
        ends_s = WALL.now_s() + self.first_image_s + 2.0 * count / max(camera.settings.rate_hz, 1.0)
        while len(found) < count and WALL.now_s() < ends_s:
            frame = camera.receive(0.5)
            if frame is not None and frame.status is FrameStatus.COMPLETE:
                found.append(frame)
        assert len(found) == count, f"{len(found)} of {count} images came"
        return found

    def test_the_library_lists_its_camera_and_says_its_own_name(
        self, library: CameraLibrary, camera: Camera
    ) -> None:
        assert library.name
        listed = {each.key: each for each in library.cameras()}
        there = listed[camera.info.key]
        assert (there.model, there.serial) == (camera.info.model, camera.info.serial)
        assert min(camera.info.sensor_px) > 0

    def test_a_camera_that_is_not_there_is_named_with_those_that_are(
        self, library: CameraLibrary
    ) -> None:
        with pytest.raises(NotConnectedError) as caught:
            library.open("no such camera")
        assert "no such camera" in str(caught.value)
        assert self.key(library) in str(caught.value)

    def test_a_frame_has_shape_and_type_of_its_settings_in_each_format(
        self, camera: Camera
    ) -> None:
        for pixel_format in camera.ranges.pixel_formats:
            settings = camera.configure(replace(camera.settings, pixel_format=pixel_format))
            camera.start()
            (frame,) = self.frames(camera, 1)
            camera.stop()
            assert isinstance(frame.data, np.ndarray)
            layers = (3,) if pixel_format is PixelFormat.RGB8 else ()
            assert frame.data.shape == (settings.roi.height_px, settings.roi.width_px, *layers)
            eight = pixel_format in (PixelFormat.MONO8, PixelFormat.RGB8)
            assert frame.data.dtype == (np.uint8 if eight else np.uint16)
            assert frame.pixel_format is settings.pixel_format is pixel_format
            assert frame.size_px == (settings.roi.width_px, settings.roi.height_px)

    def test_frames_are_read_only_and_never_written_to_again(self, camera: Camera) -> None:
        camera.start()
        first, *rest = self.frames(camera, 3)
        kept = first.data.copy()
        assert not first.data.flags.writeable
        self.frames(camera, 2)
        assert (first.data == kept).all()
        assert all(each.data is not first.data for each in rest)

    def test_frame_numbers_rise_and_gaps_are_counted(self, camera: Camera) -> None:
        camera.start()
        numbers = [each.frame_id for each in self.frames(camera, 5)]
        assert numbers == sorted(set(numbers))
        missing = numbers[-1] - numbers[0] + 1 - len(numbers)
        assert camera.counters.lost + camera.counters.failed >= missing
        assert camera.counters.completed >= 5

    def test_an_exposure_lies_before_its_frame(self, camera: Camera) -> None:
        camera.start()
        for frame in self.frames(camera, 2):
            assert frame.exposed_s <= frame.time_s

    def test_nothing_comes_before_the_start_or_after_the_stop(self, camera: Camera) -> None:
        assert camera.receive(0.0) is None
        camera.start()
        self.frames(camera, 1)
        camera.stop()
        camera.stop()
        assert camera.receive(0.0) is None

    def test_a_new_start_counts_anew(self, camera: Camera) -> None:
        for _ in range(2):
            camera.start()
            assert self.frames(camera, 1)[0].frame_id < 5
            camera.stop()

    def test_settings_in_force_are_accepted_again(self, camera: Camera) -> None:
        before = camera.settings
        assert camera.configure(before) == before

    def test_what_it_cannot_take_is_refused_and_changes_nothing(self, camera: Camera) -> None:
        before = camera.settings
        wrong = [
            replace(before, exposure_s=math.nan),
            replace(before, exposure_s=-1.0),
            replace(before, rate_hz=1e9),
            replace(before, binning=77),
            replace(before, roi=replace(before.roi, width_px=10**6)),
        ]
        for each in wrong:
            with pytest.raises(CosmicError):
                camera.configure(each)
        assert camera.settings == before

    def test_a_closed_camera_stays_closed_and_can_be_opened_again(
        self, library: CameraLibrary
    ) -> None:
        key = self.key(library)
        camera = library.open(key)
        camera.start()
        camera.close()
        camera.close()
        camera.stop()
        for attempt in (camera.start, lambda: camera.configure(camera.settings)):
            with pytest.raises(DeviceError):
                attempt()
        again = library.open(key)
        again.start()
        self.frames(again, 1)
        again.close()
