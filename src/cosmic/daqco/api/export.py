"""Recordings in other formats, for programs that do not read HDF5: CSV, TDMS and what is brought.

A format is an exporter of the group ``cosmic.exporters``: its name is what ``--to`` says, and how
its files end.
"""

import csv
import os
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Final, Protocol

import numpy as np
import numpy.typing as npt

from cosmic.daqco.api.export_formats import (
    CsvTarget,
    Target,
    TdmsTarget,
    event_lines,
    position_lines,
)
from cosmic.daqco.api.recording import Recording, open_recording
from cosmic.daqco.core.recording_format import SUFFIX
from cosmic.frame.errors import (
    ConfigError,
    ExportCancelled,
    RecordingError,
    RecordingExistsError,
)
from cosmic.frame.plugins import Backend, Kind, NoOptions, make, names

READ_SAMPLES: Final = 32_768

Values = npt.NDArray[np.float64]
Progress = Callable[[float], object]


class Exporter(Protocol):
    """Writes a recording in another format."""

    def __call__(
        self,
        recording: Recording,
        path: Path,
        progress: Progress | None = None,
        *,
        overwrite: bool = False,
    ) -> Path:
        """Write `path` and return what was written; as `export_csv`, which says what it raises."""


ExporterBackend = Backend[None, Exporter]
"""What an entry point of the group ``cosmic.exporters`` leads to."""


def export_file(
    recording_path: "str | os.PathLike[str]",
    to: str,
    out_path: "str | os.PathLike[str] | None" = None,
    progress: Progress | None = None,
    *,
    overwrite: bool = False,
) -> Path:
    """Export a recording and return the path of the new file; see `Exporter`.

    Parameters
    ----------
    to : str
        "csv", "tdms", or a format that another package brings.
    out_path : path, optional
        Without it the file lies beside the recording, under the same name.

    Raises
    ------
    RecordingError
        The recording cannot be read, there is no such format, or the file cannot be written; it
        is the recording itself, or its ending that of another format.
    RecordingExistsError
        There is such a file, and `overwrite` is False.
    ExportCancelled
        `progress` returned False.
    """
    try:
        export: Exporter = make(Kind.EXPORTER, to, None)
    except ConfigError as exc:
        raise RecordingError(f"cannot export to {to!r}: {exc}") from exc
    source = Path(recording_path)
    try:
        folder = source.is_dir()
    except OSError as exc:  # a name that no file can have
        raise RecordingError(f"{str(source)[:80]}: cannot be read ({exc.strerror})") from exc
    if folder:
        raise RecordingError(f"{source}: is a directory; name a recording in it")
    target = source.with_suffix(f".{to}") if out_path is None else Path(out_path)
    with open_recording(source) as recording:
        _check_other(recording, target)  # whatever a format of others looks at
        _check_suffix(target, to)
        return export(recording, target, progress, overwrite=overwrite)


def export_csv(
    recording: Recording,
    path: Path,
    progress: Progress | None = None,
    *,
    overwrite: bool = False,
) -> Path:
    """Write physical values as CSV: a line of names with units, then a line a sample.

    Positions of axes and events go to files of their own beside it, ``NAME.positions.csv`` and
    ``NAME.events.csv``, where there are any.

    Parameters
    ----------
    progress : callable, optional
        Told the fraction done, 0 to 1; returns False to end it, and nothing is left.

    Raises
    ------
    RecordingError, RecordingExistsError, ExportCancelled
        As `export_file`.
    """
    beside = {
        path.with_name(f"{path.stem}.positions.csv"): position_lines(recording),
        path.with_name(f"{path.stem}.events.csv"): event_lines(recording),
    }
    tables = {target: lines for target, lines in beside.items() if len(lines) > 1}
    for target in (path, *tables):
        _check_free(recording, target, overwrite=overwrite)
    _export(recording, path, CsvTarget, progress)
    for target, lines in tables.items():
        with _replacing(target) as part, part.open("w", newline="", encoding="utf-8") as file:
            csv.writer(file, lineterminator="\n").writerows(lines)
    return path


def export_tdms(
    recording: Recording,
    path: Path,
    progress: Progress | None = None,
    *,
    overwrite: bool = False,
) -> Path:
    """Write physical values as TDMS, with groups ``samples``, ``positions`` and ``events``.

    Parameters, Raises
    ------------------
    As `export_csv`.
    """
    _check_free(recording, path, overwrite=overwrite)
    _export(recording, path, TdmsTarget, progress)
    return path


@contextmanager
def _replacing(path: Path) -> Iterator[Path]:
    """Write under another name, which becomes `path` only when all went well."""
    part = _part_of(path)
    try:
        yield part
        part.replace(path)
    except OSError as exc:
        raise RecordingError(
            f"{path}: cannot be written ({exc.strerror or exc}); nothing of it is left. "
            "Make room, or choose another directory"
        ) from exc
    finally:
        with suppress(OSError):  # why it could not be written was told above
            part.unlink(missing_ok=True)


def _export(
    recording: Recording,
    path: Path,
    kind: Callable[[Recording, Path], Target],
    progress: Progress | None,
) -> None:
    def report(fraction: float) -> None:
        if progress is not None and progress(fraction) is False:
            raise ExportCancelled(f"{path}: the export was cancelled")

    with _replacing(path) as part, closing(kind(recording, part)) as target:
        report(0.0)
        for block, fraction in _blocks(recording):
            target.write(block)
            report(fraction)
        target.finish()


def _blocks(recording: Recording) -> Iterator[tuple[list[Values], float]]:
    total = recording.samples
    for first in range(0, total, READ_SAMPLES):
        last = min(total, first + READ_SAMPLES)
        yield recording.block(first, last), last / total


def _part_of(path: Path) -> Path:
    return path.with_name(path.name + ".part")


def _check_suffix(path: Path, to: str) -> None:
    """Refuse what would lie about what is in the file."""
    ending = path.suffix.lower().lstrip(".")
    if ending != to and ending in (*names(Kind.EXPORTER), SUFFIX.lstrip(".")):
        raise RecordingError(
            f"{path}: ends in .{ending}, and {to} would be written; end it in .{to}, or name "
            "another format"
        )


def _check_other(recording: Recording, path: Path) -> None:
    """Refuse to write over the recording that is read, by whichever path it is named."""
    for written in (path, _part_of(path)):
        try:
            same = written.samefile(recording.path)
        except OSError:  # one is not there
            continue
        if same:
            raise RecordingError(
                f"{written}: is the recording itself, which an export never replaces; choose "
                "another name"
            )


def _check_free(recording: Recording, path: Path, *, overwrite: bool) -> None:
    _check_other(recording, path)
    try:
        folder, there = path.parent.is_dir(), path.exists()
    except OSError as exc:
        raise RecordingError(
            f"{str(path)[:80]}: is not the name of a file ({exc.strerror}); choose another"
        ) from exc
    if not folder:
        raise RecordingError(f"directory {path.parent} does not exist; create it or choose another")
    if there and not overwrite:
        raise RecordingExistsError(
            f"{path}: there is such a file; choose another name, or say that it may be replaced"
        )


def _make_csv(_options: NoOptions, _context: None) -> Exporter:
    return export_csv


def _make_tdms(_options: NoOptions, _context: None) -> Exporter:
    return export_tdms


CSV: Final = ExporterBackend(_make_csv)
TDMS: Final = ExporterBackend(_make_tdms)
