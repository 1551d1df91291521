"""DAQCo as other stations use it; it stands beside the application that has the boards."""

import secrets
from collections.abc import Callable, Sequence
from datetime import datetime
from pathlib import Path
from threading import Lock
from typing import Final

from PySide6.QtCore import Qt

from cosmic.daqco.api.application import DaqcoApplication
from cosmic.daqco.api.files import named_file, recordings_in
from cosmic.daqco.api.station_folders import EXPORTS, RECORDINGS, StationFolders
from cosmic.daqco.api.station_report import (
    CROSSINGS,
    FAILURES,
    DaqFolder,
    DaqRecordingReport,
    DaqReport,
    plain_settings,
    settings_of,
)
from cosmic.daqco.api.station_stream import DISPLAY_S, ReportSender, SampleStream
from cosmic.daqco.core.limits import Crossing, Limit
from cosmic.daqco.core.scale import Scale
from cosmic.frame.errors import ConfigError, CosmicError
from cosmic.frame.file_names import NameOption, directory_problem, space_left
from cosmic.frame.network.remote import remote
from cosmic.frame.network.station import Station
from cosmic.frame.task import Task

MOST_CROSSINGS: Final = 20


class DaqcoStationSide:
    """Offers a `DaqcoApplication` to other stations once a `Station` hosts it; at last `close`.

    Limits are watched here, where the boards are, and what they stop here is stopped whoever
    listens. Commands return a report, so that who gave one sees at once what came of it.

    Parameters
    ----------
    folders : sequence of Path
        Where others may have files written, with everything below; the directory for recordings
        by default.
    """

    def __init__(self, application: DaqcoApplication, folders: Sequence[Path] = ()) -> None:
        self._application = application
        self._folders = StationFolders(folders or (application.directory,))
        self._name = secrets.token_hex(8)
        self._lock = Lock()
        self._number = 0
        self._problem = ""
        self._station: Station | None = None
        self._reports: ReportSender | None = None
        self._ends: list[Callable[[], None]] = []

    # Hosting

    def on_hosted(self, station: Station) -> None:
        """Publish samples and reports on this station from now on; `close` ends it."""
        application = self._application
        reports = ReportSender(self._report, station.publish, station.policy)
        self._station, self._reports = station, reports
        application.guard.subscribe(self._on_crossing)
        application.recorder.on_change(reports.note_change)
        direct = Qt.ConnectionType.DirectConnection
        application.status_changed.connect(lambda: self._on_status(), direct)
        stream = SampleStream(station.publish, DISPLAY_S * max(1.0, application.clock.rate))
        self._ends = [application.buffer.subscribe(stream.take)]
        reports.start()

    def close(self) -> None:
        """Publish no more; any state."""
        while self._ends:
            self._ends.pop()()
        if self._reports is not None:
            self._reports.request_end()
            self._reports.join()
        self._station = None

    def _on_status(self) -> None:
        problem, before = self._application.problem, self._problem
        self._problem = problem
        if problem and problem != before:
            self._publish(FAILURES, problem)
        self._note_change()

    def _on_crossing(self, crossing: Crossing) -> None:
        self._publish(CROSSINGS, crossing)
        self._note_change()

    def _publish(self, topic: str, payload: object) -> None:
        if self._station is not None:
            self._station.publish(topic, payload)

    def _note_change(self) -> None:
        if self._reports is not None:
            self._reports.note_change()

    def _report(self) -> DaqReport:
        application = self._application
        with self._lock:
            self._number += 1
            return DaqReport(
                station=self._name,
                number=self._number,
                settings=plain_settings(application.settings),
                running=application.running,
                rate_hz=application.rate_hz,
                problem=application.problem,
                now_s=application.clock.now_s(),
                clock_rate=application.clock.rate,
                samples=application.buffer.samples,
                recording=DaqRecordingReport.of(application.recorder.state),
                limits=tuple(application.guard.limits.values()),
                crossings=application.guard.crossings[-MOST_CROSSINGS:],
                boards=tuple(application.infos.values()),
                directory=str(application.directory),
            )

    def _changed(self) -> DaqReport:
        self._note_change()
        return self._report()

    # What is read

    @remote(reads=True)
    def report(self) -> DaqReport:
        """Return how everything stands."""
        return self._report()

    @remote(reads=True)
    def now_s(self) -> float:
        """Return what the platform's clock says here."""
        return self._application.clock.now_s()

    @remote(reads=True)
    def folder(self, directory: str) -> DaqFolder:
        """Return whether there can be recorded in a directory here, and how much room there is."""
        try:
            whole = self._folders.folder(directory)
            problem = directory_problem(str(whole))
            free = 0 if problem else space_left(whole, 1.0).free_bytes
        except CosmicError as exc:
            return DaqFolder(directory, str(exc), 0)
        return DaqFolder(directory, problem, free)

    @remote(reads=True)
    def recordings(self, directory: str) -> list[str]:
        """Return the recordings in a directory here, the newest first."""
        return [str(each) for each in recordings_in(self._folders.folder(directory))]

    @remote(reads=True)
    def name_recording(
        self, base: str, append: str, directory: str, when: datetime
    ) -> tuple[str, int | None]:
        """Return the file for a recording, and how large the one is that lies there already."""
        try:
            option = NameOption(append)
        except ValueError:
            raise ConfigError(f"nothing is appended to a name by {append[:60]!r}") from None
        folder = self._folders.folder(directory)
        found = named_file(base, option, folder, when.astimezone())
        return str(found.path), found.size_bytes

    # Acquisition

    @remote
    def look_for_boards(self) -> DaqReport:
        """Look for boards and open those there are."""
        self._application.look_for_boards()
        return self._changed()

    @remote
    def start_acquisition(self) -> DaqReport:
        """Begin to acquire."""
        self._application.start_acquisition()
        return self._changed()

    @remote
    def stop_acquisition(self) -> DaqReport:
        """End acquiring."""
        self._application.stop_acquisition()
        return self._changed()

    @remote
    def apply(self, settings: dict[str, object]) -> DaqReport:
        """Put settings in force that are checked here as if they stood in a file."""
        wanted = settings_of(settings)
        present = self._application.settings
        if wanted.directory != present.directory:
            self._folders.folder(wanted.directory)
        if (wanted.backend, wanted.clock_sources) != (present.backend, present.clock_sources):
            raise ConfigError("driver and clocks of the boards are set in the platform file only")
        self._application.apply(wanted)
        return self._changed()

    @remote
    def set_scale(
        self, channel: str, name: str, unit: str, coefficients: Sequence[float]
    ) -> DaqReport:
        """Give a channel a scale."""
        self._application.set_scale(channel, Scale(name, unit, tuple(coefficients)))
        return self._changed()

    # Recording

    @remote
    def start_recording(self, path: str, overwrite: bool = False) -> DaqReport:
        """Record to a file here."""
        self._application.recorder.start(self._folders.file(path, RECORDINGS), overwrite=overwrite)
        return self._changed()

    @remote
    def stop_recording(self) -> DaqReport:
        """Close the file."""
        self._application.recorder.stop()
        return self._changed()

    @remote
    def mark(self, text: str) -> None:
        """Write a mark into the recording."""
        self._application.recorder.mark(text)

    @remote
    def export(self, source: str, target: str) -> Task:
        """Begin to export a recording here to a file here."""
        return self._application.files.export(
            self._folders.file(source, RECORDINGS), self._folders.file(target, EXPORTS)
        )

    # Limits

    @remote
    def set_limit(
        self,
        channel: str,
        low: float,
        high: float,
        hysteresis: float,
        armed: bool,
    ) -> DaqReport:
        """Put the limit of an active channel in force; infinite where a side is free."""
        active = [each.name for each in self._application.settings.channel if each.active]
        if channel not in active:
            there = ", ".join(active)
            raise ConfigError(f"there is no active channel {channel[:60]!r}; there are {there}")
        self._application.guard.set_limit(
            Limit(channel, low=low, high=high, hysteresis=hysteresis, armed=armed)
        )
        return self._changed()

    @remote
    def remove_limit(self, channel: str) -> DaqReport:
        """Take away the limit of a channel."""
        self._application.guard.remove(channel)
        return self._changed()

    @remote
    def reset_limit(self, channel: str) -> DaqReport:
        """Forget that the limit of a channel was crossed."""
        self._application.guard.acknowledge(channel)
        return self._changed()
