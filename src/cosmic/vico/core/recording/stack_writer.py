"""`StackWriter`: all images of a recording in one OME-TIFF."""

from collections.abc import Mapping
from pathlib import Path
from typing import Final

import tifffile

from cosmic.vico.core.recording.ome import described
from cosmic.vico.core.recording.side_row import SideRow
from cosmic.vico.core.recording.tiff_png import SOFTWARE, UM_IN_CM, details
from cosmic.vico.hw.interface import Pixels

_BEFORE: Final = "OME-XML follows when the recording is closed"


class StackWriter:
    """A stack being written; one thread. Methods raise `OSError` where it cannot be written.

    Each image is a page that every program reads after a kill; what OME says of all of them is
    written at the end.

    Parameters
    ----------
    axes : mapping of str to str
        Unit of each axis by its name.
    """

    def __init__(self, path: Path, axes: Mapping[str, str]) -> None:
        self._path = path
        self._axes = axes
        self._file = tifffile.TiffWriter(path, bigtiff=True)
        self._rows: list[SideRow] = []
        self._shape: tuple[int, ...] = ()
        self._kind = ""
        self._size_bytes = 0

    @property
    def size_bytes(self) -> int:
        """How much is written."""
        return self._size_bytes

    def write(self, data: Pixels, row: SideRow) -> None:
        """Add an image."""
        scale = row.circumstances.scale_um_px
        self._file.write(
            data,
            photometric="rgb" if data.ndim == 3 else "minisblack",
            metadata=None,
            description=_BEFORE if not self._rows else None,
            software=SOFTWARE,
            resolution=(UM_IN_CM / scale, UM_IN_CM / scale) if scale else None,
            resolutionunit="CENTIMETER" if scale else None,
        )
        self._file.filehandle.flush()
        self._rows.append(row)
        self._shape, self._kind = data.shape, str(data.dtype)
        self._size_bytes += data.nbytes

    def close(self) -> None:
        """Write what OME says of the images."""
        self._file.close()
        if not self._rows:
            return
        scale = self._rows[0].circumstances.scale_um_px
        height, width, *layers = self._shape
        colours = layers[0] if layers else 1
        made = tifffile.OmeXml(Creator=SOFTWARE)
        made.addimage(
            self._kind,
            (len(self._rows), *self._shape),
            (len(self._rows), 1, 1, height, width, colours),
            axes="TYXS" if layers else "TYX",
            **described(self._rows, scale),
            MapAnnotation={"Namespace": "cosmic/image", **details(self._rows[0], self._axes)},
        )
        tifffile.tiffcomment(self._path, made.tostring(declaration=True).encode("utf-8"))
