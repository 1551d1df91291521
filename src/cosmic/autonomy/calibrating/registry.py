"""`CalibrationRegistry`: what was measured, how well, when, with what, and whether it holds."""

import logging
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from enum import StrEnum
from pathlib import Path
from threading import Lock
from typing import Annotated, Any, Final, Literal
from uuid import uuid4

from pydantic import AwareDatetime, Field

from cosmic.frame.arguments import checked_class
from cosmic.frame.clock import Clock
from cosmic.frame.config import StrictModel, load_model
from cosmic.frame.errors import ConfigError
from cosmic.frame.events import Event, Unsubscribe
from cosmic.frame.kept_file import changing, toml_lines, write_whole

logger = logging.getLogger(__name__)

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


def _read(path: Path) -> list[dict[str, Any]]:
    """Return the entries of a file; raises `ConfigError` with file, key and reason."""
    return [each.model_dump() for each in load_model(path, _File).entry]


def _write_file(path: Path, entries: Sequence[Mapping[str, object]]) -> None:
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


FILE: Final = "calibrations.toml"
LONGEST_S: Final = 7200.0
"""Age at which a calibration is stale where nobody says another."""
CLOCKS_DIFFER: Final = timedelta(minutes=1)
"""One that was made later than now, by more: the date was set back, and its age is unknown."""


class CalibrationStanding(StrEnum):
    """Whether a calibration may be used."""

    FRESH = "fresh"
    STALE = "stale"
    UNCHECKED = "to be checked"
    POOR = "poor"


@dataclass(frozen=True, slots=True)
class CalibrationEntry:
    """One calibration.

    Attributes
    ----------
    name : str
        What was measured, such as "height over the plate".
    tool : str
        With what, or of what.
    values : mapping of str to float
        What came of it; units stand in the names.
    residual, largest : float
        How well it fits, and what is accepted at most; in `unit`.
    made : datetime
        With its time zone.
    made_s : float
        The same on the platform's clock, which begins anew with each start.
    session : str
        The start of the program in which it was made, or checked last.
    zoom : float or None
        Magnification of the images; None: no image, or several.
    made_with : str
        What it rests on; made with anything else it is none.
    how : str
        Method and amount, such as "9 images a sweep".
    version : str
        Of the program.
    checked : datetime or None
        When it was last looked at whether it still holds.
    problem : str
        Why it was refused; empty when it was not.
    """

    name: str
    tool: str
    values: Mapping[str, float]
    residual: float
    unit: str
    largest: float
    made: datetime
    made_s: float
    session: str
    zoom: float | None = None
    made_with: str = ""
    how: str = ""
    version: str = ""
    checked: datetime | None = None
    problem: str = ""

    @property
    def key(self) -> tuple[str, str]:
        """By which it is kept."""
        return self.name, self.tool


