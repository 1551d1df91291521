"""`Recorder`: begins and ends recordings, and joins to them what belongs in the file."""

import logging
import math
from abc import abstractmethod
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from threading import Lock, RLock
from typing import Final, Protocol

from PySide6.QtCore import Qt

from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.file_writer import RecordingStats, UDaqFileWriter
from cosmic.daqco.core.left_behind import OpenRecordings
from cosmic.daqco.core.limits import Crossing, LimitGuard
from cosmic.daqco.core.plan import restarts
from cosmic.daqco.core.recording_format import (
    AxisPosition,
    RecordedEvent,
    RecordedExposure,
    RecordingHeader,
)
from cosmic.daqco.core.scale import Scale
from cosmic.daqco.core.settings import DaqcoSettings
from cosmic.daqco.core.udaq_buffer import UDaqBuffer
from cosmic.daqco.core.unclosed_file import is_unclosed
from cosmic.daqco.hw.board_group import ClockAgreement
from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import ConfigError, CosmicError, NotAvailable
from cosmic.frame.events import Event
from cosmic.frame.failure import FailurePolicy

logger = logging.getLogger(__name__)

POSITIONS_S: Final = 0.05
"""How often the positions of all axes are written, in wall time."""

MOST_BEFORE_S: Final = 5.0
"""So much of what was acquired is kept for a recording that begins."""

MOST_BEFORE_BYTES: Final = 32 * 1024 * 1024

PositionSource = Callable[[], Iterable[AxisPosition]]


@dataclass(frozen=True, slots=True)
class RecordingState:
    """The recording that runs, or the last one.

    Attributes
    ----------
    active : bool
        Samples are being written.
    path : Path or None
        None before the first recording.
    duration_s : float
        How much is in the file.
    lost : int
        Samples a channel missing in it.
    backlog : int
        Samples a channel acquired and not yet written.
    left_s : float
        How long it may go on before the disk is full.
    failure : str
        Why it ended by itself; empty when it did not.
    """

    active: bool = False
    path: Path | None = None
    duration_s: float = 0.0
    size_bytes: int = 0
    lost: int = 0
    backlog: int = 0
    left_s: float = 0.0
    failure: str = ""


class Acquisition(Protocol):
    """What a recorder writes of."""

    clock: Clock
    buffer: UDaqBuffer
    guard: LimitGuard

    @property
    @abstractmethod
    def running(self) -> bool:
        """Samples are being acquired."""

    @property
    @abstractmethod
    def settings(self) -> DaqcoSettings:
        """What is in force."""

    @property
    @abstractmethod
    def rate_hz(self) -> float:
        """The rate of each channel."""

    @property
    @abstractmethod
    def clock_agreement(self) -> tuple[ClockAgreement, ...]:
        """How well the sample clocks of the boards agree that have clocks of their own."""

    @abstractmethod
    def exposures_in(self, chunk: DataChunk) -> Iterable[RecordedExposure]:
        """Return the exposures of a camera that begin at samples of a chunk."""

    @abstractmethod
    def scales(self) -> dict[str, Scale]:
        """Return the scale in force of every channel, by its name."""

    @abstractmethod
    def before_change(self, check: Callable[[DaqcoSettings], None]) -> None:
        """Call `check(settings)` before they come into force; what it raises forbids them."""


class SamplesBefore:
    """Keeps the newest seconds of what is acquired, with the positions of that time."""

    def __init__(self) -> None:
        self._kept: deque[tuple[DataChunk, tuple[AxisPosition, ...]]] = deque()
        self._bytes = 0

    def add(self, chunk: DataChunk, positions: tuple[AxisPosition, ...]) -> None:
        """Keep a chunk, and forget what is too old; another acquisition begins anew."""
        kept = self._kept
        if kept and not _follows(kept[-1][0], chunk):
            kept.clear()
            self._bytes = 0
        kept.append((chunk, positions))
        self._bytes += chunk.nbytes
        oldest_s = chunk.end_time_s - MOST_BEFORE_S
        while kept and (kept[0][0].end_time_s <= oldest_s or self._bytes > MOST_BEFORE_BYTES):
            self._bytes -= kept.popleft()[0].nbytes

    def start_s(self, now_s: float, before_s: float) -> float:
        """Return when a recording begins that takes up to `before_s` along; platform time."""
        chosen = self.since(now_s - before_s) if before_s else ()
        return next((chunk.time_s for chunk, _ in chosen), now_s)

    def since(self, start_s: float) -> tuple[tuple[DataChunk, tuple[AxisPosition, ...]], ...]:
        """Return whole chunks from a platform time on, oldest first."""
        return tuple(each for each in tuple(self._kept) if each[0].time_s >= start_s)


