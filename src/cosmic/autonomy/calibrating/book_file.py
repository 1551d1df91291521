"""The book of calibrations as a file that a person can read."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from pydantic import AwareDatetime, Field

from cosmic.frame.config import StrictModel, load_model
from cosmic.frame.errors import ConfigError
from cosmic.frame.kept_file import toml_lines, write_whole

HEAD: Final = """\
# Calibrations of the platform, written by the program when it measures.
# Delete an [[entry]] to have it measured anew.

format = 1
"""


class _Entry(StrictModel):
    name: str = Field(min_length=1)
    tool: str
    values: dict[str, float]
    residual: float = Field(ge=0.0)
    unit: str
    largest: float = Field(ge=0.0)
    made: AwareDatetime
    made_s: float
    session: str
    zoom: float | None = None
    made_with: str = ""
    how: str = ""
    version: str = ""
    checked: AwareDatetime | None = None
    problem: str = ""


class _File(StrictModel):
    format: Literal[1]
    entry: Annotated[tuple[_Entry, ...], Field(strict=False)] = ()


def read_book(path: Path) -> list[dict[str, Any]]:
    """Return the entries of a file; raises `ConfigError` with file, key and reason."""
    return [each.model_dump() for each in load_model(path, _File).entry]


def write_book(path: Path, entries: Sequence[Mapping[str, object]]) -> None:
    """Write all entries; the old file stays whole until the new one is.

    Raises
    ------
    ConfigError
        It cannot be written there.
    """
    text = HEAD + "".join(f"\n[[entry]]\n{toml_lines(each)}" for each in entries)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, text)
    except OSError as exc:
        raise ConfigError(f"{path}: cannot be written: {exc.strerror or exc}") from exc
