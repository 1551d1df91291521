"""A recording of movements under way, as scripts and windows see it."""

from collections.abc import Callable, Collection
from datetime import datetime
from pathlib import Path
from types import TracebackType
from typing import Self

from PySide6.QtCore import QObject, Qt

from cosmic.frame.arguments import checked_class
from cosmic.frame.errors import NotAvailable, RecordingError
from cosmic.frame.events import notify
from cosmic.frame.failure import FailurePolicy
from cosmic.mico.core.poses import Pose
from cosmic.mico.core.trajectory.model import Trajectory
from cosmic.mico.core.trajectory.reader import head_problem
from cosmic.mico.core.trajectory.recorder import Recordable, TrajectoryRecorder


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

    @property
    def missed(self) -> int:
        """How much from a station was lost on its way; a remark in the file marks where."""
        return self._recorder.missed

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


class Recordings:
    """What this process records of movements, wherever the axes are: one file at a time.

    The movements are dated and placed where the axes are; the file is written here. Any thread.
    """

    def __init__(self, policy: FailurePolicy) -> None:
        self._policy = policy
        self._recorder: TrajectoryRecorder | None = None

    @property
    def current(self) -> TrajectoryRecording | None:
        """What is being recorded; None while nothing is."""
        recorder = self._recorder
        running = recorder is not None and recorder.recording
        return TrajectoryRecording(recorder) if recorder is not None and running else None

    def begin(
        self,
        axes: Recordable,
        path: Path,
        *,
        platform: str,
        title: str,
        pose: Pose | None,
        timed: bool,
        sources: Collection[str] | None,
        overwrite: bool,
    ) -> TrajectoryRecording:
        """Begin to record; the arguments and errors are those of `Trajectories.record`."""
        running = self.current
        if running is not None:
            raise NotAvailable(f"{running.path} is being recorded; stop that first")
        said = (("title", title, "a title"), ("platform", platform, "the name of a platform"))
        for word, text, what in said:
            if problem := head_problem(word, text):  # or nobody could read the file
                raise RecordingError(f"{what} {problem}: {text[:60]!r}")
        head = Trajectory(
            platform=platform or "any",
            statements=(),
            title=title.strip(),
            recorded=f"{datetime.now():%Y-%m-%d %H:%M:%S}",
            pose=pose.name if pose is not None else "",
            pose_axes=tuple(pose.positions) if pose is not None else None,
        )
        self._recorder = TrajectoryRecorder(
            axes,
            path,
            head,
            self._policy,
            timed=timed,
            zero=pose.positions if pose is not None else None,
            sources=sources,
            overwrite=overwrite,
        )
        return TrajectoryRecording(self._recorder)

    def close(self) -> None:
        """End a recording that goes on."""
        if self._recorder is not None:
            self._recorder.stop()
