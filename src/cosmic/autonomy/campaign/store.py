"""`CampaignStore`: writes a campaign so that an end at any moment loses and doubles nothing."""

import hashlib
import json
import math
import sqlite3
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from pathlib import Path, PurePosixPath
from types import TracebackType
from typing import Self

import cv2

from cosmic.autonomy.campaign.records import (
    FINISHED,
    CalibrationNote,
    CampaignError,
    CampaignInfo,
    FibreRecord,
    Outcome,
    Picture,
    Pose,
    Value,
)
from cosmic.autonomy.campaign.store_curves import curves_file
from cosmic.autonomy.campaign.store_files import (
    DATABASE,
    FIBRES,
    remove_parts,
    write_through,
    write_whole,
)
from cosmic.autonomy.campaign.store_line import WriteLine, last_number
from cosmic.autonomy.campaign.store_read import CampaignReader
from cosmic.autonomy.campaign.store_rows import (
    Row,
    cell,
    fibre_row,
    insert,
    operation_row,
    picture_row,
    span_row,
    update,
)

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
        self._line = WriteLine(folder, info)
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
            There is a campaign in it, or it cannot be written.
        """
        folder = Path(folder)
        if CampaignReader(folder).version() != 0:
            raise CampaignError(
                f"{folder} holds a campaign already: go on with it, or name another folder"
            )
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
    ) -> Self:
        """Open a campaign to go on with it; what was running when it ended is left running.

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

    def _begin_run(self, time_s: float, versions: Mapping[str, str]) -> None:
        row: Row = {
            "started": self._now().isoformat(),
            "versions_json": json.dumps(dict(versions)),
            "begin_s": time_s,
        }
        with self._line.transaction() as line:
            insert(line, "run", row)
            self._run = last_number(line)

    def close(self) -> None:
        """Let go of the folder; without effect after the first time."""
        self._line.close()

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
        self, found: Pose | None = None, *, time_s: float, length_um: float = math.nan
    ) -> int:
        """Note that a fibre's treatment begins, and return its number.

        Place and length let it be known again if the treatment is interrupted.
        """
        row: dict[str, str | int | float | None] = {
            "run": self._run,
            "outcome": Outcome.RUNNING.value,
            "began_s": time_s,
            "length_um": cell(length_um),
        }
        if found is not None:
            row["found_x_plate_um"] = found.x_plate_um
            row["found_y_plate_um"] = found.y_plate_um
            row["found_angle_deg"] = found.angle_deg
        with self._line.transaction() as line:
            insert(line, "fibre", row)
            return last_number(line)

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
        }
        with self._line.transaction(durable=False) as line:
            insert(line, "journal", row)

    def finish_fibre(self, record: FibreRecord) -> None:
        """Write all of a fibre, once.

        Raises
        ------
        CampaignError
            It was not begun, is finished already, or cannot be written: then it stays as it was,
            and this may be called again.
        """
        if record.outcome not in FINISHED and record.outcome is not Outcome.INTERRUPTED:
            raise CampaignError(f"fibre {record.number} is {record.outcome}, which is no end")
        with self._line.guard:
            with self._line.transaction() as line:
                self._refuse_unless_running(line, record.number)
            name = f"{record.number:05d}"
            curves = PurePosixPath(FIBRES, f"{name}.h5")
            write_whole(self.folder / curves, curves_file(record))
            pictures = [
                self._write_picture(picture, PurePosixPath(FIBRES, f"{name}-{order:02d}.png"))
                for order, picture in enumerate(record.pictures)
            ]
            write_through(self.folder / FIBRES)
            with self._line.transaction() as line:
                self._refuse_unless_running(line, record.number)
                update(line, "fibre", fibre_row(record, str(curves)), key=record.number)
                fits = record.bending.spans if record.bending is not None else ()
                _insert_all(line, "span", record.number, [span_row(fit) for fit in fits])
                _insert_all(line, "picture", record.number, pictures)
                steps = [operation_row(each) for each in record.operations]
                _insert_all(line, "operation", record.number, steps)

    def interrupt_running(self, text: str = "the campaign ended without warning") -> list[int]:
        """Mark fibres that were in treatment when the campaign ended, and return their numbers."""
        with self._line.transaction() as line:
            rows = line.execute(
                "SELECT number FROM fibre WHERE outcome = ? ORDER BY number", (Outcome.RUNNING,)
            ).fetchall()
            numbers = [int(row[0]) for row in rows]
            for each in numbers:
                row: Row = {"outcome": Outcome.INTERRUPTED.value, "text": text}
                update(line, "fibre", row, key=each)
        return numbers

    def keep_calibrations(self, notes: Sequence[CalibrationNote]) -> None:
        """Note the calibrations in force in this run."""
        with self._line.transaction() as line:
            for each in notes:
                row: Row = {
                    "name": each.name,
                    "residual": each.residual,
                    "unit": each.unit,
                    "made": each.made,
                    "run": self._run,
                }
                insert(line, "calibration", row)

    def end(self, reason: str, *, time_s: float) -> None:
        """Note why the campaign ended; it may be gone on with all the same."""
        with self._line.transaction() as line:
            line.execute(
                "UPDATE campaign SET ended = ?, end_reason = ?", (self._now().isoformat(), reason)
            )
            update(line, "run", {"end_s": time_s}, key=self._run)

    # ------------------------------------------------------------------ inside

    def _refuse_unless_running(self, line: sqlite3.Connection, fibre: int) -> None:
        row = line.execute("SELECT outcome FROM fibre WHERE number = ?", (fibre,)).fetchone()
        if row is None:
            raise CampaignError(f"fibre {fibre} was not begun in {self.folder}")
        if row[0] != Outcome.RUNNING:
            raise CampaignError(f"fibre {fibre} in {self.folder} has its end already: {row[0]}")

    def _write_picture(self, picture: Picture, file: PurePosixPath) -> Row:
        done, data = cv2.imencode(".png", picture.pixels)
        if not done:
            raise CampaignError(
                f"the picture {picture.name!r} ({picture.pixels.shape}, {picture.pixels.dtype}) "
                "cannot be kept as PNG"
            )
        content = data.tobytes()
        write_whole(self.folder / file, content)
        return picture_row(picture, file, hashlib.sha256(content).hexdigest())


def _insert_all(line: sqlite3.Connection, table: str, fibre: int, rows: Sequence[Row]) -> None:
    for order, row in enumerate(rows):
        insert(line, table, {"fibre": fibre, "number": order, **row})