def _follows(before: DataChunk, after: DataChunk) -> bool:
    alike = (before.channels, before.rate_hz) == (after.channels, after.rate_hz)
    return alike and after.first_sample >= before.first_sample + before.samples


class Recorder:
    """One recording at a time of what an application acquires; any thread.

    Attributes
    ----------
    position_source : callable or None
        Returns where every axis is; what it returns is written about 20 times a second. Called
        in the acquisition thread, it must return at once.
    """

    def __init__(
        self,
        application: Acquisition,
        policy: FailurePolicy,
        *,
        software: str = "",
        configuration: str = "",
        notes: OpenRecordings | None = None,
    ) -> None:
        self._application = application
        self._policy = policy
        self._notes = notes
        self._note: Path | None = None
        self._software, self._configuration = software, configuration
        self._lock = RLock()
        self._writer: UDaqFileWriter | None = None
        self._closing: UDaqFileWriter | None = None
        self._before = SamplesBefore()
        self._handing_over = Lock()
        self._stats: RecordingStats | None = None
        self._failure = ""
        self._left_behind: list[UDaqFileWriter] = []
        self._positions_due_s = 0.0
        self._changed: Event[[]] = Event()
        self.position_source: PositionSource | None = None
        application.buffer.subscribe(self._on_chunk)
        application.guard.subscribe(self._on_crossing)
        application.guard.on_note(self._on_limit_note)
        application.before_change(self._forbid)

    def on_change(self, listener: Callable[[], object]) -> None:
        """Call `listener()` when a recording begins, goes on or ends, in any thread."""
        self._changed.subscribe(listener)

    @property
    def state(self) -> RecordingState:
        """How the recording stands; it is active until its file is closed."""
        writer, stats = self._writer or self._closing, self._stats
        return RecordingState(
            active=writer is not None and writer.isRunning() and writer.error is None,
            path=writer.path if writer is not None else stats.path if stats else None,
            duration_s=stats.duration_s if stats else 0.0,
            size_bytes=stats.file_bytes if stats else 0,
            lost=stats.lost if stats else 0,
            backlog=writer.backlog if writer is not None else 0,
            left_s=stats.left_s if stats else 0.0,
            failure=self._failure,
        )

    def start(self, path: Path, *, overwrite: bool = False, before_s: float = 0.0) -> None:
        """Begin to write what is acquired to `path`, and what came up to `before_s` ago.

        Raises
        ------
        ConfigError
            `before_s` is not from 0 to `MOST_BEFORE_S`.
        NotAvailable
            Nothing is acquired, or a recording runs already.
        RecordingError
            The name, the directory or the disk forbid it, or there is such a file and
            `overwrite` is False.
        """
        if not 0.0 <= before_s <= MOST_BEFORE_S:
            raise ConfigError(f"before_s is {before_s:g}; give 0 to {MOST_BEFORE_S:g} s")
        with self._lock:
            if self.state.active:
                raise NotAvailable(f"{self.state.path} is being recorded; stop it first")
            self._close()
            if not self._application.running:
                raise NotAvailable("nothing is acquired; start the acquisition first")
            header = self._header(before_s)
            writer = UDaqFileWriter(path, header, self._policy, overwrite=overwrite)
            direct = Qt.ConnectionType.DirectConnection
            writer.recorded.connect(self._on_recorded, direct)
            writer.failed.connect(self._on_failed, direct)
            self._failure, self._stats = "", None
            self._note = None if self._notes is None else self._notes.note(writer.path)
            writer.start()
            with self._handing_over:  # no chunk twice, and none between
                for chunk, positions in self._before.since(header.start_s):
                    self._put(writer, chunk)
                    writer.add_positions(positions)
                self._writer = writer
                self._positions_due_s = -math.inf  # with the first chunk, however short it gets
            for each in self._application.clock_agreement:
                self.note("clocks", each.text)
        logger.info("recording to %s", writer.path)
        self._changed.emit()

    def stop(self) -> None:
        """Close the file and wait until it is closed; harmless when nothing is recorded."""
        self._application.guard.wait_published()  # the crossing that ended a move belongs in it
        self._close()

    def _close(self) -> None:
        with self._lock:
            self._closing = writer = self._writer
            self._writer = None
            if writer is None:
                return
            if self.position_source is not None:  # where all came to, however short it was
                writer.add_positions(tuple(self.position_source()))
            writer.request_end()
            if not writer.join():
                # Kept, for a thread that is forgotten while it runs ends the program.
                self._left_behind.append(writer)
                self._failure = f"{writer.path}: the disk does not answer; it is still being closed"
                logger.error("%s", self._failure)
            self._forget(writer.path)
            self._closing = None
            duration_s = self._stats.duration_s if self._stats else 0.0
            logger.info("recorded %.1f s to %s", duration_s, writer.path)
        self._changed.emit()

    def _forget(self, path: Path) -> None:
        """Take the note of a recording away, if it is closed: else the next start closes it."""
        note, self._note = self._note, None
        if self._notes is None or note is None:
            return
        try:
            closed = not is_unclosed(path)
        except OSError:
            closed = not path.exists()
        if closed:
            self._notes.forget(note)

    def mark(self, text: str) -> None:
        """Write a mark with the present time.

        Raises
        ------
        NotAvailable
            Nothing is recorded, the file is being closed, or writing has failed; the text says so.
        """
        writer = self._writer
        if self._add_event("mark", text, self._application.clock.now_s()):
            return
        failed = self._failure or (str(writer.error) if writer and writer.error else "")
        why = f"the recording has ended ({failed})" if failed else "nothing is recorded"
        if not failed and (writer or self._closing) is not None:
            why = "the recording is being closed"
        raise NotAvailable(f"{why}, so the mark {text!r} cannot be kept; begin a recording first")

    def note(self, kind: str, text: str, channel: str = "") -> None:
        """Write an event of any kind with the present time; nothing where nothing is recorded."""
        self._add_event(kind, text, self._application.clock.now_s(), channel=channel)

    def _header(self, before_s: float) -> RecordingHeader:
        application = self._application
        now_s, now_utc = application.clock.now_s(), datetime.now(UTC)
        start_s = self._before.start_s(now_s, before_s)
        passed_s = (now_s - start_s) / (application.clock.rate or 1.0)
        channels = tuple(each for each in application.settings.channel if each.active)
        scales = application.scales()
        positions = () if self.position_source is None else self.position_source()
        return RecordingHeader(
            rate_hz=application.rate_hz,
            channels=channels,
            scales=tuple(scales[each.name] for each in channels),
            start_utc=now_utc - timedelta(seconds=passed_s),
            start_s=start_s,
            software=self._software,
            configuration=self._configuration,
            axes=tuple((each.axis, each.unit) for each in positions),
        )

    def _forbid(self, settings: DaqcoSettings) -> None:
        if self.state.active and restarts(self._application.settings, settings):
            raise NotAvailable(
                "rate and channels cannot change while recording; stop the recording first"
            )

    # What is written

    def _on_chunk(self, chunk: DataChunk) -> None:
        """Write a chunk, or keep it for a recording that may begin; acquisition thread."""
        with self._handing_over:
            # Asked for in here: the first chunk of a recording has positions, and may be its last.
            positions: tuple[AxisPosition, ...] = ()
            now_s = WALL.now_s()
            if self.position_source is not None and now_s >= self._positions_due_s:
                self._positions_due_s = now_s + POSITIONS_S
                positions = tuple(self.position_source())
            self._before.add(chunk, positions)
            writer = self._writer
            if writer is not None:
                self._put(writer, chunk)
                writer.add_positions(positions)

    def _put(self, writer: UDaqFileWriter, chunk: DataChunk) -> None:
        writer.put(chunk)
        for exposure in self._application.exposures_in(chunk):
            writer.add_exposure(exposure)

    def _on_crossing(self, crossing: Crossing) -> None:
        self._add_event(
            "limit",
            crossing.text,
            crossing.time_s,
            sample=crossing.sample,
            channel=crossing.channel,
            value=crossing.value,
        )

    def _on_limit_note(self, channel: str, text: str) -> None:
        self.note("note", f"{channel}: {text}", channel)

    def _add_event(
        self,
        kind: str,
        text: str,
        time_s: float,
        *,
        sample: int = -1,
        channel: str = "",
        value: float = float("nan"),
    ) -> bool:
        """Return whether it will be written."""
        writer = self._writer
        if writer is None:
            return False
        at = self._application.buffer.samples if sample < 0 else sample
        return writer.add_event(RecordedEvent(time_s, at, kind, text, channel, value))

    def _on_recorded(self, stats: RecordingStats) -> None:
        self._stats = stats
        self._changed.emit()

    def _on_failed(self, error: CosmicError) -> None:
        self._failure = str(error)
        logger.error("the recording ended: %s", error)
        self._changed.emit()
