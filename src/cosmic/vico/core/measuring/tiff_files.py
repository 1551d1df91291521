"""The pages of a TIFF, each with its own pixel size."""

from collections.abc import Iterator
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import numpy.typing as npt

from cosmic.frame.errors import RecordingError
from cosmic.vico.core.measuring.file_image import FileImage, Refused, reading, refuse
from cosmic.vico.core.measuring.lzw import lzw_is_whole
from cosmic.vico.core.measuring.pixel_sizes import (
    UNKNOWN,
    OmeImages,
    PixelSize,
    axes_in_words,
    imagej_size,
    imagej_step_um,
    pixel_size,
)
from cosmic.vico.core.vision.grey import MOST_SIDE_PX

if TYPE_CHECKING:
    import tifffile

LZW = 5
TAG_UM = {2: 25_400.0, 3: 1e4}
# What tifffile decodes by itself: none, deflate (three numbers), PackBits.
PLAIN_COMPRESSIONS = (1, 8, 32946, 32773, 50013)
# What OpenCV decodes besides: CCITT (three numbers), LZW, JPEG. Of others it makes a blank image.
DECODED_COMPRESSIONS = (*PLAIN_COMPRESSIONS, 2, 3, 4, 5, 7)
# Others than these tifffile unpacks with a library that is not there.
PLAIN_BITS = (1, 8, 16, 32, 64)
PALETTE, SEPARATED = 3, 5  # the second: cyan, magenta, yellow, black
# Deflate, the tightest of all, makes no more than this many bytes of one.
MOST_UNPACKED = 1100

Layers = npt.NDArray[np.generic]


def tiff_pages(path: Path, refused: Refused | None = None) -> Iterator[FileImage]:
    """Yield the pages of a TIFF; those of reduced resolution and masks are none.

    Raises
    ------
    RecordingError
        The file cannot be read, or a page and `refused` is not given.
    """
    import tifffile

    with reading(str(path)), tifffile.TiffFile(path) as file:
        if not len(file.pages):
            raise RecordingError(f"{path}: is not a TIFF, or damaged: it has no page")
        metadata = _Metadata(file)
        if metadata.declared > 1 and len(file.pages) == 1:
            yield from _stack_of_one_page(path, file, metadata, refused)
            return
        yield from _separate_pages(path, file, metadata, refused)
        if metadata.declared > len(file.pages):
            refuse(_incomplete(path, metadata.declared, len(file.pages)), refused)


def _separate_pages(
    path: Path, file: "tifffile.TiffFile", metadata: "_Metadata", refused: Refused | None
) -> Iterator[FileImage]:
    count = len(file.pages)
    pages: list[tuple[int, Any]] = []
    for index in range(count):
        try:
            with reading(f"{path}: page {index + 1}" if count > 1 else str(path)):
                pages.append((index, file.pages[index]))
        except RecordingError as exc:
            refuse(exc, refused if count > 1 else None)
    full = [each for each in pages if not (_first(each[1]).subfiletype & 0b101)] or pages
    opencv = _OpenCv(path)
    for index, page in full:
        several = len(full) > 1
        where = f"{path}: page {index + 1}" if several else str(path)
        try:
            with reading(where):
                pixels = _page_pixels(where, page, index, opencv)
        except RecordingError as exc:
            refuse(exc, refused if several else None)
            continue
        name = f"{path.name} page {index + 1}" if several else path.name
        yield metadata.image(name, pixels, page, index)


def _stack_of_one_page(
    path: Path, file: "tifffile.TiffFile", metadata: "_Metadata", refused: Refused | None
) -> Iterator[FileImage]:
    """Yield the images that lie one after another behind a single page, as ImageJ writes them."""
    page: Any = file.pages[0]
    size = int(page.nbytes)
    _check_declared(str(path), page)
    whole = int(page.compression) == 1 and page.is_contiguous and int(page.bitspersample) % 8 == 0
    there = (file.filehandle.size - page.dataoffsets[0]) // size if whole else 1
    there = min(there, metadata.declared)
    for index in range(there):
        raw = file.filehandle.read_array(
            page.dtype.newbyteorder(file.byteorder), page.size, page.dataoffsets[0] + index * size
        )
        pixels = raw.astype(page.dtype).reshape(page.shape)
        name = f"{path.name} page {index + 1}"
        yield metadata.image(name, _in_colours(pixels, page), page, index)
    if there < metadata.declared:
        refuse(_incomplete(path, metadata.declared, there), refused)


