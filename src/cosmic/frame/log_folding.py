"""Floods of the log are counted and told in one line, so that no log grows without limit."""

import logging
import weakref
from collections import OrderedDict
from collections.abc import Iterable
from dataclasses import dataclass
from threading import Lock
from typing import Final

from typing_extensions import override

from cosmic.frame.clock import WALL, Clock

WINDOW_S: Final = 10.0
"""Repetitions are counted for so long, and then told in one line."""
SOURCES_LIMIT: Final = 512
"""The most sources that are remembered; the one that was silent longest is forgotten first."""
_DISTINCT_ERRORS: Final = 200
_KEY_CHARACTERS: Final = 200
_TEXT_CHARACTERS: Final = 500


@dataclass(frozen=True, slots=True)
class _Allowance:
    """How many records of one source pass in a window: the first, and those of a long flood."""

    first: int
    later: int


# What the operator does is kept in full as long as a person or a script does it.
_INFO: Final = _Allowance(first=500, later=20)
_WARNING: Final = _Allowance(first=50, later=10)

_Key = tuple[str, int, str]


class _Source:
    """What came from one place of the program in the present window."""

    def __init__(self, allowed: int, now_s: float) -> None:
        self.allowed = allowed
        self.began_s = now_s
        self.passed = 0
        self.folded = 0
        self.example: tuple[str, int, str, int, str] | None = None

    def fold(self, record: logging.LogRecord) -> None:
        """Count `record`; only the text of the first is kept, for a record holds objects alive."""
        if self.example is None:
            text = _text(record)[:_TEXT_CHARACTERS]
            self.example = record.name, record.levelno, record.pathname, record.lineno, text
        self.folded += 1


class FoldingHandler(logging.Handler):
    """Hands records on to other handlers, and of a flood only the first and how many; any thread.

    A source is a logger with a format string. Above its allowance in 10 s (500 records; 50 from
    WARNING on; less while the flood goes on) its records are counted, and told as one: "...
    repeated 812 times in 10 s". Errors are counted by their whole text, so that one that is new
    passes in any flood. DEBUG is what somebody asked for in full, and passes.

    Parameters
    ----------
    targets : iterable of logging.Handler
        Their levels and filters hold as before.
    """

    def __init__(self, targets: Iterable[logging.Handler], clock: Clock = WALL) -> None:
        super().__init__()
        self._targets = tuple(targets)
        self._clock = clock
        self._guard = Lock()
        self._sources: OrderedDict[_Key, _Source] = OrderedDict()
        self._next_due_s = float("inf")
        with _all_lock:
            _all.add(self)

    @override
    def handle(self, record: logging.LogRecord) -> bool:
        self.emit(record)  # without a lock: each target has its own, and a slow one holds up nobody
        return True

    @override
    def emit(self, record: logging.LogRecord) -> None:
        try:
            lines, passes = self._decided(record)
            for each in (*lines, record) if passes else lines:
                self._hand_on(each)
        except Exception:  # noqa: BLE001 - logging's contract: a handler never raises
            self.handleError(record)

    def flush_due(self) -> None:
        """Tell what was folded in windows that are over; returns at once where there is none."""
        now_s = self._clock.now_s()
        if now_s < self._next_due_s:
            return
        with self._guard:
            lines = self._due(now_s)
        for each in lines:
            self._hand_on(each)

    @override
    def close(self) -> None:
        """Tell what was folded so far and forget it; the targets stay open."""
        with self._guard:
            now_s = self._clock.now_s()
            lines = [line for each in self._sources.values() if (line := _line(each, now_s))]
            self._sources.clear()
            self._next_due_s = float("inf")
        for each in lines:
            self._hand_on(each)
        with _all_lock:
            _all.discard(self)
        super().close()

    def _hand_on(self, record: logging.LogRecord) -> None:
        for target in self._targets:
            if record.levelno >= target.level:
                target.handle(record)

    def _decided(self, record: logging.LogRecord) -> tuple[list[logging.LogRecord], bool]:
        """Return what has to be told before `record`, and whether it passes itself."""
        if record.levelno <= logging.DEBUG:
            return [], True
        now_s = self._clock.now_s()
        with self._guard:
            lines = self._due(now_s)
            if record.levelno < logging.ERROR:
                allowance = _INFO if record.levelno < logging.WARNING else _WARNING
                return lines, self._counted(lines, _key(record), record, allowance)
            text = f"{record.msg!s}\0{_text(record)}"
            passes = self._counted(lines, _key(record, text), record, _WARNING)
            # Texts that never repeat would be a flood as well.
            distinct = _Allowance(_DISTINCT_ERRORS, _DISTINCT_ERRORS)
            return lines, passes and self._counted(lines, _key(record), record, distinct)

    def _counted(
        self,
        lines: list[logging.LogRecord],
        key: _Key,
        record: logging.LogRecord,
        allowance: _Allowance,
    ) -> bool:
        """Return whether `record` passes; add to `lines` what a forgotten source had folded."""
        now_s = self._clock.now_s()
        source = self._sources.get(key)
        if source is None:
            source = self._sources[key] = _Source(allowance.first, now_s)
            self._next_due_s = min(self._next_due_s, now_s + WINDOW_S)
            if len(self._sources) > SOURCES_LIMIT:
                _, oldest = self._sources.popitem(last=False)
                lines += [line for line in [_line(oldest, now_s)] if line is not None]
        self._sources.move_to_end(key)
        if source.passed < source.allowed:
            source.passed += 1
            return True
        source.fold(record)
        source.allowed = min(source.allowed, allowance.later)  # of the next window
        return False

    def _due(self, now_s: float) -> list[logging.LogRecord]:
        """Return what is to be told of the windows that are over, and begin the next ones."""
        if now_s < self._next_due_s:
            return []
        lines = []
        for key, source in list(self._sources.items()):
            if now_s - source.began_s < WINDOW_S:
                continue
            line = _line(source, now_s)
            if line is None:
                del self._sources[key]
            else:
                lines.append(line)
                source.began_s, source.passed, source.folded, source.example = now_s, 0, 0, None
        self._next_due_s = min(
            (each.began_s + WINDOW_S for each in self._sources.values()), default=float("inf")
        )
        return lines


def _key(record: logging.LogRecord, text: str | None = None) -> _Key:
    return (
        record.name,
        record.levelno,
        (str(record.msg) if text is None else text)[:_KEY_CHARACTERS],
    )


def _text(record: logging.LogRecord) -> str:
    try:
        return record.getMessage()
    except (TypeError, ValueError):  # the arguments do not fit; the target says so
        return str(record.msg)


def _line(source: _Source, now_s: float) -> logging.LogRecord | None:
    """Return the record that stands for those that were folded; None where none was."""
    if source.example is None:
        return None
    name, level, path, line_number, text = source.example
    times = "once" if source.folded == 1 else f"{source.folded} times"
    over_s = max(1.0, now_s - source.began_s)
    said = (text, times, over_s)
    return logging.LogRecord(
        name, level, path, line_number, "%s ... repeated %s in %.0f s", said, None
    )


_all: Final["weakref.WeakSet[FoldingHandler]"] = weakref.WeakSet()
_all_lock: Final = Lock()


def flush_folded() -> None:
    """Tell what was folded and is due, where nothing else is logged; returns at once."""
    with _all_lock:
        found = list(_all)
    for each in found:
        each.flush_due()
