"""The log of a session, kept beside its recordings with the platform's time."""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from threading import Lock
from typing import IO, Final

from cosmic.frame.clock import Clock
from cosmic.frame.log import RingBufferHandler

logger = logging.getLogger(__name__)

NAME: Final = "log.tsv"
HEAD: Final = ("time_s", "utc", "level", "where", "message")
_AROUND_S: Final = 0.5


@dataclass(frozen=True, slots=True)
class LogLine:
    """One line of the log.

    Attributes
    ----------
    time_s : float
        Platform time.
    level : str
        "INFO", "WARNING" or "ERROR".
    where : str
        Which part of the program wrote it.
    """

    time_s: float
    utc: datetime
    level: str
    where: str
    text: str


class SessionLog:
    """Writes the records of a ring into the session's folder, once that exists; any thread.

    Lines of before come first. A disk that is full or gone ends it with one line in the log, and
    nothing else.

    Parameters
    ----------
    ring : RingBufferHandler
        Where the records come from.
    clock : Clock
        The platform's.
    """

    def __init__(self, ring: RingBufferHandler, clock: Clock) -> None:
        self._ring, self._clock = ring, clock
        self._lock = Lock()
        self._file: IO[str] | None = None
        self._failed = False
        self._unsubscribe: Callable[[], None] | None = None

    def begin(self, folder: Path) -> None:
        """Write to a folder from now on; harmless where it is written already."""
        with self._lock:
            if self._file is not None or self._failed:
                return
            try:
                path = folder / NAME
                fresh = not path.exists()
                # A name of a file may hold bytes that are no text.
                self._file = path.open("a", encoding="utf-8", errors="backslashreplace", newline="")
                if fresh:
                    self._file.write("\t".join(HEAD) + "\n")
                for record in self._ring.records():
                    self._file.write(self._text(record))
                self._file.flush()
            except OSError as exc:
                self._failed = True
                self._end()
                reason = exc.strerror or str(exc)
                logger.warning("The log of the session is not kept in %s: %s", folder, reason)
                return
        self._unsubscribe = self._ring.subscribe(self._on_record)

    def close(self) -> None:
        """Give the file back; harmless the second time."""
        if self._unsubscribe is not None:
            self._unsubscribe()
            self._unsubscribe = None
        with self._lock:
            self._end()

    def _end(self) -> None:
        if self._file is not None:
            self._file.close()
            self._file = None

    def _on_record(self, record: logging.LogRecord) -> None:
        with self._lock:
            if self._file is None:
                return
            try:
                self._file.write(self._text(record))
                self._file.flush()
            except OSError:  # a line about it would come back here
                self._failed = True
                self._end()

    def _text(self, record: logging.LogRecord) -> str:
        age_s = max(0.0, datetime.now(UTC).timestamp() - record.created)
        time_s = self._clock.now_s() - age_s * (self._clock.rate or 1.0)
        utc = datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds")
        where = record.name.removeprefix("cosmic.")
        text = " ".join(record.getMessage().split())
        return f"{time_s:.3f}\t{utc}\t{record.levelname}\t{where}\t{text}\n"


def log_lines(
    folder: Path, start_s: float, end_s: float, start_utc: datetime
) -> tuple[LogLine, ...]:
    """Return the lines of a session's log from one platform time to another; empty without any.

    Parameters
    ----------
    start_utc : datetime
        The moment `start_s`: a folder may hold the logs of two starts, with two clocks.
    """
    try:
        text = (folder / NAME).read_text(encoding="utf-8")
    except (OSError, ValueError):
        return ()
    whole = text[: text.rfind("\n") + 1]  # a kill can cut the last line off
    found = []
    earliest = start_utc - timedelta(seconds=_AROUND_S)
    for each in whole.splitlines()[1:]:
        line = _line(each)
        if line is not None and line.utc >= earliest and line.time_s <= end_s + _AROUND_S:
            found.append(line)
    return tuple(each for each in found if each.time_s >= start_s - _AROUND_S)


def _line(text: str) -> LogLine | None:
    try:
        time_s, utc, level, where, message = text.split("\t", 4)
        return LogLine(float(time_s), datetime.fromisoformat(utc), level, where, message)
    except ValueError:
        return None
