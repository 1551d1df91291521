"""`TrajectoryRecorder`: writes all movements into a trajectory as they happen (thesis 6.1.3)."""

import logging
import os
from abc import abstractmethod
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import BinaryIO, Final, Protocol

from PySide6.QtCore import Signal
from typing_extensions import override

from cosmic.frame.clock import Clock
from cosmic.frame.errors import RecordingError, RecordingExistsError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.file_names import check_base_name, check_directory
from cosmic.frame.threads import WorkerThread
from cosmic.mico.core.motion.messages import MovementBegun
from cosmic.mico.core.motion.positioner import PositionerState, positions_of
from cosmic.mico.core.trajectory.model import StartPosition, Statement, Trajectory
from cosmic.mico.core.trajectory.reader import END_OF_RECORDING
from cosmic.mico.core.trajectory.segments import SegmentBuilder
from cosmic.mico.core.trajectory.words import number
from cosmic.mico.core.trajectory.writer import head_lines, statement_lines

logger = logging.getLogger(__name__)

IDLE_S: Final = 0.1
OpenFile = Callable[[Path, str], BinaryIO]


@dataclass(frozen=True, slots=True)
class RecordedBegin:
    """A movement that began, and what was so where the axes are.

    Attributes
    ----------
    positions : mapping of float
        Where all axes were, as far as that is known, in gate coordinates.
    resting : frozenset of str
        The axes at rest: their state knows before their end is published.
    sensed : bool
        The axis has a sensor.
    frequency_hz : int or None
        Its closed-loop frequency; None where that is the configured one.
    """

    event: MovementBegun
    positions: Mapping[str, float]
    resting: frozenset[str]
    sensed: bool
    frequency_hz: int | None


@dataclass(frozen=True, slots=True)
class RecordedEnd:
    """A movement that ended; `positions` as in `RecordedBegin`."""

    name: str
    positions: Mapping[str, float]
    time_s: float
    well: bool


Recorded = RecordedBegin | RecordedEnd


class Recordable(Protocol):
    """The axes whose movements are recorded."""

    @property
    @abstractmethod
    def clock(self) -> Clock:
        """By which movements are dated."""

    @property
    @abstractmethod
    def missed(self) -> int:
        """How much of what a station sent did not arrive."""

    @abstractmethod
    def states(self) -> Mapping[str, PositionerState]:
        """Return the state of every axis by name."""

    @abstractmethod
    def follow_recorded(self, receiver: Callable[[Recorded], object]) -> Callable[[], None]:
        """Call `receiver` with every movement, in order; returns the function that ends it."""


def resting_of(states: Mapping[str, PositionerState]) -> frozenset[str]:
    """Return the axes at rest."""
    return frozenset(name for name, each in states.items() if not each.in_motion)


def _open(path: Path, mode: str) -> BinaryIO:
    return path.open(mode, buffering=0)  # type: ignore[return-value]


