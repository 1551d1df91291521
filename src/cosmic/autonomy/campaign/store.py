"""`CampaignStore`: writes a campaign so that an end at any moment loses and doubles nothing."""

import hashlib
import json
import logging
import math
import sqlite3
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from datetime import datetime
from pathlib import Path, PurePosixPath
from threading import RLock
from types import TracebackType
from typing import Final, Self

import cv2

from cosmic.autonomy.bending.result import BendingResult
from cosmic.autonomy.campaign.record_sums import RESULTS, RecordSums
from cosmic.autonomy.campaign.records import (
    FIBRE,
    FINISHED,
    NOT_TRUSTED,
    CalibrationNote,
    CampaignError,
    CampaignInfo,
    FibreImage,
    FibreRecord,
    Outcome,
    Pose,
    Sighting,
    Value,
)
from cosmic.autonomy.campaign.storage_format import (
    DATABASE,
    FIBRES,
    LATER_TABLES,
    SCHEMA_VERSION,
    TABLES,
    Row,
    add_columns,
    cell,
    curves_file,
    fibre_row,
    image_row,
    insert,
    operation_row,
    raw_file,
    result_row,
    span_row,
    statements,
    update,
)
from cosmic.autonomy.campaign.store_read import CampaignReader, refuse_raw_files_alone
from cosmic.frame import kept_file
from cosmic.frame.kept_file import PART
from cosmic.frame.platform_services import sync_folder

logger = logging.getLogger(__name__)

LOCK: Final = "campaign.lock"


class NotWrittenError(CampaignError):
    """The disk did not take it: there may be room later."""


def write_whole(path: Path, data: bytes) -> None:
    """Write a file of a campaign as a whole.

    Raises
    ------
    NotWrittenError
        It cannot be written; nothing of it is left.
    """
    try:
        kept_file.write_whole(path, data)
    except OSError as exc:
        raise NotWrittenError(
            f"{path} cannot be written: {exc.strerror or exc}. Completed fibres are saved: "
            "make room, and start the campaign again in the same folder"
        ) from exc