def _incomplete(path: Path, declared: int, there: int) -> RecordingError:
    return RecordingError(
        f"{path}: is not complete: it declares {declared} images, and {there} can be read; "
        "copy it again from where it was made"
    )


class _Metadata:
    """What a TIFF says of its pages as a whole."""

    def __init__(self, file: "tifffile.TiffFile") -> None:
        pages = len(file.pages)
        first: Any = file.pages[0]  # by type a frame as well, which the first one never is
        self._imagej: dict[str, Any] = file.imagej_metadata or {}
        self._ome = OmeImages(file.ome_metadata or "", pages, int(first.samplesperpixel))
        self.declared = self._ome.declared
        if file.is_imagej:
            self.declared = max(self.declared, int(self._imagej.get("images", 1)))
        elif pages == 1 and file.is_shaped and not self._ome:
            self.declared = _shaped_images(file)
        channels, times = (int(self._imagej.get(each, 1)) for each in ("channels", "frames"))
        self._besides = self._ome.besides_height() or axes_in_words(channels, times)

    def image(self, name: str, pixels: Layers, page: Any, index: int) -> FileImage:
        """Return a page with what is known of it."""
        size = self._size(page, index)
        step = self._ome.step_um(index) or imagej_step_um(self._imagej)
        return FileImage(name, pixels, size.um, size.source, step, index + 1, self._besides)

    def _size(self, page: Any, index: int) -> PixelSize:
        """Return the pixel size of OME, else of ImageJ, else of the page's resolution."""
        ome = self._ome.size(index)
        if ome is not None:
            return ome
        tags = _first(page).tags
        x_each, y_each = (_quotient(tags, f"{axis}Resolution") for axis in "XY")
        if not x_each or y_each == 0.0:
            return UNKNOWN
        imagej = imagej_size(self._imagej, x_each, y_each)
        if imagej is not None:
            return imagej
        unit = tags["ResolutionUnit"].value if "ResolutionUnit" in tags else 0
        um = TAG_UM.get(int(unit[0] if isinstance(unit, tuple) else unit), 0.0)
        y_um = None if y_each is None else um / y_each
        return pixel_size(um / x_each, y_um, "TIFF resolution", quiet=True)


def _first(page: Any) -> Any:
    """Return the page that has the tags of this one."""
    return page if hasattr(page, "tags") else page.keyframe


def _quotient(tags: Any, name: str) -> float | None:
    """Return a resolution, 0 for one that is none; some programs write a plain number."""
    if name not in tags:
        return None
    over, under = (*np.atleast_1d(tags[name].value).tolist(), 1)[:2]
    found = float(over) / float(under) if under else 0.0
    return found if 0 < found < float("inf") else 0.0


