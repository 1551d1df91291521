"""`RecordControl`: records movements as the bar of the trajectory panel says."""

from pathlib import Path

from PySide6.QtCore import QObject, Signal

from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.relay import Relay
from cosmic.mico.api.trajectories import Trajectories
from cosmic.mico.api.trajectory_recording import TrajectoryRecording
from cosmic.mico.gui.trajectory_bars import RecordBar
from cosmic.mico.gui.trajectory_texts import recording_text


class RecordControl(QObject):
    """Begins and ends a recording; GUI thread. Nothing here waits.

    Signals
    -------
    recorded(Path)
        A recording was ended, and its file is whole.
    """

    recorded = Signal(object)

    def __init__(self, api: Trajectories, bar: RecordBar, parent: QObject) -> None:
        super().__init__(parent)
        self._api = api
        self._bar = bar
        self._recording: TrajectoryRecording | None = None
        self._relay = Relay(self._on_changed)
        bar.stop_requested.connect(self.stop)

    def record(self, path: Path) -> None:
        """Begin to record as the bar says, in place of what is in the file."""
        bar = self._bar
        try:
            self._recording = self._api.record(
                path,
                title=path.stem,
                timed=bar.timed.isChecked(),
                relative_to=bar.relative_to,
                sources=bar.sources,
                overwrite=True,
            )
        except CosmicError as exc:
            bar.show_recording(str(exc), recording=False)
            return
        self._recording.subscribe(self._relay)
        self._on_changed()

    def stop(self) -> None:
        """End the recording."""
        recording, self._recording = self._recording, None
        if recording is None:
            return
        recording.stop()
        self._bar.show_recording(recording_text(recording), recording=False)
        if recording.error is None:
            self.recorded.emit(recording.path)

    def _on_changed(self) -> None:
        if self._recording is not None:
            error = self._recording.error
            self._bar.show_recording(recording_text(self._recording), recording=error is None)
