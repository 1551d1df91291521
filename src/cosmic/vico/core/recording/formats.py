"""The formats that images are recorded in, and the names that recordings get."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Final

import numpy as np

from cosmic.frame.errors import RecordingError
from cosmic.frame.file_names import check_base_name, check_directory
from cosmic.vico.hw.interface import CameraSettings, PixelFormat, Pixels

SIDE_SUFFIX: Final = ".csv"


class ImageFormat(StrEnum):
    """How images are recorded."""

    FFV1 = "ffv1"
    FAST = "fast"
    SMALL = "small"
    STACK = "stack"
    ZARR = "zarr"
    TIFF = "tiff"
    PNG = "png"


@dataclass(frozen=True, slots=True)
class Traits:
    """What a format is like.

    Attributes
    ----------
    text : str
        What the operator reads.
    suffix : str
        Of the file, or of each image of a sequence.
    sequence : bool
        A directory with a file an image, not one file.
    store : bool
        A directory that is one thing to programs, with an ending of its own.
    lossless : bool
        Every pixel comes back as it was.
    ratio : float
        Bytes in the file to bytes of the pixels, about, to tell how long a disk lasts.
    codec, container : str
        As FFmpeg names them; empty for sequences.
    coded : mapping of PixelFormat to str
        FFmpeg's pixel format by the camera's; what is missing cannot be recorded.
    options : mapping of str to str
        Of the codec.
    threads : str
        What its threads share out, "SLICE" or "FRAME"; PyAV's default is slower by half.
    """

    text: str
    suffix: str
    lossless: bool
    ratio: float
    sequence: bool = False
    store: bool = False
    codec: str = ""
    container: str = ""
    coded: Mapping[PixelFormat, str] | None = None
    options: Mapping[str, str] | None = None
    threads: str = "SLICE"

    def holds(self, pixel_format: PixelFormat) -> bool:
        """Return whether images of `pixel_format` can be recorded."""
        return self.coded is None or pixel_format in self.coded


def _coded(mono8: str, mono16: str, rgb8: str) -> dict[PixelFormat, str]:
    # 10 and 12 bits go as 16: FFmpeg would stretch them where it converts, and values must stay.
    deep = (PixelFormat.MONO10, PixelFormat.MONO12, PixelFormat.MONO16)
    found = {PixelFormat.MONO8: mono8, PixelFormat.RGB8: rgb8}
    return found | dict.fromkeys(deep, mono16) if mono16 else found


FORMATS: Final[Mapping[ImageFormat, Traits]] = {
    ImageFormat.FFV1: Traits(
        text="FFV1 in Matroska, lossless",
        suffix=".mkv",
        lossless=True,
        ratio=0.55,
        codec="ffv1",
        container="matroska",
        coded=_coded("gray", "gray16le", "bgr0"),
        options={"level": "3", "slices": "16", "slicecrc": "1", "g": "1"},
    ),
    ImageFormat.FAST: Traits(
        text="Huffman in NUT, lossless, for high frame rates",
        suffix=".nut",
        lossless=True,
        ratio=0.7,
        codec="ffvhuff",
        container="nut",
        coded=_coded("gray", "gray16le", "gbrp"),
        threads="FRAME",
    ),
    ImageFormat.SMALL: Traits(
        text="Motion JPEG in Matroska, small, 8 bits, not lossless",
        suffix=".mkv",
        lossless=False,
        ratio=0.15,
        codec="mjpeg",
        container="matroska",
        coded=_coded("yuvj420p", "", "yuvj444p"),
    ),
    ImageFormat.STACK: Traits(
        text="OME-TIFF, all images in one file, uncompressed",
        suffix=".tif",
        lossless=True,
        ratio=1.0,
    ),
    ImageFormat.ZARR: Traits(
        text="OME-Zarr, uncompressed, for long series",
        suffix=".zarr",
        lossless=True,
        ratio=1.0,
        store=True,
    ),
    ImageFormat.TIFF: Traits(
        text="a TIFF an image, uncompressed",
        suffix=".tif",
        lossless=True,
        ratio=1.0,
        sequence=True,
    ),
    ImageFormat.PNG: Traits(
        text="a PNG an image, lossless, slow",
        suffix=".png",
        lossless=True,
        ratio=0.65,
        sequence=True,
    ),
}

# Endings that would say something else than what is in the file.
_FILES: Final = {".mkv", ".nut", ".avi", ".mp4", ".mov", ".tif", ".tiff", ".png"}
_MEANT: Final = {*_FILES, ".zarr", SIDE_SUFFIX}


def traits(image_format: ImageFormat | str) -> Traits:
    """Return what a format is like.

    Raises
    ------
    RecordingError
        There is no such format; the text lists those there are.
    """
    try:
        return FORMATS[ImageFormat(image_format)]
    except ValueError as exc:
        known = ", ".join(ImageFormat)
        raise RecordingError(
            f"there is no image format {str(image_format)!r}; choose one of {known}"
        ) from exc


def check_pixels(image_format: ImageFormat, pixel_format: PixelFormat) -> None:
    """Refuse pixels that a format cannot keep.

    Raises
    ------
    RecordingError
        It cannot; the text says which can.
    """
    if not traits(image_format).holds(pixel_format):
        able = ", ".join(name for name, each in FORMATS.items() if each.holds(pixel_format))
        raise RecordingError(
            f"format {image_format} cannot keep {pixel_format} images; choose one of {able}"
        )


def image_bytes_per_s(image_format: ImageFormat, settings: CameraSettings) -> float:
    """Return how fast a recording grows, about."""
    sample_bytes = {PixelFormat.MONO8: 1, PixelFormat.RGB8: 3}.get(settings.pixel_format, 2)
    raw = settings.roi.width_px * settings.roi.height_px * sample_bytes * settings.rate_hz
    return raw * traits(image_format).ratio


def recording_suffix(image_format: ImageFormat) -> str:
    """Return the ending of a recording's path; none for the directory of a sequence."""
    found = traits(image_format)
    return "" if found.sequence else found.suffix


