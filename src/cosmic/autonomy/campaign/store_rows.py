"""Records as rows of the tables, and rows as records."""

import math
import sqlite3
from collections.abc import Mapping, Sequence
from pathlib import PurePosixPath
from typing import Final

import numpy as np

from cosmic.autonomy.bending.result import BendingResult, Quality, SpanFit
from cosmic.autonomy.campaign.records import (
    FibreRecord,
    Floats,
    OperationRecord,
    Outcome,
    Picture,
    Pose,
    Shape,
)

Cell = str | int | float | bytes | None
Row = Mapping[str, Cell]

RESULT_NUMBERS: Final = (
    "ei_n_m2",
    "ei_low_n_m2",
    "ei_high_n_m2",
    "clamp_offset_um",
    "clamp_offset_std_um",
    "chi2",
)
SPAN_NUMBERS: Final = (
    "place_um",
    "k_un_um",
    "k_std_un_um",
    "k_loading_un_um",
    "k_unloading_un_um",
    "hinge_um",
    "hinge_back_um",
    "baseline_un",
    "drift_un_s",
    "hysteresis_percent",
    "peak_un",
    "chi2",
)
SHAPE_NUMBERS: Final = (
    "length_um",
    "length_std_um",
    "width_um",
    "width_std_um",
    "curl",
    "curl_std",
)
REGION_NUMBERS: Final = (
    "region_left_px",
    "region_top_px",
    "region_width_px",
    "region_height_px",
)
SEPARATOR: Final = "\n"


def number(value: Cell) -> float:
    """Return a cell as a number; nan for an empty one."""
    return float(value) if isinstance(value, int | float) else math.nan


def cell(value: float) -> float | None:
    """Return a number as a cell, which is empty where there is none."""
    return float(value) if math.isfinite(value) else None


def fibre_row(record: FibreRecord, file: str) -> dict[str, Cell]:
    """Return the row of a fibre's record."""
    row: dict[str, Cell] = {
        "outcome": record.outcome.value,
        "began_s": record.began_s,
        "ended_s": record.ended_s,
        "cause": record.cause,
        "text": record.text,
        "attempts": record.attempts,
        "peak_force_un": cell(record.peak_force_un),
        "file": file,
    }
    row |= {name: cell(getattr(record.shape, name)) for name in SHAPE_NUMBERS}
    row |= _pose_row("found", record.found) | _pose_row("left", record.left)
    result = record.bending
    if result is not None:
        row |= {name: cell(getattr(result, name)) for name in RESULT_NUMBERS}
        row["freedom"] = result.freedom
        row["trusted"] = int(result.trusted)
        row["flags"] = SEPARATOR.join(sorted(result.flags))
        row["reasons"] = SEPARATOR.join(result.reasons)
        row["used_spans"] = " ".join(map(str, result.used))
    return row


def _pose_row(which: str, pose: Pose | None) -> dict[str, Cell]:
    if pose is None:
        return {}
    return {
        f"{which}_x_plate_um": pose.x_plate_um,
        f"{which}_y_plate_um": pose.y_plate_um,
        f"{which}_angle_deg": pose.angle_deg,
    }


def span_row(fit: SpanFit) -> dict[str, Cell]:
    """Return the row of a span."""
    row: dict[str, Cell] = {name: cell(getattr(fit, name)) for name in SPAN_NUMBERS}
    return row | {"freedom": fit.freedom, "flags": SEPARATOR.join(sorted(fit.flags))}


def picture_row(picture: Picture, file: PurePosixPath, sha256: str) -> dict[str, Cell]:
    """Return the row of a picture."""
    region = picture.region_px or (None, None, None, None)
    return {
        "name": picture.name,
        "file": str(file),
        "sha256": sha256,
        "taken_s": picture.taken_s,
        "scale_um_px": cell(picture.scale_um_px),
        "zoom": cell(picture.zoom),
        "focus_um": cell(picture.focus_um),
        "light_percent": cell(picture.light_percent),
        **dict(zip(REGION_NUMBERS, region, strict=True)),
    }


def region_px(row: Row) -> tuple[int, int, int, int] | None:
    """Return the region of a picture, if it has one."""
    # A table of a campaign begun before there were regions does not have the columns.
    left, top, width, height = (row.get(name) for name in REGION_NUMBERS)
    if left is None or top is None or width is None or height is None:
        return None
    return int(left), int(top), int(width), int(height)


def operation_row(operation: OperationRecord) -> dict[str, Cell]:
    """Return the row of a try of an operation."""
    return {
        "name": operation.name,
        "began_s": operation.began_s,
        "ended_s": operation.ended_s,
        "attempt": operation.attempt,
        "cause": operation.cause,
        "text": operation.text,
    }


def fibre_record(row: Row, spans: Sequence[Row], operations: Sequence[Row]) -> FibreRecord:
    """Return a record without curves and pictures."""
    return FibreRecord(
        number=int(number(row["number"])),
        outcome=Outcome(str(row["outcome"])),
        began_s=number(row["began_s"]),
        ended_s=number(row["ended_s"]),
        found=_pose(row, "found"),
        left=_pose(row, "left"),
        shape=Shape(**{name: number(row[name]) for name in SHAPE_NUMBERS}),
        cause=str(row["cause"]),
        text=str(row["text"]),
        attempts=int(row["attempts"] or 0),
        peak_force_un=number(row["peak_force_un"]),
        bending=None if row["trusted"] is None else _result(row, spans),
        operations=tuple(_operation(each) for each in operations),
    )


def _pose(row: Row, which: str) -> Pose | None:
    if row[f"{which}_x_plate_um"] is None:
        return None
    columns = ("x_plate_um", "y_plate_um", "angle_deg")
    return Pose(*(number(row[f"{which}_{name}"]) for name in columns))


def _flags(text: Cell) -> frozenset[Quality]:
    return frozenset(Quality(each) for each in str(text).split(SEPARATOR) if each)


def _result(row: Row, spans: Sequence[Row]) -> BendingResult:
    numbers = {name: number(row[name]) for name in RESULT_NUMBERS}
    return BendingResult(
        **numbers,
        spans=tuple(_span(each, np.empty(0)) for each in spans),
        used=tuple(int(each) for each in str(row["used_spans"]).split()),
        freedom=int(row["freedom"] or 0),
        flags=_flags(row["flags"]),
        trusted=bool(row["trusted"]),
        reasons=tuple(each for each in str(row["reasons"]).split(SEPARATOR) if each),
    )


def _span(row: Row, fitted_un: Floats) -> SpanFit:
    numbers = {name: number(row[name]) for name in SPAN_NUMBERS}
    return SpanFit(
        **numbers,
        freedom=int(row["freedom"] or 0),
        fitted_un=fitted_un,
        flags=_flags(row["flags"]),
    )


def _operation(row: Row) -> OperationRecord:
    return OperationRecord(
        name=str(row["name"]),
        began_s=number(row["began_s"]),
        ended_s=number(row["ended_s"]),
        attempt=int(row["attempt"] or 1),
        cause=str(row["cause"]),
        text=str(row["text"]),
    )


def insert(line: sqlite3.Connection, table: str, row: Row) -> None:
    """Add a row."""
    names = ", ".join(row)
    places = ", ".join("?" for _ in row)
    line.execute(f"INSERT INTO {table} ({names}) VALUES ({places})", tuple(row.values()))


def update(line: sqlite3.Connection, table: str, row: Row, *, key: int) -> None:
    """Change the row with a number."""
    pairs = ", ".join(f"{name} = ?" for name in row)
    line.execute(f"UPDATE {table} SET {pairs} WHERE number = ?", (*row.values(), key))
