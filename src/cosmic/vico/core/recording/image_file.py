"""`ImageFile`: a recording of images being written, without a thread of its own."""

import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Protocol

from cosmic.frame.errors import RecordingError, RecordingExistsError
from cosmic.vico.core.recording.formats import (
    ImageFormat,
    checked_path,
    kind_of,
    recording_suffix,
    side_path_of,
    traits,
)
from cosmic.vico.core.recording.sequence_writer import SequenceWriter, image_files
from cosmic.vico.core.recording.side_file import SideFile
from cosmic.vico.core.recording.side_row import SideRow
from cosmic.vico.core.recording.stack_writer import StackWriter
from cosmic.vico.core.recording.video_writer import VideoWriter, check_codec
from cosmic.vico.core.recording.zarr_store import ZarrWriter, is_zarr
from cosmic.vico.hw.interface import PixelFormat, Pixels


class ImageWriter(Protocol):
    """What writes images in one format; methods raise `OSError`."""

    @property
    def size_bytes(self) -> int:
        """How much is written."""

    def write(self, data: Pixels, row: SideRow) -> None:
        """Add an image."""

    def close(self) -> None:
        """Finish."""


class ImageFile:
    """A video file, or a directory of images, with its side file; one thread.

    Both are created at once; what a video begins with is written with the first image.

    Parameters
    ----------
    path : Path
        Of the file, or of the directory of a sequence.
    axes : mapping of str to str
        Unit of each axis, "um" or "deg", by its name.
    rate_hz : float
        Nominal rate.
    stem : str
        What the names of a sequence's files begin with; the name of its directory without it.

    Raises
    ------
    RecordingExistsError
        There is such a file, or such a side file, and `overwrite` is False.
    RecordingError
        The name, the directory or a missing codec forbid it.
    """

    def __init__(
        self,
        path: Path,
        image_format: ImageFormat,
        *,
        axes: Mapping[str, str] | None = None,
        rate_hz: float = 15.0,
        overwrite: bool = False,
        stem: str = "",
    ) -> None:
        check_codec(image_format)
        self._path = checked_path(path, image_format)
        self._format = image_format
        self._stem = stem or self._path.name
        self._axes = dict(axes or {})
        self._rate_hz = rate_hz
        self._kind: tuple[tuple[int, ...], str, PixelFormat] | None = None
        self._writer: ImageWriter | None = None
        self._count = 0
        if not overwrite and self._path.exists():
            raise _exists(self._path)
        side_path = side_path_of(self._path)
        _check_alone(self._path, side_path)
        self._side = SideFile(side_path, self._axes, overwrite=overwrite)
        try:
            self._create(overwrite=overwrite)
        except (OSError, RecordingError):
            self._side.close(complete=False)
            side_path.unlink(missing_ok=True)
            raise

    @property
    def path(self) -> Path:
        """Where it lies."""
        return self._path

    @property
    def side_path(self) -> Path:
        """Where its side file lies."""
        return self._side.path

    @property
    def count(self) -> int:
        """How many images are in it."""
        return self._count

    @property
    def size_bytes(self) -> int:
        """How long it is, without the side file."""
        return self._writer.size_bytes if self._writer is not None else 0

    def append(self, data: Pixels, row: SideRow) -> None:
        """Add an image.

        Raises
        ------
        RecordingError
            Its size or pixel format is another than the first one's, or cannot be kept.
        OSError
            The file cannot be written.
        """
        kind = kind_of(data, PixelFormat(row.pixel_format))
        if self._writer is None:
            self._kind, self._writer = kind, self._opened(kind)
        if kind != self._kind:
            raise RecordingError(
                f"{self._path}: image {row.frame_id} is {_said(kind)}, where the recording was "
                f"begun with {_said(self._kind)}; a recording keeps one size and one pixel format, "
                "so it ends here. Start another"
            )
        self._writer.write(data, row)
        self._side.add(replace(row, index=self._count))
        self._count += 1

    def note(self, row: SideRow) -> None:
        """Add the row of an image that is not in the file; raises `OSError`."""
        self._side.add(row)

    def flush(self) -> None:
        """Make the side file safe from the end of the process; raises `OSError`."""
        self._side.flush()

    def close(self, *, complete: bool) -> None:
        """Finish both files; raises `OSError`."""
        try:
            if self._writer is not None:
                self._writer.close()
            elif traits(self._format).store:
                self._path.rmdir()
            elif not traits(self._format).sequence:
                self._path.unlink(missing_ok=True)  # a video without an image is none
            self._side.close(complete=complete)
        finally:
            self._side.close(complete=False)

    def _create(self, *, overwrite: bool) -> None:
        try:
            if traits(self._format).store:
                if overwrite and is_zarr(self._path):
                    shutil.rmtree(self._path)
                self._path.mkdir()
            elif traits(self._format).sequence:
                self._path.mkdir(exist_ok=overwrite)
                for each in image_files(self._path, self._stem).values():
                    each.unlink()
            else:
                self._path.touch(exist_ok=overwrite)
        except FileExistsError as exc:
            raise _exists(self._path) from exc
        except OSError as exc:
            raise RecordingError(
                f"{self._path}: cannot be created ({exc.strerror or exc}); choose another directory"
            ) from exc

    def _opened(self, kind: tuple[tuple[int, ...], str, PixelFormat]) -> ImageWriter:
        shape, _, pixel_format = kind
        found = traits(self._format)
        if not found.holds(pixel_format):
            raise RecordingError(
                f"{self._path}: format {self._format} cannot keep {pixel_format} images"
            )
        if found.sequence:
            return SequenceWriter(self._path, self._format, self._stem, self._axes)
        if self._format is ImageFormat.ZARR:
            return ZarrWriter(self._path, self._axes, self._rate_hz)
        if self._format is ImageFormat.STACK:
            return StackWriter(self._path, self._axes)
        return VideoWriter(self._path, self._format, shape, pixel_format, self._rate_hz)


def _check_alone(path: Path, side_path: Path) -> None:
    """Refuse to take the side file of a recording in another format."""
    for suffix in {recording_suffix(each) for each in ImageFormat}:
        other = side_path.with_name(side_path.stem + suffix)
        if other != path and _is_recording(other):
            raise RecordingError(
                f"{other} is a recording in another format, which {side_path.name} belongs to; "
                "choose another name"
            )


def _is_recording(path: Path) -> bool:
    if not path.is_dir():
        return path.is_file()
    return is_zarr(path) or bool(image_files(path, path.name))


def _said(kind: tuple[tuple[int, ...], str, PixelFormat] | None) -> str:
    if kind is None:
        return "nothing"
    (height, width, *_), _, pixel_format = kind
    return f"{width} x {height} px {pixel_format}"


def _exists(path: Path) -> RecordingExistsError:
    return RecordingExistsError(
        f"{path}: there is such a recording; choose another name, or say that it may be replaced"
    )
