"""What is known here of DAQCo at another station, without asking it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Lock
from typing import Final

from PySide6.QtCore import QObject

from cosmic.daqco.api.recorder import RecordingState
from cosmic.daqco.api.station_report import DaqRecordingReport, DaqReport, settings_of
from cosmic.daqco.core.scale import Scale
from cosmic.daqco.core.settings import ChannelSettings, DaqcoSettings
from cosmic.daqco.hw.interface import BoardInfo
from cosmic.frame.application import GuiFactory
from cosmic.frame.clock import WALL
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.task_application import TaskApplication

NOTHING_KNOWN: Final = DaqcoSettings(
    channel=(ChannelSettings(name="unknown", board="unknown", input="ai0", active=False),)
)
"""Stands for settings while the station was never reached."""


@dataclass(frozen=True, slots=True)
class Taken:
    """What a report was: the first of a start of the station, and whether anybody has to know."""

    first: bool
    changed: bool


class StationView(TaskApplication):
    """Keeps the newest report, and answers out of it; any thread."""

    def __init__(
        self,
        policy: FailurePolicy,
        gui_factory: GuiFactory | None = None,
        parent: QObject | None = None,
    ) -> None:
        super().__init__("DAQCo", policy, gui_factory, parent)
        self._lock = Lock()
        self._report: DaqReport | None = None
        self._settings = NOTHING_KNOWN
        self._away, self._here = "not connected yet", False
        self._heard_wall_s = -float("inf")

    @property
    def away(self) -> str:
        """Why the station cannot be reached; empty while it can."""
        return self._away

    @property
    def settings(self) -> DaqcoSettings:
        """What is in force there."""
        return self._settings

    @property
    def directory(self) -> Path:
        """Where recordings go there unless somebody says otherwise."""
        return Path(self._report.directory) if self._report is not None else Path()

    @property
    def problem(self) -> str:
        """Why acquisition cannot run, or ended by itself, or that the station is away."""
        return self._away or (self._report.problem if self._report is not None else "")

    @property
    def infos(self) -> Mapping[str, BoardInfo]:
        """The boards there are, by name."""
        boards = self._report.boards if self._report is not None else ()
        return {each.name: each for each in boards}

    @property
    def running(self) -> bool:
        """Samples are being acquired, and the station is there."""
        return not self._away and self._report is not None and self._report.running

    @property
    def rate_hz(self) -> float:
        """The rate the boards really make; that of the settings while nothing runs."""
        return self._report.rate_hz if self._report is not None else self._settings.rate_hz

    def scales(self) -> dict[str, Scale]:
        """Return the scale in force of every channel, by its name."""
        settings = self._settings
        known = settings.scales()
        return {each.name: known[each.scale] for each in settings.channel}

    @property
    def here(self) -> bool:
        """There is a line to the station; whether it hosts DAQCo is another question."""
        return self._here

    @property
    def heard_wall_s(self) -> float:
        """When the newest report came, on the clock of the wall."""
        return self._heard_wall_s

    # For the application

    def take_report(self, report: DaqReport) -> Taken | None:
        """Keep a report, and return what it was; None where a newer one is known.

        Raises
        ------
        ConfigError
            The settings in it are none.
        """
        settings = settings_of(report.settings)
        with self._lock:
            before = self._report
            first = before is None or before.station != report.station
            if before is not None and not first and before.number >= report.number:
                return None
            was_away, self._away = self._away, "" if self._here else self._away
            self._heard_wall_s = WALL.now_s()
            if settings != self._settings:
                self._settings = settings
            self._report = report
        changed = was_away != self._away or _kept(before) != _kept(report)
        return Taken(first, first or changed)

    def note_presence(self, here: bool) -> None:
        """Note whether there is a line; `away` ends with the next report only."""
        self._here = here

    def note_away(self, why: str) -> bool:
        """Note why the station cannot be reached; True when that is new."""
        with self._lock:
            before, self._away = self._away, why
        return before != why


def _kept(report: DaqReport | None) -> DaqReport | None:
    """Return a report without what changes all the time, or is told by the recorder."""
    if report is None:
        return None
    quiet = DaqRecordingReport.of(RecordingState())
    return replace(report, number=0, now_s=0.0, samples=0, recording=quiet)
