"""Closing recordings that a process left open when it was killed, and knowing which there are.

Whatever is in doubt is left as it is: a file is closed only when its writer is known to be gone.
"""

import logging
import os
import tomllib
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Final
from uuid import uuid4

import h5py

from cosmic.daqco.core import recording_format as form
from cosmic.daqco.core.recording_source import READ_ERRORS, RecordingSource
from cosmic.daqco.core.unclosed_file import (
    END_AT,
    FLAGS_AT,
    LENGTH,
    UnclosedFile,
    closed_head,
    is_recent,
    is_unclosed,
    missing_bytes,
)
from cosmic.frame.errors import RecordingError
from cosmic.frame.file_holder import FileHold, Life, ProcessMark
from cosmic.frame.kept_file import toml_lines, write_whole

logger = logging.getLogger(__name__)

MOST_NOTES: Final = 500
"""Notes of open recordings that are kept; the oldest go."""
MOST_FILES: Final = 500
"""Files of a folder that are looked at, the newest first."""
_NOTE: Final = ".toml"
_BLOCK: Final = 1 << 20
_STEP: Final = 4096


class Outcome(Enum):
    """What was found of a file."""

    CLOSED = "closed"
    WHOLE = "whole"
    IN_USE = "in use"
    UNSURE = "unsure"


@dataclass(frozen=True, slots=True)
class Closing:
    """What was done with one file.

    Attributes
    ----------
    text : str
        In words, with the path.
    """

    outcome: Outcome
    path: Path
    text: str


def close_left_open(path: Path, *, trusted: bool = False) -> Closing:
    """Close a recording whose writer is gone, so that every program can open it.

    Its head gets what HDF5's ``h5clear`` writes, and the room taken ahead is given back. Samples
    and tables stay as they are; where the result could not be read, the head is put back.

    Parameters
    ----------
    trusted : bool
        Somebody says that the writer is gone where that cannot be seen from here.

    Raises
    ------
    RecordingError
        It is no recording, damaged beyond this, or cannot be written; it is as it was.
    """
    try:
        with FileHold(path, alone=True) as hold:
            with path.open("rb") as file:
                head = file.read(LENGTH)
            if not is_recent(head):
                raise RecordingError(f"{path}: is not a recording by CoSMic; nothing was changed")
            if not is_unclosed(path):
                hold.take(alone=False)
                _contents(path)
                return Closing(Outcome.WHOLE, path, f"{path}: is closed; there is nothing to do")
            doubt = _doubt(path, trusted=trusted) if hold.held else _in_use(path)
            return doubt or _close(path, head, hold)
    except OSError as exc:
        raise RecordingError(
            f"{path}: cannot be closed ({exc.strerror or exc}); it is as it was"
        ) from exc


def _check_is_recording(path: Path, file: h5py.File) -> None:
    if file.attrs.get("format") != form.FORMAT:
        raise _cut_off(path) or RecordingError(
            f"{path}: is an HDF5 file, but not a recording by CoSMic; nothing was changed. "
            "HDF5's own h5clear --status closes such files"
        )


def _broken(path: Path, exc: Exception) -> RecordingError:
    return _cut_off(path) or RecordingError(
        f"{path}: cannot be read ({form.reason(exc)}); it is damaged beyond what can be mended, "
        "and nothing was changed. Look for a copy"
    )


def _cut_off(path: Path) -> RecordingError | None:
    missing = missing_bytes(path)
    if not missing:
        return None
    return RecordingError(
        f"{path}: is cut off, its last {missing} bytes are missing; it is damaged beyond what can "
        "be mended, and nothing was changed. Look for a copy"
    )


def _in_use(path: Path) -> Closing:
    text = f"{path}: is in use; it was not changed. Close the program that has it open"
    return Closing(Outcome.IN_USE, path, text)


def _doubt(path: Path, *, trusted: bool) -> Closing | None:
    """Return why the file must be left alone; None: nobody writes it."""
    writer = _writer_of(path)
    life = Life.UNKNOWN if writer is None else writer.life
    if life is Life.LIVES:
        return _in_use(path)
    if life is Life.GONE or trusted:
        return None
    if writer is None:
        who = "does not say which process wrote it"
    else:
        who = (
            f"was written by process {writer.pid} on {writer.host}, which cannot be seen from here"
        )
    return Closing(
        Outcome.UNSURE,
        path,
        f"{path}: {who}; it was left alone. When nothing writes it any more: "
        f"cosmic repair --ended {path}",
    )


def _writer_of(path: Path) -> ProcessMark | None:
    try:
        with h5py.File(UnclosedFile(path), "r") as file:
            _check_is_recording(path, file)
            attributes = file.attrs
            if "writer_pid" not in attributes:
                return None
            return ProcessMark(
                str(attributes["writer_host"]),
                int(attributes["writer_pid"]),
                str(attributes["writer_start"]),
            )
    except READ_ERRORS as exc:
        raise _broken(path, exc) from exc


def _close(path: Path, head: bytes, hold: FileHold) -> Closing:
    end, lost = _end_of(path, head)
    before = _contents(path)
    size = path.stat().st_size
    with path.open("r+b") as file:
        _write_head(file.fileno(), closed_head(head, end))
        hold.take(alone=False)  # for HDF5, which holds what it reads
        try:
            if _contents(path) != before:
                raise RecordingError("it would not have the same in it")
        except BaseException as exc:
            _write_head(file.fileno(), head)
            if isinstance(exc, Exception):
                text = f"{path}: cannot be closed ({exc}); it is as it was. Look for a copy"
                raise RecordingError(text) from exc
            raise
        file.truncate(end)
        os.fsync(file.fileno())
    summary = f"{path}: closed; {before.seconds:.2f} s of samples"
    if lost:
        summary += f", of which {lost} blocks are lost with the end of the file"
    if end < size:
        summary += f"; {(size - end) / 1e6:.1f} MB of disk space released"
    return Closing(Outcome.CLOSED, path, summary)


