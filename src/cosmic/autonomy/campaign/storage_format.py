"""How a campaign is stored: the tables of its database, and the HDF5 file of each fibre."""

import io
import json
import math
import sqlite3
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path, PurePosixPath
from typing import Any, Final

import h5py
import numpy as np

from cosmic.autonomy.bending.bent_shape import BentShape
from cosmic.autonomy.bending.curved import NaturalShape
from cosmic.autonomy.bending.result import BendingResult, Contribution, Kind, Quality, SpanFit
from cosmic.autonomy.bending.span import Freed, Span
from cosmic.autonomy.campaign.records import (
    FIBRE,
    CampaignError,
    FibreImage,
    FibreRecord,
    OperationRecord,
    Outcome,
    Pose,
    Series,
    Shape,
)
from cosmic.frame.arrays import Floats

DATABASE: Final = "campaign.sqlite"
FIBRES: Final = "fibres"
"""Folder with a file for each fibre."""
FINAL: Final = "analysis.h5"
"""The model of the final analysis at each point of each span; raw files are never written again."""

SCHEMA_VERSION: Final = 2

TABLES: Final = """
CREATE TABLE campaign (
    one INTEGER PRIMARY KEY CHECK (one = 1),
    name TEXT NOT NULL, procedure TEXT NOT NULL, sample TEXT NOT NULL,
    recipe_text TEXT NOT NULL, recipe_sha256 TEXT NOT NULL, started TEXT NOT NULL,
    description TEXT NOT NULL, operator TEXT NOT NULL, hardware TEXT NOT NULL,
    seed INTEGER NOT NULL, rate REAL NOT NULL, versions_json TEXT NOT NULL,
    world TEXT NOT NULL DEFAULT '',
    ended TEXT NOT NULL DEFAULT '', end_reason TEXT NOT NULL DEFAULT '',
    analysis_json TEXT NOT NULL DEFAULT '', sums_json TEXT NOT NULL DEFAULT ''
);
CREATE TABLE run (
    number INTEGER PRIMARY KEY, started TEXT NOT NULL, versions_json TEXT NOT NULL,
    begin_s REAL NOT NULL, end_s REAL, record_sha256 TEXT NOT NULL DEFAULT ''
);
CREATE TABLE calibration (
    name TEXT NOT NULL, residual REAL, unit TEXT NOT NULL, made TEXT NOT NULL,
    run INTEGER NOT NULL REFERENCES run, age_s REAL
);
CREATE TABLE fibre (
    number INTEGER PRIMARY KEY, run INTEGER NOT NULL REFERENCES run, outcome TEXT NOT NULL,
    began_s REAL NOT NULL, ended_s REAL,
    found_x_plate_um REAL, found_y_plate_um REAL, found_angle_deg REAL,
    left_x_plate_um REAL, left_y_plate_um REAL, left_angle_deg REAL,
    length_um REAL, length_std_um REAL, width_um REAL, width_std_um REAL,
    curl REAL, curl_std REAL,
    cause TEXT NOT NULL DEFAULT '', text TEXT NOT NULL DEFAULT '',
    attempts INTEGER, peak_force_un REAL,
    ei_n_m2 REAL, ei_low_n_m2 REAL, ei_high_n_m2 REAL,
    clamp_offset_um REAL, clamp_offset_std_um REAL, chi2 REAL, freedom INTEGER,
    trusted INTEGER, flags TEXT NOT NULL DEFAULT '', reasons TEXT NOT NULL DEFAULT '',
    used_spans TEXT NOT NULL DEFAULT '', file TEXT NOT NULL DEFAULT '',
    budget_json TEXT NOT NULL DEFAULT '[]', scale_verified INTEGER NOT NULL DEFAULT 0,
    notes TEXT NOT NULL DEFAULT '', role TEXT NOT NULL DEFAULT 'fibre',
    file_sha256 TEXT NOT NULL DEFAULT '', online_ei_n_m2 REAL,
    online_outcome TEXT NOT NULL DEFAULT '', plate INTEGER NOT NULL DEFAULT 1, probability REAL
);
CREATE TABLE span (
    fibre INTEGER NOT NULL REFERENCES fibre, number INTEGER NOT NULL,
    place_um REAL, k_un_um REAL, k_std_un_um REAL, k_loading_un_um REAL, k_unloading_un_um REAL,
    hinge_um REAL, hinge_back_um REAL, baseline_un REAL, drift_un_s REAL,
    hysteresis_percent REAL, peak_un REAL, chi2 REAL, freedom INTEGER,
    flags TEXT NOT NULL DEFAULT '', off_model_log REAL, PRIMARY KEY (fibre, number)
);
CREATE TABLE picture (
    fibre INTEGER NOT NULL REFERENCES fibre, number INTEGER NOT NULL, name TEXT NOT NULL,
    file TEXT NOT NULL, sha256 TEXT NOT NULL, taken_s REAL NOT NULL,
    scale_um_px REAL, zoom REAL, focus_um REAL, light_percent REAL,
    region_left_px INTEGER, region_top_px INTEGER,
    region_width_px INTEGER, region_height_px INTEGER,
    PRIMARY KEY (fibre, number)
);
CREATE TABLE operation (
    fibre INTEGER NOT NULL REFERENCES fibre, number INTEGER NOT NULL, name TEXT NOT NULL,
    began_s REAL NOT NULL, ended_s REAL NOT NULL, attempt INTEGER NOT NULL,
    cause TEXT NOT NULL, text TEXT NOT NULL, PRIMARY KEY (fibre, number)
);
CREATE TABLE journal (
    number INTEGER PRIMARY KEY, fibre INTEGER, time_s REAL NOT NULL, operation TEXT NOT NULL,
    phase TEXT NOT NULL, payload_json TEXT NOT NULL, run INTEGER
);
"""

