"""The pixel size that metadata state: which one is used, and why another one is not."""

import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import inf
from xml.etree import ElementTree

NOT_KNOWN = "not known"
# What a resolution says above is how large a picture is printed (300 dpi are 85 µm).
PRINTED_UM = 25.0
# A tenth of a nanometre, and a centimetre: beyond, something else is meant.
SMALLEST_UM, LARGEST_UM = 1e-4, 1e4
NOT_SQUARE = 1e-3
UM_IN = {
    "m": 1e6,
    "dm": 1e5,
    "cm": 1e4,
    "mm": 1e3,
    "µm": 1.0,
    "μm": 1.0,
    "um": 1.0,
    "nm": 1e-3,
    "\u00c5": 1e-4,  # as a letter
    "\u212b": 1e-4,  # as the sign of the unit
    "A": 1e-4,
    "pm": 1e-6,
    "in": 25_400.0,
    "thou": 25.4,
}
WORDS = {
    "\\u00b5m": 1.0,
    "micron": 1.0,
    "micrometer": 1.0,
    "micrometre": 1.0,
    "nanometer": 1e-3,
    "nanometre": 1e-3,
    "millimeter": 1e3,
    "millimetre": 1e3,
    "centimeter": 1e4,
    "centimetre": 1e4,
    "meter": 1e6,
    "metre": 1e6,
    "inch": 25_400.0,
    "inche": 25_400.0,  # inches, without the s
}
NO_UNIT = ("", "pixel", "pixels", "px")
PNG_HEAD = b"\x89PNG\r\n\x1a\n"


@dataclass(frozen=True, slots=True)
class PixelSize:
    """A pixel size or none, and where it was found or why there is none."""

    um: float | None
    source: str


UNKNOWN = PixelSize(None, NOT_KNOWN)


def unit_um(unit: str) -> float | None:
    """Return how many micrometres a unit has; None for one that is not known."""
    word = unit.strip()
    return UM_IN.get(word) or WORDS.get(word.lower()) or WORDS.get(word.lower().removesuffix("s"))


def unusable(why: str) -> PixelSize:
    """Return that there is no pixel size, with the reason."""
    return PixelSize(None, f"{NOT_KNOWN}: {why}; give it with --pixel-size-um")


def pixel_size(
    x_um: float,
    y_um: float | None,
    source: str,
    *,
    of_print: bool = False,
    quiet: bool = False,
) -> PixelSize:
    """Return the size of square pixels, or why it is none that lengths can be told by.

    Parameters
    ----------
    y_um : float or None
        None where the file says nothing of it: then pixels are taken to be square.
    of_print : bool
        It may be the size of a print: 25 µm and more are none of a pixel.
    quiet : bool
        As `of_print`, and give no reason then: nearly every file states the size of a print.
    """
    y_um = x_um if y_um is None else y_um
    if not (0 < x_um < inf and 0 < y_um < inf):
        return UNKNOWN
    said = f"{x_um:.5g} x {y_um:.5g} µm ({source})"
    if (of_print or quiet) and min(x_um, y_um) >= PRINTED_UM:
        return (
            UNKNOWN if quiet else unusable(f"{said} is the resolution of a print, 25 µm and more")
        )
    if abs(x_um / y_um - 1.0) > NOT_SQUARE:
        return PixelSize(
            None,
            f"{NOT_KNOWN}: its pixels are not square: {said}; resample it, then give the size "
            "with --pixel-size-um",
        )
    if not x_um >= SMALLEST_UM:
        return unusable(f"{said} is smaller than any pixel")
    return PixelSize(x_um, source)


def imagej_size(
    metadata: Mapping[str, object], x_per_unit: float, y_per_unit: float | None
) -> PixelSize | None:
    """Return the size of ImageJ's scale; None where it has no unit."""
    unit = str(metadata.get("unit", ""))
    units = (unit, str(metadata.get("yunit", unit)))
    if unit.strip().lower() in NO_UNIT:
        return None
    known = [unit_um(each) for each in units]
    for um, name in zip(known, units, strict=True):
        if um is None:
            return unusable(f"the unit {name!r} (ImageJ) is not known")
    x_um, y_um = (um or 0.0 for um in known)
    return pixel_size(
        x_um / x_per_unit,
        None if y_per_unit is None else y_um / y_per_unit,
        "ImageJ",
        of_print=x_um == UM_IN["in"],  # so it keeps the dots per inch of what it opened
    )


def imagej_step_um(metadata: Mapping[str, object]) -> float | None:
    """Return the distance of the planes in height."""
    unit = unit_um(str(metadata.get("zunit", metadata.get("unit", "")))) or 0.0
    try:
        step = abs(float(str(metadata.get("spacing", 0.0)))) * unit
    except ValueError:
        return None
    return step if 0 < step <= LARGEST_UM * 100 else None


