"""`SequenceWriter`: images into a directory, a file each."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from cosmic.vico.core.recording.formats import ImageFormat
from cosmic.vico.core.recording.side_row import SideRow
from cosmic.vico.core.recording.tiff_png import encoded_png, encoded_tiff
from cosmic.vico.hw.interface import Pixels

DIGITS: Final = 6
PART: Final = ".part"


def image_files(directory: Path, stem: str | None = None) -> dict[int, Path]:
    """Return the images of a sequence by their index, in order; those of any stem without one."""
    begin = ".*" if stem is None else re.escape(stem)
    pattern = re.compile(rf"{begin}_(\d{{{DIGITS},}})\.(tif|png)")
    found = {}
    for path in directory.iterdir():
        match = pattern.fullmatch(path.name)
        if match:
            found[int(match[1])] = path
    return dict(sorted(found.items()))


class SequenceWriter:
    """A sequence being written into a directory that exists; one thread.

    Each file is written under another name first, so that one that is there is whole.
    Methods raise `OSError` where a file cannot be written.

    Parameters
    ----------
    stem : str
        What the names of the files begin with.
    axes : mapping of str to str
        Unit of each axis by its name.
    """

    def __init__(
        self, directory: Path, image_format: ImageFormat, stem: str, axes: Mapping[str, str]
    ) -> None:
        self._directory = directory
        self._png = image_format is ImageFormat.PNG
        self._stem = stem
        self._axes = axes
        self._index = 0
        self._size_bytes = 0

    @property
    def size_bytes(self) -> int:
        """How long all files are together."""
        return self._size_bytes

    def write(self, data: Pixels, row: SideRow) -> None:
        """Add an image."""
        encoded = encoded_png if self._png else encoded_tiff
        coded = encoded(data, row, self._axes)
        ending = ".png" if self._png else ".tif"
        path = self._directory / f"{self._stem}_{self._index:0{DIGITS}d}{ending}"
        part = path.with_name(path.name + PART)
        part.write_bytes(coded)
        part.replace(path)
        self._index += 1
        self._size_bytes += len(coded)

    def close(self) -> None:
        """Nothing is held back."""