LATER_TABLES: Final = """
CREATE TABLE IF NOT EXISTS plate (
    number INTEGER PRIMARY KEY, run INTEGER NOT NULL REFERENCES run,
    asked_s REAL NOT NULL, put_s REAL, put_by TEXT NOT NULL DEFAULT ''
);
CREATE TABLE IF NOT EXISTS sighting (
    plate INTEGER NOT NULL, number INTEGER NOT NULL, x_plate_um REAL, y_plate_um REAL,
    length_um REAL, width_um REAL, curl REAL, problem TEXT NOT NULL DEFAULT '',
    PRIMARY KEY (plate, number)
);
"""
"""Tables that a campaign begun with an earlier program does not have."""


ADDED: Final = {
    "campaign": {
        "world": "TEXT NOT NULL DEFAULT ''",
        "analysis_json": "TEXT NOT NULL DEFAULT ''",
        "sums_json": "TEXT NOT NULL DEFAULT ''",
    },
    "run": {"record_sha256": "TEXT NOT NULL DEFAULT ''"},
    "calibration": {"age_s": "REAL"},
    "fibre": {
        "budget_json": "TEXT NOT NULL DEFAULT '[]'",
        "scale_verified": "INTEGER NOT NULL DEFAULT 0",
        "notes": "TEXT NOT NULL DEFAULT ''",
        "role": "TEXT NOT NULL DEFAULT 'fibre'",
        "file_sha256": "TEXT NOT NULL DEFAULT ''",
        "online_ei_n_m2": "REAL",
        "online_outcome": "TEXT NOT NULL DEFAULT ''",
        "plate": "INTEGER NOT NULL DEFAULT 1",
        "probability": "REAL",
    },
    "span": {"off_model_log": "REAL"},
    "journal": {"run": "INTEGER"},
}
"""Columns that a campaign begun with an earlier program does not have."""


