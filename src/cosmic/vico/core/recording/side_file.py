"""The side file: a CSV with a line for every image that came."""

import csv
import io
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from cosmic.frame.errors import RecordingError, RecordingExistsError
from cosmic.vico.core.recording.side_row import (
    COLUMNS,
    END,
    ENDED_EARLY,
    NOT_THERE,
    SideRow,
    position_column,
    position_texts,
    row_from,
)

_UNITS = ("um", "deg")


class SideFile:
    """A side file being written; one thread.

    The first row decides which axes have a column: those of `axes`, and those it has positions of.

    Parameters
    ----------
    axes : mapping of str to str
        Unit of each axis, "um" or "deg", by its name.

    Raises
    ------
    RecordingExistsError
        There is such a file, and `overwrite` is False.
    RecordingError
        It cannot be created.
    """

    def __init__(
        self, path: Path, axes: Mapping[str, str] | None = None, *, overwrite: bool = False
    ) -> None:
        self._path = path
        self._axes = dict(axes or {})
        self._last: SideRow | None = None
        try:
            # Closed by `close`: it stays open as long as the recording.
            self._file = path.open("w" if overwrite else "x", newline="", encoding="utf-8")
        except FileExistsError as exc:
            raise RecordingExistsError(
                f"{path}: there is such a file; choose another name, or say that it may be replaced"
            ) from exc
        except OSError as exc:
            raise RecordingError(
                f"{path}: cannot be created ({exc.strerror or exc}); choose another directory"
            ) from exc
        self._lines = csv.writer(self._file, lineterminator="\n")

    @property
    def path(self) -> Path:
        """Where it lies."""
        return self._path

    def add(self, row: SideRow) -> None:
        """Write a row; raises `OSError`."""
        if self._last is None:
            for axis in row.circumstances.positions:
                self._axes.setdefault(axis, "")
            self._write_header()
        self._last = row
        texts = row.texts() | position_texts(row, self._axes)
        self._lines.writerow(texts.values())

    def flush(self) -> None:
        """Hand everything to the system; raises `OSError`."""
        self._file.flush()

    def close(self, *, complete: bool) -> None:
        """Say how the recording ended, and close; harmless the second time; raises `OSError`."""
        if self._file.closed:
            return
        try:
            if self._last is not None:
                status = END if complete else ENDED_EARLY
                # The last values again, for an empty number would make pandas round the others.
                self.add(replace(self._last, index=NOT_THERE, lost_before=0, status=status))
            elif complete:
                self._write_header()
        finally:
            self._file.close()

    def _write_header(self) -> None:
        columns = [position_column(*each) for each in self._axes.items()]
        self._lines.writerow([*COLUMNS, *columns])


@dataclass(frozen=True, slots=True)
class SideTable:
    """What stands in a side file.

    Attributes
    ----------
    rows : tuple of SideRow
        Without the one that says how it ended.
    axes : mapping of str to str
        Unit of each axis by its name; empty where the column has none.
    complete : bool
        It was closed in order.
    """

    rows: tuple[SideRow, ...] = ()
    axes: Mapping[str, str] = field(default_factory=dict)
    complete: bool = False


def read_side_file(path: Path) -> SideTable:
    """Return what stands in a side file, finished, running or cut off.

    Raises
    ------
    RecordingError
        There is no such file, or it is none.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, ValueError) as exc:
        raise RecordingError(f"{path}: cannot be read as a side file ({exc})") from exc
    whole = text[: text.rfind("\n") + 1]  # a kill can cut the last line off
    lines = csv.DictReader(io.StringIO(whole, newline=""))
    header = lines.fieldnames or ()
    if header and not set(COLUMNS) <= set(header):
        raise RecordingError(f"{path}: is not a side file of a recording of images")
    units = _axes(header)
    columns = {position_column(axis, unit): axis for axis, unit in units.items()}
    try:
        rows = [row_from(each, columns) for each in lines]
    except RecordingError as exc:
        raise RecordingError(f"{path}, line {lines.line_num}: {exc}") from exc
    complete = rows[-1].status == END if rows else bool(header)
    return SideTable(tuple(row for row in rows if not row.is_end), units, complete)


def _axes(header: Iterable[str]) -> dict[str, str]:
    """Return the unit of each axis by its name."""
    parts = [each.rpartition("_") for each in header if each not in COLUMNS]
    return {
        (axis if unit in _UNITS else f"{axis}{mark}{unit}"): unit if unit in _UNITS else ""
        for axis, mark, unit in parts
    }
