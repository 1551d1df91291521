"""One camera of ``rig.vico``; its view uses this as well."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from typing_extensions import override

from cosmic.frame.arguments import checked_class
from cosmic.frame.clock import Clock
from cosmic.frame.errors import CosmicError, NotAvailable
from cosmic.frame.file_names import space_left
from cosmic.frame.task import Task
from cosmic.vico.api.application import VicoApplication
from cosmic.vico.api.camera_places import CameraPlaces
from cosmic.vico.api.camera_shape import CameraShape
from cosmic.vico.api.camera_shown import FormatShown, LinkShown, Seen, formats_shown, links_shown
from cosmic.vico.api.places import Places
from cosmic.vico.core.camera_recordings import PictureRecordingState
from cosmic.vico.core.job_thread import JobThread
from cosmic.vico.core.picture import Picture
from cosmic.vico.core.recording.formats import FORMATS, picture_bytes_per_s
from cosmic.vico.core.recording.snap import save_picture
from cosmic.vico.core.recording.time_lapse import TimeLapsePlan
from cosmic.vico.hw.interface import CameraCounters, CameraInfo, CameraRanges, CameraSettings

BACKGROUND_FRAMES = 8


@checked_class
class CameraHandle(CameraPlaces, CameraShape):
    """One camera: its pictures, settings, recordings and what machine vision finds; any thread.

    It has the shape of a bluesky detector without importing bluesky.
    """

    def __init__(self, application: VicoApplication, name: str) -> None:
        self._application = application
        self._unit = application.unit(name)
        self._thread = self._unit.thread
        self.name = name

    # What is in force

    @property
    def title(self) -> str:
        """What the operator reads."""
        return self._unit.place.shown

    @property
    @override
    def info(self) -> CameraInfo | None:
        """Which camera it is; None while none is connected."""
        return self._thread.info

    @property
    def ranges(self) -> CameraRanges | None:
        """What it accepts now; None while it is not connected."""
        return self._thread.ranges

    @property
    @override
    def settings(self) -> CameraSettings | None:
        """What is in force, as read back; None while it is not connected."""
        return self._thread.settings

    @property
    def counters(self) -> CameraCounters:
        """What became of the frames since the start."""
        return self._thread.counters

    @property
    def running(self) -> bool:
        """It takes pictures, or waits for its trigger."""
        return self._thread.running

    @property
    def problem(self) -> str:
        """Why no pictures come; empty when all is well."""
        return self._thread.problem

    @property
    def refused(self) -> str:
        """Why the last wish of a window was not granted, where that was heard later; or empty."""
        return ""

    # Pictures

    def latest(self) -> Picture | None:
        """Return the newest whole picture, background corrected; None before the first."""
        return self._unit.shown()

    @override
    def next_picture(self, timeout_s: float = 5.0, since_s: float | None = None) -> Picture:
        """Wait for a whole picture exposed from `since_s` of platform time on; None is now.

        Raises
        ------
        NotAvailable
            None came in time; the text says why.
        WrongThreadError
            Called in the GUI thread.
        """
        since = self._application.clock.now_s() if since_s is None else since_s
        return self._thread.next_picture(since, timeout_s)

    def picture_since(self, since_s: float) -> Picture | None:
        """Return the newest whole picture if it was exposed at `since_s` of platform time or later.

        Asked for often, it costs nothing: who wants a certain picture does not look at all.
        """
        last = self._thread.last
        if last is None or not last.frame.exposed_s >= since_s:
            return None
        return self._unit.corrected(last)

    def on_picture(self, listener: Callable[[], object]) -> Callable[[], None]:
        """Call `listener()` in the camera's thread at each whole picture; returns what ends it."""
        return self._thread.on_newest(listener)

    @property
    def focus(self) -> float | None:
        """How sharp the newest picture is; None while that is not measured."""
        newest = self._unit.vision.newest
        return newest.get("focus", float) if newest is not None else None

    @property
    def has_background(self) -> bool:
        """Pictures are corrected by a background."""
        return self._unit.background.frames > 0

    def set_background(self) -> None:
        """Correct pictures by the mean of the next few: show an empty ground meanwhile."""
        self._unit.background.collect(BACKGROUND_FRAMES)
        self._application.status_changed.emit()

    def clear_background(self) -> None:
        """Show pictures as they come."""
        self._unit.background.reset()
        self._application.status_changed.emit()

    # Commands

    def configure(self, settings: CameraSettings) -> Task:
        """Begin to put settings in force; the task fails with what the camera refuses."""
        return self._thread.configure(settings)

    def start(self) -> Task:
        """Begin to take pictures."""
        return self._thread.start_pictures()

    def stop(self, success: bool = True) -> Task:  # noqa: ARG002 - bluesky's signature
        """End taking pictures; a recording is closed."""
        self._unit.recordings.request_stop()
        return self._thread.stop_pictures()

    @override
    def software_trigger(self) -> None:
        """Take one picture, with the software trigger; raises `NotAvailable` without it."""
        self._thread.trigger()

    # Machine vision

    @property
    def algorithms(self) -> Sequence[LinkShown]:
        """The chain, in its order."""
        return links_shown(self._unit.chain.states, self._unit.vision.newest)

    def switch(self, algorithm: str, *, on: bool) -> None:
        """Have an algorithm run on the pictures, or not; raises `ConfigError`."""
        self._unit.chain.switch(algorithm, on=on)
        self._application.status_changed.emit()

    @property
    def analysis(self) -> Seen | None:
        """The newest result; None while nothing is on."""
        newest = self._unit.vision.newest
        return Seen.of(newest) if newest is not None else None

    # Files

    @property
    def elsewhere(self) -> str:
        """Whose disk files go to, where it is not this computer's; empty: it is."""
        return ""

    @property
    def directory(self) -> Path:
        """Where pictures go unless the operator says otherwise."""
        return self._application.directory

    @property
    def formats(self) -> Sequence[FormatShown]:
        """The ways to record; the first is the usual one."""
        return formats_shown(self.settings)

    @property
    def recording(self) -> PictureRecordingState:
        """The recording that runs, or the last one."""
        return self._unit.recordings.state

    def room_s(self, directory: Path, format_name: str) -> float | None:
        """Return how long the disk lasts for a recording there; None while nobody knows."""
        settings = self.settings
        chosen = next((each for each in FORMATS if each == format_name), None)
        if settings is None or chosen is None:
            return None
        return space_left(directory, picture_bytes_per_s(chosen, settings)).left_s

    def snap(self, path: Path, *, overwrite: bool = False) -> Task:
        """Begin to write the newest picture to a .tif or .png; the camera goes on meanwhile."""

        def job(task: Task) -> None:
            try:
                picture = self._unit.shown()
                if picture is None:
                    raise NotAvailable(f"{self.name}: {self.problem or 'no picture yet'}")
                axes = self._unit.recordings.axes
                save_picture(picture, path, axes=axes, overwrite=overwrite)
                task.finish()
            except CosmicError as exc:
                task.fail(exc)

        return self._application.begin(f"Saving {path.name}", job)

    def record(
        self, path: Path | str, format_name: str = "ffv1", *, overwrite: bool = False
    ) -> None:
        """Begin to record; see `CameraRecordings.start` for what it raises."""
        self._unit.recordings.start(Path(path), format_name, overwrite=overwrite)

    def stop_recording(self, *, wait: bool = False) -> None:
        """Ask for the file to be closed; it is when `recording.active` is False."""
        if wait:
            self._unit.recordings.stop()
        else:
            self._unit.recordings.request_stop()

    def time_lapse(
        self,
        path: Path,
        format_name: str = "tiff",
        *,
        interval_s: float,
        count: int,
        overwrite: bool = False,
    ) -> Task:
        """Begin to record one picture each `interval_s`, `count` in all; raises as `record`."""
        plan = TimeLapsePlan(interval_s, count)
        now_s = self._application.clock.now_s()
        recordings = self._unit.recordings
        return recordings.time_lapse(path, format_name, plan, now_s, overwrite=overwrite)

    # For its shape, and for the same over a line

    @property
    @override
    def _newest(self) -> Picture | None:
        return self._thread.newest

    @property
    @override
    def _places(self) -> Places | None:
        return self._application.places

    @property
    @override
    def _clock(self) -> Clock:
        return self._application.clock

    @property
    @override
    def _jobs(self) -> JobThread:
        return self._unit.jobs

    @property
    @override
    def _axes(self) -> Mapping[str, str]:
        return self._unit.recordings.axes
