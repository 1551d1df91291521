"""Recordings of images in another format, for programs that do not read theirs."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np

from cosmic.frame.errors import ExportCancelled, RecordingError, RecordingExistsError
from cosmic.frame.renamed import renamed_in
from cosmic.vico.core.recording.formats import (
    ImageFormat,
    check_pixels,
    checked_path,
    recording_suffix,
    side_path_of,
)
from cosmic.vico.core.recording.image_file import ImageFile
from cosmic.vico.core.recording.reading import (
    ImageRecording,
    RecordedImage,
    open_image_recording,
)
from cosmic.vico.core.recording.sequence_writer import image_files
from cosmic.vico.core.recording.side_row import UNKNOWN, SideRow
from cosmic.vico.core.recording.zarr_store import is_zarr

PART: Final = "being exported"
Progress = Callable[[float], object]


__getattr__ = renamed_in(__name__, {"export_pictures": "export_images"})


def export_images(
    recording_path: "str | os.PathLike[str]",
    to: ImageFormat | str,
    out_path: "str | os.PathLike[str] | None" = None,
    progress: Progress | None = None,
    *,
    overwrite: bool = False,
) -> Path:
    """Write a recording in format `to`, with a side file, and return the path of the new one.

    The new side file has the rows of the images in it, with their columns as they were.

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
    image_format = _format(to)
    with open_image_recording(recording_path) as recording:
        check_pixels(image_format, recording.pixel_format)
        target = _target(recording, image_format, out_path)
        _check_free(target, recording, overwrite=overwrite)
        temporary = target.with_name(f"{_stem(target)}, {PART}{recording_suffix(image_format)}")
        try:
            _copy(recording, temporary, image_format, target.name, progress)
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


def _format(to: ImageFormat | str) -> ImageFormat:
    try:
        return ImageFormat(to)
    except ValueError as exc:
        known = ", ".join(ImageFormat)
        raise RecordingError(f"cannot export to {to!r}; there are {known}") from exc


def _target(
    recording: ImageRecording,
    image_format: ImageFormat,
    out_path: "str | os.PathLike[str] | None",
) -> Path:
    if out_path is not None:
        return checked_path(Path(out_path), image_format)
    name = f"{_stem(recording.path)}_{image_format}{recording_suffix(image_format)}"
    return checked_path(recording.path.with_name(name), image_format)


def _check_free(target: Path, recording: ImageRecording, *, overwrite: bool) -> None:
    own = {recording.path.absolute(), recording.side_path.absolute()}
    for path in (target, side_path_of(target)):
        if path in own:
            raise RecordingError(f"{path}: a recording cannot be exported onto itself")
        if path.exists() and not overwrite:
            raise RecordingExistsError(
                f"{path}: there is such a file; choose another name, or say that it may be replaced"
            )
    if _has_other_files(target):
        raise RecordingError(
            f"{target}: there are other files in this directory, which would be lost; choose "
            "another name"
        )


def _has_other_files(target: Path) -> bool:
    if not target.is_dir() or is_zarr(target):
        return False
    return bool(set(target.iterdir()) - set(image_files(target, target.name).values()))


def _copy(
    recording: ImageRecording,
    path: Path,
    image_format: ImageFormat,
    stem: str,
    progress: Progress | None,
) -> None:
    def report(fraction: float) -> None:
        if progress is not None and progress(fraction) is False:
            raise ExportCancelled(f"{path.parent}: the export was cancelled")

    report(0.0)
    total = len(recording)
    target = ImageFile(
        path,
        image_format,
        axes=recording.axes,
        rate_hz=recording.rate_hz,
        overwrite=True,
        stem=stem,
    )
    try:
        for image in recording:
            target.append(image.data, image.row or _unknown(recording, image))
            report(min(1.0, target.count / max(1, total)))
    except BaseException:
        target.close(complete=False)
        raise
    target.close(complete=True)


def _unknown(recording: ImageRecording, image: RecordedImage) -> SideRow:
    """Return a row for an image of which the side file does not tell."""
    known = recording.time_s[np.isfinite(recording.time_s)]
    end_s = float(known[-1]) if known.size else 0.0
    time_s = end_s + (image.index + 1 - known.size) / recording.rate_hz
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
