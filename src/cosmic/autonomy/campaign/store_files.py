"""Files of a campaign: written whole or not at all, and the lock that keeps a second writer out."""

import os
import sqlite3
from contextlib import suppress
from pathlib import Path
from typing import Final

from cosmic.autonomy.campaign.records import CampaignError

DATABASE: Final = "campaign.sqlite"
LOCK: Final = "campaign.lock"
FIBRES: Final = "fibres"
PART: Final = ".part"


class NotWrittenError(CampaignError):
    """The disk did not take it: there may be room later."""


def write_whole(path: Path, data: bytes) -> None:
    """Write a file under another name, see that it is on the disk, and give it its name.

    Raises
    ------
    NotWrittenError
        It cannot be written; nothing of it is left.
    """
    part = path.with_name(path.name + PART)
    try:
        with part.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    except OSError as exc:
        with suppress(OSError):
            part.unlink(missing_ok=True)
        raise NotWrittenError(
            f"{path} cannot be written: {exc.strerror or exc}; what was finished before is kept: "
            "make room, and start the campaign again in the same folder"
        ) from exc


def write_through(folder: Path) -> None:
    """See that the names in a folder are on the disk too, where a folder can be opened.

    Raises
    ------
    NotWrittenError
        They cannot be written.
    """
    if os.name != "posix":
        return
    try:
        opened = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(opened)
        finally:
            os.close(opened)
    except OSError as exc:
        raise NotWrittenError(f"{folder} cannot be written: {exc.strerror or exc}") from exc


def remove_parts(folder: Path) -> None:
    """Remove what an end without warning left half written."""
    for part in folder.glob(f"*{PART}"):
        with suppress(OSError):
            part.unlink()


class FolderLock:
    """Keeps a folder to one writer; the system lets go of it when the process ends, however.

    Raises
    ------
    CampaignError
        Another process, or another store of this one, has it.
    """

    def __init__(self, folder: Path) -> None:
        self._line = sqlite3.connect(
            folder / LOCK, timeout=0.0, isolation_level=None, check_same_thread=False
        )
        try:
            self._line.execute("PRAGMA journal_mode = MEMORY")
            self._line.execute("BEGIN EXCLUSIVE")
        except sqlite3.Error as exc:
            self._line.close()
            raise CampaignError(
                f"{folder}: a campaign is being written there already ({exc}); "
                "wait for its end, or name another folder"
            ) from exc

    def release(self) -> None:
        """Let others write."""
        self._line.close()
