"""`UDaqFileWriter`: writes what is acquired into a file, in a thread of its own (thesis 6.2)."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from threading import Event, Lock
from typing import Final

from PySide6.QtCore import Signal
from typing_extensions import override

from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.recording_file import WRITE_ERRORS, RecordingFile
from cosmic.daqco.core.recording_format import (
    AxisPosition,
    RecordedEvent,
    RecordedExposure,
    RecordingHeader,
    reason,
)
from cosmic.frame.clock import WALL
from cosmic.frame.errors import CosmicError, RecordingError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.file_names import check_base_name, check_directory, check_space, space_left
from cosmic.frame.threads import WorkerThread

FLUSH_S: Final = 0.25
WAKE_S: Final = 0.1
LONGEST_BACKLOG_S: Final = 10.0
LARGEST_BACKLOG_BYTES: Final = 64 * 1024 * 1024


@dataclass(frozen=True, slots=True)
class RecordingStats:
    """How a recording stands.

    Attributes
    ----------
    samples : int
        A channel, in the file.
    lost : int
        A channel, missing between those in the file.
    backlog : int
        Samples a channel that wait to be written.
    file_bytes : int
        Size of the file.
    left_s : float
        How long it may go on before the disk is full.
    """

    path: Path
    samples: int
    duration_s: float
    lost: int
    backlog: int
    file_bytes: int
    left_s: float


class _End:
    """Everything before it in the queue is still written."""


_Item = DataChunk | RecordedEvent | RecordedExposure | tuple[AxisPosition, ...] | _End


class UDaqFileWriter(WorkerThread):
    """Writes one recording; made for it, and gone with it.

    The file is created at once, so that what forbids it is raised here. Then `start`; `put` from
    the thread that acquires; at the end `request_end` and `join`.

    Parameters
    ----------
    path : Path
        Of the file, which must not exist unless `overwrite` is true.

    Raises
    ------
    RecordingExistsError
        There is such a file.
    RecordingError
        Its name, its directory or the room on the disk forbid it.

    Notes
    -----
    Signals: ``recorded`` (`RecordingStats`, some four times a second), ``failed``
    (`CosmicError`; the recording ends early, acquisition does not), ``closed`` (`Path`).
    """

    recorded = Signal(object)
    failed = Signal(object)
    closed = Signal(object)

    def __init__(
        self,
        path: Path,
        header: RecordingHeader,
        policy: FailurePolicy,
        *,
        overwrite: bool = False,
    ) -> None:
        check_base_name(path.name)
        directory = check_directory(path.parent)
        space = check_space(directory, header.bytes_per_s)
        super().__init__(f"recorder {path.name}", policy)
        self._header = header
        self._left_s = space.left_s
        self._file = RecordingFile(directory / path.name, header, overwrite=overwrite)
        self._queue: SimpleQueue[_Item] = SimpleQueue()
        self._wake = Event()
        # Waking this thread for every chunk would cost the one that acquires more than the rest.
        self._enough = max(1, int(WAKE_S * header.rate_hz))
        self._limit = int(
            min(
                LONGEST_BACKLOG_S * header.rate_hz,
                LARGEST_BACKLOG_BYTES / (8 * len(header.channels)),
            )
        )
        self._given = 0  # written by the thread that acquires alone
        self._taken = 0  # written by this thread alone
        self._refused = False
        self._ending = False
        self._taking = Lock()  # nothing that counts as taken comes after the end in the queue
        self._error: CosmicError | None = None
        self._ended = False

    @property
    def path(self) -> Path:
        """Where the file lies."""
        return self._file.path

    @property
    def backlog(self) -> int:
        """How many samples a channel wait to be written."""
        return self._given - self._taken

    @property
    def error(self) -> CosmicError | None:
        """Why the recording ended early; None when it did not."""
        return self._error

    def put(self, chunk: DataChunk) -> None:
        """Have `chunk` written; returns at once. One thread."""
        if self._ended or self._refused:
            return
        if self.backlog + chunk.samples > self._limit:
            with self._taking:
                self._refused = True
            waiting_s = self.backlog / self._header.rate_hz
            self._fail(
                RecordingError(
                    f"{self.path}: the disk is too slow, {waiting_s:.1f} s of samples wait to be "
                    "written; the recording ends here and acquisition goes on. Record to a "
                    "faster disk, fewer channels or a lower rate"
                )
            )
            self._queue.put(_End())
            self._wake.set()
            return
        self._given += chunk.samples
        self._queue.put(chunk)
        if self.backlog >= self._enough and not self._wake.is_set():
            self._wake.set()

    def add_event(self, event: RecordedEvent) -> bool:
        """Have `event` written; returns at once, False where it comes too late. Any thread."""
        with self._taking:
            if self._ended or self._ending or self._refused or self._error is not None:
                return False
            self._queue.put(event)
            return True

    def add_exposure(self, exposure: RecordedExposure) -> None:
        """Have `exposure` written; returns at once. Any thread."""
        if not (self._ended or self._refused):
            self._queue.put(exposure)

    def add_positions(self, positions: Iterable[AxisPosition]) -> None:
        """Have `positions` written; returns at once. Any thread.

        Give the rows of all axes some ten times a second, of those that rest too: between two
        rows an axis is taken to have moved evenly.
        """
        if not (self._ended or self._refused):
            self._queue.put(tuple(positions))

    @override
    def request_end(self) -> None:
        super().request_end()
        with self._taking:
            self._ending = True
        self._queue.put(_End())
        self._wake.set()

    @override
    def run_body(self) -> None:
        try:
            if self._survived(self._write_all):
                self._survived(self._close)
        finally:
            self._ended = True
            self._file.abandon()
            self.recorded.emit(self._stats())
            self.closed.emit(self.path)

    def _survived(self, action: Callable[[], None]) -> bool:
        """Do it; return whether the file can still be written to."""
        try:
            action()
        except RecordingError as exc:
            self._fail(exc)
        except WRITE_ERRORS as exc:
            self._fail(
                RecordingError(
                    f"{self.path}: writing failed ({reason(exc)}); the recording ends here with "
                    "what was written before, and acquisition goes on. Is the disk full, or gone?"
                )
            )
            return False
        return True

    def _write_all(self) -> None:
        due_s = WALL.now_s() + FLUSH_S
        while True:
            self._wake.wait(max(0.0, due_s - WALL.now_s()))
            self._wake.clear()
            if self._write_waiting():
                return
            if WALL.now_s() >= due_s:
                self._flush()
                due_s = WALL.now_s() + FLUSH_S

    def _write_waiting(self) -> bool:
        """Write what is in the queue now; return whether the end was among it."""
        for _ in range(self._queue.qsize()):
            item = self._queue.get()
            if isinstance(item, _End):
                return True
            self._write(item)
        return False

    def _write(self, item: _Item) -> None:
        if isinstance(item, DataChunk):
            self._file.append(item)
            self._taken += item.samples
        elif isinstance(item, RecordedEvent):
            self._file.add_event(item)
        elif isinstance(item, RecordedExposure):
            self._file.add_exposure(item)
        elif isinstance(item, tuple):
            self._file.add_positions(item)

    def _flush(self) -> None:
        self._file.flush()
        if not self.path.exists():  # a file that was deleted takes everything without a word
            raise RecordingError(
                f"{self.path}: was taken away while it was written; its samples are lost and "
                "acquisition goes on. Record to another directory"
            )
        directory, a_while = self.path.parent, self._header.bytes_per_s * FLUSH_S
        self._left_s = space_left(directory, self._header.bytes_per_s).left_s
        check_space(directory, a_while)
        self.recorded.emit(self._stats())

    def _stats(self) -> RecordingStats:
        return RecordingStats(
            path=self.path,
            samples=self._file.samples,
            duration_s=self._file.samples / self._header.rate_hz,
            lost=self._file.lost,
            backlog=self.backlog,
            file_bytes=self._file.size_bytes,
            left_s=self._left_s,
        )

    def _close(self) -> None:
        if self._error is not None:
            self._file.add_event(
                RecordedEvent(
                    time_s=self._file.end_s, sample=-1, kind="error", text=str(self._error)
                )
            )
        self._file.close(complete=self._error is None)

    def _fail(self, error: CosmicError) -> None:
        self._error = error
        self._policy.report(error, self.name)
        self.failed.emit(error)
