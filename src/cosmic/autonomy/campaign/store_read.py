"""Reading a campaign, also while it is written, and by another process."""

import hashlib
import json
import math
import sqlite3
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np

from cosmic.autonomy.campaign.record_sums import RESULTS, RecordSums
from cosmic.autonomy.campaign.records import (
    FIBRE,
    FINISHED,
    CalibrationNote,
    CampaignError,
    CampaignInfo,
    FibreImage,
    FibreRecord,
    Image,
    JournalEntry,
    PlateChange,
    Sighting,
)
from cosmic.autonomy.campaign.storage_format import (
    DATABASE,
    FIBRES,
    FINAL,
    SCHEMA_VERSION,
    Cell,
    Row,
    fibre_record,
    number,
    raw_file,
    read_curves,
    read_fitted,
    region_px,
)
from cosmic.frame.arguments import checked_class
from cosmic.frame.renamed import Renamed

ANALYSED: Final = ("fit", "standard", "scale")
"""What is kept of an analysis."""


@checked_class
class CampaignReader:
    """What a campaign's folder holds; each call reads anew; any thread."""

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder)

    def check(self) -> None:
        """See that this is a campaign that can be read.

        Raises
        ------
        CampaignError
            It is not.
        """
        if not (self.folder / DATABASE).exists():
            refuse_raw_files_alone(self.folder)
            what = f"there is no {DATABASE} in it" if self.folder.is_dir() else "it is not a folder"
            raise CampaignError(f"{self.folder} holds no campaign: {what}")
        version = self.version()
        if version == 0:
            refuse_raw_files_alone(self.folder)
            raise CampaignError(f"{self.folder} holds no campaign: its creation was interrupted")
        if version != SCHEMA_VERSION:
            raise CampaignError(
                f"{self.folder / DATABASE} is of version {version}, and this program reads "
                f"version {SCHEMA_VERSION}: open it with the program that wrote it"
            )

    def version(self) -> int:
        """Return the version of the tables; 0 where there is no campaign."""
        if not (self.folder / DATABASE).exists():
            return 0
        with self._connection() as connection:
            return int(connection.execute("PRAGMA user_version").fetchone()[0])

    def info(self) -> CampaignInfo:
        """Return what the campaign is."""
        with self._understood():
            (row,) = self._rows("SELECT * FROM campaign")
            return CampaignInfo(
                name=str(row["name"]),
                procedure=str(row["procedure"]),
                sample=str(row["sample"]),
                recipe_text=str(row["recipe_text"]),
                started=str(row["started"]),
                description=str(row["description"]),
                operator=str(row["operator"]),
                hardware=str(row["hardware"]),
                seed=int(number(row["seed"])),
                rate=number(row["rate"]),
                versions=json.loads(str(row["versions_json"])),
                world=str(row.get("world", "")),
            )

    def ended(self) -> tuple[str, str]:
        """Return when the campaign ended last, ISO 8601, and why; both empty while it runs."""
        (row,) = self._rows("SELECT ended, end_reason FROM campaign")
        return str(row["ended"]), str(row["end_reason"])

    def cut_off(self) -> bool:
        """Return whether the run before the last one ended without a word."""
        rows = self._rows("SELECT end_s FROM run ORDER BY number DESC LIMIT 2")
        return len(rows) == 2 and rows[1]["end_s"] is None

    def elapsed_s(self) -> float:
        """Return how long all runs took together, on the platform's clock.

        A run that was cut off counts until the last that it wrote of: a fibre, or in the journal.
        """
        rows = self._rows(
            "SELECT run.*, max(coalesce(run.end_s, run.begin_s),"
            " coalesce(max(fibre.ended_s), run.begin_s), coalesce(max(fibre.began_s), run.begin_s))"
            " AS until_s FROM run LEFT JOIN fibre ON fibre.run = run.number GROUP BY run.number"
        )
        noted_s = self._noted_s()
        for row in rows:
            if row["end_s"] is None:
                row["until_s"] = max(number(row["until_s"]), noted_s.get(row["number"], -math.inf))
        return sum(number(row["until_s"]) - number(row["begin_s"]) for row in rows)

    def _noted_s(self) -> dict[Cell, float]:
        """Return when each run wrote the last line of its journal."""
        with self._connection() as connection:
            columns = {row[1] for row in connection.execute("PRAGMA table_info(journal)")}
        if "run" not in columns:  # of an earlier program
            return {}
        rows = self._rows("SELECT run, max(time_s) AS noted_s FROM journal GROUP BY run")
        return {row["run"]: number(row["noted_s"]) for row in rows}

    def calibrations(self) -> tuple[CalibrationNote, ...]:
        """Return the calibrations that were in force, oldest first."""
        return tuple(
            CalibrationNote(
                str(row["name"]),
                number(row["residual"]),
                str(row["unit"]),
                str(row["made"]),
                number(row.get("age_s")),
            )
            for row in self._rows(
                "SELECT * FROM calibration GROUP BY name, residual, unit, made ORDER BY min(rowid)"
            )
        )

    def fibres(self, role: str = FIBRE, *, first: int = 1) -> tuple[FibreRecord, ...]:
        """Return all fibres without curves and images, those in treatment included.

        Parameters
        ----------
        role : str
            "standard" for the measurements of the standard, which are no fibres.
        first : int
            Those with this number and larger ones.
        """
        spans = self._by_fibre("SELECT * FROM span WHERE fibre >= ? ORDER BY fibre, number", first)
        steps = self._by_fibre(
            "SELECT * FROM operation WHERE fibre >= ? ORDER BY fibre, number", first
        )
        with self._understood():
            return tuple(
                record
                for row in self._rows(
                    "SELECT * FROM fibre WHERE number >= ? ORDER BY number", first
                )
                if (
                    record := fibre_record(
                        row, spans.get(row["number"], []), steps.get(row["number"], [])
                    )
                ).role
                == role
            )

    def sightings(self) -> tuple[Sighting, ...]:
        """Return what the first survey of each plate saw; empty where it was not kept."""
        if not self._has("sighting"):
            return ()
        return tuple(
            Sighting(
                plate=int(number(row["plate"])),
                x_plate_um=number(row["x_plate_um"]),
                y_plate_um=number(row["y_plate_um"]),
                length_um=number(row["length_um"]),
                width_um=number(row["width_um"]),
                curl=number(row["curl"]),
                problem=str(row["problem"]),
            )
            for row in self._rows("SELECT * FROM sighting ORDER BY plate, number")
        )

    def plate_changes(self) -> tuple[PlateChange, ...]:
        """Return the changes of the plate, oldest first; the last may not be over."""
        if not self._has("plate"):
            return ()
        return tuple(
            PlateChange(
                plate=int(number(row["number"])),
                run=int(number(row["run"])),
                asked_s=number(row["asked_s"]),
                put_s=number(row["put_s"]),
                by=str(row["put_by"]),
            )
            for row in self._rows("SELECT * FROM plate ORDER BY number")
        )

    def handling_s(self, role: str = FIBRE) -> float:
        """Return how long fibres of a role were in work, on the platform's clock.

        What two arms do at the same time counts once.
        """
        rows = self._rows("SELECT * FROM fibre WHERE ended_s IS NOT NULL ORDER BY run, began_s")
        whole_s, until_s = 0.0, -math.inf
        run: Cell = None
        for row in rows:
            if row.get("role", FIBRE) != role:
                continue
            if row["run"] != run:
                run, until_s = row["run"], -math.inf
            begin_s, end_s = max(number(row["began_s"]), until_s), number(row["ended_s"])
            whole_s += max(end_s - begin_s, 0.0)
            until_s = max(until_s, end_s)
        return whole_s

    def _has(self, table: str) -> bool:
        found = self._rows("SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = ?", table)
        return bool(found)

    def raw_files(self) -> dict[int, tuple[Path, str]]:
        """Return where the raw curves of finished fibres and standards are, with their SHA-256.

        The hash is empty of files that an earlier program wrote.
        """
        finished = {each.value for each in FINISHED}
        return {
            int(number(row["number"])): (
                self.folder / str(row["file"]),
                str(row.get("file_sha256", "")),
            )
            for row in self._rows("SELECT * FROM fibre ORDER BY number")
            if row["file"] and row["outcome"] in finished
        }

    def unfinished_files(self) -> tuple[str, ...]:
        """Return raw files of fibres whose treatment was cut off: they have no value.

        Also where they would be of fibres that have none in the record: a file is written before
        the record says so, and the end may come between.
        """
        finished = {each.value for each in FINISHED}
        rows = self._rows("SELECT * FROM fibre")
        return tuple(
            str(row["file"]) or raw_file(int(number(row["number"])))
            for row in rows
            if row["outcome"] not in finished
        )

    def run_records(self) -> dict[int, str]:
        """Return the runs that kept a record of what they were made with, with its SHA-256.

        The hash is empty of those by an earlier program that made fibres: that they kept a record
        is known by the commit among their versions.
        """
        return {
            number: sha256
            for number, sha256, used, recorded in self._runs()
            if sha256 or (used and recorded)
        }

    def unrecorded_runs(self) -> tuple[int, ...]:
        """Return the runs with fibres by a program that may not have kept records."""
        return tuple(
            number
            for number, sha256, used, recorded in self._runs()
            if used and not (sha256 or recorded)
        )

    def _runs(self) -> list[tuple[int, str, bool, bool]]:
        rows = self._rows(
            "SELECT *, EXISTS (SELECT 1 FROM fibre WHERE fibre.run = run.number) AS used"
            " FROM run ORDER BY number"
        )
        with self._understood():
            return [
                (
                    int(number(row["number"])),
                    str(row.get("record_sha256", "")),
                    bool(row["used"]),
                    "commit" in json.loads(str(row["versions_json"])),
                )
                for row in rows
            ]

    def changed_parts(self) -> tuple[str, ...]:
        """Return which parts of the database something else has changed, in words.

        Known of a campaign that has come to its end, and kept when it is gone on with.
        """
        with self._understood(), self._connection() as connection:
            wrong = RecordSums.kept(connection).differing(connection)
        with self._understood():
            (row,) = self._rows("SELECT * FROM campaign")
            text, digest = str(row["recipe_text"]), row.get("recipe_sha256")
        parts = ["results" if each == RESULTS else f"table {each}" for each in wrong]
        if hashlib.sha256(text.encode()).hexdigest() != digest:
            parts.append("the recipe in it")
        return tuple(parts)

    def image_files(self) -> dict[str, str]:
        """Return the files of all images with their SHA-256."""
        rows = self._rows("SELECT file, sha256 FROM picture ORDER BY fibre, number")
        return {str(row["file"]): str(row["sha256"]) for row in rows}

    def analysis(self) -> dict[str, Any]:
        """Return what the final analysis was done with, and what it says; empty: there is none."""
        with self._understood():
            (row,) = self._rows("SELECT * FROM campaign")
            found = dict(json.loads(str(row.get("analysis_json") or "{}")))
            if found and not all(isinstance(found.get(part), dict) for part in ANALYSED):
                raise ValueError(f"an analysis without {', '.join(ANALYSED)}")
            return found

    def finished(self) -> tuple[FibreRecord, ...]:
        """Return the fibres that have their end, without curves and images."""
        return tuple(each for each in self.fibres() if each.outcome in FINISHED)

    def fibre(self, fibre: int) -> FibreRecord:
        """Return one fibre with curves and images.

        Raises
        ------
        CampaignError
            There is none of that number, or its file cannot be read.
        """
        rows = self._rows("SELECT * FROM fibre WHERE number = ?", fibre)
        if not rows:
            raise CampaignError(f"{self.folder} has no fibre {fibre}")
        spans = self._rows("SELECT * FROM span WHERE fibre = ? ORDER BY number", fibre)
        steps = self._rows("SELECT * FROM operation WHERE fibre = ? ORDER BY number", fibre)
        with self._understood():
            record = fibre_record(rows[0], spans, steps)
        if not rows[0]["file"]:
            return record
        measured, fitted, series = read_curves(self.folder / str(rows[0]["file"]))
        bending = record.bending
        if bending is not None:
            fitted = read_fitted(self.folder / FINAL, fibre) or fitted
            fits = [
                replace(fit, fitted_un=curve)
                for fit, curve in zip(bending.spans, fitted, strict=False)
            ]
            bending = replace(bending, spans=tuple(fits))
        return replace(
            record, bending=bending, spans=measured, series=series, images=self.images(fibre)
        )

    pictures = Renamed("images")

    def images(self, fibre: int) -> tuple[FibreImage, ...]:
        """Return the images of one fibre."""
        rows = self._rows("SELECT * FROM picture WHERE fibre = ? ORDER BY number", fibre)
        return tuple(
            FibreImage(
                name=str(row["name"]),
                pixels=_pixels(self.folder / str(row["file"])),
                taken_s=number(row["taken_s"]),
                scale_um_px=number(row["scale_um_px"]),
                zoom=number(row["zoom"]),
                focus_um=number(row["focus_um"]),
                light_percent=number(row["light_percent"]),
                region_px=region_px(row),
            )
            for row in rows
        )

    def journal(self, last: int | None = None) -> tuple[JournalEntry, ...]:
        """Return the journal, oldest first; of it only the `last` lines, if told."""
        rows = self._rows(
            "SELECT * FROM journal ORDER BY number DESC LIMIT ?", -1 if last is None else last
        )
        return tuple(_entry(row) for row in reversed(rows))

    def phase(self, phase: str) -> tuple[JournalEntry, ...]:
        """Return the lines of the journal of one phase, oldest first."""
        rows = self._rows("SELECT * FROM journal WHERE phase = ? ORDER BY number", phase)
        return tuple(_entry(row) for row in rows)

    # ------------------------------------------------------------------ inside

    @contextmanager
    def _understood(self) -> Generator[None]:
        """Turn what is written otherwise than this program knows into words."""
        try:
            yield
        except (KeyError, TypeError, ValueError) as exc:
            raise CampaignError(
                f"{self.folder / DATABASE} holds what this program does not know ({exc}): open it "
                "with the program that wrote it, or take the folder from a copy"
            ) from exc

    @contextmanager
    def _connection(self) -> Generator[sqlite3.Connection]:
        file = self.folder / DATABASE
        if not file.exists():
            raise CampaignError(f"{self.folder} holds no campaign: there is no {DATABASE} in it")
        try:
            connection = sqlite3.connect(_address(file), uri=True, timeout=10.0)
            try:
                connection.row_factory = sqlite3.Row
                yield connection
            finally:
                connection.close()
        except sqlite3.Error as exc:
            raise CampaignError(f"{file} cannot be read: {exc}") from exc

    def _rows(self, query: str, *values: Cell) -> list[dict[str, Cell]]:
        with self._connection() as connection:
            return [dict(row) for row in connection.execute(query, values).fetchall()]

    def _by_fibre(self, query: str, *values: Cell) -> dict[Cell, list[Row]]:
        found: dict[Cell, list[Row]] = {}
        for row in self._rows(query, *values):
            found.setdefault(row["fibre"], []).append(row)
        return found