class OmeImages:
    """The images that an OME-TIFF names, and which of its pages belong to which."""

    def __init__(self, text: str, pages: int, layers: int = 1) -> None:
        self._layers = max(1, layers)
        self._pixels: list[ElementTree.Element] = []
        self._by_page: dict[int, ElementTree.Element] = {}
        self.declared = pages
        """How many pages it names in this file."""
        try:
            root = ElementTree.fromstring(text)
        except ElementTree.ParseError:
            return
        self._pixels = [each for each in root.iter() if _tag(each) == "Pixels"]
        for pixels in self._pixels:
            for first, count in self._planes(pixels, root.get("UUID")):
                self.declared = max(self.declared, first + count)
                for page in range(first, min(first + count, pages)):
                    self._by_page.setdefault(page, pixels)

    def __bool__(self) -> bool:
        return bool(self._pixels)

    def size(self, page: int) -> PixelSize | None:
        """Return the pixel size of a page, counted from 0; None where nothing is said."""
        pixels = self._of(page)
        if pixels is None:
            return UNKNOWN if self._pixels else None
        try:
            x_um, y_um = (_physical_um(pixels, axis) for axis in "XY")
        except ValueError as exc:
            return unusable(str(exc))
        if x_um is None and y_um is None:
            return None
        if x_um is None:
            return unusable("OME states the height of a pixel alone")
        return pixel_size(x_um, y_um, "OME")

    def step_um(self, page: int) -> float | None:
        """Return the distance of the planes in height."""
        pixels = self._of(page)
        try:
            step = None if pixels is None else _physical_um(pixels, "Z")
        except ValueError:
            return None
        return abs(step) if step and 0 < abs(step) < inf else None

    def besides_height(self) -> str:
        """Return what else than the height its pages differ in, in words."""
        if len(self._pixels) > 1:
            return f"{len(self._pixels)} images"
        if not self._pixels:
            return ""
        return axes_in_words(self._channels(self._pixels[0]), _whole(self._pixels[0], "SizeT"))

    def _of(self, page: int) -> ElementTree.Element | None:
        alone = self._pixels[0] if len(self._pixels) == 1 else None
        return self._by_page.get(page, alone)

    def _channels(self, pixels: ElementTree.Element) -> int:
        """Return how many channels are pages of their own; the colours of a page are one."""
        return max(1, _whole(pixels, "SizeC") // self._layers)

    def _planes(self, pixels: ElementTree.Element, own: str | None) -> Iterator[tuple[int, int]]:
        """Yield first page and number of pages of an image, of those in this file."""
        every = _whole(pixels, "SizeZ") * _whole(pixels, "SizeT") * self._channels(pixels)
        for data in pixels:
            if _tag(data) != "TiffData":
                continue
            file = next((each.text for each in data if _tag(each) == "UUID"), own)
            if own is not None and file != own:
                continue
            first = _whole(data, "IFD") if "IFD" in data.attrib else 0
            alone = 1 if "IFD" in data.attrib else every
            yield first, _whole(data, "PlaneCount") if "PlaneCount" in data.attrib else alone


def axes_in_words(channels: int, times: int) -> str:
    """Return channels and moments where there are several; else nothing."""
    said = [f"{channels} channels"] if channels > 1 else []
    return " and ".join(said + ([f"{times} moments in time"] if times > 1 else []))


def png_size(coded: bytes) -> PixelSize:
    """Return the pixel size in the chunk pHYs of a PNG."""
    for kind, data in _png_chunks(coded):
        if kind == b"pHYs" and len(data) == 9:
            x_per_m, y_per_m, unit = struct.unpack(">IIB", data)
            if unit == 1 and x_per_m and y_per_m:
                return pixel_size(1e6 / x_per_m, 1e6 / y_per_m, "PNG resolution", quiet=True)
            return UNKNOWN
    return UNKNOWN


def _png_chunks(coded: bytes) -> Iterator[tuple[bytes, bytes]]:
    at = len(PNG_HEAD) if coded.startswith(PNG_HEAD) else len(coded)
    while at + 8 <= len(coded):
        length, kind = struct.unpack(">I4s", coded[at : at + 8])
        yield kind, coded[at + 8 : at + 8 + length]
        at += 12 + length


def _tag(element: ElementTree.Element) -> str:
    return element.tag.rsplit("}", 1)[-1]


def _whole(element: ElementTree.Element, name: str) -> int:
    text = element.get(name, "1")
    return int(text) if text.isdecimal() else 1


def _physical_um(pixels: ElementTree.Element, axis: str) -> float | None:
    """Return the size along an axis; raises `ValueError` with words of ours."""
    name = f"PhysicalSize{axis}"
    if name not in pixels.attrib:
        return None
    unit = pixels.get(f"{name}Unit", "µm")
    um = unit_um(unit)
    if um is None:
        raise ValueError(f"the unit {unit!r} (OME) is not known")
    try:
        return float(pixels.attrib[name]) * um
    except ValueError:
        raise ValueError(f"{pixels.attrib[name]!r} (OME) is not a size") from None
