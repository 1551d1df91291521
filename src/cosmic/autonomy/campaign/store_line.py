"""The line to the database of a campaign, for its one writer."""

import hashlib
import json
import sqlite3
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from threading import RLock
from typing import Final

from cosmic.autonomy.campaign.records import CampaignError, CampaignInfo
from cosmic.autonomy.campaign.store_files import DATABASE, PART, FolderLock, NotWrittenError
from cosmic.autonomy.campaign.store_rows import Row, insert
from cosmic.autonomy.campaign.store_schema import SCHEMA_VERSION, TABLES

BUSY_S: Final = 10.0


class WriteLine:
    """Transactions on the database; any thread, one at a time.

    Attributes
    ----------
    guard : RLock
        Held during a transaction, and by who needs several to be one.

    Parameters
    ----------
    info : CampaignInfo, optional
        What is begun; None: it is there already.
    """

    def __init__(self, folder: Path, info: CampaignInfo | None = None) -> None:
        self.guard = RLock()
        self._file = folder / DATABASE
        self._lock = FolderLock(folder)
        self._closed = False
        try:
            if info is not None:
                _lay_out(self._file, info)
            self._line = _opened(self._file)
        except BaseException:
            self._lock.release()
            raise

    @contextmanager
    def transaction(self, *, durable: bool = True) -> Generator[sqlite3.Connection]:
        """Do all of it or nothing; durable: it is on the disk before going on.

        Raises
        ------
        CampaignError
            The line is closed, or it cannot be written.
        """
        with self.guard:
            if self._closed:
                raise CampaignError(f"{self._file.parent}: this campaign is closed")
            try:
                self._line.execute(f"PRAGMA synchronous = {'FULL' if durable else 'NORMAL'}")
                self._line.execute("BEGIN IMMEDIATE")
                try:
                    yield self._line
                    self._line.execute("COMMIT")
                finally:
                    if self._line.in_transaction:
                        self._line.execute("ROLLBACK")
            except sqlite3.Error as exc:
                raise _failure(self._file, exc) from exc

    def close(self) -> None:
        """Let go of the folder; without effect after the first time."""
        with self.guard:
            if not self._closed:
                self._closed = True
                self._line.close()
                self._lock.release()


def _opened(file: Path) -> sqlite3.Connection:
    try:
        line = sqlite3.connect(file, timeout=BUSY_S, isolation_level=None, check_same_thread=False)
        line.execute("PRAGMA foreign_keys = ON")
        line.execute("PRAGMA journal_mode = WAL")
    except sqlite3.Error as exc:
        raise _failure(file, exc) from exc
    return line


def _lay_out(file: Path, info: CampaignInfo) -> None:
    """Make the tables under another name, so that there is a whole database or none."""
    part = file.with_name(file.name + PART)
    part.unlink(missing_ok=True)
    row: Row = {
        "one": 1,
        "name": info.name,
        "procedure": info.procedure,
        "sample": info.sample,
        "recipe_text": info.recipe_text,
        "recipe_sha256": hashlib.sha256(info.recipe_text.encode()).hexdigest(),
        "started": info.started,
        "description": info.description,
        "operator": info.operator,
        "hardware": info.hardware,
        "seed": info.seed,
        "rate": info.rate,
        "versions_json": json.dumps(dict(info.versions)),
    }
    line = sqlite3.connect(part, isolation_level=None)
    try:
        line.execute("BEGIN")
        for statement in TABLES.split(";"):
            if statement.strip():
                line.execute(statement)
        insert(line, "campaign", row)
        line.execute(f"PRAGMA user_version = {SCHEMA_VERSION}")
        line.execute("COMMIT")
    except sqlite3.Error as exc:
        raise _failure(file, exc) from exc
    finally:
        line.close()
    part.replace(file)


def _failure(file: Path, error: sqlite3.Error) -> NotWrittenError:
    return NotWrittenError(
        f"{file} cannot be written: {error}; what was finished before is kept: make room, and "
        "start the campaign again in the same folder"
    )


def last_number(line: sqlite3.Connection) -> int:
    """Return the number that the last row got."""
    return int(line.execute("SELECT last_insert_rowid()").fetchone()[0])