def refuse_raw_files_alone(folder: Path) -> None:
    """Refuse a folder with raw files of fibres that no database tells of.

    Raises
    ------
    CampaignError
        A campaign begun there would write over them.
    """
    alone = sorted((folder / FIBRES).glob("*.h5"))
    if alone:
        raise CampaignError(
            f"{folder} holds raw files of {len(alone)} fibres, such as {FIBRES}/{alone[0].name}, "
            f"and no {DATABASE} that tells of them: take it from a copy, or name another folder"
        )


def _entry(row: Row) -> JournalEntry:
    return JournalEntry(
        number=int(number(row["number"])),
        fibre=None if row["fibre"] is None else int(row["fibre"]),
        time_s=number(row["time_s"]),
        operation=str(row["operation"]),
        phase=str(row["phase"]),
        payload=json.loads(str(row["payload_json"])),
    )


def _address(file: Path) -> str:
    """Return what to open for reading, so that nothing is made beside it.

    Without a log beside it nobody writes the database, and one who begins meanwhile leaves the
    file itself as it is until much is in the log. SQLite would make a log only to read, and leave
    it there.
    """
    beside = (file.with_name(f"{file.name}-{each}") for each in ("wal", "journal"))
    written = any(each.exists() for each in beside)
    return f"{file.resolve().as_uri()}?mode=ro{'' if written else '&immutable=1'}"


def _pixels(file: Path) -> Image:
    try:
        data = np.frombuffer(file.read_bytes(), dtype=np.uint8)
    except OSError as exc:
        raise CampaignError(f"{file} cannot be read: {exc.strerror or exc}") from exc
    pixels = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
    if pixels is None:
        raise CampaignError(f"{file} is not a readable image")
    if pixels.dtype == np.uint16:
        return np.asarray(pixels, dtype=np.uint16)
    return np.asarray(pixels, dtype=np.uint8)
