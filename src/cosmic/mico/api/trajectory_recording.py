"""A recording of movements under way, as scripts and windows see it."""

from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Self

from PySide6.QtCore import QObject, Qt

from cosmic.frame.arguments import checked_class
from cosmic.frame.errors import RecordingError
from cosmic.frame.events import notify
from cosmic.mico.core.trajectory_recorder import TrajectoryRecorder


@checked_class
class TrajectoryRecording:
    """Every movement goes into a file until it is stopped; any thread.

    As a context manager it is stopped at the end of the block.
    """

    def __init__(self, recorder: TrajectoryRecorder) -> None:
        self._recorder = recorder

    @property
    def path(self) -> Path:
        """The file, which grows as things happen."""
        return self._recorder.path

    @property
    def lines(self) -> int:
        """How many lines it has."""
        return self._recorder.lines

    @property
    def recording(self) -> bool:
        """True while movements are written."""
        return self._recorder.recording

    @property
    def error(self) -> RecordingError | None:
        """Why it ended early, such as a full disk; None when it did not."""
        return self._recorder.error

    def subscribe(self, callback: Callable[[], object]) -> Callable[[], None]:
        """Call `callback()` after each line and at a failure; returns what ends it.

        It is called in the recorder's thread and must return at once.
        """

        def on_change(_what: object) -> None:
            notify(callback)

        direct = Qt.ConnectionType.DirectConnection
        connections = [
            signal.connect(on_change, direct)
            for signal in (self._recorder.recorded, self._recorder.failed)
        ]

        def unsubscribe() -> None:
            for connection in connections:
                QObject.disconnect(connection)

        return unsubscribe

    def stop(self) -> None:
        """Write what is left and close the file; harmless the second time."""
        self._recorder.stop()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()
