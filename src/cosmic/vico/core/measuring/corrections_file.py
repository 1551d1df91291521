"""The file of an operator's corrections as it is read: whole and strict, or refused by its name."""

import json
from pathlib import Path
from typing import Annotated, Final

from pydantic import ConfigDict, Field

from cosmic.frame.config import StrictModel, check_model
from cosmic.frame.errors import ConfigError, RecordingError
from cosmic.vico.core.vision.grey import MOST_SIDE_PX

MOST_SAID: Final = 3
TO_DO: Final = "Restore it from a copy, or move it away to begin anew."

# Older versions let points lie outside the image; a point beyond this is damage.
Coordinate = Annotated[float, Field(ge=-MOST_SIDE_PX, le=2 * MOST_SIDE_PX)]
KeptPoint = Annotated[list[Coordinate], Field(min_length=2, max_length=2)]
Number = Annotated[int, Field(ge=1, lt=2**31)]


class KeptLine(StrictModel):
    """A fibre as it was found."""

    model_config = ConfigDict(extra="ignore")

    number: Number
    width_px: float = Field(gt=0.0, le=MOST_SIDE_PX)
    line_px: list[KeptPoint] = Field(min_length=2)
    by_operator: bool


class KeptEdit(StrictModel):
    """One edit; `new_number` is 0 in files of version 1."""

    model_config = ConfigDict(extra="ignore")

    kind: str
    numbers: list[Number]
    points_px: list[KeptPoint]
    width_px: float
    when: str
    new_number: int = Field(default=0, ge=0, lt=2**31)


class KeptCorrections(StrictModel):
    """What is read of a file; the fibres that follow from it are made anew."""

    model_config = ConfigDict(extra="ignore")

    version: int
    pixels_sha256: str
    found: list[KeptLine]
    edits: list[KeptEdit]
    in_force: int = Field(ge=0)
    next_number: Number = 1


def read_corrections(path: Path, newest: int) -> KeptCorrections:
    """Read a file of corrections, of the version `newest` or an older one.

    Raises
    ------
    RecordingError
        It is missing, damaged or of a newer version; the text says which.
    """
    try:
        whole = json.loads(path.read_text(encoding="utf-8"), parse_constant=_refused)
    except OSError as exc:
        raise unreadable(path, exc.strerror or str(exc)) from exc
    except RecursionError:
        raise unreadable(path, "its lists lie too deep") from None
    except ValueError as exc:
        raise unreadable(path, str(exc).partition(";")[0]) from exc
    version = whole.get("version") if isinstance(whole, dict) else None
    if isinstance(version, bool) or not isinstance(version, int):
        raise unreadable(path, "it says no version")
    if not 1 <= version <= newest:
        raise RecordingError(
            f"{path}: is of version {version}, and this program reads 1 to {newest}. Open it with "
            "the program that wrote it, or move it away to begin anew."
        )
    try:
        kept = check_model("file", whole, KeptCorrections)
    except ConfigError as exc:
        raise unreadable(path, _shortened(str(exc))) from None
    if not kept.in_force <= len(kept.edits):
        raise unreadable(path, f"{kept.in_force} edits in force of {len(kept.edits)}")
    return kept


def unreadable(path: Path, why: str) -> RecordingError:
    """Return what is raised for a damaged file."""
    return RecordingError(f"{path}: holds no corrections that can be read ({why}). {TO_DO}")


def _refused(constant: str) -> object:
    raise ValueError(f"it has {constant}, which is not a number")


def _shortened(problems: str) -> str:
    lines = [each.removeprefix("file: ") for each in problems.splitlines()]
    more = f"; and {len(lines) - MOST_SAID} more" if len(lines) > MOST_SAID else ""
    return "; ".join(lines[:MOST_SAID]) + more
