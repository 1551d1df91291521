"""Logging: one set-up for the process, and a ring of recent records for the log panel."""

import copy
import logging
from collections import deque
from collections.abc import Callable
from logging.handlers import RotatingFileHandler
from pathlib import Path
from threading import Lock
from typing import Final

from typing_extensions import override

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.log_folding import FoldingHandler

LINE_FORMAT: Final = "%(asctime)s.%(msecs)03d %(levelname)-7s %(name)s: %(message)s"
TIME_FORMAT: Final = "%Y-%m-%d %H:%M:%S"

Listener = Callable[[logging.LogRecord], None]


class RingBufferHandler(logging.Handler):
    """Keeps the newest `capacity` records and tells listeners of each new one; any thread.

    Listeners are called in the thread that logs and must return at once. A record is kept as
    text: `message`, and `exc_text` where it carried a traceback.
    """

    def __init__(self, capacity: int = 5000, level: int = logging.INFO) -> None:
        super().__init__(level)
        self._records: deque[logging.LogRecord] = deque(maxlen=capacity)
        self._listeners: tuple[Listener, ...] = ()
        self._guard = Lock()

    @override
    def emit(self, record: logging.LogRecord) -> None:
        try:
            kept = _as_text(record)
            self._records.append(kept)
            for listener in self._listeners:
                listener(kept)
        except Exception:  # noqa: BLE001 - logging's contract: a handler never raises
            self.handleError(record)

    def records(self) -> list[logging.LogRecord]:
        """Return the records kept, oldest first."""
        return list(self._records)

    def subscribe(self, listener: Listener) -> Callable[[], None]:
        """Call `listener` with each new record; returns the function that ends it."""
        with self._guard:
            self._listeners = (*self._listeners, listener)

        def unsubscribe() -> None:
            with self._guard:
                self._listeners = tuple(each for each in self._listeners if each is not listener)

        return unsubscribe


def _as_text(record: logging.LogRecord) -> logging.LogRecord:
    """Return a copy that keeps no object alive: a traceback holds every local of its frames."""
    kept = copy.copy(record)
    kept.msg = kept.message = record.getMessage()
    kept.args = None
    if record.exc_info and not record.exc_text:
        kept.exc_text = logging.Formatter().formatException(record.exc_info)
    kept.exc_info = None
    return kept


def set_up_logging(
    ring: RingBufferHandler | None = None,
    *,
    file: Path | None = None,
    console: bool = False,
    console_level: int = logging.INFO,
    clock: Clock = WALL,
) -> Callable[[], None]:
    """Send the records of ``cosmic`` to `ring`, a rotating file and, from a level on, the terminal.

    Floods are folded on the way (`FoldingHandler`), by `clock`. The file and its three predecessors
    hold 20 MB at most. Returns the function that undoes it.
    """
    root = logging.getLogger("cosmic")
    handlers: list[logging.Handler] = [] if ring is None else [ring]
    formatter = logging.Formatter(LINE_FORMAT, TIME_FORMAT)
    if file is not None:
        file.parent.mkdir(parents=True, exist_ok=True)
        handlers.append(
            RotatingFileHandler(
                file, maxBytes=5_000_000, backupCount=3, encoding="utf-8", delay=True
            )
        )
    if console:
        terminal = logging.StreamHandler()
        terminal.setLevel(console_level)
        handlers.append(terminal)
    for handler in handlers:
        handler.setFormatter(formatter)
    folding = FoldingHandler(handlers, clock)
    root.addHandler(folding)
    before = root.level
    root.setLevel(logging.INFO)

    def undo() -> None:
        root.setLevel(before)
        root.removeHandler(folding)
        folding.close()
        for handler in handlers:
            if handler is not ring:
                handler.close()

    return undo
