"""Which process writes a file, and whether it still lives."""

import os
import platform
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from types import TracebackType
from typing import Self

from cosmic.frame.platform_services import lock_file, process_exists, process_start


class Life(Enum):
    """What can be said of a process."""

    LIVES = "lives"
    GONE = "gone"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class ProcessMark:
    """A process that no other is taken for.

    Attributes
    ----------
    host : str
        Name of its computer.
    pid : int
        Its number there; numbers are given again.
    start : str
        When it began, as the system counts; empty where the system does not say.
    """

    host: str
    pid: int
    start: str = ""

    @property
    def is_here(self) -> bool:
        """True for a process of this computer."""
        return self.host == platform.node()

    @property
    def life(self) -> Life:
        """Whether it lives; unknown on another computer, and where the system does not say."""
        if not self.is_here or self.pid <= 0:
            return Life.UNKNOWN
        start = process_start(self.pid)
        if start is not None:
            if not self.start:
                return Life.UNKNOWN
            return Life.LIVES if start == self.start else Life.GONE
        exists = process_exists(self.pid)
        if exists is None:
            return Life.UNKNOWN
        return Life.LIVES if exists else Life.GONE


def own_mark() -> ProcessMark:
    """Return the mark of this process."""
    return ProcessMark(platform.node(), os.getpid(), process_start(os.getpid()) or "")


class FileHold:
    """Says to other programs that a file is in use, for as long as this process has it.

    Advisory, and without effect where the system or the disk has no such locks.

    Parameters
    ----------
    alone : bool
        Hold it alone, rather than beside others who hold it so.

    Raises
    ------
    OSError
        The file cannot be opened.
    """

    def __init__(self, path: Path, *, alone: bool = False) -> None:
        self._file = path.open("rb")
        self.held = self.take(alone=alone)

    def take(self, *, alone: bool) -> bool:
        """Hold it otherwise than before; returns False where somebody else has it."""
        return lock_file(self._file.fileno(), alone=alone)

    def release(self) -> None:
        """Let others have it; harmless the second time."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.release()
