"""The files of another station: directories, names, room and exports there."""

from datetime import datetime
from pathlib import Path
from threading import Lock
from typing import Final

from cosmic.daqco.api.files import NamedFile
from cosmic.daqco.api.remote_line import DaqcoLine, may_wait
from cosmic.daqco.api.station_report import DaqFolder
from cosmic.frame.clock import WALL
from cosmic.frame.errors import CosmicError, NotAvailable, ProtocolError
from cosmic.frame.file_names import NameOption
from cosmic.frame.network.ongoing import Ongoing
from cosmic.frame.task import Progress, Task

FOLDER_AGE_S: Final = 2.0
"""How old what is known of a directory there may become before it is asked for again."""
_REMEMBERED: Final = 32


class RemoteFiles:
    """What `LocalFiles` is at home; any thread.

    A thread that must not wait gets what is known already, and has it asked for anew.
    """

    def __init__(self, line: DaqcoLine) -> None:
        self._line = line
        self._lock = Lock()
        self._folders: dict[str, tuple[float, DaqFolder]] = {}
        self._asked: set[str] = set()
        self.station = ""

    @property
    def elsewhere(self) -> str:
        """Where the files lie, as the operator is told."""
        return f"at the station {self.station}" if self.station else "at another station"

    def problem(self, directory: str) -> str:
        """Return why nothing can be stored in `directory` there; empty when it can."""
        if not directory.strip():
            return "type a directory"
        folder = self._folder(directory)
        return folder.problem if folder is not None else ""

    def free_bytes(self, directory: Path) -> int:
        """Return how much room there is for recordings there.

        Raises
        ------
        NotAvailable
            There is no such directory, the station is away, or it has not answered yet.
        """
        folder = self._folder(str(directory))
        if folder is None:
            raise NotAvailable("the station is asked for the room on its disk")
        if folder.problem:
            raise NotAvailable(folder.problem)
        return folder.free_bytes

    def name(self, base: str, option: NameOption, directory: Path, when: datetime) -> NamedFile:
        """Return the file for a recording that is begun now; raises as `LocalFiles.name`."""
        said = self._line.call(
            "name_recording",
            {
                "base": base,
                "append": str(option),
                "directory": str(directory),
                "when": when.astimezone(),
            },
        )
        if not (isinstance(said, tuple) and len(said) == 2 and isinstance(said[0], str)):
            raise ProtocolError("the station named a file in an unknown way")
        return NamedFile(Path(said[0]), said[1] if isinstance(said[1], int) else None)

    def recordings(self, directory: Path) -> tuple[Path, ...]:
        """Return the newest recordings in a directory there; raises as `LocalFiles.recordings`."""
        said = self._line.call("recordings", {"directory": str(directory)})
        if not (isinstance(said, list) and all(isinstance(each, str) for each in said)):
            raise ProtocolError("the station listed its recordings in an unknown way")
        return tuple(Path(each) for each in said)

    def export(self, source: Path, target: Path) -> Task:
        """Begin to export a recording there; what forbids it ends the task."""
        task = Task(f"Export to {target.name}")
        arguments = {"source": str(source), "target": str(target)}

        def begin() -> object:
            return self._line.call("export", arguments)

        def told(begun: object, error: CosmicError | None) -> None:
            if isinstance(begun, Ongoing):
                self._follow(begun, task)
            else:
                task.fail(error or ProtocolError("the station began an export in an unknown way"))

        self._line.carry_out(begin, told)
        return task

    def _follow(self, begun: Ongoing, task: Task) -> None:
        """Have `task` go on and end with `begun`, which goes on at the station."""

        def end(*_: object) -> None:
            try:
                begun.wait(0.0)
            except CosmicError as exc:
                task.fail(exc)
            else:
                task.finish()

        def on_progress(progress: Progress) -> None:
            task.report(progress.fraction, progress.text)
            if progress.done:
                end()

        task.on_cancel(lambda: self._line.carry_out(begun.cancel, lambda *_: None))
        for name, listener in (("subscribe", on_progress), ("add_callback", end)):
            listen = getattr(begun, name, None)
            if listen is not None:
                listen(listener)

    def _folder(self, directory: str) -> DaqFolder | None:
        with self._lock:
            at_s, folder = self._folders.get(directory, (-float("inf"), None))
        if WALL.now_s() - at_s < FOLDER_AGE_S:
            return folder
        if may_wait():
            return self._ask(directory)
        with self._lock:
            waits = directory in self._asked
            self._asked.add(directory)
        if not waits:
            self._line.carry_out(lambda: self._ask(directory), lambda *_: self._answered(directory))
        return folder

    def _answered(self, directory: str) -> None:
        with self._lock:
            self._asked.discard(directory)

    def _ask(self, directory: str) -> DaqFolder:
        found = self._line.call("folder", {"directory": directory})
        if not isinstance(found, DaqFolder):
            raise ProtocolError("the station described a directory in an unknown way")
        with self._lock:
            self._folders[directory] = (WALL.now_s(), found)
            while len(self._folders) > _REMEMBERED:
                del self._folders[next(iter(self._folders))]
        return found
