"""Sums over the tables of a campaign: what was changed in its database by something else is seen.

Raw files, images and files of the record have their SHA-256 in the database; these are those of the
database itself. They stand in it, so that a slip is seen, a changed cell and a lost row, and not
somebody who computes them anew.
"""

import hashlib
import json
import sqlite3
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Self

from cosmic.autonomy.campaign.storage_format import RESULT_CELLS

RESULTS: Final = "results"
"""What an analysis writes: it can be had again from the raw files, and takes no part in `fibre`."""
SUMS: Final = "sums_json"
ANALYSIS: Final = "analysis_json"
TABLES: Final = ("campaign", "run", "calibration", "picture", "operation", "plate", "sighting")
_Rows = list[dict[str, Any]]


@dataclass(frozen=True, slots=True)
class RecordSums:
    """SHA-256 of the parts of a record as they were written.

    Attributes
    ----------
    sums : mapping of str to str
        By part: a table, or "results". Empty while the campaign runs, and of earlier programs.
    altered : tuple of str
        Parts that had been changed when the campaign was gone on with.
    """

    sums: Mapping[str, str] = field(default_factory=dict)
    altered: tuple[str, ...] = ()

    @classmethod
    def kept(cls, connection: sqlite3.Connection) -> Self:
        """Return what a record says of itself.

        Raises
        ------
        ValueError
            It is not understood.
        """
        page = json.loads(_rows(connection, "campaign")[0].get(SUMS) or "{}")
        if not isinstance(page, dict):
            raise ValueError(f"{SUMS} is no table")
        return cls(dict(page.get("sums", {})), tuple(page.get("altered", ())))

    def differing(self, connection: sqlite3.Connection) -> tuple[str, ...]:
        """Return the parts that are not as they were written."""
        if not self.sums:
            return self.altered
        now = sums_of(connection)
        wrong = {part for part, digest in self.sums.items() if now.get(part) != digest}
        return tuple(sorted(wrong.union(self.altered)))

    def renewed(self, connection: sqlite3.Connection, *, but: Collection[str] = ()) -> Self:
        """Return those of now; parts that differed already keep the sum of before."""
        now = sums_of(connection)
        return type(self)(
            {part: self.sums.get(part, "") if part in but else now[part] for part in now},
            self.altered,
        )

    def write(self, connection: sqlite3.Connection) -> None:
        """Put them into the record."""
        page = {"sums": dict(self.sums), "altered": list(self.altered)}
        connection.execute(f"UPDATE campaign SET {SUMS} = ?", (json.dumps(page),))


def sums_of(connection: sqlite3.Connection) -> dict[str, str]:
    """Return the SHA-256 of each part of a record as it is."""
    campaign, fibres = _rows(connection, "campaign"), _rows(connection, "fibre")
    results = [
        _only(campaign, {ANALYSIS}),
        _only(fibres, RESULT_CELLS | {"number"}),
        _rows(connection, "span"),
    ]
    parts: dict[str, object] = {each: _rows(connection, each) for each in TABLES[1:]}
    parts["campaign"] = _without(campaign, {ANALYSIS, SUMS})
    parts["fibre"] = _without(fibres, RESULT_CELLS)
    parts[RESULTS] = results
    return {
        part: hashlib.sha256(json.dumps(rows, sort_keys=True, default=str).encode()).hexdigest()
        for part, rows in parts.items()
    }


def _only(rows: _Rows, names: Collection[str]) -> _Rows:
    return [{name: cell for name, cell in row.items() if name in names} for row in rows]


def _without(rows: _Rows, names: Collection[str]) -> _Rows:
    return [{name: cell for name, cell in row.items() if name not in names} for row in rows]


def _rows(connection: sqlite3.Connection, table: str) -> _Rows:
    """Return the rows of a table; none where a campaign of an earlier program has no such table."""
    named = "SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = ?"
    if connection.execute(named, (table,)).fetchone() is None:
        return []
    cursor = connection.execute(f"SELECT * FROM {table} ORDER BY rowid")
    names = [each[0] for each in cursor.description]
    return [dict(zip(names, row, strict=True)) for row in cursor.fetchall()]
