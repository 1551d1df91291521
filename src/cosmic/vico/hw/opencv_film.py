"""Films and folders of pictures, read one picture after the other."""

from abc import ABC, abstractmethod
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from typing_extensions import override

from cosmic.frame.errors import DeviceError, DeviceFault, NotConnectedError
from cosmic.vico.hw.interface import Pixels
from cosmic.vico.hw.opencv_source import Kind, VideoSource

PICTURES_HZ: Final = 15.0
_ENDINGS: Final = (".png", ".tif", ".tiff", ".bmp", ".jpg", ".jpeg", ".pgm", ".ppm")

Raw = Pixels


class Film(ABC):
    """Pictures in their order; one thread.

    Attributes
    ----------
    first : ndarray
        Its first picture, as OpenCV reads it.
    rate_hz : float
        Its own rate.
    """

    first: Raw
    rate_hz: float

    @abstractmethod
    def read(self) -> Raw | None:
        """Return the next picture, None at the end; raises `DeviceError` for a broken one."""

    @abstractmethod
    def rewind(self) -> None:
        """Begin anew; raises `DeviceError` when the file is gone."""

    @abstractmethod
    def close(self) -> None:
        """Give the file back."""


class VideoFilm(Film):
    """A video file."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._capture: Any = cv2.VideoCapture(str(path))
        first = self.read() if self._capture.isOpened() else None
        if first is None:
            self.close()
            raise _unreadable(path, "OpenCV finds no pictures that it can decode in it")
        self.first = first
        rate_hz = float(self._capture.get(cv2.CAP_PROP_FPS))
        self.rate_hz = rate_hz if 0.0 < rate_hz < 1e4 else PICTURES_HZ
        self.rewind()

    @override
    def read(self) -> Raw | None:
        there, picture = self._capture.read()
        return picture if there else None

    @override
    def rewind(self) -> None:
        # Opened anew: setting the position is inexact for films without key frames throughout.
        self._capture.release()
        self._capture = cv2.VideoCapture(str(self._path))
        if not self._capture.isOpened():
            raise _gone(self._path)

    @override
    def close(self) -> None:
        self._capture.release()


class PictureFilm(Film):
    """A folder of pictures of one size, in the order of their names."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._paths = sorted(
            each for each in folder.iterdir() if each.suffix.lower() in _ENDINGS and each.is_file()
        )
        if not self._paths:
            raise _unreadable(folder, f"it holds no pictures ({', '.join(_ENDINGS)})")
        self.rate_hz = PICTURES_HZ
        self._next = 0
        first = _decoded(self._paths[0])
        if first is None:
            raise _unreadable(self._paths[0], "it is no picture of 8 or 16 bits")
        self.first = first

    @override
    def read(self) -> Raw | None:
        if self._next >= len(self._paths):
            return None
        path = self._paths[self._next]
        self._next += 1
        if not path.is_file():
            raise _gone(path)
        picture = _decoded(path)
        if picture is None or picture.dtype != self.first.dtype:
            raise _unreadable(path, "it cannot be decoded, or its depth differs from the first")
        return picture

    @override
    def rewind(self) -> None:
        self._next = 0

    @override
    def close(self) -> None:
        self._paths = []


def open_film(source: VideoSource) -> Film:
    """Open a film or a folder of pictures.

    Raises
    ------
    NotConnectedError
        It is not there or cannot be read.
    """
    path = Path(source.address)
    if not path.exists():
        raise _gone(path)
    return PictureFilm(path) if source.kind is Kind.PICTURES else VideoFilm(path)


def _decoded(path: Path) -> Raw | None:
    picture: Any = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    known = picture is not None and picture.dtype in (np.uint8, np.uint16)
    return picture if known else None


def _gone(path: Path) -> NotConnectedError:
    return NotConnectedError(
        f"{path}: the file is not there any more", fault=DeviceFault.COMMUNICATION
    )


def _unreadable(path: Path, why: str) -> DeviceError:
    return NotConnectedError(f"{path}: {why}", fault=DeviceFault.UNSUPPORTED)
