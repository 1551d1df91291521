"""One camera of ``rig.vico``; its view and stations use nothing else."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from typing_extensions import override

from cosmic.frame.arguments import checked_class
from cosmic.frame.clock import Clock
from cosmic.frame.declaration import Declared, command, state, stream
from cosmic.frame.errors import CosmicError, NotAvailable
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.file_names import space_left
from cosmic.frame.job_queue import JobQueue
from cosmic.frame.network.caller import called_remotely
from cosmic.frame.network.transport import Rule
from cosmic.frame.operation import Operation, Task
from cosmic.frame.renamed import Renamed
from cosmic.vico.api.application import VicoApplication
from cosmic.vico.api.camera_coordinates import CameraCoordinates
from cosmic.vico.api.camera_images import (
    CameraImages,
    ImageWait,
    LocalImages,
    RemoteImages,
    always,
)
from cosmic.vico.api.camera_shown import (
    FormatShown,
    LinkShown,
    Seen,
    formats_shown,
    links_shown,
    utc_of,
)
from cosmic.vico.api.coordinate_transform import CoordinateTransform, RotationShown
from cosmic.vico.api.plan_camera import PlanCamera
from cosmic.vico.api.sent_image import SentImage, SentSeen
from cosmic.vico.core.camera_recordings import ImageRecordingState
from cosmic.vico.core.image import CameraImage
from cosmic.vico.core.recording.formats import FORMATS, image_bytes_per_s
from cosmic.vico.core.recording.snap import save_image
from cosmic.vico.core.recording.time_lapse import TimeLapsePlan
from cosmic.vico.core.vision.chain import Analysis
from cosmic.vico.hw.interface import (
    CameraCounters,
    CameraInfo,
    CameraRanges,
    CameraSettings,
    FrameStatus,
)

BACKGROUND_FRAMES = 8

if TYPE_CHECKING:
    from cosmic.vico.core.measuring.corrections import Corrections


@checked_class
class CameraHandle(CameraCoordinates, PlanCamera, Declared):
    """One camera: its images, settings, recordings and what machine vision finds; any thread.

    It has the shape of a bluesky detector without importing bluesky.
    """

    plan_pictures = Renamed("plan_images")
    next_picture = Renamed("next_image")
    picture_since = Renamed("image_since")
    on_picture = Renamed("on_image")
    await_picture = Renamed("await_image")
    pictures = Renamed("images")

    def __init__(self, application: VicoApplication, name: str) -> None:
        self._application = application
        self._unit = application.unit(name)
        self._thread = self._unit.thread
        self.name = name
        self._images: CameraImages = LocalImages(application, self._unit)

    @override
    def set_up_proxy(self, key: str, policy: FailurePolicy) -> None:
        """Take images over the line."""
        self.name = key
        self._images = RemoteImages(self, policy)

    @property
    def images(self) -> CameraImages:
        """Where the images come from."""
        return self._images

    @override
    @command(reads=True)
    def now_s(self) -> float:
        """Return the platform's time where the camera is, by which its images are dated."""
        return self._application.clock.now_s()

    # What is in force

    @property
    @state
    def title(self) -> str:
        """What the operator reads."""
        return self._unit.config.shown

    @property
    @override
    def clock(self) -> Clock:
        """The platform's."""
        return self._application.clock

    @property
    @override
    def info(self) -> CameraInfo | None:
        """Which camera it is; None while none is connected."""
        return None if self.away else self._info

    @property
    @state
    def _info(self) -> CameraInfo | None:
        return self._thread.info

    @property
    def ranges(self) -> CameraRanges | None:
        """What it accepts now; None while it is not connected."""
        return None if self.away else self._ranges

    @property
    @state
    def _ranges(self) -> CameraRanges | None:
        return self._thread.ranges

    @property
    @override
    def settings(self) -> CameraSettings | None:
        """What is in force, as read back; None while it is not connected."""
        return None if self.away else self._settings

    @property
    @state
    def _settings(self) -> CameraSettings | None:
        return self._thread.settings

    @property
    @state(unknown=CameraCounters(), quiet=True)
    def counters(self) -> CameraCounters:
        """What became of the frames since the start."""
        return self._thread.counters

    @property
    def running(self) -> bool:
        """It takes images, or waits for its trigger."""
        return not self.away and self._running

    @property
    @state
    def _running(self) -> bool:
        return self._thread.running

    @property
    def problem(self) -> str:
        """Why no images come; empty when all is well."""
        return self.away or self._fault

    @property
    @state
    def _fault(self) -> str:
        return self._thread.problem

    # Images

    def latest(self) -> CameraImage | None:
        """Return the newest whole image, background corrected; None before the first."""
        return self._images.latest()

    @command(reads=True)
    def sent_latest(self) -> SentImage | None:
        """Return the newest whole image as it travels to another station."""
        newest = self.latest()
        return None if newest is None else SentImage.of(newest, self._transform)

    @override
    def next_image(self, timeout_s: float = 5.0, since_s: float | None = None) -> CameraImage:
        """Wait for a whole image exposed from `since_s` of platform time on; None is now.

        Raises
        ------
        NotAvailable
            None came in time; the text says why.
        WrongThreadError
            Called in the GUI thread.
        """
        return self._images.next(timeout_s, since_s)

    @command(reads=True)
    def await_image(self, since_s: float | None = None) -> ImageWait:
        """Begin to wait for a whole image exposed from `since_s` on; None is now."""
        since = self.clock.now_s() if since_s is None else since_s
        return ImageWait(self._thread, since, self._transform)

    def image_since(self, since_s: float) -> CameraImage | None:
        """Return the newest whole image if it was exposed at `since_s` of platform time or later.

        Asked for often, it costs nothing: who wants a certain image does not look at all.
        """
        return self._images.since(since_s)

    def on_image(self, listener: Callable[[], object]) -> Callable[[], None]:
        """Call `listener()` in the camera's thread at each whole image; returns what ends it."""
        return self._images.on_image(listener)

    @stream(Rule.ALL, topic="images")
    def watch_frames(
        self, receiver: Callable[[SentImage], object], wanted: Callable[[], bool] | None = None
    ) -> Callable[[], None]:
        """Call `receiver` with every frame as it came, in order, while it is `wanted`."""

        def take(image: CameraImage) -> None:
            if wanted is None or wanted():
                receiver(SentImage.of(image, self._transform))

        return self._thread.subscribe(take)

    @stream(Rule.LATEST, topic="shown")
    def watch_shown(
        self, receiver: Callable[[SentImage], object], wanted: Callable[[], bool] | None = None
    ) -> Callable[[], None]:
        """Call `receiver` with whole images as a view shows them, while they are `wanted`."""

        def take(image: CameraImage) -> None:
            receiver(SentImage.of(image, self._transform))

        return self._unit.live.subscribe(take, wanted or always)

    @stream(Rule.LATEST, topic="seen")
    def watch_seen(
        self, receiver: Callable[[SentSeen], object], wanted: Callable[[], bool] | None = None
    ) -> Callable[[], None]:
        """Call `receiver` with what machine vision finds, while it is `wanted`."""
        over = False

        def take(newest: Analysis) -> None:
            if not over:
                receiver(SentSeen.of(Seen.of(newest)))

        def end() -> None:
            nonlocal over
            over = True

        self._unit.vision.subscribe(take, lambda: not over and (wanted or always)())
        return end

    @property
    @state(quiet=True)
    def newest_id(self) -> int | None:
        """Number of the newest whole frame; None before the first."""
        newest = self._thread.last
        whole = newest is not None and newest.frame.status is FrameStatus.COMPLETE
        return int(newest.frame.frame_id) if newest is not None and whole else None

    @property
    @state(quiet=True)
    def focus(self) -> float | None:
        """How sharp the newest image is; None while that is not measured."""
        newest = self._unit.vision.newest
        return newest.get("focus", float) if newest is not None else None

    @property
    @state
    def has_background(self) -> bool:
        """Images are corrected by a background."""
        return self._unit.background.frames > 0

    @command(aside=True)
    def set_background(self) -> None:
        """Correct images by the mean of the next few: show an empty ground meanwhile."""
        self._unit.background.collect(BACKGROUND_FRAMES)
        self._application.status_changed.emit()

    @command(aside=True)
    def clear_background(self) -> None:
        """Show images as they come."""
        self._unit.background.reset()
        self._application.status_changed.emit()

    # Commands

    @command
    def configure(self, settings: CameraSettings) -> Task:
        """Begin to put settings in force; the task fails with what the camera refuses."""
        return self._thread.configure(settings)

    @command
    def start(self) -> Task:
        """Begin to take images."""
        return self._thread.start_images()

    @command
    def stop(self, success: bool = True) -> Task:  # noqa: ARG002 - bluesky's signature
        """End taking images; a recording is closed."""
        self._unit.recordings.request_stop()
        return self._thread.stop_images()

    @command(aside=True)
    def software_trigger(self) -> None:
        """Take one image, with the software trigger; raises `NotAvailable` without it."""
        self._thread.trigger()

    @override
    def triggered_image(self, timeout_s: float = 5.0) -> CameraImage:
        """Give the software trigger and wait for its image.

        Raises
        ------
        NotAvailable
            It is not the trigger chosen, or no image came in time; the text says why.
        WrongThreadError
            Called in the GUI thread.
        """
        return self._images.triggered(timeout_s)

    @command(aside=True)
    def await_triggered(self) -> ImageWait:
        """Give the software trigger and begin to wait for its image."""
        since_s = self.clock.now_s()
        self._thread.trigger()
        return ImageWait(self._thread, since_s, self._transform)

    # Machine vision

    @property
    def algorithms(self) -> Sequence[LinkShown]:
        """The chain, in its order."""
        links, away = self._links, self.away
        return tuple(replace(each, problem=away) for each in links) if away else links

    @property
    @state
    def _links(self) -> tuple[LinkShown, ...]:
        return links_shown(self._unit.chain.states, self._unit.vision.newest)

    @command(aside=True)
    def switch(self, algorithm: str, *, on: bool) -> None:
        """Have an algorithm run on the images, or not; raises `ConfigError`."""
        self._unit.chain.switch(algorithm, on=on)
        self._application.status_changed.emit()

    @property
    def analysis(self) -> Seen | None:
        """The newest result; None while nothing is on."""
        return self._images.analysis if any(each.on for each in self._links) else None

    def corrections(self, image: CameraImage) -> "Operation[Corrections]":
        """Begin to find the fibres on an image, for an operator to correct them.

        The operation fails with `NotAvailable` where they cannot be looked for.
        """

        def find() -> "Corrections":
            from cosmic.vico.core.measuring.corrections import Corrections
            from cosmic.vico.core.vision.finding import find_fibres

            # Files have blue first, and corrections belong to the pixels of a file.
            pixels = image.data[:, :, ::-1] if image.data.ndim == 3 else image.data
            return Corrections(pixels, find_fibres(pixels))

        return self._images.jobs.submit(find, f"Fibres of {self.name}")

    # Files

    @property
    @state(unknown=Path())
    def directory(self) -> Path:
        """Where images go unless the operator says otherwise."""
        return self._application.directory

    @property
    def formats(self) -> Sequence[FormatShown]:
        """The ways to record; the first is the usual one."""
        formats, away = self._formats, self.away
        return tuple(replace(each, problem=away) for each in formats) if away else formats

    @property
    @state
    def _formats(self) -> tuple[FormatShown, ...]:
        shown = formats_shown(self._settings)
        return tuple(replace(each, name=str(each.name)) for each in shown)

    @property
    def recording(self) -> ImageRecordingState:
        """The recording that runs, or the last one."""
        found = self._recording
        return replace(found, active=False) if self.away else found

    @property
    @state(unknown=ImageRecordingState())
    def _recording(self) -> ImageRecordingState:
        return self._unit.recordings.state

    @command(reads=True, remembered_s=2.0, meanwhile=None)
    def room_s(self, directory: Path, format_name: str) -> float | None:
        """Return how long the disk lasts for a recording there; None while nobody knows."""
        settings = self.settings
        chosen = next((each for each in FORMATS if each == format_name), None)
        if settings is None or chosen is None:
            return None
        return space_left(directory, image_bytes_per_s(chosen, settings)).left_s

    @command
    def snap(self, path: Path, *, overwrite: bool = False) -> Task:
        """Begin to write the newest image to a .tif or .png; the camera goes on meanwhile."""
        path = self._on_disk(path)

        def job(task: Task) -> None:
            try:
                image = self._unit.shown()
                if image is None:
                    raise NotAvailable(f"{self.name}: {self.problem or 'no image yet'}")
                axes, taken = self._unit.recordings.axes, utc_of(image, self.clock)
                save_image(image, path, axes=axes, overwrite=overwrite, utc=taken)
                task.finish()
            except CosmicError as exc:
                task.fail(exc)

        return self._application.begin(f"Saving {path.name}", job)

    @command(aside=True)
    def record(
        self, path: Path | str, format_name: str = "ffv1", *, overwrite: bool = False
    ) -> None:
        """Begin to record; see `CameraRecordings.start` for what it raises."""
        self._unit.recordings.start(self._on_disk(path), format_name, overwrite=overwrite)

    def stop_recording(self, *, wait: bool = False) -> None:
        """Ask for the file to be closed; it is when `recording.active` is False."""
        self.end_recording()
        if wait:
            self._images.wait_closed()

    @command(aside=True)
    def end_recording(self) -> None:
        """Ask for the file to be closed, and wait for nothing."""
        self._unit.recordings.request_stop()

    @command
    def time_lapse(
        self,
        path: Path,
        format_name: str = "tiff",
        *,
        interval_s: float,
        count: int,
        overwrite: bool = False,
    ) -> Task:
        """Begin to record one image each `interval_s`, `count` in all; raises as `record`."""
        plan = TimeLapsePlan(interval_s, count)
        now_s = self._application.clock.now_s()
        recordings = self._unit.recordings
        path = self._on_disk(path)
        return recordings.time_lapse(path, format_name, plan, now_s, overwrite=overwrite)

    def _on_disk(self, path: Path | str) -> Path:
        """Return a path on this disk; named elsewhere, it begins where images go."""
        if not called_remotely():
            return Path(path)
        return self._application.directory / Path(path).expanduser()

    # For its shape

    @property
    @state
    def axes(self) -> Mapping[str, str]:
        """Unit of each axis whose position comes with the images."""
        return dict(self._unit.recordings.axes)

    @property
    @state
    def rotation(self) -> RotationShown | None:
        """About which point the plate turns; None while it was not measured."""
        transform = self._application.transform
        return transform.rotation_centre(self.name) if transform is not None else None

    @property
    @override
    def _newest(self) -> CameraImage | None:
        return self._images.newest

    @property
    @override
    def _transform(self) -> CoordinateTransform | None:
        return self._images.transform

    @property
    @override
    def _clock(self) -> Clock:
        return self.clock

    @property
    @override
    def _jobs(self) -> JobQueue:
        return self._images.jobs

    @property
    @override
    def _axes(self) -> Mapping[str, str]:
        return self.axes
