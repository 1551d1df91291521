"""The HDF5 file of one fibre: spans as measured and as fitted, and everything over time."""

import io
from pathlib import Path

import h5py
import numpy as np

from cosmic.autonomy.bending.span import Span
from cosmic.autonomy.campaign.records import CampaignError, FibreRecord, Floats, Series

FORMAT = "cosmic fibre"
FORMAT_VERSION = 1
COLUMNS = ("way_um", "force_un", "force_std_un", "time_s")


def curves_file(record: FibreRecord) -> bytes:
    """Return the file of a record."""
    memory = io.BytesIO()
    with h5py.File(memory, "w") as file:
        file.attrs.update(
            {"format": FORMAT, "format_version": FORMAT_VERSION, "fibre": record.number}
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
    for name in COLUMNS:
        group[name] = getattr(span, name)
    group["loading"] = span.loading


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
            spans = tuple(_span(group) for group in groups)
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
    except (OSError, KeyError) as exc:
        raise CampaignError(f"{path} cannot be read: {exc}") from exc
    return spans, fitted, series


def _span(group: h5py.Group) -> Span:
    columns = {name: np.asarray(group[name]) for name in COLUMNS}
    return Span(
        nominal_um=float(group.attrs["nominal_um"]),
        probe_x_um=float(group.attrs["probe_x_um"]),
        hold_x_um=float(group.attrs["hold_x_um"]),
        way_um=columns["way_um"],
        force_un=columns["force_un"],
        force_std_un=columns["force_std_un"],
        time_s=columns["time_s"],
        loading=np.asarray(group["loading"], dtype=np.bool_),
    )


def _fitted(group: h5py.Group) -> Floats:
    if "fitted_un" in group:
        return np.asarray(group["fitted_un"], dtype=np.float64)
    return np.full(len(group["way_um"]), np.nan)
