"""Reading the HDF5 file of a recording, finished, running or killed."""

import logging
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Final

import h5py
import numpy as np
import numpy.typing as npt

from cosmic.daqco.core import recording_format as form
from cosmic.daqco.core.unclosed_file import UnclosedFile, is_unclosed, missing_bytes
from cosmic.frame.clock import WALL
from cosmic.frame.errors import RecordingError

READ_ERRORS: Final = (OSError, RuntimeError, ValueError, KeyError, TypeError, MemoryError)
"""What h5py raises over a file that is damaged."""

logger = logging.getLogger(__name__)

ATTEMPTS: Final = 5
PAUSE_S: Final = 0.002

Table = npt.NDArray[np.void]
Values = npt.NDArray[np.float64]


def open_file(path: Path) -> h5py.File:
    """Open `path` for reading, also while it is written and after its writer was killed.

    Raises
    ------
    RecordingError
        There is none, or it is none.
    READ_ERRORS
        It cannot be read.
    """
    if not path.is_file():
        raise RecordingError(f"{path}: there is no such file")
    if is_unclosed(path):
        file = h5py.File(UnclosedFile(path), "r")
    else:
        file = h5py.File(path, "r", locking="best-effort")
    try:
        if file.attrs.get("format") != form.FORMAT:
            raise _cut_off(path) or RecordingError(
                f"{path}: is an HDF5 file, but not a recording by CoSMic"
            )
    except Exception:
        file.close()
        raise
    return file


@dataclass(frozen=True)
class Columns:
    """Which samples of a recording are meant: columns `first` to before `last`."""

    first: int
    last: int

    @property
    def count(self) -> int:
        """How many."""
        return max(0, self.last - self.first)


