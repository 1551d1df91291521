"""What OME-TIFF says of images: when they were taken, how long exposed, where the stage stood."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Final

from cosmic.vico.core.recording.side_row import SideRow

STAGES: Final = ("stage", "sample", "table")
"""Assemblies whose x, y and z are the position of the stage; the first that has one of them."""
UNEVEN: Final = 0.05
"""Intervals that differ by more of their mean are not regular: `TimeIncrement` would mislead."""


def described(rows: Sequence[SideRow], scale_um_px: float | None) -> dict[str, object]:
    """Return the metadata of images in the order of `rows`, as tifffile takes them.

    Times count from the exposure of the first. A value that one of the images lacks is left out.
    """
    first = rows[0]
    found: dict[str, object] = {"Name": first.camera}
    if first.utc is not None:
        found["AcquisitionDate"] = first.utc.isoformat(timespec="microseconds")
    if scale_um_px:
        found |= {
            "PhysicalSizeX": scale_um_px,
            "PhysicalSizeXUnit": "µm",
            "PhysicalSizeY": scale_um_px,
            "PhysicalSizeYUnit": "µm",
        }
    every_s = _interval_s(rows)
    if every_s is not None:
        found |= {"TimeIncrement": every_s, "TimeIncrementUnit": "s"}
    found["Plane"] = _planes(rows)
    return found


def _interval_s(rows: Sequence[SideRow]) -> float | None:
    """Return the time from image to image; None where they do not come regularly."""
    if len(rows) < 2:
        return None
    mean_s = (rows[-1].exposed_s - rows[0].exposed_s) / (len(rows) - 1)
    intervals_s = [after.exposed_s - before.exposed_s for before, after in pairwise(rows)]
    regular = all(abs(each - mean_s) <= UNEVEN * mean_s for each in intervals_s)
    return mean_s if mean_s > 0.0 and regular else None


def _planes(rows: Sequence[SideRow]) -> dict[str, object]:
    count = len(rows)
    planes: dict[str, object] = {
        "DeltaT": [each.exposed_s - rows[0].exposed_s for each in rows],
        "DeltaTUnit": ["s"] * count,
    }
    exposures = [each.circumstances.exposure_s for each in rows]
    if None not in exposures:
        planes |= {"ExposureTime": exposures, "ExposureTimeUnit": ["s"] * count}
    stage = _stage(rows[0])
    for letter in "xyz":
        places = [each.circumstances.positions.get(f"{stage}.{letter}") for each in rows]
        if None not in places:
            name = f"Position{letter.upper()}"
            planes |= {name: places, f"{name}Unit": ["µm"] * count}
    return planes


def _stage(row: SideRow) -> str:
    positions = row.circumstances.positions
    return next(
        (name for name in STAGES if any(f"{name}.{letter}" in positions for letter in "xyz")), ""
    )
