"""Images of other programs, with the pixel size that their metadata tell."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import cv2
import numpy as np
import numpy.typing as npt

from cosmic.frame.errors import RecordingError

if TYPE_CHECKING:
    import tifffile

TIFF = (".tif", ".tiff")
VIDEO = (".avi", ".mkv", ".mov", ".mp4")
SUFFIXES = (*TIFF, ".png", ".jpg", ".jpeg", *VIDEO)
# What a resolution says above is how large a picture is printed (300 dpi are 85 µm).
PRINTED_UM = 25.0
UM_IN = {"m": 1e6, "cm": 1e4, "mm": 1e3, "µm": 1.0, "μm": 1.0, "um": 1.0, "nm": 1e-3}
WORDS = {"micron": 1.0, "microns": 1.0, "\\u00B5m": 1.0, "inch": 25_400.0}
TAG_UM = {2: 25_400.0, 3: 1e4}
NOT_KNOWN = "not known"
# What tifffile decodes by itself: none, deflate (three numbers), PackBits.
PLAIN_COMPRESSIONS = (1, 8, 32946, 32773, 50013)
# What OpenCV decodes besides: CCITT (three numbers), LZW, JPEG. Of others it makes a blank image.
DECODED_COMPRESSIONS = (*PLAIN_COMPRESSIONS, 2, 3, 4, 5, 7)
SEPARATED = 5  # cyan, magenta, yellow, black


@dataclass(frozen=True, slots=True, eq=False)
class FileImage:
    """One page of a file.

    Attributes
    ----------
    pixels : ndarray, shape (height, width) or (height, width, layers)
        Colours in the order blue, green, red.
    step_um : float or None
        Distance in height to the next page, where the file says so.
    """

    name: str
    pixels: npt.NDArray[np.generic]
    pixel_size_um: float | None
    pixel_size_from: str
    step_um: float | None = None


def read_images(path: Path, every: int = 1) -> Iterator[FileImage]:
    """Yield the pages of a TIFF, PNG or JPEG, or each `every`-th image of a video.

    Raises
    ------
    RecordingError
        It cannot be read, or is of another kind.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise RecordingError(f"{path}: is not one of {', '.join(SUFFIXES)}")
    if path.suffix.lower() in VIDEO:
        yield from _video_images(path, every)
        return
    if path.suffix.lower() in TIFF:
        yield from _tiff_pages(path)
        return
    try:
        coded = path.read_bytes()
        pixels = cv2.imdecode(np.frombuffer(coded, np.uint8), cv2.IMREAD_UNCHANGED)
    except (OSError, cv2.error) as exc:
        raise RecordingError(f"{path}: cannot be read ({exc})") from exc
    if pixels is None:
        raise RecordingError(f"{path}: is no image, or damaged")
    size = _png_size_um(coded)
    yield FileImage(path.name, pixels, size, "PNG resolution" if size else NOT_KNOWN)


def _tiff_pages(path: Path) -> Iterator[FileImage]:
    import tifffile

    try:
        with tifffile.TiffFile(path) as file:
            size, source = _tiff_size_um(file)
            step = _tiff_step_um(file)
            count = len(file.pages)
            decoded = _decoded(file, path)
            for number in range(count):
                pixels = decoded[number] if decoded else _page_pixels(file.pages[number])
                name = path.name if count == 1 else f"{path.name} page {number + 1}"
                yield FileImage(name, pixels, size, source, step)
    except (OSError, ValueError, LookupError, struct.error, tifffile.TiffFileError) as exc:
        raise RecordingError(f"{path}: cannot be read ({exc})") from exc


def _page_pixels(page: Any) -> npt.NDArray[np.generic]:
    """Return the pixels of a page, colours in the order blue, green, red."""
    pixels: npt.NDArray[np.generic] = page.asarray()
    if pixels.ndim == 3 and pixels.shape[0] in (3, 4) and pixels.shape[2] > 4:
        pixels = np.moveaxis(pixels, 0, 2)
    if int(page.photometric) == SEPARATED and pixels.ndim == 3 and pixels.dtype == np.uint8:
        inks = pixels.astype(np.float32) / 255.0
        mixed = (1.0 - inks[:, :, :3]) * (1.0 - inks[:, :, 3:4])
        pixels = np.round(255.0 * mixed).astype(np.uint8)
    if pixels.ndim == 3 and pixels.shape[2] in (3, 4):
        pixels = pixels[:, :, [2, 1, 0]]
    return pixels


