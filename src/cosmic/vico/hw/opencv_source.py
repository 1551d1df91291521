"""Where OpenCV gets images from, and how it hands them over.

USB cameras and network addresses are captures; video files and folders of images are films.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
import numpy.typing as npt
from typing_extensions import override

from cosmic.frame.errors import DeviceError, DeviceFault, NotConnectedError
from cosmic.vico.hw.interface import CameraInfo, Kind, PixelFormat, Pixels, Roi, VideoSource

SYSFS: Final = Path("/sys/class/video4linux")
SILENCE_S: Final = 1.5
"""After so long without an image a camera counts as gone."""

_IMAGES_HZ: Final = 15.0
_ENDINGS: Final = (".png", ".tif", ".tiff", ".bmp", ".jpg", ".jpeg", ".pgm", ".ppm")

Raw = Pixels
MakeCapture = Callable[..., Any]


def attached_devices(sysfs: Path = SYSFS) -> tuple[CameraInfo, ...]:
    """Return the video devices that Linux knows; none on other systems.

    A camera shows up twice or more, once for its images (index 0) and once for its metadata.
    """
    found = []
    for folder in sorted(sysfs.glob("video*"), key=lambda each: (len(each.name), each.name)):
        if _text(folder / "index") not in ("", "0"):
            continue
        usb = folder / "device" / ".."
        found.append(
            CameraInfo(
                key=folder.name,
                vendor=_text(usb / "manufacturer") or "video4linux",
                model=_text(folder / "name") or folder.name,
                serial=_text(usb / "serial"),
            )
        )
    return tuple(found)


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return ""


class Film(ABC):
    """Images in their order; one thread.

    Attributes
    ----------
    first : ndarray
        Its first image, as OpenCV reads it.
    rate_hz : float
        Its own rate.
    """

    first: Raw
    rate_hz: float

    @abstractmethod
    def read(self) -> Raw | None:
        """Return the next image, None at the end; raises `DeviceError` for a broken one."""

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
            raise _unreadable(path, "OpenCV finds no images that it can decode in it")
        self.first = first
        rate_hz = float(self._capture.get(cv2.CAP_PROP_FPS))
        self.rate_hz = rate_hz if 0.0 < rate_hz < 1e4 else _IMAGES_HZ
        self.rewind()

    @override
    def read(self) -> Raw | None:
        there, image = self._capture.read()
        return image if there else None

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


class ImageFilm(Film):
    """A folder of images of one size, in the order of their names."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._paths = sorted(
            each for each in folder.iterdir() if each.suffix.lower() in _ENDINGS and each.is_file()
        )
        if not self._paths:
            raise _unreadable(folder, f"it holds no images ({', '.join(_ENDINGS)})")
        self.rate_hz = _IMAGES_HZ
        self._next = 0
        first = _decoded(self._paths[0])
        if first is None:
            raise _unreadable(self._paths[0], "it is not an image of 8 or 16 bits")
        self.first = first

    @override
    def read(self) -> Raw | None:
        if self._next >= len(self._paths):
            return None
        path = self._paths[self._next]
        self._next += 1
        if not path.is_file():
            raise _gone(path)
        image = _decoded(path)
        if image is None or image.dtype != self.first.dtype:
            raise _unreadable(path, "it cannot be decoded, or its depth differs from the first")
        return image

    @override
    def rewind(self) -> None:
        self._next = 0

    @override
    def close(self) -> None:
        self._paths = []


def open_film(source: VideoSource) -> Film:
    """Open a film or a folder of images.

    Raises
    ------
    NotConnectedError
        It is not there or cannot be read.
    """
    path = Path(source.address)
    if not path.exists():
        raise _gone(path)
    return ImageFilm(path) if source.kind is Kind.IMAGES else VideoFilm(path)


def _decoded(path: Path) -> Raw | None:
    try:
        # OpenCV itself opens no path with other letters than ASCII on Windows.
        data = np.fromfile(path, np.uint8)
        image: Any = cv2.imdecode(data, cv2.IMREAD_UNCHANGED) if data.size else None
    except (OSError, cv2.error):  # it may not be read, or says that it has too many pixels
        return None
    known = image is not None and image.dtype in (np.uint8, np.uint16)
    return image if known else None


def _gone(path: Path) -> NotConnectedError:
    return NotConnectedError(
        f"{path}: the file is not there any more", fault=DeviceFault.COMMUNICATION
    )


def _unreadable(path: Path, why: str) -> DeviceError:
    return NotConnectedError(f"{path}: {why}", fault=DeviceFault.UNSUPPORTED)


def open_capture(source: VideoSource, make: MakeCapture) -> Any:
    """Open a device or an address.

    Raises
    ------
    NotConnectedError
        It does not open.
    """
    if source.kind is Kind.DEVICE:
        capture = make(source.device)
        if capture.isOpened() and source.size_px is not None:
            capture.set(cv2.CAP_PROP_FRAME_WIDTH, source.size_px[0])
            capture.set(cv2.CAP_PROP_FRAME_HEIGHT, source.size_px[1])
    else:
        limit_ms = int(SILENCE_S * 1000)
        capture = make(
            source.address,
            cv2.CAP_FFMPEG,
            [
                cv2.CAP_PROP_OPEN_TIMEOUT_MSEC,
                limit_ms,
                cv2.CAP_PROP_READ_TIMEOUT_MSEC,
                limit_ms,
            ],
        )
    if not capture.isOpened():
        capture.release()
        raise NotConnectedError(
            f"{source.address}: the {source.kind} does not open; check that it is there and that "
            f"no other program uses it",
            fault=DeviceFault.COMMUNICATION,
        )
    return capture


def formats_of(image: Pixels) -> tuple[PixelFormat, ...]:
    """Return what an image can be made into, the format nearest to its own first."""
    if image.dtype == np.uint16:
        return (PixelFormat.MONO16, PixelFormat.MONO8)
    if image.ndim == 2:
        return (PixelFormat.MONO8, PixelFormat.RGB8)
    return (PixelFormat.RGB8, PixelFormat.MONO8)


def made_of(image: Pixels, pixel_format: PixelFormat, roi: Roi) -> Pixels:
    """Return a read-only copy of the part `roi` in `pixel_format`."""
    part = image[roi.y_px : roi.y_px + roi.height_px, roi.x_px : roi.x_px + roi.width_px]
    shaped = _layers(part, colour=pixel_format is PixelFormat.RGB8)
    wide = pixel_format is PixelFormat.MONO16
    if shaped.dtype == np.uint16 and not wide:
        shaped = shaped >> 8
    data: Any = np.array(shaped, np.uint16 if wide else np.uint8, order="C")
    data.flags.writeable = False
    pixels: Pixels = data
    return pixels


def _layers(part: Pixels, *, colour: bool) -> npt.NDArray[Any]:
    if part.ndim == 2:
        return cv2.cvtColor(part, cv2.COLOR_GRAY2RGB) if colour else part
    clear = part.shape[2] == 4
    if colour:
        return cv2.cvtColor(part, cv2.COLOR_BGRA2RGB if clear else cv2.COLOR_BGR2RGB)
    return cv2.cvtColor(part, cv2.COLOR_BGRA2GRAY if clear else cv2.COLOR_BGR2GRAY)
