"""`TrajectoryRecorder`: writes all movements into a trajectory as they happen (thesis 6.1.3)."""

import os
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import BinaryIO, Final

from PySide6.QtCore import Qt, Signal
from typing_extensions import override

from cosmic.frame.errors import RecordingError, RecordingExistsError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.file_names import check_base_name, check_directory
from cosmic.frame.threads import WorkerThread
from cosmic.mico.core.motion.messages import MovementBegun, MovementEnded
from cosmic.mico.core.motion.positioner import class_for
from cosmic.mico.core.ports import DevicePort, ManagerPort
from cosmic.mico.core.trajectory.model import Place, Statement, Trajectory
from cosmic.mico.core.trajectory.reader import END_OF_RECORDING
from cosmic.mico.core.trajectory.segments import SegmentBuilder
from cosmic.mico.core.trajectory.words import number
from cosmic.mico.core.trajectory.writer import head_lines, statement_lines

IDLE_S: Final = 0.1
OpenFile = Callable[[Path, str], BinaryIO]


@dataclass(frozen=True, slots=True)
class _Begun:
    event: MovementBegun
    positions: Mapping[str, float]
    resting: frozenset[str]
    sensed: bool
    frequency_hz: int | None


@dataclass(frozen=True, slots=True)
class _Ended:
    name: str
    positions: Mapping[str, float]
    time_s: float
    well: bool


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
        manager: ManagerPort,
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
        self._manager = manager
        self.path = directory / path.name
        self._sources = None if sources is None else frozenset(sources)
        self._queue: SimpleQueue[_Begun | _Ended | None] = SimpleQueue()
        self._joined: list[DevicePort] = []
        self._error: RecordingError | None = None
        self._lines = 0
        self._size = 0
        self._under_way: set[str] = set()
        self._builder = SegmentBuilder(
            self._take,
            lambda text: self._write([f"# {text}"]),
            begin_s=manager.clock.now_s(),
            timed=timed,
            zero=zero or {},
        )
        self._file = self._create(open_file, overwrite=overwrite)
        self._write(head_lines(head))
        if self._error is not None:
            self._file.close()
            raise self._error
        self._join_devices()
        manager.changed.connect(self._join_devices, Qt.ConnectionType.DirectConnection)
        self.start()

    def _create(self, open_file: OpenFile, *, overwrite: bool) -> BinaryIO:
        try:
            return open_file(self.path, "wb" if overwrite else "xb")
        except FileExistsError:
            text = f"{self.path} is there already; choose another name, or say that it may go"
            raise RecordingExistsError(text) from None
        except OSError as exc:
            text = f"{self.path} cannot be written: {exc.strerror or exc}"
            raise RecordingError(text) from exc

    def _join_devices(self) -> None:
        """Hear of the movements of the devices there are now."""
        direct = Qt.ConnectionType.DirectConnection
        for device in self._manager.devices.values():
            if device not in self._joined:
                self._joined.append(device)
                device.movement_begun.connect(self._on_movement_begun, direct)
                device.movement_ended.connect(self._on_movement_ended, direct)

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
    def recording(self) -> bool:
        """True while movements are written."""
        return self._error is None and not self.end_requested

    def stop(self) -> None:
        """Write what is left and close the file; harmless the second time."""
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

    # Device threads

    def _on_movement_begun(self, event: MovementBegun) -> None:
        if not self.recording:
            return
        if self._sources is not None and event.source not in self._sources:
            return
        address = self._manager.address(event.name)
        positioner = self._manager.device(event.name).container.positioner(address.channel)
        hertz = positioner.frequency_hz if positioner is not None else None
        if hertz == self._manager.settings.defaults.closed_loop_frequency_hz:
            hertz = None
        state = self._manager.state(event.name)
        sensed = class_for(state.kind, state.positioner).has_sensor
        self._under_way.add(event.name)
        self._queue.put(_Begun(event, self._positions(), self._resting(), sensed, hertz))

    def _on_movement_ended(self, event: MovementEnded) -> None:
        if not self.recording or event.name not in self._under_way:
            return
        positions = self._positions()
        now_s = self._manager.clock.now_s()
        well = event.error is None
        self._queue.put(_Ended(event.name, positions, now_s, well=well))

    def _positions(self) -> dict[str, float]:
        states = self._manager.states().values()
        return {each.name: each.position for each in states if each.position is not None}

    def _resting(self) -> frozenset[str]:
        """Return the axes at rest: their state knows before their end is told."""
        return frozenset(
            name for name, each in self._manager.states().items() if not each.in_motion
        )

    # Its own thread

    @override
    def run_body(self) -> None:
        try:
            self._record()
            now_s = self._manager.clock.now_s()
            self._builder.close(self._positions(), now_s, self._resting())
            self._write([END_OF_RECORDING])
        finally:
            self._close()

    def _record(self) -> None:
        while self._error is None:
            try:
                item = self._queue.get(timeout=IDLE_S)
            except Empty:
                self._builder.idle(self._manager.clock.now_s())
                continue
            match item:
                case None:
                    return
                case _Begun():
                    self._builder.begun(
                        item.event,
                        item.positions,
                        sensed=item.sensed,
                        frequency_hz=item.frequency_hz,
                        resting=item.resting,
                    )
                case _Ended():
                    self._builder.ended(item.name, item.positions, item.time_s, well=item.well)

    def _take(self, found: Statement | tuple[str, Place]) -> None:
        if isinstance(found, tuple):
            axis, place = found
            self._write([f"start {axis} {number(place.value)} {place.unit}"])
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