def _write_head(handle: int, head: bytes) -> None:
    # Below the size of a sector, and in one call: it is there whole or not at all.
    os.lseek(handle, 0, os.SEEK_SET)
    os.write(handle, head)
    os.fsync(handle)


@dataclass(frozen=True)
class _Contents:
    samples: int
    seconds: float
    tables: tuple[bytes, ...]


def _contents(path: Path) -> _Contents:
    """Return what a reader finds; raises `RecordingError`."""
    try:
        source = RecordingSource(path)
    except RecordingError as exc:
        # A reader advises this repair, which cannot bring back what is cut off.
        raise _cut_off(path) or exc from exc
    try:
        tables = tuple(source.tables[name].tobytes() for name in sorted(source.tables))
        return _Contents(source.samples, source.samples / source.rate_hz, tables)
    finally:
        source.close()


def _end_of(path: Path, head: bytes) -> tuple[int, int]:
    """Return where the file ends without the room taken ahead, and how many blocks lie beyond."""
    size = path.stat().st_size
    ends: list[int] = []
    try:
        with h5py.File(UnclosedFile(path), "r") as file:
            for name in filter(file.__contains__, ("volts", *form.GROWING)):
                file[name].id.chunk_iter(lambda each: ends.append(each.byte_offset + each.size))
    except READ_ERRORS as exc:
        raise _broken(path, exc) from exc
    written = int.from_bytes(head[END_AT : END_AT + 8], "little")
    used = max([_last_byte(path, size), written, *ends])
    # Room that HDF5 itself gave to a table ends in zeros that belong to it.
    return min(size, -(-used // _STEP) * _STEP), sum(each > size for each in ends)


def _last_byte(path: Path, size: int) -> int:
    """Return where the zeros at the end of the file begin."""
    with path.open("rb") as file:
        for begin in range((size - 1) // _BLOCK * _BLOCK, -1, -_BLOCK):
            file.seek(begin)
            kept = file.read(_BLOCK).rstrip(b"\0")
            if kept:
                return begin + len(kept)
    return 0


class OpenRecordings:
    """Notes, in a folder of the user's, of the recordings that are being written; any thread.

    A note is a file of its own, so that processes do not wait for each other; it survives them.

    Parameters
    ----------
    folder : Path
        Made when it is needed.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def note(self, path: Path) -> Path | None:
        """Note that `path` is being written; returns the note, for `forget`.

        A note that cannot be made costs no recording.
        """
        note = self._folder / f"{os.getpid()}-{uuid4().hex[:12]}{_NOTE}"
        try:
            where = str(path.absolute())
            where.encode("utf-8")  # a folder of another system may have a name that is no text
            self._folder.mkdir(parents=True, exist_ok=True)
            write_whole(note, toml_lines({"recording": where}))
            for old in self._notes()[MOST_NOTES:]:
                old.unlink(missing_ok=True)
        except (OSError, UnicodeError) as exc:
            logger.warning("%s: it is not noted that %r is recorded (%s)", note, str(path), exc)
            return None
        return note

    def forget(self, note: Path) -> None:
        """Take a note away; harmless where it is gone."""
        with suppress(OSError):
            note.unlink(missing_ok=True)

    def close_left_open(self, folders: tuple[Path, ...] = ()) -> list[Closing]:
        """Close the recordings of processes that are gone: those noted, and those in `folders`.

        Returns what was done, and what was left for a person to decide.
        """
        closings: list[Closing] = []
        seen: set[Path] = set()
        for note in self._notes():
            path = _noted(note)
            if path is None or (path.parent.is_dir() and not path.is_file()):
                self.forget(note)
            if path is None or not path.is_file():  # its disk may come back
                continue
            seen.add(path)
            found = _attempt(path)
            if found is None or found.outcome in (Outcome.CLOSED, Outcome.WHOLE):
                self.forget(note)
            if found is not None:
                closings.append(found)
        for path in _recordings(folders):
            if path not in seen and _looks_unclosed(path):
                found = _attempt(path)
                closings += [] if found is None else [found]
        return [each for each in closings if each.outcome is not Outcome.WHOLE]

    def _notes(self) -> list[Path]:
        """Return the notes, the newest first."""
        return _newest(self._folder, f"*{_NOTE}")


def _attempt(path: Path) -> Closing | None:
    try:
        return close_left_open(path)
    except RecordingError as exc:
        logger.warning("%s", exc)
        return None


def _noted(note: Path) -> Path | None:
    with suppress(OSError, ValueError), note.open("rb") as file:
        return Path(str(tomllib.load(file).get("recording", ""))).absolute()
    return None


def _recordings(folders: tuple[Path, ...]) -> Iterator[Path]:
    for folder in folders:
        yield from (each.absolute() for each in _newest(folder, f"*{form.SUFFIX}")[:MOST_FILES])


def _newest(folder: Path, pattern: str) -> list[Path]:
    dated: list[tuple[float, Path]] = []
    with suppress(OSError):
        for each in folder.glob(pattern):
            with suppress(OSError):
                dated.append((each.stat().st_mtime, each))
    return [path for _, path in sorted(dated, reverse=True)]


def _looks_unclosed(path: Path) -> bool:
    try:
        with path.open("rb") as file:
            head = file.read(LENGTH)
        return is_recent(head) and head[FLAGS_AT] != 0
    except OSError:
        return False