def _shaped_images(file: "tifffile.TiffFile") -> int:
    """Return how many images tifffile wrote behind a single page."""
    shapes = [each.get("shape", ()) for each in file.shaped_metadata or ()]
    size = int(file.pages[0].size)
    return max(1, prod(shapes[0]) // size) if len(shapes) == 1 and shapes[0] and size else 1


def _check_declared(where: str, page: Any) -> None:
    """Refuse a page that says it is larger than any image, before room is made for it."""
    width, height = int(page.imagewidth), int(page.imagelength)
    if not (0 < width <= MOST_SIDE_PX and 0 < height <= MOST_SIDE_PX):
        raise RecordingError(
            f"{where}: declares {width} x {height} pixels; images have up to "
            f"{MOST_SIDE_PX} a side: the file is damaged, or has to be cut into parts"
        )
    bits = width * height * int(page.samplesperpixel) * int(page.bitspersample)
    most = MOST_UNPACKED if int(page.compression) != 1 else 1
    if not bits // 8 <= most * page.parent.filehandle.size:
        raise RecordingError(
            f"{where}: declares {bits // 8} bytes of pixels, more than the file holds: "
            "it is damaged, or was not copied to its end"
        )


class _OpenCv:
    """The pages that tifffile has no decoder for; the file is read once for all of them."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._coded: npt.NDArray[np.uint8] | None = None

    def page(self, index: int) -> Layers | None:
        """Return a page as OpenCV decodes it; None where it cannot."""
        if self._coded is None:
            self._coded = np.frombuffer(self._path.read_bytes(), np.uint8)
        which = (index, index + 1)
        done, pages = cv2.imdecodemulti(self._coded, cv2.IMREAD_UNCHANGED, range=which)
        return np.asarray(pages[0]) if done and pages else None


def _check_lzw(where: str, page: Any, first: Any) -> None:
    """Refuse a page of which a strip or tile is damaged; OpenCV makes something up for it."""
    if int(first.fillorder) != 1:
        return
    layers = int(first.samplesperpixel) if int(first.planarconfig) == 1 else 1
    height, width = int(first.imagelength), int(first.imagewidth)
    rows, columns = int(first.rowsperstrip), width
    if first.is_tiled:
        rows, columns = int(first.tilelength), int(first.tilewidth)
    row_bytes = (columns * layers * int(first.bitspersample) + 7) // 8
    strips = max(1, -(-height // max(1, rows)))
    file = page.parent.filehandle
    for number, (at, count) in enumerate(zip(page.dataoffsets, page.databytecounts, strict=True)):
        left = rows if first.is_tiled else min(rows, height - number % strips * rows)
        file.seek(at)
        if not lzw_is_whole(file.read(count), left * row_bytes):
            raise RecordingError(
                f"{where}: is damaged: a part of its pixels, compressed by LZW, cannot be decoded; "
                "copy it again from where it was made"
            )


def _page_pixels(where: str, page: Any, index: int, opencv: _OpenCv) -> Layers:
    """Return the pixels of a page, colours in the order blue, green, red."""
    first = _first(page)
    _check_declared(where, first)
    compression = int(first.compression)
    if compression in PLAIN_COMPRESSIONS and int(first.bitspersample) in PLAIN_BITS:
        return _in_colours(page.asarray(), first)
    if compression == LZW:
        _check_lzw(where, page, first)
    pixels = opencv.page(index) if compression in DECODED_COMPRESSIONS else None
    if pixels is None:
        kind = getattr(first.compression, "name", compression)
        said = f"compressed by {kind}" if compression != 1 else f"{first.bitspersample} bits each"
        damaged = "is damaged, or " if compression in DECODED_COMPRESSIONS else ""
        raise RecordingError(
            f"{where}: cannot be read: {damaged}{said}; save it without compression, with 8 or 16 "
            "bits"
        )
    return pixels


def _in_colours(pixels: Layers, page: Any) -> Layers:
    """Return what tifffile read as an image of grey, or of blue, green and red."""
    if int(page.photometric) == PALETTE and page.colormap is not None and pixels.ndim == 2:
        return _by_palette(pixels, np.asarray(page.colormap, np.uint16))
    if pixels.ndim == 3 and pixels.shape[0] in (3, 4) and pixels.shape[2] > 4:
        pixels = np.moveaxis(pixels, 0, 2)
    if int(page.photometric) == SEPARATED and pixels.ndim == 3 and pixels.dtype == np.uint8:
        inks = pixels.astype(np.float32) / 255.0
        mixed = (1.0 - inks[:, :, :3]) * (1.0 - inks[:, :, 3:4])
        pixels = np.round(255.0 * mixed).astype(np.uint8)
    if pixels.ndim == 3 and pixels.shape[2] in (3, 4):
        pixels = pixels[:, :, [2, 1, 0]]
    return pixels


def _by_palette(pixels: Layers, colours: npt.NDArray[np.uint16]) -> Layers:
    """Return the colours that a page's numbers stand for."""
    # The standard has 16 bits; some programs write 0 to 255.
    table = colours // 256 if colours.max() > 255 else colours
    found: Layers = table[::-1].T.astype(np.uint8)[pixels.astype(np.intp)]
    return found
