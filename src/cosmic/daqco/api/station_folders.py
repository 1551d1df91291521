"""Which files other stations may have written on this computer's disk."""

from collections.abc import Iterable
from pathlib import Path
from typing import Final

from cosmic.frame.errors import RecordingError

RECORDINGS: Final = (".h5",)
EXPORTS: Final = (".csv", ".tdms")


class StationFolders:
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
            raise RecordingError(f"{text[:200]!r} is no path: {exc}") from exc
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