@checked_class
@dataclass(slots=True)
class CalibrationRegistry:
    """All calibrations, the newest of each name and tool; any thread.

    Parameters
    ----------
    folder : Path or None
        Where it is kept as a file, made when the first is written; None: until the program ends.
    clock : Clock or None
        The platform's, by which ages count; None: the wall.
    now : callable
        Date and time, with a time zone.

    Attributes
    ----------
    session : str
        Names this start of the program: where stages are referenced anew, what was made before is
        looked at before it is trusted.
    focus_before : int or None
        Where the lens was focused before it was homed, counts, until it is focused there again.

    Raises
    ------
    ConfigError
        The file there is broken; the text names the key.
    """

    folder: Path | None = None
    version: str = ""
    clock: Clock | None = None
    now: Callable[[], datetime] = lambda: datetime.now(UTC)
    session: str = field(default_factory=lambda: uuid4().hex[:12])
    focus_before: int | None = None
    _known: dict[tuple[str, str], CalibrationEntry] = field(default_factory=dict)
    _kept: dict[tuple[str, str], CalibrationEntry] = field(default_factory=dict)
    _lock: Lock = field(default_factory=Lock)
    _writing: Lock = field(default_factory=Lock)
    _changed: Event[[]] = field(default_factory=Event)

    def __post_init__(self) -> None:
        self._kept = self._in_file()
        self._known = dict(self._kept)

    @property
    def entries(self) -> tuple[CalibrationEntry, ...]:
        """All of them, by name and tool."""
        with self._lock:
            return tuple(self._known[key] for key in sorted(self._known))

    def get(self, name: str, tool: str) -> CalibrationEntry | None:
        """Return the one in force; None where there is none, or the last was refused."""
        with self._lock:
            found = self._known.get((name, tool))
        return None if found is None or found.problem else found

    def put(self, entry: CalibrationEntry) -> None:
        """Put one in force, and keep it.

        Raises
        ------
        ConfigError
            It cannot be written, or holds what is no number: then all stays as it was.
        """
        numbers = {**entry.values, "residual": entry.residual, "largest": entry.largest}
        wrong = [name for name, value in numbers.items() if not math.isfinite(value)]
        if wrong:
            names = ", ".join(wrong)
            raise ConfigError(
                f"{entry.name} of {entry.tool}: {names}: not a number; measure it again"
            )
        with self._lock:
            self._known[entry.key] = replace(entry, session=self.session, version=self.version)
        self._write(entry.key)

    def refuse(self, entry: CalibrationEntry, problem: str) -> None:
        """Note that one was refused; what was in force before is none any more."""
        # What is no number cannot be kept; `problem` says it.
        values = {name: value for name, value in entry.values.items() if math.isfinite(value)}
        residual = entry.residual if math.isfinite(entry.residual) else 0.0
        self.put(replace(entry, values=values, residual=residual, problem=problem))

    def confirm(self, entry: CalibrationEntry, now_s: float) -> CalibrationEntry:
        """Note that one was looked at and holds, and return it as it stands now."""
        made_s = now_s - self.age_s(entry)
        checked = replace(entry, checked=self.now(), session=self.session, made_s=made_s)
        self.put(checked)
        return checked

    def forget(self, name: str, tool: str) -> None:
        """Have one measured anew; harmless where there is none."""
        with self._lock:
            self._known.pop((name, tool), None)
        self._write((name, tool))

    def age_s(self, entry: CalibrationEntry) -> float:
        """Return how long ago one was made: on the platform's clock, or by date if before it."""
        if self.clock is not None and entry.session == self.session:
            return max(0.0, self.clock.now_s() - entry.made_s)
        return max(0.0, (self.now() - entry.made).total_seconds())

    def standing(
        self, entry: CalibrationEntry, longest_s: float = LONGEST_S
    ) -> CalibrationStanding:
        """Return whether it may be used."""
        if entry.problem or not entry.residual <= entry.largest:
            return CalibrationStanding.POOR
        if entry.session != self.session and entry.made - self.now() > CLOCKS_DIFFER:
            return CalibrationStanding.STALE
        if not self.age_s(entry) <= longest_s:
            return CalibrationStanding.STALE
        return (
            CalibrationStanding.FRESH
            if entry.session == self.session
            else CalibrationStanding.UNCHECKED
        )

    def on_change(self, listener: Callable[[], object]) -> Unsubscribe:
        """Call `listener()`, in any thread, after each change; returns what ends it."""
        return self._changed.subscribe(listener)

    def _in_file(self) -> dict[tuple[str, str], CalibrationEntry]:
        """Return what the file holds; empty without one."""
        if self.folder is None or not (self.folder / FILE).exists():
            return {}
        found = [CalibrationEntry(**each) for each in _read(self.folder / FILE)]
        return {each.key: each for each in found}

    def _write(self, changed: tuple[str, str]) -> None:
        """Write what became of one; what others did to the file meanwhile stays."""
        if self.folder is not None:
            with self._writing, changing(self.folder / FILE):
                if (self.folder / FILE).exists():
                    self._take_over(self._in_file(), changed)
                names = CalibrationEntry.__slots__
                rows = [{name: getattr(each, name) for name in names} for each in self.entries]
                _write_file(self.folder / FILE, rows)
                self._kept = self._in_file()
            logger.info("%s written", self.folder / FILE)
        self._changed.emit()

    def _take_over(
        self, now: Mapping[tuple[str, str], CalibrationEntry], changed: tuple[str, str]
    ) -> None:
        """Take what another program, or a person, put into the file or took out of it."""
        with self._lock:
            for key in (self._kept.keys() | now.keys()) - {changed}:
                if now.get(key) == self._kept.get(key):
                    continue
                if key in now:
                    self._known[key] = now[key]
                else:
                    self._known.pop(key, None)
