"""Where recordings go on this computer's disk, and which of it other stations may use."""

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Final

from cosmic.daqco.core.recording_format import SUFFIX
from cosmic.frame.errors import RecordingError
from cosmic.frame.file_names import NameOption, file_name

RECORDINGS: Final = (".h5",)
EXPORTS: Final = (".csv", ".tdms")
MOST_LISTED: Final = 200


@dataclass(frozen=True, slots=True)
class NamedFile:
    """A file to record to; `size_bytes` of the one that lies there already, None without any."""

    path: Path
    size_bytes: int | None


def named_file(base: str, option: NameOption, directory: Path, when: datetime) -> NamedFile:
    """Return the file for a recording that is begun now; raises `RecordingError`."""
    name = file_name(base, option, suffix=SUFFIX, when=when, directory=directory)
    path = directory / name
    try:
        return NamedFile(path, path.stat().st_size if path.exists() else None)
    except OSError as exc:
        raise RecordingError(f"{path}: {exc}") from exc


def recordings_in(directory: Path) -> tuple[Path, ...]:
    """Return the newest recordings in a directory, newest first; raises `RecordingError`."""
    dated: list[tuple[float, Path]] = []
    try:
        for each in directory.glob(f"*{SUFFIX}"):
            with suppress(FileNotFoundError):  # taken away meanwhile, or a link to nowhere
                dated.append((each.stat().st_mtime, each))
    except OSError as exc:
        raise RecordingError(f"{directory}: {exc}") from exc
    return tuple(each for _, each in sorted(dated, reverse=True)[:MOST_LISTED])


class RecordingFolders:
    """Keeps what others name inside some folders; any thread.

    Parameters
    ----------
    folders : iterable of Path
        Where, with everything below; the first is where a relative path begins.
    """

    def __init__(self, folders: Iterable[Path]) -> None:
        self._folders = tuple(each.expanduser().resolve() for each in folders)

    def folder(self, text: str) -> Path:
        """Return a directory as an absolute path without links.

        Raises
        ------
        RecordingError
            It lies outside of the folders for recordings.
        """
        try:
            whole = (self._folders[0] / Path(text).expanduser()).resolve()
        except (OSError, ValueError, RuntimeError) as exc:
            raise RecordingError(f"{text[:200]!r} is not a path: {exc}") from exc
        if not any(whole.is_relative_to(each) for each in self._folders):
            inside = ", ".join(str(each) for each in self._folders)
            raise RecordingError(
                f"{text[:200]}: other stations may use files in {inside} only; "
                "choose a folder there"
            )
        return whole

    def file(self, text: str, suffixes: tuple[str, ...]) -> Path:
        """Return a file of one of some kinds; raises `RecordingError` as `folder`."""
        whole = self.folder(text)
        if whole.suffix.lower() not in suffixes:
            raise RecordingError(f"{text[:200]}: its name has to end in {' or '.join(suffixes)}")
        return whole