class RecordingSource:
    """The tables of a recording in memory, and its volts on demand; one thread.

    Raises
    ------
    RecordingError
        It cannot be read, or was written by a newer CoSMic.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.file: h5py.File | None = None
        self._open()

    def refresh(self) -> None:
        """Look again at a file that is still being written."""
        self.close()
        self._open()

    def read_volts(self, channel: int, columns: Columns) -> Values:
        """Return volts of one channel."""
        if self.file is None:
            raise RecordingError(f"{self.path}: was closed; open it again")
        try:
            volts: Values = self._volts[channel, columns.first : columns.last]
        except READ_ERRORS as exc:
            logger.info("%s: read again (%s)", self.path, form.reason(exc))
            self.refresh()
            try:
                volts = self._volts[channel, columns.first : columns.last]
            except READ_ERRORS as again:
                raise self._broken(again) from again
        return volts

    def close(self) -> None:
        """Give the file back; harmless the second time."""
        if self.file is not None:
            self.file.close()
            self.file = None

    def times(self, columns: Columns) -> Values:
        """Return the platform time of samples."""
        chunks = self.tables["chunks"]
        if not columns.count:
            return np.empty(0)
        low, high = self._chunks_of(columns)
        starts, times = chunks["column"][low:high], chunks["time_s"][low:high]
        counts = chunks["samples"][low:high]
        column = np.arange(starts[0], starts[-1] + counts[-1], dtype=np.float64)
        found: Values = np.repeat(times, counts) + (column - np.repeat(starts, counts)) / (
            self.rate_hz
        )
        return found[columns.first - starts[0] : columns.last - starts[0]]

    def columns(self, start_s: float | None, end_s: float | None) -> Columns:
        """Return the samples from `start_s` to before `end_s`, platform time."""
        first = 0 if start_s is None else self._column_at(start_s)
        last = self.samples if end_s is None else self._column_at(end_s)
        return Columns(first, max(first, last))

    def versions(self, columns: Columns) -> list[tuple[int, Columns]]:
        """Return the versions of the scales in force, each with the samples it goes for."""
        chunks = self.tables["chunks"]
        if not columns.count:
            return []
        low, high = self._chunks_of(columns)
        version, starts = chunks["scale_version"][low:high], chunks["column"][low:high]
        cuts = [0, *(np.flatnonzero(np.diff(version)) + 1)]
        edges = [columns.first, *(int(starts[cut]) for cut in cuts[1:]), columns.last]
        return [
            (int(version[cut]), Columns(begin, end))
            for cut, (begin, end) in zip(cuts, pairwise(edges), strict=True)
        ]

    def _chunks_of(self, columns: Columns) -> tuple[int, int]:
        starts = self.tables["chunks"]["column"]
        low = int(np.searchsorted(starts, columns.first, "right")) - 1
        return low, int(np.searchsorted(starts, columns.last, "left"))

    def _column_at(self, time_s: float) -> int:
        if not -np.inf < time_s < np.inf:
            raise ValueError(f"a time is a finite number of seconds, got {time_s!r}")
        chunks = self.tables["chunks"]
        index = int(np.searchsorted(chunks["time_s"], time_s, "right")) - 1
        if index < 0:
            return 0
        row = chunks[index]
        # The times of samples are sums of floats; a sample asked for by its own time is meant.
        into = np.ceil((time_s - row["time_s"]) * self.rate_hz - 1e-6)
        return int(row["column"]) + min(max(0, int(into)), int(row["samples"]))

    def _open(self) -> None:
        """Open the file, a few times: what is half written now is whole in a moment."""
        for attempt in range(ATTEMPTS):
            try:
                self.file = open_file(self.path)
                self._load(self.file)
            except READ_ERRORS as exc:
                self.close()
                if attempt + 1 == ATTEMPTS:
                    raise self._broken(exc) from exc
                WALL.sleep(PAUSE_S)
            except RecordingError:
                self.close()
                raise
            else:
                return

    def _load(self, file: h5py.File) -> None:
        version = int(file.attrs["format_version"])
        if version > form.VERSION:
            raise RecordingError(
                f"{self.path}: has format {version}, this CoSMic reads up to {form.VERSION}; "
                "use a newer one"
            )
        self.rate_hz = float(file.attrs["rate_hz"])
        self.channels: Table = file["channels"][:]
        self.names = tuple(form.decoded(each) for each in self.channels["name"])
        self.complete = bool(file["complete"][()]) and not missing_bytes(self.path)
        # Backwards: what a row of `chunks` speaks of was written before it.
        self.tables: dict[str, Table] = {
            # Files of before lack some tables.
            name: file[name][:] if name in file else np.empty(0, dtype)
            for name, dtype in reversed(form.GROWING.items())
        }
        self.attributes = {name: file.attrs[name] for name in ("software", "start_utc", "start_s")}
        self.configuration = form.decoded(file["configuration"][()])
        self._volts = file["volts"]
        self._trim()
        self._check_tables()

    def _trim(self) -> None:
        """Leave out what a killed process had not written whole."""
        chunks, columns = self.tables["chunks"], self._volts.shape[1]
        whole = chunks[chunks["column"] + chunks["samples"] <= columns]
        self.tables["chunks"] = whole
        self.samples = int(whole["column"][-1] + whole["samples"][-1]) if len(whole) else 0

    def _check_tables(self) -> None:
        """Raise `ValueError` where rows speak of what is not there: a page of the file is lost."""
        chunks, scales = self.tables["chunks"], self.tables["scales"]
        ends = np.concatenate(([0], chunks["column"] + chunks["samples"]))
        if (chunks["samples"] < 0).any() or (chunks["column"] != ends[:-1]).any():
            raise ValueError("its chunks do not follow each other")
        used = set(np.unique(chunks["scale_version"]).tolist())
        for channel in range(len(self.names)):
            if used - set(scales["version"][scales["channel"] == channel].tolist()):
                raise ValueError(f"a scale of {self.names[channel]} is missing")

    def _broken(self, exc: Exception) -> RecordingError:
        return _cut_off(self.path) or RecordingError(
            f"{self.path}: cannot be read ({form.reason(exc)}); it is not a recording, or damaged "
            "beyond what its writer could prevent. Look for a copy"
        )


def _cut_off(path: Path) -> RecordingError | None:
    try:
        missing = missing_bytes(path)
    except OSError:  # why it cannot be read is told by whoever asks
        return None
    if not missing:
        return None
    return RecordingError(
        f"{path}: is cut off, its last {missing} bytes are missing. Run cosmic repair {path}, or "
        "look for a copy"
    )