def write_through(folder: Path) -> None:
    """See that the names in a folder are on the disk too, where a folder can be opened.

    Raises
    ------
    NotWrittenError
        They cannot be written.
    """
    try:
        sync_folder(folder)
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
        Another process, or another store of this one, has it; or it cannot be written there.
    """

    def __init__(self, folder: Path) -> None:
        try:
            self._connection = sqlite3.connect(
                folder / LOCK, timeout=0.0, isolation_level=None, check_same_thread=False
            )
        except sqlite3.Error as exc:
            raise _no_lock(folder, exc) from exc
        try:
            self._connection.execute("PRAGMA journal_mode = MEMORY")
            self._connection.execute("BEGIN EXCLUSIVE")
        except sqlite3.Error as exc:
            self._connection.close()
            raise _no_lock(folder, exc) from exc

    def release(self) -> None:
        """Let others write."""
        self._connection.close()


def _no_lock(folder: Path, error: sqlite3.Error) -> CampaignError:
    if error.sqlite_errorcode & 0xFF in (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED):
        return CampaignError(
            f"{folder}: a campaign is already being written there ({error}): "
            "wait for its end, or name another folder"
        )
    return CampaignError(
        f"{folder}: {LOCK} cannot be written there ({error}): see who may write in it, or name "
        "another folder"
    )


def is_written(folder: Path) -> bool:
    """Return whether a program writes the campaign in a folder now; changes nothing."""
    file = folder / LOCK
    if not file.exists():
        return False
    try:
        connection = sqlite3.connect(f"{file.absolute().as_uri()}?mode=ro", uri=True, timeout=0.0)
        try:
            connection.execute("SELECT 1 FROM sqlite_master").fetchall()
        finally:
            connection.close()
    except sqlite3.Error as exc:
        return exc.sqlite_errorcode == sqlite3.SQLITE_BUSY
    return False


BUSY_S: Final = 10.0


class WriteConnection:
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
            self._connection = _opened(self._file)
        except BaseException:
            self._lock.release()
            raise

    @contextmanager
    def transaction(self, *, durable: bool = True) -> Generator[sqlite3.Connection]:
        """Do all of it or nothing; durable: it is on the disk before going on.

        Raises
        ------
        CampaignError
            The connection is closed, or it cannot be written.
        """
        with self.guard:
            if self._closed:
                raise CampaignError(f"{self._file.parent}: this campaign is closed")
            try:
                self._connection.execute(f"PRAGMA synchronous = {'FULL' if durable else 'NORMAL'}")
                self._connection.execute("BEGIN IMMEDIATE")
                try:
                    yield self._connection
                    self._connection.execute("COMMIT")
                finally:
                    if self._connection.in_transaction:
                        self._connection.execute("ROLLBACK")
            except sqlite3.Error as exc:
                raise _failure(self._file, exc) from exc

    def close(self) -> None:
        """Let go of the folder; without effect after the first time."""
        with self.guard:
            if not self._closed:
                self._closed = True
                self._connection.close()
                self._lock.release()


def _opened(file: Path) -> sqlite3.Connection:
    try:
        connection = sqlite3.connect(
            file, timeout=BUSY_S, isolation_level=None, check_same_thread=False
        )
        connection.execute("PRAGMA foreign_keys = ON")
        connection.execute("PRAGMA journal_mode = WAL")
    except sqlite3.Error as exc:
        raise _failure(file, exc) from exc
    return connection


def _lay_out(file: Path, info: CampaignInfo) -> None:
    """Make the tables under another name, so that there is a whole database or none."""
    part = file.with_name(file.name + PART)
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
        "world": info.world,
        "versions_json": json.dumps(dict(info.versions)),
    }
    try:
        part.unlink(missing_ok=True)
        with closing(sqlite3.connect(part, isolation_level=None)) as connection:
            connection.execute("BEGIN")
            for statement in statements(TABLES + LATER_TABLES):
                connection.execute(statement)
            insert(connection, "campaign", row)
            connection.execute(f"PRAGMA user_version = {SCHEMA_VERSION}")
            connection.execute("COMMIT")
        part.replace(file)
    except (sqlite3.Error, OSError) as exc:
        raise _failure(file, exc) from exc


_CLOSED: Final = (sqlite3.SQLITE_CANTOPEN, sqlite3.SQLITE_READONLY, sqlite3.SQLITE_PERM)


def _failure(file: Path, error: sqlite3.Error | OSError) -> NotWrittenError:
    if getattr(error, "sqlite_errorcode", 0) & 0xFF in _CLOSED:
        return NotWrittenError(
            f"{file} cannot be written: {error}. It is as it was: see who may write in its folder"
        )
    return NotWrittenError(
        f"{file} cannot be written: {error}. Completed fibres are saved: make room, and "
        "start the campaign again in the same folder"
    )


def last_number(connection: sqlite3.Connection) -> int:
    """Return the number that the last row got."""
    return int(connection.execute("SELECT last_insert_rowid()").fetchone()[0])


Now = Callable[[], datetime]


def _now() -> datetime:
    return datetime.now().astimezone().replace(microsecond=0)


class CampaignStore:
    """The folder of a campaign, open for writing; any thread, one at a time.

    Each start of the program on the folder is a run; times count on the platform's clock of their
    run. Make one with `create` or `open`.
    """

    def __init__(self, folder: Path, info: CampaignInfo | None = None, *, now: Now = _now) -> None:
        self.folder = folder
        self.reader = CampaignReader(folder)
        self._now = now
        self._connection = WriteConnection(folder, info)
        self._run = 0

    # ------------------------------------------------------------------ opening and closing

    @classmethod
    def create(
        cls, folder: str | Path, info: CampaignInfo, *, time_s: float = 0.0, now: Now = _now
    ) -> Self:
        """Begin a campaign in a folder, which is made.

        Raises
        ------
        CampaignError
            There is a campaign in it, or raw files of one, or it cannot be written.
        """
        folder = Path(folder)
        if CampaignReader(folder).version() != 0:
            raise CampaignError(
                f"{folder} already holds a campaign: resume it, or name another folder"
            )
        refuse_raw_files_alone(folder)
        store = cls._opened(folder, now, info)
        try:
            store._begin_run(time_s, info.versions)  # noqa: SLF001 - its own class
        except BaseException:
            store.close()
            raise
        return store

    @classmethod
    def open(
        cls,
        folder: str | Path,
        *,
        time_s: float = 0.0,
        versions: Mapping[str, str] | None = None,
        now: Now = _now,
        run: bool = True,
    ) -> Self:
        """Open a campaign to go on with it; what was running when it ended is left running.

        Parameters
        ----------
        run : bool
            It is gone on with; otherwise what stands in it is only analysed anew.

        Raises
        ------
        CampaignError
            There is none, it is of another version, or somebody is writing it.
        """
        folder = Path(folder)
        if not (folder / DATABASE).exists():
            raise CampaignError(f"{folder} holds no campaign: there is no {DATABASE} in it")
        store = cls._opened(folder, now)
        try:
            store.reader.check()
            remove_parts(folder / FIBRES)
            store._bring_up_to_date(run=run)  # noqa: SLF001 - its own class
            if run:
                store._begin_run(time_s, versions or {})  # noqa: SLF001 - its own class
        except BaseException:
            store.close()
            raise
        return store

    @classmethod
    def _opened(cls, folder: Path, now: Now, info: CampaignInfo | None = None) -> Self:
        try:
            (folder / FIBRES).mkdir(parents=True, exist_ok=True)
        except OSError as exc:
            raise CampaignError(
                f"{folder} cannot be made: {exc.strerror or exc}; name another folder"
            ) from exc
        return cls(folder, info, now=now)

    def _bring_up_to_date(self, *, run: bool) -> None:
        """Add what tables of an earlier program lack; what was changed in them stays known."""
        with self._connection.transaction() as connection:
            kept = self._sums(connection)
            wrong = kept.differing(connection)
            add_columns(connection)
            if wrong:
                logger.warning(
                    "%s was changed by another program since the campaign was written: %s",
                    self.folder / DATABASE,
                    ", ".join(wrong),
                )
            if run:
                kept = RecordSums(altered=wrong)
            elif kept.sums:
                kept = kept.renewed(connection, but=wrong)
            kept.write(connection)

    def _sums(self, connection: sqlite3.Connection) -> RecordSums:
        try:
            return RecordSums.kept(connection)
        except (TypeError, ValueError) as exc:
            raise CampaignError(
                f"{self.folder / DATABASE} holds what this program does not know ({exc}): take "
                "the folder from a copy"
            ) from exc

    def _begin_run(self, time_s: float, versions: Mapping[str, str]) -> None:
        row: Row = {
            "started": self._now().isoformat(),
            "versions_json": json.dumps(dict(versions)),
            "begin_s": time_s,
        }
        with self._connection.transaction() as connection:
            insert(connection, "run", row)
            self._run = last_number(connection)

    @property
    def run(self) -> int:
        """Number of this start of the program; 0 where nothing is gone on with."""
        return self._run

    def keep_record(self, sha256: str) -> None:
        """Note the SHA-256 of the file that says what this run is made with."""
        with self._connection.transaction() as connection:
            update(connection, "run", {"record_sha256": sha256}, key=self._run)

    def close(self) -> None:
        """Let go of the folder; without effect after the first time."""
        self._connection.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    # ------------------------------------------------------------------ writing

    def begin_fibre(
        self,
        found: Pose | None = None,
        *,
        time_s: float,
        length_um: float = math.nan,
        role: str = FIBRE,
        plate: int = 1,
    ) -> int:
        """Note that a fibre's treatment begins, and return its number.

        Position and length let it be known again if the treatment is interrupted.
        """
        row: dict[str, str | int | float | None] = {
            "run": self._run,
            "outcome": Outcome.RUNNING.value,
            "began_s": time_s,
            "length_um": cell(length_um),
            "role": role,
            "plate": plate,
        }
        if found is not None:
            row["found_x_plate_um"] = found.x_plate_um
            row["found_y_plate_um"] = found.y_plate_um
            row["found_angle_deg"] = found.angle_deg
        with self._connection.transaction() as connection:
            insert(connection, "fibre", row)
            return last_number(connection)

    def note(
        self,
        operation: str,
        phase: str,
        payload: Mapping[str, Value] | None = None,
        *,
        time_s: float,
        fibre: int | None = None,
    ) -> None:
        """Write a line of the journal, before the motion that it tells of.

        It outlives an end of the process without warning; a fibre's end is written through to the
        disk, a line of the journal is not.
        """
        row: Row = {
            "fibre": fibre,
            "time_s": time_s,
            "operation": operation,
            "phase": phase,
            "payload_json": json.dumps(dict(payload or {})),
            "run": self._run,
        }
        with self._connection.transaction(durable=False) as connection:
            insert(connection, "journal", row)

    def keep_sightings(self, plate: int, sightings: Sequence[Sighting]) -> None:
        """Keep what the first survey of a plate saw; without effect where one is kept already."""
        with self._connection.transaction() as connection:
            kept = connection.execute("SELECT 1 FROM sighting WHERE plate = ?", (plate,)).fetchone()
            for order, each in enumerate(() if kept else sightings):
                row: Row = {
                    "plate": plate,
                    "number": order,
                    "x_plate_um": each.x_plate_um,
                    "y_plate_um": each.y_plate_um,
                    "length_um": cell(each.length_um),
                    "width_um": cell(each.width_um),
                    "curl": cell(each.curl),
                    "problem": each.problem,
                }
                insert(connection, "sighting", row)

    def begin_plate(self, plate: int, *, time_s: float, by: str) -> None:
        """Note that another plate is asked for; from now on it is not known which one is there."""
        row: Row = {"number": plate, "run": self._run, "asked_s": time_s, "put_by": by}
        with self._connection.transaction() as connection:
            connection.execute("DELETE FROM plate WHERE number = ? AND put_s IS NULL", (plate,))
            insert(connection, "plate", row)

    def finish_plate(self, plate: int, *, time_s: float) -> None:
        """Note that it is there."""
        with self._connection.transaction() as connection:
            update(connection, "plate", {"put_s": time_s}, key=plate)

    def finish_fibre(self, record: FibreRecord) -> None:
        """Write all of a fibre, once.

        Raises
        ------
        CampaignError
            It was not begun, is finished already, or cannot be written: then it stays as it was,
            and this may be called again.
        """
        if record.outcome not in FINISHED and record.outcome is not Outcome.INTERRUPTED:
            raise CampaignError(f"fibre {record.number} is {record.outcome}, which is not final")
        with self._connection.guard:
            with self._connection.transaction() as connection:
                self._refuse_unless_running(connection, record.number)
            curves = PurePosixPath(raw_file(record.number))
            content = curves_file(record)
            write_whole(self.folder / curves, content)
            row = fibre_row(record, str(curves))
            row["file_sha256"] = hashlib.sha256(content).hexdigest()
            images = [
                self._write_image(image, curves.with_name(f"{curves.stem}-{order:02d}.png"))
                for order, image in enumerate(record.images)
            ]
            write_through(self.folder / FIBRES)
            with self._connection.transaction() as connection:
                self._refuse_unless_running(connection, record.number)
                update(connection, "fibre", row, key=record.number)
                fits = record.bending.spans if record.bending is not None else ()
                _insert_all(connection, "span", record.number, [span_row(fit) for fit in fits])
                _insert_all(connection, "picture", record.number, images)
                steps = [operation_row(each) for each in record.operations]
                _insert_all(connection, "operation", record.number, steps)

    def keep_analysis(
        self, results: Mapping[int, BendingResult], analysis: Mapping[str, object]
    ) -> None:
        """Put final results in the place of those of the campaign, which are kept beside them.

        A measured fibre is good or not by its final result; one that failed by something else
        stays as it was.

        Parameters
        ----------
        results : mapping of int to BendingResult
            By the number of the fibre.
        analysis : mapping
            What it was done with, and what it says of all fibres together; goes into the record as
            JSON.
        """
        with self._connection.transaction() as connection:
            sums = self._sums(connection)
            wrong = {*sums.differing(connection)} - {RESULTS}
            for fibre, result in results.items():
                outcome, cause, ei = connection.execute(
                    "SELECT outcome, cause, ei_n_m2 FROM fibre WHERE number = ?", (fibre,)
                ).fetchone()
                row = result_row(result)
                if outcome == Outcome.GOOD or cause == NOT_TRUSTED:
                    outcome_now = Outcome.GOOD if result.trusted else Outcome.DOUBTFUL
                    row["outcome"] = outcome_now.value
                    row["cause"] = "" if result.trusted else NOT_TRUSTED
                    row["text"] = "" if result.trusted else "; ".join(result.reasons)
                update(connection, "fibre", row, key=fibre)
                connection.execute(
                    "UPDATE fibre SET online_outcome = ?, online_ei_n_m2 = ? "
                    "WHERE number = ? AND online_outcome = ''",
                    (outcome, ei, fibre),
                )
                connection.execute("DELETE FROM span WHERE fibre = ?", (fibre,))
                _insert_all(connection, "span", fibre, [span_row(each) for each in result.spans])
            connection.execute(
                "UPDATE campaign SET analysis_json = ?", (json.dumps(dict(analysis)),)
            )
            if sums.sums:  # it has come to its end: nothing else is written any more
                sums.renewed(connection, but=wrong).write(connection)

    def interrupt_running(self, text: str = "the campaign ended without warning") -> list[int]:
        """Mark fibres that were in treatment when the campaign ended, and return their numbers."""
        with self._connection.transaction() as connection:
            rows = connection.execute(
                "SELECT number FROM fibre WHERE outcome = ? ORDER BY number", (Outcome.RUNNING,)
            ).fetchall()
            numbers = [int(row[0]) for row in rows]
            for each in numbers:
                row: Row = {"outcome": Outcome.INTERRUPTED.value, "text": text}
                update(connection, "fibre", row, key=each)
        return numbers

    def keep_calibrations(self, notes: Sequence[CalibrationNote]) -> None:
        """Note the calibrations in force in this run."""
        with self._connection.transaction() as connection:
            for each in notes:
                row: Row = {
                    "name": each.name,
                    "residual": each.residual,
                    "unit": each.unit,
                    "made": each.made,
                    "age_s": cell(each.age_s),
                    "run": self._run,
                }
                insert(connection, "calibration", row)

    def end(self, reason: str, *, time_s: float) -> None:
        """Note why the campaign ended; it may be gone on with all the same."""
        with self._connection.transaction() as connection:
            connection.execute(
                "UPDATE campaign SET ended = ?, end_reason = ?", (self._now().isoformat(), reason)
            )
            update(connection, "run", {"end_s": time_s}, key=self._run)
            self._sums(connection).renewed(connection).write(connection)

    # ------------------------------------------------------------------ inside

    def _refuse_unless_running(self, connection: sqlite3.Connection, fibre: int) -> None:
        row = connection.execute("SELECT outcome FROM fibre WHERE number = ?", (fibre,)).fetchone()
        if row is None:
            raise CampaignError(f"fibre {fibre} was not started in {self.folder}")
        if row[0] != Outcome.RUNNING:
            raise CampaignError(f"fibre {fibre} in {self.folder} is already completed: {row[0]}")

    def _write_image(self, image: FibreImage, file: PurePosixPath) -> Row:
        done, data = cv2.imencode(".png", image.pixels)
        if not done:
            raise CampaignError(
                f"the image {image.name!r} ({image.pixels.shape}, {image.pixels.dtype}) "
                "cannot be kept as PNG"
            )
        content = data.tobytes()
        write_whole(self.folder / file, content)
        return image_row(image, file, hashlib.sha256(content).hexdigest())


def _insert_all(
    connection: sqlite3.Connection, table: str, fibre: int, rows: Sequence[Row]
) -> None:
    for order, row in enumerate(rows):
        insert(connection, table, {"fibre": fibre, "number": order, **row})
