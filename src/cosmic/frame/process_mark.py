"""Which process writes a file, and whether it still lives."""

import os
import platform
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from types import TracebackType
from typing import Final, Self

_START_FIELD: Final = 19
"""Of /proc/PID/stat, counted after the name of the program, which may hold anything."""
_PROC: Final = Path("/proc")


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
        if _PROC.is_dir():
            if not self.start:
                return Life.UNKNOWN
            return Life.LIVES if _start_of(self.pid) == self.start else Life.GONE
        if os.name != "posix":  # Windows ends a process that is asked so
            return Life.UNKNOWN
        try:
            os.kill(self.pid, 0)
        except ProcessLookupError:
            return Life.GONE
        except OSError:
            return Life.LIVES
        return Life.LIVES


def own_mark() -> ProcessMark:
    """Return the mark of this process."""
    return ProcessMark(platform.node(), os.getpid(), _start_of(os.getpid()))


def _start_of(pid: int) -> str:
    """Return when a process began, with the start of the system that it counts from."""
    try:
        boot = (_PROC / "sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
        stat = (_PROC / str(pid) / "stat").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
    state, *fields = stat.rpartition(")")[2].split()
    ended = state in ("Z", "X")  # it holds nothing any more, whoever has not asked for its end yet
    return "" if ended else f"{boot}:{fields[_START_FIELD - 1]}"


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
        try:
            import fcntl
        except ImportError:
            return True
        try:
            kind = fcntl.LOCK_EX if alone else fcntl.LOCK_SH
            fcntl.flock(self._file, kind | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        except OSError:  # a disk without locks
            return True
        return True

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
