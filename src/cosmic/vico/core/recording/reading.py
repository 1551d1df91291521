"""`open_image_recording`: reads recorded images, finished, running or left by a kill."""

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import Final, Self

import numpy as np
import numpy.typing as npt

from cosmic.frame.errors import RecordingError
from cosmic.frame.renamed import renamed_in
from cosmic.vico.core.recording.formats import SIDE_SUFFIX, ImageFormat, recording_suffix
from cosmic.vico.core.recording.formats import side_path_of as _side_path_of
from cosmic.vico.core.recording.side_file import SideTable, read_side_file
from cosmic.vico.core.recording.side_row import NOT_THERE, SideRow
from cosmic.vico.core.recording.sources import (
    ImageSource,
    SequenceSource,
    StackSource,
    VideoSource,
)
from cosmic.vico.core.recording.video_writer import TimeStamps
from cosmic.vico.core.recording.zarr_store import ZarrSource, is_zarr
from cosmic.vico.hw.interface import FrameStatus, PixelFormat, Pixels

_ENDINGS: Final = tuple(dict.fromkeys(recording_suffix(each) for each in ImageFormat))


@dataclass(frozen=True, slots=True, eq=False)
class RecordedImage:
    """One image of a recording.

    Attributes
    ----------
    data : ndarray, shape (height, width) or (height, width, 3), uint8 or uint16
    index : int
        In the file, from 0.
    row : SideRow or None
        What stands beside it; None where the side file was cut off before it.
    """

    data: Pixels
    index: int
    row: SideRow | None


__getattr__ = renamed_in(__name__, {"open_picture_recording": "open_image_recording"})


def open_image_recording(path: "str | os.PathLike[str]") -> "ImageRecording":
    """Open a recording of images; use it with ``with``.

    Parameters
    ----------
    path : path
        Of the video file, of the directory of a sequence, or of the side file.

    Raises
    ------
    RecordingError
        There is no such recording, it is none, or it is damaged.
    """
    return ImageRecording(_found(Path(path)))


class ImageRecording:
    """What was recorded. Images are read when asked for. One thread."""

    def __init__(self, path: Path) -> None:
        self._path = path
        side_path = self.side_path
        self._side = read_side_file(side_path) if side_path.exists() else SideTable()
        there = [row for row in self._side.rows if row.index != NOT_THERE]
        self._written = sorted(there, key=lambda row: row.index)
        self._source = self._opened()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[RecordedImage]:
        """Yield all images, in order."""
        if self._source is None:
            return
        for index, data in enumerate(self._source.images()):
            yield RecordedImage(data, index, self._row(index))

    def __getitem__(self, index: int) -> RecordedImage:
        """Return one image; those that follow it are found fastest.

        Raises
        ------
        IndexError
            There are not so many.
        RecordingError
            It cannot be read.
        """
        if not 0 <= index < self._count or self._source is None:
            raise IndexError(f"{self._path}: has images 0 to {self._count - 1}, not {index}")
        stamp = self._stamps[index] if index < len(self._stamps) else None
        return RecordedImage(self._source.image(index, stamp), index, self._row(index))

    def close(self) -> None:
        """Give the files back; harmless the second time."""
        if self._source is not None:
            self._source.close()

    @property
    def path(self) -> Path:
        """Where the file lies, or the directory of a sequence."""
        return self._path

    @property
    def side_path(self) -> Path:
        """Where the side file lies."""
        return _side_path_of(self._path)

    @property
    def complete(self) -> bool:
        """True when it was closed in order: neither running, nor ended by an error or a kill."""
        return self._side.complete

    @property
    def rows(self) -> tuple[SideRow, ...]:
        """A row for every image that came, in the file or not, in the order of coming."""
        return self._side.rows

    @property
    def time_s(self) -> npt.NDArray[np.float64]:
        """Platform time of each image, shape (n,); NaN where the side file was cut off."""
        found = np.full(self._count, np.nan)
        times = [row.time_s for row in self._written[: self._count]]
        found[: len(times)] = times
        return found

    @property
    def rate_hz(self) -> float:
        """How often images came, by the middle one of the times between them; 15 without any."""
        steps = np.diff(self.time_s)
        steps = steps[steps > 0.0]
        return 1.0 / float(np.median(steps)) if steps.size else 15.0

    @property
    def axes(self) -> Mapping[str, str]:
        """Unit of each axis whose positions stand in the side file, by its name."""
        return self._side.axes

    @property
    def camera(self) -> str:
        """Which camera took the images; empty where no side file tells."""
        return self.rows[0].camera if self.rows else ""

    @property
    def pixel_format(self) -> PixelFormat:
        """Of the images."""
        return PixelFormat(self._written[0].pixel_format) if self._written else PixelFormat.MONO8

    @property
    def dropped(self) -> int:
        """Images that came and could not be written in time."""
        return self.rows[-1].dropped if self.rows else 0

    @property
    def incomplete(self) -> int:
        """Images that came with parts missing, and are not in the file."""
        return sum(row.status == FrameStatus.INCOMPLETE.value for row in self.rows)

    @property
    def lost(self) -> int:
        """Frames that the camera lost between the images."""
        return sum(row.lost_before for row in self.rows)

    @cached_property
    def _count(self) -> int:
        if self._source is None:
            return 0
        # After a kill the side file may know more images than reached the disk, or fewer.
        return len(self._written) if self._side.complete else self._source.count()

    @cached_property
    def _stamps(self) -> list[int]:
        stamps = TimeStamps()
        return [stamps.next(row.time_s) for row in self._written]

    def _row(self, index: int) -> SideRow | None:
        return self._written[index] if index < len(self._written) else None

    def _opened(self) -> ImageSource | None:
        if is_zarr(self._path):
            return ZarrSource(self._path)
        if self._path.is_dir():
            return SequenceSource(self._path)
        if not self._path.exists():  # nothing came: a video without an image is not kept
            return None
        if self._side.rows and not self._written and not self._path.stat().st_size:
            return None  # the first image failed already
        if self._path.suffix.lower() == recording_suffix(ImageFormat.STACK):
            return StackSource(self._path)
        colour = self.pixel_format is PixelFormat.RGB8
        return VideoSource(self._path, colour=colour, whole=self._side.complete)


def _found(path: Path) -> Path:
    """Return the path of the images."""
    if path.suffix.lower() != SIDE_SUFFIX:
        if not path.exists() and not _side_path_of(path).exists():
            raise RecordingError(f"{path}: there is no such recording")
        return path
    if not path.exists():
        raise RecordingError(f"{path}: there is no such recording")
    stem = path.name[: -len(SIDE_SUFFIX)]
    for ending in _ENDINGS:
        if (beside := path.with_name(stem + ending)).exists():
            return beside
    return path.with_name(stem + _ENDINGS[0])