def checked_path(path: Path, image_format: ImageFormat) -> Path:
    """Return the absolute path of a recording, with the ending of its format.

    Raises
    ------
    RecordingError
        Its name or its directory forbid it, or its ending is another format's.
    """
    suffix = recording_suffix(image_format)
    name = check_base_name(path.name)
    if name.lower().endswith(suffix or "/"):
        name = name[: len(name) - len(suffix)]
    other = Path(name).suffix.lower()
    if other in _MEANT:
        raise RecordingError(
            f"name {path.name!r}: {other} is not the ending of format {image_format}; leave it "
            f"out, or end it in {suffix or 'nothing, for it names a directory'}"
        )
    return check_directory(path.parent) / (check_base_name(name) + suffix)


def side_path_of(path: Path) -> Path:
    """Return where the side file of a recording lies."""
    known = {recording_suffix(each) for each in ImageFormat} - {""}
    stem = path.stem if path.suffix.lower() in known else path.name
    return path.with_name(stem + SIDE_SUFFIX)


def kind_of(data: Pixels, pixel_format: PixelFormat) -> tuple[tuple[int, ...], str, PixelFormat]:
    """Return what all images of a recording have in common.

    Raises
    ------
    RecordingError
        The pixels are not of the kind that `pixel_format` says.
    """
    deep = pixel_format not in {PixelFormat.MONO8, PixelFormat.RGB8}
    layers = data.shape[2:] == (3,) if pixel_format is PixelFormat.RGB8 else data.ndim == 2
    if not layers or data.dtype != (np.uint16 if deep else np.uint8) or 0 in data.shape:
        raise RecordingError(
            f"an image said to be {pixel_format} has shape {data.shape} and type {data.dtype}; "
            "it cannot be recorded"
        )
    return data.shape, str(data.dtype), pixel_format


def words(items: Iterable[object]) -> str:
    """Return a list for a message."""
    return ", ".join(str(each) for each in items) or "none"
