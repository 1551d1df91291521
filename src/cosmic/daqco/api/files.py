"""Where recordings go: names, directories, room and exports, on the disk of this computer."""

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Final

from cosmic.daqco.core.recording_format import SUFFIX
from cosmic.frame.errors import CosmicError, RecordingError
from cosmic.frame.file_names import NameOption, directory_problem, file_name, space_left
from cosmic.frame.task import Task
from cosmic.frame.task_application import TaskApplication

MOST_LISTED: Final = 200


@dataclass(frozen=True, slots=True)
class NamedFile:
    """A file to record to; `size_bytes` of the one that lies there already, None without any."""

    path: Path
    size_bytes: int | None


def named_file(base: str, option: NameOption, directory: Path, when: datetime) -> NamedFile:
    """Return the file for a recording that is begun now; raises `RecordingError`."""
    name = file_name(base, option, suffix=SUFFIX, when=when, directory=directory)
    path = directory / name
    try:
        return NamedFile(path, path.stat().st_size if path.exists() else None)
    except OSError as exc:
        raise RecordingError(f"{path}: {exc}") from exc


def recordings_in(directory: Path) -> tuple[Path, ...]:
    """Return the newest recordings in a directory, newest first; raises `RecordingError`."""
    try:
        dated = [(each.stat().st_mtime, each) for each in directory.glob(f"*{SUFFIX}")]
    except OSError as exc:
        raise RecordingError(f"{directory}: {exc}") from exc
    return tuple(each for _, each in sorted(dated, reverse=True)[:MOST_LISTED])


class LocalFiles:
    """The files of an application whose boards are at this computer; any thread."""

    elsewhere = ""
    """Where the files lie, as the operator is told; empty on this computer."""

    def __init__(self, application: TaskApplication) -> None:
        self._application = application

    def problem(self, directory: str) -> str:
        """Return why nothing can be stored in `directory`; empty when it can."""
        return directory_problem(directory)

    def free_bytes(self, directory: Path) -> int:
        """Return how much room there is for recordings; raises `RecordingError`."""
        return space_left(directory, 1.0).free_bytes

    def name(self, base: str, option: NameOption, directory: Path, when: datetime) -> NamedFile:
        """Return the file for a recording that is begun now; raises `RecordingError`."""
        return named_file(base, option, directory, when)

    def recordings(self, directory: Path) -> tuple[Path, ...]:
        """Return the newest recordings in a directory, newest first; raises `RecordingError`."""
        return recordings_in(directory)

    def export(self, source: Path, target: Path) -> Task:
        """Begin to export a recording to CSV or TDMS, by the suffix of `target`.

        Raises
        ------
        NotAvailable
            Another long operation is under way.
        """
        # Imported here: its libraries take their time to load.
        from cosmic.daqco.api.export import export_file

        def job(task: Task) -> None:
            def report(fraction: float) -> bool:
                task.report(fraction, target.name)
                return not task.cancel_requested

            try:
                export_file(source, target.suffix.lstrip("."), target, report)
                task.report(1.0, "done")
                task.finish()
            except CosmicError as exc:
                task.fail(exc)

        return self._application.begin(f"Export to {target.name}", job)