class TrajectoryRecorder(WorkerThread):
    """Records what moves, whoever moves it, until `stop`; made for one file and gone with it.

    The file is created at once and grows as things happen. A disk that is full ends the
    recording, not the movement; whole lines that were written stay.

    Parameters
    ----------
    head : Trajectory
        Title, platform and pose.
    timed : bool
        With the times at which movements began and the speeds of jogs.
    zero : mapping of float
        What positions count from, by axis; those of a named pose.
    sources : collection of str or None
        Whose movements: "window", "key", "script" ...; None: everybody's.

    Where something from a station was lost on its way, a remark says so in the file and the
    recording goes on; `missed` counts it.

    Signals
    -------
    recorded(int)
        How many lines the file has.
    failed(RecordingError)
        The recording ended early.

    Raises
    ------
    RecordingExistsError
        There is such a file.
    RecordingError
        Its name or its directory forbid it.
    """

    recorded = Signal(int)
    failed = Signal(object)

    def __init__(
        self,
        axes: Recordable,
        path: Path,
        head: Trajectory,
        policy: FailurePolicy,
        *,
        timed: bool = True,
        zero: Mapping[str, float] | None = None,
        sources: Collection[str] | None = None,
        overwrite: bool = False,
        open_file: OpenFile = _open,
    ) -> None:
        check_base_name(path.name)
        directory = check_directory(path.parent)
        super().__init__(f"recorder {path.name}", policy)
        self._axes = axes
        self.path = directory / path.name
        self._sources = None if sources is None else frozenset(sources)
        self._queue: SimpleQueue[Recorded | None] = SimpleQueue()
        self._error: RecordingError | None = None
        self._lines = 0
        self._size = 0
        self._running: set[str] = set()
        self._missed_before, self._missed = axes.missed, 0
        self._builder = SegmentBuilder(
            self._take,
            lambda text: self._write([f"# {text}"]),
            begin_s=axes.clock.now_s(),
            timed=timed,
            zero=zero or {},
        )
        self._file = self._create(open_file, overwrite=overwrite)
        self._write(head_lines(head))
        if self._error is not None:
            self._file.close()
            raise self._error
        self._end_following = axes.follow_recorded(self._on_recorded)
        self.start()

    def _create(self, open_file: OpenFile, *, overwrite: bool) -> BinaryIO:
        try:
            return open_file(self.path, "wb" if overwrite else "xb")
        except FileExistsError:
            text = f"{self.path} exists already; choose another name, or allow it to be overwritten"
            raise RecordingExistsError(text) from None
        except OSError as exc:
            text = f"{self.path} cannot be written: {exc.strerror or exc}"
            raise RecordingError(text) from exc

    # For any thread

    @property
    def lines(self) -> int:
        """How many lines the file has."""
        return self._lines

    @property
    def error(self) -> RecordingError | None:
        """Why the recording ended early; None when it did not."""
        return self._error

    @property
    def missed(self) -> int:
        """How much from a station was lost on its way while this was recorded."""
        return self._missed

    @property
    def recording(self) -> bool:
        """True while movements are written."""
        return self._error is None and not self.end_requested

    def stop(self) -> None:
        """Write what is left and close the file; harmless the second time."""
        self._end_following()
        self.request_end()
        self.join()

    def __enter__(self) -> "TrajectoryRecorder":
        return self

    def __exit__(self, *_error: object) -> None:
        self.stop()

    @override
    def request_end(self) -> None:
        super().request_end()
        self._queue.put(None)

    # The threads that hear of movements

    def _on_recorded(self, item: Recorded) -> None:
        if not self.recording:
            return
        if isinstance(item, RecordedBegin):
            if self._sources is not None and item.event.source not in self._sources:
                return
            self._running.add(item.event.name)
            self._queue.put(item)
        elif item.name in self._running:
            self._queue.put(item)

    # Its own thread

    @override
    def run_body(self) -> None:
        try:
            self._record()
            self._note_missed()
            states = self._axes.states()
            now_s = self._axes.clock.now_s()
            self._builder.close(positions_of(states), now_s, resting_of(states))
            self._write([END_OF_RECORDING])
        finally:
            self._close()

    def _record(self) -> None:
        while self._error is None:
            try:
                item = self._queue.get(timeout=IDLE_S)
            except Empty:
                self._builder.idle(self._axes.clock.now_s())
                continue
            self._note_missed()
            match item:
                case None:
                    return
                case RecordedBegin():
                    self._builder.begun(
                        item.event,
                        item.positions,
                        sensed=item.sensed,
                        frequency_hz=item.frequency_hz,
                        resting=item.resting,
                    )
                case RecordedEnd():
                    self._builder.ended(item.name, item.positions, item.time_s, well=item.well)

    def _note_missed(self) -> None:
        """Mark in the file where something is missing."""
        missed = self._axes.missed - self._missed_before
        if missed > self._missed:
            lost, self._missed = missed - self._missed, missed
            text = f"{lost} messages from the station were lost before here: movements are missing"
            logger.error("%s: %s", self.path, text)
            self._write([f"# {text}"])

    def _take(self, found: Statement | tuple[str, StartPosition]) -> None:
        if isinstance(found, tuple):
            axis, position = found
            self._write([f"start {axis} {number(position.value)} {position.unit}"])
        else:
            self._write(statement_lines(found))

    def _write(self, lines: list[str]) -> None:
        """Write whole lines; a disk that takes no more keeps those before."""
        if self._error is not None:
            return
        data = "".join(f"{line}\n" for line in lines).encode("utf-8")
        try:
            view = memoryview(data)
            while view:
                view = view[self._file.write(view) :]
        except OSError as exc:
            self._give_up(exc)
            return
        self._size += len(data)
        self._lines += len(lines)
        self.recorded.emit(self._lines)

    def _give_up(self, error: OSError) -> None:
        self._error = RecordingError(
            f"{self.path}: writing failed ({error.strerror or error}); the recording ends here "
            f"with the {self._lines} lines written before. Is the disk full, or gone?"
        )
        try:
            self._file.truncate(self._size)  # no half line
        except OSError:
            self._size = -1
        self._policy.report(self._error, self.name)
        self.failed.emit(self._error)

    def _close(self) -> None:
        try:
            if self._error is None:
                os.fsync(self._file.fileno())
            self._file.close()
        except OSError as exc:
            self._give_up(exc)
