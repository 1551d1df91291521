"""`WindowPort`: what a window needs of DAQCo beyond what a script does."""

from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import TypeVar

from cosmic.daqco.api.daqco import Daqco
from cosmic.daqco.api.errands import Told
from cosmic.daqco.api.files import NamedFile
from cosmic.daqco.core.chunk import DataChunk
from cosmic.frame.file_names import NameOption

T = TypeVar("T")


class WindowPort(Daqco):
    """`Daqco` for widgets, which must never wait for a line; any thread."""

    @property
    def elsewhere(self) -> str:
        """Where the recordings lie, as the operator is told; empty on this computer."""
        return self.application.files.elsewhere

    def folder_problem(self, directory: str) -> str:
        """Return why nothing can be recorded in `directory`; empty when it can."""
        return self.application.files.problem(directory)

    def name_recording(
        self, base: str, option: NameOption, directory: Path, when: datetime
    ) -> NamedFile:
        """Return the file for a recording that is begun now; raises `RecordingError`."""
        return self.application.files.name(base, option, directory, when)

    def recordings(self, directory: Path) -> tuple[Path, ...]:
        """Return the newest recordings in a directory, newest first; raises `RecordingError`."""
        return self.application.files.recordings(directory)

    def follow(self, receiver: Callable[[DataChunk], object]) -> Callable[[], None]:
        """Call `receiver(chunk)` with the newest samples, for a display; as `subscribe` at home.

        From another station they come in larger pieces, and some may be passed over.
        """
        return self.application.buffer.follow(lambda chunk: (receiver(chunk), None)[1])

    def carry_out(self, action: Callable[[], T], told: Told[T], *, slow: bool = False) -> None:
        """Do what may have to wait for a line, without waiting in a window's thread.

        `told` takes the result, or the `CosmicError` that was raised; at home it is called at
        once, unless it is `slow`, else maybe in another thread.
        """
        self.application.carry_out(action, told, slow=slow)
