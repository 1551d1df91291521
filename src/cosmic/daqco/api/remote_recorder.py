"""Recordings at another station, on its disk."""

from collections.abc import Callable
from pathlib import Path

from cosmic.daqco.api.recorder import RecordingState
from cosmic.daqco.api.remote_line import Asks
from cosmic.frame.listeners import tell


class RemoteRecorder:
    """What a `Recorder` is at home; the file lies at the station. Any thread."""

    def __init__(self, ask: Asks) -> None:
        self._ask = ask
        self._state = RecordingState()
        self._listeners: tuple[Callable[[], object], ...] = ()

    @property
    def state(self) -> RecordingState:
        """How the recording stands, as the station last told."""
        return self._state

    def on_change(self, listener: Callable[[], object]) -> None:
        """Call `listener()` when a recording begins, goes on or ends, in any thread."""
        self._listeners = (*self._listeners, listener)

    def start(self, path: Path, *, overwrite: bool = False) -> None:
        """Begin to write to `path` at the station; a relative one begins at its directory.

        Raises
        ------
        NotAvailable
            Nothing is acquired, a recording runs already, or the station is away.
        RecordingError
            As `Recorder.start`, or it lies outside of the folders that the station allows.
        """
        self._ask("start_recording", {"path": str(path), "overwrite": overwrite})

    def stop(self) -> None:
        """Close the file and wait until it is closed; raises `StationAway`."""
        self._ask("stop_recording")

    def mark(self, text: str) -> None:
        """Write a mark with the present time of the station; raises `StationAway`."""
        self._ask("mark", {"text": text})

    def take(self, state: RecordingState) -> None:
        """Take what a report says."""
        before, self._state = self._state, state
        if before != state:
            tell(self._listeners)
