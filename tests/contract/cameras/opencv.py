"""Cameras through OpenCV: a video file, a folder of images, an address on loopback."""

import tempfile
from pathlib import Path
from typing import Self

import cv2
import numpy as np
from typing_extensions import override

from contract.cameras import CameraRig, Can
from contract.cameras.mjpeg_server import MjpegServer
from cosmic.vico.hw.interface import Roi, VideoSource
from cosmic.vico.hw.opencv import OpenCvLibrary

WIDTH, HEIGHT = 160, 120


def pattern(number: int) -> np.ndarray:
    """Return a grey image that no other number has."""
    image = np.add.outer(np.arange(HEIGHT), np.arange(WIDTH)) + 7 * number
    return (image % 256).astype(np.uint8)


def write_film(path: Path, count: int = 60, *, rate_hz: float = 100.0, codec: str = "FFV1") -> None:
    writer = cv2.VideoWriter(
        str(path), cv2.VideoWriter.fourcc(*codec), rate_hz, (WIDTH, HEIGHT), isColor=False
    )
    assert writer.isOpened()
    for number in range(count):
        writer.write(pattern(number))
    writer.release()


def write_images(folder: Path, count: int = 20) -> None:
    folder.mkdir()
    for number in range(count):
        assert cv2.imwrite(str(folder / f"{number:04d}.png"), pattern(number))


class FilmRig(CameraRig):
    name = "opencv-film"
    two = True
    can = frozenset({Can.RATE, Can.ROI})
    rate_hz = 100.0
    roi = Roi(8, 16, 64, 48)
    quiet_rate_hz = 0.05

    @override
    def __enter__(self) -> Self:
        self._folder = tempfile.TemporaryDirectory()
        self.place = Path(self._folder.name)
        self.key, self.other_key = (str(each) for each in self.make())
        sources = [VideoSource(key, loop=True) for key in (self.key, self.other_key)]
        self.library = OpenCvLibrary(self.clock, sources=sources)
        return self

    @override
    def __exit__(self, *exc: object) -> None:
        super().__exit__(*exc)
        self._folder.cleanup()

    def make(self) -> tuple[Path, Path]:
        paths = (self.place / "one.mkv", self.place / "other.mkv")
        for path in paths:
            write_film(path)
        return paths


class ImagesRig(FilmRig):
    name = "opencv-images"
    can = frozenset({Can.RATE, Can.ROI, Can.UNPLUG})

    @override
    def make(self) -> tuple[Path, Path]:
        paths = (self.place / "one", self.place / "other")
        for path in paths:
            write_images(path)
        return paths

    @override
    def unplug(self) -> None:
        Path(self.key).rename(self.place / "away")

    @override
    def plug_in(self) -> None:
        (self.place / "away").rename(self.key)


class AddressRig(CameraRig):
    name = "opencv-mjpeg"
    can = frozenset({Can.ROI, Can.UNPLUG})
    rate_hz = 100.0
    roi = Roi(8, 16, 64, 48)

    @override
    def __enter__(self) -> Self:
        self._images = [pattern(number) for number in range(20)]
        self._server = MjpegServer(self._images, rate_hz=self.rate_hz)
        self.key = self._server.address
        self.library = OpenCvLibrary(self.clock, sources=[self.key])
        return self

    @override
    def __exit__(self, *exc: object) -> None:
        super().__exit__(*exc)
        self._server.close()

    @override
    def unplug(self) -> None:
        self._server.close()

    @override
    def plug_in(self) -> None:
        self._server = MjpegServer(self._images, rate_hz=self.rate_hz, port=self._server.port)


RIGS = (FilmRig, ImagesRig, AddressRig)
