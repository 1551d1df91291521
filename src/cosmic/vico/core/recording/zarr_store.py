"""`ZarrWriter` and `ZarrSource`: all images of a recording as OME-Zarr 0.4, a chunk each.

The store is version 2 of Zarr without compression: each chunk is a file with the pixels and nothing
else, so that writing one costs as much as any file, and every program that reads Zarr reads it.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosmic.frame.clock import WALL
from cosmic.frame.errors import RecordingError
from cosmic.vico.core.recording.side_row import SideRow, position_column
from cosmic.vico.core.recording.tiff_png import SOFTWARE, details
from cosmic.vico.hw.interface import Pixels

SUFFIX: Final = ".zarr"
IMAGES: Final = "0"
"""Path of the images in the store, the only level."""
_SHAPE_EVERY_S: Final = 0.25
_PART: Final = ".part"
_TIMES: Final = ("time_s", "exposed_s")
_AXES: Final = ("t", "c", "y", "x")


def is_zarr(path: Path) -> bool:
    """Return whether a directory is a Zarr store of version 2."""
    return (path / ".zgroup").is_file()


class ZarrWriter:
    """A store being written into a directory that exists; one thread.

    Four times a second the store is whole; when each image came, and where every axis stood, is
    added when it is closed. Methods raise `OSError` where a file cannot be written.

    Parameters
    ----------
    axes : mapping of str to str
        Unit of each axis by its name.
    rate_hz : float
        Nominal rate; the real one is written at the end.
    """

    def __init__(self, path: Path, axes: Mapping[str, str], rate_hz: float) -> None:
        self._path = path
        self._axes = dict(axes)
        self._rate_hz = rate_hz
        self._rows: list[SideRow] = []
        self._shape: tuple[int, ...] = ()
        self._kind = ""
        self._size_bytes = 0
        self._due_s = 0.0

    @property
    def size_bytes(self) -> int:
        """How much is written."""
        return self._size_bytes

    def write(self, data: Pixels, row: SideRow) -> None:
        """Add an image."""
        planes = np.moveaxis(data, 2, 0) if data.ndim == 3 else data  # OME wants colours first
        if not self._rows:
            self._begin(planes, row)
        chunk = chunk_path(self._path, len(self._rows), planes.ndim)
        for folder in reversed(chunk.parents[: planes.ndim]):
            folder.mkdir()
        # Nobody reads it before the shape says that it is there.
        chunk.write_bytes(planes.astype(self._kind, copy=False).tobytes())
        self._rows.append(row)
        self._size_bytes += data.nbytes
        if WALL.now_s() >= self._due_s:
            self._put_shape()

    def close(self) -> None:
        """Write what came when, and where the axes stood."""
        if not self._rows:
            return
        self._put_shape()
        exposed = [each.exposed_s for each in self._rows]
        steps = np.diff(exposed)
        if steps.size and float(np.median(steps)) > 0.0:
            self._rate_hz = 1.0 / float(np.median(steps))
        self._describe(self._rows[0])
        self._column("t", [each - exposed[0] for each in exposed], "s")
        for name in _TIMES:
            self._column(name, [getattr(each, name) for each in self._rows], "s")
        for axis, unit in self._axes.items():
            places = [each.circumstances.positions.get(axis, np.nan) for each in self._rows]
            self._column(position_column(axis, unit), places, unit)

    def _begin(self, planes: Pixels, row: SideRow) -> None:
        self._shape, self._kind = planes.shape, planes.dtype.newbyteorder("<").str
        _put_json(self._path / ".zgroup", {"zarr_format": 2})
        self._describe(row)
        (self._path / IMAGES).mkdir()
        _put_json(self._path / IMAGES / ".zattrs", {"_ARRAY_DIMENSIONS": self._dimensions})

    @property
    def _dimensions(self) -> list[str]:
        return [each for each in _AXES if each != "c" or len(self._shape) == 3]

    def _describe(self, row: SideRow) -> None:
        """Write what OME says of the images, and what is known of the first."""
        scale = row.circumstances.scale_um_px
        kinds = {"t": "time", "c": "channel"}
        axes = [{"name": each, "type": kinds.get(each, "space")} for each in self._dimensions]
        axes[0]["unit"] = "second"
        if scale:
            for each in axes[-2:]:
                each["unit"] = "micrometer"
        steps = [1.0 / self._rate_hz, *(1.0 for _ in self._shape[:-2]), *(2 * [scale or 1.0])]
        dataset = {
            "path": IMAGES,
            "coordinateTransformations": [{"type": "scale", "scale": steps}],
        }
        known = {"version": "0.4", "name": row.camera, "axes": axes, "datasets": [dataset]}
        attributes = {
            "multiscales": [known],
            "creator": SOFTWARE,
            "cosmic": details(row, self._axes),
        }
        _put_json(self._path / ".zattrs", attributes)

    def _put_shape(self) -> None:
        """Say how many images there are."""
        shape = (len(self._rows), *self._shape)
        _put_json(self._path / IMAGES / ".zarray", _described(shape, (1, *shape[1:]), self._kind))
        self._due_s = WALL.now_s() + _SHAPE_EVERY_S

    def _column(self, name: str, values: Sequence[float], unit: str) -> None:
        """Write one number an image, beside the images."""
        folder = self._path / name
        folder.mkdir(exist_ok=True)
        coded = np.asarray(values, "<f8")
        _put(folder / "0", coded.tobytes())
        _put_json(folder / ".zattrs", {"_ARRAY_DIMENSIONS": ["t"], "units": unit})
        _put_json(folder / ".zarray", _described(coded.shape, coded.shape, "<f8"))


class ZarrSource:
    """The images of a store that `ZarrWriter` wrote, finished or cut off.

    Raises
    ------
    RecordingError
        It cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            found = json.loads((path / IMAGES / ".zarray").read_text(encoding="utf-8"))
            self._kind = np.dtype(found["dtype"])
            self._total, *shape = (int(each) for each in found["shape"])
            if found["compressor"] is not None or found["chunks"] != [1, *shape]:
                raise RecordingError(f"{path}: was not recorded by CoSMic; open it with zarr")
        except (OSError, ValueError, TypeError, KeyError) as exc:
            raise RecordingError(f"{path}: cannot be read ({exc})") from exc
        self._shape = tuple(shape)

    def count(self) -> int:
        """Return how many whole images there are."""
        return self._total

    def images(self) -> Iterator[Pixels]:
        """Yield all images."""
        for index in range(self._total):
            yield self.image(index)

    def image(self, index: int, stamp: int | None = None) -> Pixels:
        """Return one image; `stamp` is not needed."""
        del stamp
        chunk = chunk_path(self._path, index, len(self._shape))
        try:
            planes: npt.NDArray[Any] = np.fromfile(chunk, self._kind).reshape(self._shape)
        except (OSError, ValueError) as exc:
            raise RecordingError(f"{self._path}: image {index} cannot be read ({exc})") from exc
        native = planes.astype(self._kind.newbyteorder("="), copy=False)
        return np.ascontiguousarray(np.moveaxis(native, 0, 2)) if native.ndim == 3 else native

    def close(self) -> None:
        """Nothing is open."""


def chunk_path(path: Path, index: int, dimensions: int) -> Path:
    """Return the file with the pixels of one image."""
    return path.joinpath(IMAGES, str(index), *("0" for _ in range(dimensions)))


def _described(shape: Sequence[int], chunks: Sequence[int], kind: str) -> dict[str, Any]:
    return {
        "zarr_format": 2,
        "shape": list(shape),
        "chunks": list(chunks),
        "dtype": kind,
        "compressor": None,
        # Where images had one, xarray would take black pixels for missing ones.
        "fill_value": "NaN" if kind == "<f8" else None,
        "order": "C",
        "filters": None,
        "dimension_separator": "/",
    }


def _put_json(path: Path, values: Mapping[str, Any]) -> None:
    _put(path, json.dumps(values, ensure_ascii=False).encode("utf-8"))


def _put(path: Path, coded: bytes) -> None:
    """Write a file under another name first, so that one that is there is whole."""
    part = path.with_name(path.name + _PART)
    part.write_bytes(coded)
    part.replace(path)