def _decoded(file: "tifffile.TiffFile", path: Path) -> list[npt.NDArray[np.generic]]:
    """Return all pages as OpenCV decodes them, where tifffile has no decoder; else none.

    Raises
    ------
    RecordingError
        OpenCV has none either.
    """
    unknown = [each for each in file.pages if int(each.compression) not in PLAIN_COMPRESSIONS]
    if not unknown:
        return []
    known = all(int(each.compression) in DECODED_COMPRESSIONS for each in file.pages)
    pages = _by_opencv(path) if known else []
    if len(pages) != len(file.pages):
        kind = getattr(unknown[0].compression, "name", unknown[0].compression)
        raise RecordingError(
            f"{path}: cannot be read: compressed by {kind}; save it without compression"
        )
    return pages


def _by_opencv(path: Path) -> list[npt.NDArray[np.generic]]:
    coded = np.frombuffer(path.read_bytes(), np.uint8)
    done, pages = cv2.imdecodemulti(coded, cv2.IMREAD_UNCHANGED)
    return [np.asarray(each) for each in pages] if done else []


def _video_images(path: Path, every: int) -> Iterator[FileImage]:
    """Yield images of a video one after another; it says nothing of its pixel size."""
    video = cv2.VideoCapture(str(path))
    number = 0
    try:
        while video.grab():
            number += 1
            if (number - 1) % max(1, every):
                continue
            done, pixels = video.retrieve()
            if not done:
                break
            yield FileImage(f"{path.name} image {number}", pixels, None, NOT_KNOWN)
    except cv2.error as exc:
        raise RecordingError(f"{path}: cannot be read ({exc})") from exc
    finally:
        video.release()
    if not number:
        raise RecordingError(f"{path}: is no video that can be read, or damaged")


def _tiff_size_um(file: "tifffile.TiffFile") -> tuple[float | None, str]:
    """Return the pixel size of OME, else of ImageJ, else of the resolution."""
    ome = _ome_size_um(file.ome_metadata, "X")
    if ome:
        return ome, "OME"
    first: Any = file.pages[0]  # by type a frame as well, which the first one never is
    tags = first.tags
    per_unit = tags["XResolution"].value if "XResolution" in tags else (0, 1)
    pixels_each = per_unit[0] / per_unit[1] if per_unit[1] else 0.0
    if not pixels_each > 0:
        return None, NOT_KNOWN
    unit = str((file.imagej_metadata or {}).get("unit", ""))
    known = (UM_IN | WORDS).get(unit)
    if known:
        return known / pixels_each, "ImageJ"
    tag = tags["ResolutionUnit"].value if "ResolutionUnit" in tags else 0
    size = TAG_UM.get(int(tag), 0.0) / pixels_each
    return (size, "TIFF resolution") if 0 < size < PRINTED_UM else (None, NOT_KNOWN)


def _tiff_step_um(file: "tifffile.TiffFile") -> float | None:
    """Return the distance of the planes in height, of OME, else of ImageJ."""
    found = file.imagej_metadata or {}
    unit = (UM_IN | WORDS).get(str(found.get("unit", "")), 0.0)
    spacing = abs(float(found.get("spacing", 0.0))) * unit
    return _ome_size_um(file.ome_metadata, "Z") or (spacing if 0 < spacing < np.inf else None)


def _ome_size_um(text: str | None, axis: str) -> float | None:
    if not text:
        return None
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError:
        return None
    for each in root.iter():
        if each.tag.endswith("}Pixels") and f"PhysicalSize{axis}" in each.attrib:
            unit = UM_IN.get(each.attrib.get(f"PhysicalSize{axis}Unit", "µm"), 0.0)
            size = float(each.attrib[f"PhysicalSize{axis}"]) * unit
            return size if 0 < size < float("inf") else None
    return None


def _png_size_um(coded: bytes) -> float | None:
    """Return the pixel size in the chunk pHYs of a PNG."""
    at = coded[:4096].find(b"pHYs")
    if not coded.startswith(b"\x89PNG") or at < 0 or len(coded) < at + 13:
        return None
    per_m, _, unit = struct.unpack(">IIB", coded[at + 4 : at + 13])
    size = 1e6 / per_m if unit == 1 and per_m else 0.0
    return size if 0 < size < PRINTED_UM else None
