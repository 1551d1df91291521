"""`AuditTrail`: who commanded what, with which verdict, and when; a line of JSON each."""

import json
import logging
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from datetime import UTC, datetime
from pathlib import Path
from queue import SimpleQueue
from typing import Any, Final

from typing_extensions import override

from cosmic.frame.errors import ConfigError, CosmicError, MoveRefused
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.threads import WorkerThread

logger = logging.getLogger(__name__)

DONE: Final = "done"
REFUSED: Final = "refused"
FAILED: Final = "failed"
BEGUN: Final = "begun"
LONGEST_TEXT: Final = 500
LARGEST_BYTES: Final = 50_000_000
"""A file that is larger is kept as ``.1``, and a new one begun."""


@dataclass(frozen=True, slots=True)
class AuditEntry:
    """One command.

    Attributes
    ----------
    when : str
        UTC, ISO 8601.
    who : str
        Name of the client, or what in this program commanded it: "script", "card", "campaign" ...
    door : str
        How it came: "local" in this process, or "station", "http", "mcp", "epics".
    what : str
        The command, such as "mico.axes.begin".
    verdict : str
        "begun", "done", "refused" or "failed".
    why : str
        Reason and text, of what was not done.
    details : mapping
        Arguments, as text.
    """

    who: str
    door: str
    what: str
    verdict: str
    why: str = ""
    details: Mapping[str, str] = field(default_factory=dict)
    when: str = field(default_factory=lambda: datetime.now(UTC).isoformat(timespec="milliseconds"))


def verdict_of(error: Exception | None) -> tuple[str, str]:
    """Return verdict and reason of a command that ended so."""
    if error is None:
        return DONE, ""
    if isinstance(error, MoveRefused):
        return REFUSED, f"{error.verdict.reason.name}: {error}"[:LONGEST_TEXT]
    kind = REFUSED if isinstance(error, CosmicError) else FAILED
    return kind, f"{type(error).__name__}: {error}"[:LONGEST_TEXT]


class AuditTrail(WorkerThread):
    """Writes entries to a file of lines, in a thread of its own; `request_end` and `join` at last.

    A file that cannot be written to is said once in the log, and holds up nothing.
    """

    def __init__(self, path: Path, policy: FailurePolicy) -> None:
        super().__init__("audit trail", policy)
        self._path = path
        self._waiting: SimpleQueue[AuditEntry | None] = SimpleQueue()
        self._problem = False

    @property
    def path(self) -> Path:
        """Where it is written."""
        return self._path

    def note(self, entry: AuditEntry) -> None:
        """Have an entry written; returns at once, any thread."""
        self._waiting.put(entry)

    @override
    def run_body(self) -> None:
        while (entry := self._waiting.get()) is not None:
            lines = [_line(entry)]
            while not self._waiting.empty():
                following = self._waiting.get()
                if following is None:
                    self._write(lines)
                    return
                lines.append(_line(following))
            self._write(lines)

    def _write(self, lines: list[str]) -> None:
        try:
            try:
                full = self._path.stat().st_size > LARGEST_BYTES
            except FileNotFoundError:
                self._path.parent.mkdir(parents=True, exist_ok=True)
                full = False
            if full:
                self._path.replace(self._path.with_name(self._path.name + ".1"))
            # What is no text, such as a path of the system's own, is written as its number.
            with self._path.open("a", encoding="utf-8", errors="backslashreplace") as file:
                file.writelines(lines)
        except OSError as exc:
            if not self._problem:
                logger.warning("%s: the audit trail cannot be written: %s", self._path, exc)
            self._problem = True

    @override
    def request_end(self) -> None:
        super().request_end()
        self._waiting.put(None)


def _line(entry: AuditEntry) -> str:
    said = {name: value for name in WRITTEN if (value := getattr(entry, name))}
    return ENCODER.encode(said) + "\n"


WRITTEN: Final = ("when", *(each.name for each in fields(AuditEntry) if each.name != "when"))
"""The order of a line; `asdict` would look through all of an entry, hundreds of times a second."""

ENCODER: Final = json.JSONEncoder(ensure_ascii=False, default=dict)
"""Made once: `json.dumps` makes one for each line that is not ASCII."""


def read_entries(path: Path) -> Iterator[dict[str, Any]]:
    """Yield what stands in a trail, oldest first; a line that was cut off is left out.

    Raises
    ------
    ConfigError
        The file cannot be read, or has lines and none of them is an entry.
    """
    lines = entries = 0
    try:
        # A byte that is no text is in a line that was cut off, or in no trail at all.
        with path.open(encoding="utf-8", errors="replace") as file:
            for line in file:
                lines += 1
                found = _entry(line)
                if found is not None:
                    entries += 1
                    yield found
    except OSError as exc:
        raise ConfigError(f"{path}: cannot be read ({exc.strerror or exc})") from exc
    if lines and not entries:
        raise ConfigError(
            f"{path}: is not an audit trail: no line of it is an entry, written as JSON"
        )


def _entry(line: str) -> dict[str, Any] | None:
    try:
        found = json.loads(line)
    except ValueError:
        return None
    return found if isinstance(found, dict) else None
