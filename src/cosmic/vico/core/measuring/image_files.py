"""Images of other programs, with the pixel size that their metadata state."""

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from cosmic.frame.errors import ConfigError, RecordingError
from cosmic.vico.core.measuring.file_image import FileImage as FileImage
from cosmic.vico.core.measuring.file_image import Refused, reading, refuse
from cosmic.vico.core.measuring.pixel_sizes import NOT_KNOWN, png_size
from cosmic.vico.core.measuring.tiff_files import tiff_pages

TIFF = (".tif", ".tiff")
VIDEO = (".avi", ".mkv", ".mov", ".mp4")
SUFFIXES = (*TIFF, ".png", ".jpg", ".jpeg", *VIDEO)
JPEG_HEAD, JPEG_SCAN, JPEG_END = b"\xff\xd8", b"\xff\xda", b"\xff\xd9"


def read_images(path: Path, every: int = 1, refused: Refused | None = None) -> Iterator[FileImage]:
    """Yield the pages of a TIFF, PNG or JPEG, or each `every`-th image of a video.

    Parameters
    ----------
    refused : callable, optional
        Is called with the error of a page that cannot be read, and the others are yielded; without
        it the error is raised.

    Raises
    ------
    ConfigError
        `every` is less than 1.
    RecordingError
        It cannot be read, or is of another kind.
    """
    if not every >= 1:
        raise ConfigError(f"of a video each N-th image is read, from N = 1 on, not {every}")
    _check_there(path)
    if path.suffix.lower() in VIDEO:
        yield from _video_images(path, every, refused)
    elif path.suffix.lower() in TIFF:
        yield from tiff_pages(path, refused)
    else:
        yield _still(path)


def _check_there(path: Path) -> None:
    try:
        there, folder, kept = path.exists(), path.is_dir(), path.is_file()
        empty = kept and not path.stat().st_size
    except (OSError, ValueError) as exc:  # a name that no file can have
        why = getattr(exc, "strerror", None) or exc
        raise RecordingError(f"{str(path)[:80]}: cannot be read ({why})") from exc
    kinds = "" if path.suffix.lower() in SUFFIXES else f"is not one of {', '.join(SUFFIXES)}"
    if not there:
        raise RecordingError(f"{path}: is missing" + (f", and {kinds}" if kinds else ""))
    if folder:
        raise RecordingError(f"{path}: is a folder, not an image")
    if kinds:
        raise RecordingError(f"{path}: {kinds}")
    if not kept:  # reading a pipe would wait for whoever writes to it
        raise RecordingError(f"{path}: is a pipe or a device, not an image")
    if empty:
        raise RecordingError(f"{path}: is empty; copy it again from where it was made")


def _still(path: Path) -> FileImage:
    with reading(str(path)):
        coded = path.read_bytes()
        pixels = cv2.imdecode(np.frombuffer(coded, np.uint8), cv2.IMREAD_UNCHANGED)
    if pixels is None:
        raise RecordingError(f"{path}: is not an image, or damaged")
    # OpenCV makes grey of what is missing at the end of a JPEG.
    if coded.startswith(JPEG_HEAD) and JPEG_END not in coded[coded.rfind(JPEG_SCAN) :]:
        raise RecordingError(f"{path}: is cut off; copy it again from where it was made")
    size = png_size(coded)
    return FileImage(path.name, pixels, size.um, size.source)


def _video_images(path: Path, every: int, refused: Refused | None) -> Iterator[FileImage]:
    """Yield images of a video one after another; it says nothing of its pixel size."""
    with reading(str(path)):
        video = cv2.VideoCapture(str(path))
    number = lost = 0
    try:
        declared = video.get(cv2.CAP_PROP_FRAME_COUNT)
        with reading(str(path)):
            while video.grab():
                number += 1
                if (number - 1) % every:
                    continue
                done, pixels = video.retrieve()
                if not done:
                    lost += 1
                    continue
                name = f"{path.name} image {number}"
                yield FileImage(name, np.asarray(pixels), None, NOT_KNOWN, number=number)
    finally:
        video.release()
    if not number:
        raise RecordingError(f"{path}: is not a video that can be read, or damaged")
    # Matroska has no number of images: OpenCV rounds one from the duration.
    rounded = 1 if path.suffix.lower() == ".mkv" else 0
    if lost or number < declared - rounded:
        problem = (
            f"{path}: is not complete: it declares {declared:.0f} images, and {number - lost} can "
            "be read; copy it again from where it was made"
        )
        refuse(RecordingError(problem), refused)
