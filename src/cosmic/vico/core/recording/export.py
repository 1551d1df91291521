"""Recordings of pictures in another format, for programs that do not read theirs."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np

from cosmic.frame.errors import ExportCancelled, RecordingError, RecordingExistsError
from cosmic.vico.core.recording.formats import (
    PictureFormat,
    check_pixels,
    checked_path,
    recording_suffix,
    side_path_of,
)
from cosmic.vico.core.recording.picture_file import PictureFile
from cosmic.vico.core.recording.reading import (
    PictureRecording,
    RecordedPicture,
    open_picture_recording,
)
from cosmic.vico.core.recording.sequence_writer import picture_files
from cosmic.vico.core.recording.side_row import UNKNOWN, SideRow

PART: Final = "being exported"
Progress = Callable[[float], object]


def export_pictures(
    recording_path: "str | os.PathLike[str]",
    to: PictureFormat | str,
    out_path: "str | os.PathLike[str] | None" = None,
    progress: Progress | None = None,
    *,
    overwrite: bool = False,
) -> Path:
    """Write a recording in format `to`, with a side file, and return the path of the new one.

    The new side file has the rows of the pictures in it, with their columns as they were.

    Parameters
    ----------
    out_path : path, optional
        Without it the new one lies beside the recording, "_ffv1" or so after its name.
    progress : callable, optional
        Told the fraction done, 0 to 1; returns False to end it, and nothing is left.

    Raises
    ------
    RecordingError
        The recording cannot be read, the format cannot keep it, or the disk forbids it.
    RecordingExistsError
        There is such a file, and `overwrite` is False.
    ExportCancelled
        `progress` returned False.
    """
    picture_format = _format(to)
    with open_picture_recording(recording_path) as recording:
        check_pixels(picture_format, recording.pixel_format)
        target = _target(recording, picture_format, out_path)
        _check_free(target, recording, overwrite=overwrite)
        temporary = target.with_name(f"{_stem(target)}, {PART}{recording_suffix(picture_format)}")
        try:
            _copy(recording, temporary, picture_format, target.name, progress)
            _move(temporary, target)
        except OSError as exc:
            raise RecordingError(
                f"{target}: cannot be written ({exc.strerror or exc}); nothing of it is left. "
                "Make room, or choose another directory"
            ) from exc
        finally:
            _remove(temporary)
            _remove(side_path_of(temporary))
    return target


def _format(to: PictureFormat | str) -> PictureFormat:
    try:
        return PictureFormat(to)
    except ValueError as exc:
        known = ", ".join(PictureFormat)
        raise RecordingError(f"cannot export to {to!r}; there are {known}") from exc


def _target(
    recording: PictureRecording,
    picture_format: PictureFormat,
    out_path: "str | os.PathLike[str] | None",
) -> Path:
    if out_path is not None:
        return checked_path(Path(out_path), picture_format)
    name = f"{_stem(recording.path)}_{picture_format}{recording_suffix(picture_format)}"
    return checked_path(recording.path.with_name(name), picture_format)


def _check_free(target: Path, recording: PictureRecording, *, overwrite: bool) -> None:
    own = {recording.path.absolute(), recording.side_path.absolute()}
    for path in (target, side_path_of(target)):
        if path in own:
            raise RecordingError(f"{path}: a recording cannot be exported onto itself")
        if path.exists() and not overwrite:
            raise RecordingExistsError(
                f"{path}: there is such a file; choose another name, or say that it may be replaced"
            )
    if target.is_dir() and set(target.iterdir()) - set(picture_files(target, target.name).values()):
        raise RecordingError(
            f"{target}: there are other files in this directory, which would be lost; choose "
            "another name"
        )


def _copy(
    recording: PictureRecording,
    path: Path,
    picture_format: PictureFormat,
    stem: str,
    progress: Progress | None,
) -> None:
    def told(fraction: float) -> None:
        if progress is not None and progress(fraction) is False:
            raise ExportCancelled(f"{path.parent}: the export was cancelled")

    told(0.0)
    total = len(recording)
    target = PictureFile(
        path,
        picture_format,
        axes=recording.axes,
        rate_hz=recording.rate_hz,
        overwrite=True,
        stem=stem,
    )
    try:
        for picture in recording:
            target.append(picture.data, picture.row or _unknown(recording, picture))
            told(min(1.0, target.count / max(1, total)))
    except BaseException:
        target.close(complete=False)
        raise
    target.close(complete=True)


def _unknown(recording: PictureRecording, picture: RecordedPicture) -> SideRow:
    """Return a row for a picture of which the side file does not tell."""
    known = recording.time_s[np.isfinite(recording.time_s)]
    end_s = float(known[-1]) if known.size else 0.0
    time_s = end_s + (picture.index + 1 - known.size) / recording.rate_hz
    return SideRow(
        frame_id=-1,
        device_ns=None,
        time_s=time_s,
        exposed_s=time_s,
        utc=None,
        status=UNKNOWN,
        camera=recording.camera,
        pixel_format=recording.pixel_format.value,
    )


def _move(temporary: Path, target: Path) -> None:
    _remove(target)
    temporary.replace(target)
    side_path_of(temporary).replace(side_path_of(target))


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def _stem(path: Path) -> str:
    return side_path_of(path).stem
