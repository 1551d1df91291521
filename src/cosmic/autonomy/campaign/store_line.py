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
from cosmic.autonomy.campaign.store_files import DATABASE, FolderLock
from cosmic.autonomy.campaign.store_rows import Row, insert
from cosmic.autonomy.campaign.store_schema import SCHEMA_VERSION, TABLES

BUSY_S: Final = 10.0


class WriteLine:
    """Transactions on the database; any thread, one at a time.

    Attributes
    ----------
    guard : RLock
        Held during a transaction, and by who needs several to be one.
    """

    def __init__(self, folder: Path) -> None:
        self.guard = RLock()
        self._file = folder / DATABASE
        self._lock = FolderLock(folder)
        self._closed = False
        try:
            self._line = sqlite3.connect(
                self._file, timeout=BUSY_S, isolation_level=None, check_same_thread=False
            )
            self._line.execute("PRAGMA foreign_keys = ON")
            self._line.execute("PRAGMA journal_mode = WAL")
        except sqlite3.Error as exc:
            self._lock.release()
            raise self._failure(exc) from exc

    def lay_out(self, info: CampaignInfo) -> None:
        """Make the tables, and say what the campaign is."""
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
        with self.transaction() as line:
            for statement in TABLES.split(";"):
                if statement.strip():
                    line.execute(statement)
            insert(line, "campaign", row)
            line.execute(f"PRAGMA user_version = {SCHEMA_VERSION}")

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
                raise self._failure(exc) from exc

    def _failure(self, error: sqlite3.Error) -> CampaignError:
        return CampaignError(
            f"{self._file} cannot be written: {error}; what was finished before is kept: make "
            "room, and start the campaign again in the same folder"
        )

    def close(self) -> None:
        """Let go of the folder; without effect after the first time."""
        with self.guard:
            if not self._closed:
                self._closed = True
                self._line.close()
                self._lock.release()


def last_number(line: sqlite3.Connection) -> int:
    """Return the number that the last row got."""
    return int(line.execute("SELECT last_insert_rowid()").fetchone()[0])