def raw_file(fibre: int) -> str:
    """Return where the raw file of a fibre lies in the folder of its campaign."""
    return f"{FIBRES}/{fibre:05d}.h5"


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
RESULT_CELLS: Final = frozenset(
    {
        *RESULT_NUMBERS,
        "freedom",
        "trusted",
        "flags",
        "reasons",
        "used_spans",
        "budget_json",
        "scale_verified",
        "notes",
    }
)
"""Cells of a fibre that an analysis writes: those of `result_row`."""

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
    "off_model_log",
)
SHAPE_NUMBERS: Final = (
    "length_um",
    "length_std_um",
    "width_um",
    "width_std_um",
    "curl",
    "curl_std",
    "probability",
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
    if record.bending is not None:
        row |= result_row(record.bending)
    return row


def result_row(result: BendingResult) -> dict[str, Cell]:
    """Return the cells of a fibre's result."""
    row: dict[str, Cell] = {name: cell(getattr(result, name)) for name in RESULT_NUMBERS}
    return row | {
        "freedom": result.freedom,
        "trusted": int(result.trusted),
        "flags": SEPARATOR.join(sorted(result.flags)),
        "reasons": SEPARATOR.join(result.reasons),
        "used_spans": " ".join(map(str, result.used)),
        "budget_json": json.dumps([asdict(line) for line in result.budget]),
        "scale_verified": int(result.scale_verified),
        "notes": SEPARATOR.join(sorted(result.notes)),
    }


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


def image_row(image: FibreImage, file: PurePosixPath, sha256: str) -> dict[str, Cell]:
    """Return the row of an image."""
    region = image.region_px or (None, None, None, None)
    return {
        "name": image.name,
        "file": str(file),
        "sha256": sha256,
        "taken_s": image.taken_s,
        "scale_um_px": cell(image.scale_um_px),
        "zoom": cell(image.zoom),
        "focus_um": cell(image.focus_um),
        "light_percent": cell(image.light_percent),
        **dict(zip(REGION_NUMBERS, region, strict=True)),
    }


def region_px(row: Row) -> tuple[int, int, int, int] | None:
    """Return the region of an image, if it has one."""
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
    """Return a record without curves and images."""
    return FibreRecord(
        number=int(number(row["number"])),
        outcome=Outcome(str(row["outcome"])),
        began_s=number(row["began_s"]),
        ended_s=number(row["ended_s"]),
        found=_pose(row, "found"),
        left=_pose(row, "left"),
        shape=Shape(**{name: number(row.get(name)) for name in SHAPE_NUMBERS}),
        cause=str(row["cause"]),
        text=str(row["text"]),
        attempts=int(row["attempts"] or 0),
        peak_force_un=number(row["peak_force_un"]),
        bending=None if row["trusted"] is None else _result(row, spans),
        operations=tuple(_operation(each) for each in operations),
        role=str(row.get("role", FIBRE)),
        plate=int(number(row.get("plate", 1))),
    )


def _pose(row: Row, which: str) -> Pose | None:
    if row[f"{which}_x_plate_um"] is None:
        return None
    columns = ("x_plate_um", "y_plate_um", "angle_deg")
    return Pose(*(number(row[f"{which}_{name}"]) for name in columns))


def _flags(text: Cell) -> frozenset[Quality]:
    return frozenset(Quality(each) for each in str(text).split(SEPARATOR) if each)


def _result(row: Row, spans: Sequence[Row]) -> BendingResult:
    found = {name: number(row[name]) for name in RESULT_NUMBERS}
    return BendingResult(
        ei_n_m2=found["ei_n_m2"],
        ei_low_n_m2=found["ei_low_n_m2"],
        ei_high_n_m2=found["ei_high_n_m2"],
        clamp_offset_um=found["clamp_offset_um"],
        clamp_offset_std_um=found["clamp_offset_std_um"],
        chi2=found["chi2"],
        spans=tuple(_span_fit(each, np.empty(0)) for each in spans),
        used=tuple(int(each) for each in str(row["used_spans"]).split()),
        freedom=int(row["freedom"] or 0),
        flags=_flags(row["flags"]),
        trusted=bool(row["trusted"]),
        reasons=tuple(each for each in str(row["reasons"]).split(SEPARATOR) if each),
        budget=tuple(_contribution(each) for each in json.loads(str(row.get("budget_json", "[]")))),
        scale_verified=bool(row.get("scale_verified")),
        notes=_flags(row.get("notes", "")),
    )


def _contribution(line: Mapping[str, Any]) -> Contribution:
    return Contribution(**{**line, "kind": Kind(line["kind"])})


def _span_fit(row: Row, fitted_un: Floats) -> SpanFit:
    numbers: dict[str, Any] = {name: number(row.get(name)) for name in SPAN_NUMBERS}
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


def add_columns(connection: sqlite3.Connection) -> None:
    """Give a campaign begun with an earlier program the tables and columns it lacks."""
    for statement in statements(LATER_TABLES):
        connection.execute(statement)
    for table, columns in ADDED.items():
        there = {row[1] for row in connection.execute(f"PRAGMA table_info({table})")}
        for name, kind in columns.items():
            if name not in there:
                connection.execute(f"ALTER TABLE {table} ADD COLUMN {name} {kind}")


def statements(text: str) -> list[str]:
    """Return the statements of a text of SQL, one by one."""
    return [each for each in text.split(";") if each.strip()]


def insert(connection: sqlite3.Connection, table: str, row: Row) -> None:
    """Add a row."""
    names = ", ".join(row)
    marks = ", ".join("?" for _ in row)
    connection.execute(f"INSERT INTO {table} ({names}) VALUES ({marks})", tuple(row.values()))


def update(connection: sqlite3.Connection, table: str, row: Row, *, key: int) -> None:
    """Change the row with a number."""
    pairs = ", ".join(f"{name} = ?" for name in row)
    connection.execute(f"UPDATE {table} SET {pairs} WHERE number = ?", (*row.values(), key))


FORMAT = "cosmic fibre"
FORMAT_VERSION = 1
DAMAGED: Final = (OSError, RuntimeError, KeyError, TypeError, ValueError)
"""What reading a file raises of which a part is not as it was written."""

COLUMNS = {
    "way_um": "probe_um",
    "force_un": "force_un",
    "force_std_un": "force_std_un",
    "time_s": "time_s",
}
"""Columns of a span in the file, and what they are called in `Span`."""


def curves_file(record: FibreRecord) -> bytes:
    """Return the file of a record."""
    memory = io.BytesIO()
    with h5py.File(memory, "w") as file:
        file.attrs.update(
            {
                "format": FORMAT,
                "format_version": FORMAT_VERSION,
                "fibre": record.number,
                "role": record.role,
                "width_um": record.shape.width_um,
                "elapsed_s": record.elapsed_s,
                "assessed": record.bending is not None,
            }
        )
        for number, span in enumerate(record.spans):
            group = file.create_group(f"spans/{number:02d}")
            _put_span(group, span)
            if record.bending is not None and number < len(record.bending.spans):
                group["fitted_un"] = record.bending.spans[number].fitted_un
        for series in record.series:
            group = file.create_group(f"series/{series.name}")
            group.attrs["unit"] = series.unit
            group["time_s"], group["values"] = series.time_s, series.values
    return memory.getvalue()


def _put_span(group: h5py.Group, span: Span) -> None:
    group.attrs.update(
        {
            "nominal_um": span.nominal_um,
            "probe_x_um": span.probe_x_um,
            "hold_x_um": span.hold_x_um,
        }
    )
    for column, name in COLUMNS.items():
        group[column] = getattr(span, name)
    group["loading"] = span.loading
    if span.shape is not None:
        group["shape_um"] = np.column_stack([span.shape.ahead_um, span.shape.aside_um])
        group["shape_um"].attrs["at_um"] = span.shape.at_um
    if span.freed is not None:
        group["freed_up_un"], group["freed_down_un"] = span.freed.up_un, span.freed.down_un
        group["freed_up_un"].attrs.update(
            {
                "after": span.freed.after,
                "std_un": span.freed.std_un,
                "wait_s": span.freed.wait_s,
            }
        )
    if span.bent is not None:
        group["bent_um"] = np.column_stack([span.bent.ahead_um, span.bent.aside_um])
        group["bent_um"].attrs.update(
            {
                "std_um": span.bent.std_um,
                "probe_um": span.bent.probe_um,
                "force_un": span.bent.force_un,
            }
        )


def read_curves(path: Path) -> tuple[tuple[Span, ...], tuple[Floats, ...], tuple[Series, ...]]:
    """Return the spans, the fitted force of each, and the series.

    Raises
    ------
    CampaignError
        The file is not there, or not whole.
    """
    try:
        with h5py.File(path, "r") as file:
            groups = [file["spans"][name] for name in sorted(file.get("spans", ()))]
            spans = tuple(_measured_span(group) for group in groups)
            fitted = tuple(_fitted(group) for group in groups)
            held = file.get("series", {})
            series = tuple(
                Series(
                    name,
                    str(held[name].attrs["unit"]),
                    np.asarray(held[name]["time_s"]),
                    np.asarray(held[name]["values"]),
                )
                for name in sorted(held)
            )
    except DAMAGED as exc:
        raise CampaignError(f"{path} cannot be read: {exc}") from exc
    return spans, fitted, series


def _check_format(file: h5py.File) -> None:
    """Refuse what is no raw file of a fibre, or has a meaning that this program does not know.

    After the spans: of a spoilt file h5py may read a text for ever, and most fail there before.
    """
    said, version = file.attrs.get("format"), int(file.attrs.get("format_version", FORMAT_VERSION))
    if said != FORMAT:
        raise ValueError(f"it is no file of a fibre: its format is {said!r}, not {FORMAT!r}")
    if version > FORMAT_VERSION:
        raise ValueError(
            f"it is of version {version}, and this program reads up to version {FORMAT_VERSION}: "
            "use the program that wrote it"
        )


def _measured_span(group: h5py.Group) -> Span:
    columns = {name: _column(group[column], group.name, column) for column, name in COLUMNS.items()}
    return Span(
        nominal_um=float(group.attrs["nominal_um"]),
        probe_x_um=float(group.attrs["probe_x_um"]),
        hold_x_um=float(group.attrs["hold_x_um"]),
        probe_um=columns["probe_um"],
        force_un=columns["force_un"],
        force_std_un=columns["force_std_un"],
        time_s=columns["time_s"],
        loading=np.asarray(group["loading"], dtype=np.bool_),
        shape=_natural_shape(group),
        freed=_freed(group),
        bent=_bent(group),
    )


def _column(held: h5py.Dataset, span: str, column: str) -> Floats:
    values = np.asarray(held)
    if values.ndim != 1 or values.dtype.kind not in "fiu":
        raise ValueError(f"{column} of {span} is no row of numbers")
    return np.asarray(values, dtype=np.float64)


def _freed(group: h5py.Group) -> Freed | None:
    if "freed_up_un" not in group:  # not tried, or written before it was
        return None
    facts = group["freed_up_un"].attrs
    return Freed(
        after=int(facts["after"]),
        up_un=np.asarray(group["freed_up_un"], dtype=np.float64),
        down_un=np.asarray(group["freed_down_un"], dtype=np.float64),
        std_un=float(facts["std_un"]),
        wait_s=float(facts["wait_s"]),
    )


def _bent(group: h5py.Group) -> BentShape | None:
    if "bent_um" not in group:  # not looked at, or written before it was
        return None
    ahead, aside = np.asarray(group["bent_um"], dtype=np.float64).reshape(-1, 2).T
    facts = group["bent_um"].attrs
    return BentShape(
        ahead_um=ahead,
        aside_um=aside,
        std_um=float(facts["std_um"]),
        probe_um=float(facts["probe_um"]),
        force_un=float(facts["force_un"]),
    )


def _natural_shape(group: h5py.Group) -> NaturalShape | None:
    if "shape_um" not in group:  # straight, or written before shapes were kept
        return None
    ahead, aside = np.asarray(group["shape_um"], dtype=np.float64).T
    return NaturalShape(ahead, aside, float(group["shape_um"].attrs["at_um"]))


def _fitted(group: h5py.Group) -> Floats:
    if "fitted_un" in group:
        return np.asarray(group["fitted_un"], dtype=np.float64)
    return np.full(len(group["way_um"]), np.nan)


def fitted_file(fitted: Mapping[int, Sequence[Floats]]) -> bytes:
    """Return the file of the model at each point, by fibre and span."""
    memory = io.BytesIO()
    with h5py.File(memory, "w") as file:
        file.attrs.update({"format": "cosmic analysis", "format_version": FORMAT_VERSION})
        for fibre, curves in fitted.items():
            for number, curve in enumerate(curves):
                file[f"{fibre:05d}/{number:02d}"] = curve
    return memory.getvalue()


def read_fitted(path: Path, fibre: int) -> tuple[Floats, ...]:
    """Return the model at each point of the spans of a fibre; empty where it is not there."""
    if not path.exists():
        return ()
    try:
        with h5py.File(path, "r") as file:
            group = file.get(f"{fibre:05d}", {})
            return tuple(np.asarray(group[name], dtype=np.float64) for name in sorted(group))
    except DAMAGED as exc:
        raise CampaignError(f"{path} cannot be read: {exc}") from exc


@dataclass(frozen=True, slots=True, eq=False)
class RawFibre:
    """What the raw file of a fibre, or of a standard, holds for its analysis.

    Attributes
    ----------
    assessed : bool
        The campaign came to a value, or to the reason why there is none.
    """

    number: int
    role: str
    width_um: float
    elapsed_s: float
    assessed: bool
    spans: tuple[Span, ...]


def read_raw(path: Path) -> RawFibre:
    """Return the raw file of a fibre.

    Raises
    ------
    CampaignError
        The file is not there, not whole, or of a program that did not write what this needs.
    """
    spans, _, _ = read_curves(path)
    try:
        with h5py.File(path, "r") as file:
            held = file.attrs
            _check_format(file)
            return RawFibre(
                number=int(held["fibre"]),
                role=str(held["role"]),
                width_um=float(held["width_um"]),
                elapsed_s=float(held["elapsed_s"]),
                assessed=bool(held["assessed"]),
                spans=spans,
            )
    except KeyError as exc:
        raise CampaignError(
            f"{path} was written before raw files held all that an analysis needs: {exc}"
        ) from exc
    except DAMAGED as exc:
        raise CampaignError(f"{path} cannot be read: {exc}") from exc
