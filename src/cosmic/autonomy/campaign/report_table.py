"""All fibres of a campaign as one table of plain columns."""

import csv
import io
import math
from pathlib import Path
from typing import Final

from cosmic.autonomy.campaign.records import FibreRecord, Value
from cosmic.autonomy.campaign.store import write_whole
from cosmic.autonomy.campaign.store_read import CampaignReader

COLUMNS: Final = (
    "fibre",
    "outcome",
    "cause",
    "began_s",
    "duration_s",
    "attempts",
    "x_plate_um",
    "y_plate_um",
    "angle_deg",
    "length_um",
    "length_std_um",
    "width_um",
    "width_std_um",
    "width_resolved",
    "curl",
    "curl_std",
    "ei_n_m2",
    "ei_low_n_m2",
    "ei_high_n_m2",
    "clamp_offset_um",
    "spans",
    "spans_used",
    "peak_force_un",
    "chi2",
    "freedom",
    "trusted",
    "flags",
    "reasons",
    "plate",
    "probability",
)


def read_campaign(folder: str | Path) -> dict[str, list[Value]]:
    """Return the finished fibres of a campaign, a list a column.

    `pandas.DataFrame(read_campaign(folder))` makes a table of it. Numbers that were not measured
    are nan, texts empty.

    Raises
    ------
    CampaignError
        There is no campaign in the folder, or it cannot be read.
    """
    reader = CampaignReader(Path(folder))
    reader.check()
    rows = [_row(each) for each in reader.finished()]
    return {name: [row[name] for row in rows] for name in COLUMNS}


def write_table(folder: str | Path, path: str | Path) -> None:
    """Write the table of a campaign as CSV: UTF-8, a comma between cells, empty where not measured.

    Raises
    ------
    CampaignError
        The campaign cannot be read, or the file not be written.
    """
    columns = read_campaign(folder)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for row in zip(*columns.values(), strict=True):
        writer.writerow([_cell(each) for each in row])
    write_whole(Path(path), text.getvalue().encode())


def _cell(value: Value) -> Value:
    if isinstance(value, float):
        return "" if math.isnan(value) else float(f"{value:.8g}")
    return value


def _row(record: FibreRecord) -> dict[str, Value]:
    result, found, nan = record.bending, record.found, math.nan
    return {
        "fibre": record.number,
        "outcome": record.outcome.value,
        "cause": record.cause,
        "began_s": record.began_s,
        "duration_s": record.duration_s,
        "attempts": record.attempts,
        "x_plate_um": nan if found is None else found.x_plate_um,
        "y_plate_um": nan if found is None else found.y_plate_um,
        "angle_deg": nan if found is None else found.angle_deg,
        "length_um": record.shape.length_um,
        "length_std_um": record.shape.length_std_um,
        "width_um": record.shape.width_um,
        "width_std_um": record.shape.width_std_um,
        "width_resolved": record.shape.width_resolved,
        "curl": record.shape.curl,
        "curl_std": record.shape.curl_std,
        "ei_n_m2": nan if result is None else result.ei_n_m2,
        "ei_low_n_m2": nan if result is None else result.ei_low_n_m2,
        "ei_high_n_m2": nan if result is None else result.ei_high_n_m2,
        "clamp_offset_um": nan if result is None else result.clamp_offset_um,
        "spans": 0 if result is None else len(result.spans),
        "spans_used": 0 if result is None else len(result.used),
        "peak_force_un": record.peak_force_un,
        "chi2": nan if result is None else result.chi2,
        "freedom": 0 if result is None else result.freedom,
        "trusted": False if result is None else result.trusted,
        "flags": "" if result is None else "; ".join(sorted(result.flags)),
        "reasons": "" if result is None else "; ".join(result.reasons),
        "plate": record.plate,
        "probability": record.shape.probability,
    }
