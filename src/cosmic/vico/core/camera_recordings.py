"""`CameraRecordings`: begins and ends the recordings of one camera, one at a time."""

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from threading import RLock

from PySide6.QtCore import Qt

from cosmic.frame.errors import CosmicError, NotAvailable
from cosmic.frame.events import Event, Unsubscribe
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.operation import Task
from cosmic.vico.core.camera_thread import CameraThread
from cosmic.vico.core.image import CameraImage
from cosmic.vico.core.recording.formats import ImageFormat, traits
from cosmic.vico.core.recording.image_recorder import ImageRecorder
from cosmic.vico.core.recording.time_lapse import TimeLapse, TimeLapsePlan

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class ImageRecordingState:
    """The recording that runs, or the last one.

    Attributes
    ----------
    active : bool
        Images are being written.
    path : Path or None
        None before the first recording.
    written, dropped, waiting : int
        Images in the file, not in it for whatever reason, and in the queue.
    left_s : float or None
        How long the disk lasts at this pace.
    failure : str
        Why it ended by itself; empty when it did not.
    """

    active: bool = False
    path: Path | None = None
    written: int = 0
    dropped: int = 0
    waiting: int = 0
    duration_s: float = 0.0
    size_bytes: int = 0
    left_s: float | None = None
    failure: str = ""


class CameraRecordings:
    """One recording at a time of what a camera takes; any thread.

    Attributes
    ----------
    axes : mapping of str to str
        Unit of each axis whose position comes with the images.
    """

    def __init__(self, camera: CameraThread, policy: FailurePolicy) -> None:
        self._camera = camera
        self._policy = policy
        self._lock = RLock()
        self._writer: ImageRecorder | None = None
        self._unsubscribe: Callable[[], None] | None = None
        self._task: Task | None = None
        self._changed: Event[[]] = Event()
        self.axes: Mapping[str, str] = {}

    def on_change(self, listener: Callable[[], object]) -> Unsubscribe:
        """Call `listener()` when a recording begins, goes on or ends, in any thread."""
        return self._changed.subscribe(listener)

    @property
    def state(self) -> ImageRecordingState:
        """How it stands."""
        writer = self._writer
        if writer is None:
            return ImageRecordingState()
        stats, error = writer.stats, writer.error
        return ImageRecordingState(
            active=writer.isRunning() and error is None,
            path=stats.path,
            written=stats.written,
            dropped=stats.dropped + stats.incomplete + stats.lost,
            waiting=stats.waiting,
            duration_s=stats.duration_s,
            size_bytes=stats.file_bytes,
            left_s=stats.left_s,
            failure=str(error) if error is not None else "",
        )

    def start(self, path: Path, image_format: str, *, overwrite: bool = False) -> None:
        """Begin to write every image that is taken.

        Raises
        ------
        NotAvailable
            The camera is not there, or a recording runs already.
        RecordingError
            Name, directory, disk, codec or pixel format forbid it, or there is such a file and
            `overwrite` is False.
        """
        with self._lock:
            writer = self._begin(path, image_format, overwrite=overwrite)
            self._unsubscribe = self._camera.subscribe(writer.put)
        self._changed.emit()

    def time_lapse(
        self,
        path: Path,
        image_format: str,
        plan: TimeLapsePlan,
        now_s: float,
        *,
        overwrite: bool = False,
    ) -> Task:
        """Begin to write one image each interval; raises as `start`."""
        lapse, task = TimeLapse(plan, now_s), Task("Time-lapse")

        def choose(image: CameraImage) -> None:
            if lapse.take(image.frame.exposed_s):
                writer.put(image)
                whole = plan.count or 0
                text = f"{lapse.taken} images, {lapse.late} late, {lapse.missed} missed"
                task.report(lapse.taken / whole if whole else 0.0, text)
            if lapse.done:  # also where no image came until after the end
                self._request_stop_of(writer)

        with self._lock:
            writer = self._begin(path, image_format, overwrite=overwrite)
            self._task = task
            task.on_cancel(lambda: self._request_stop_of(writer))
            self._unsubscribe = self._camera.subscribe(choose)
        self._changed.emit()
        return task

    def _begin(self, path: Path, image_format: str, *, overwrite: bool) -> ImageRecorder:
        if self.state.active:
            raise NotAvailable(f"{self.state.path} is being recorded; stop it first")
        settings = self._camera.settings
        if settings is None:
            reason = self._camera.problem or "it is not connected"
            raise NotAvailable(f"{self._camera.camera_name} cannot be recorded: {reason}")
        self._end_images()
        self._join_last()
        traits(image_format)  # says which there are
        writer = ImageRecorder(
            path,
            ImageFormat(image_format),
            settings,
            self._policy,
            axes=self.axes,
            overwrite=overwrite,
        )
        direct = Qt.ConnectionType.DirectConnection
        writer.recorded.connect(self._on_recorded, direct)
        writer.closed.connect(self._on_closed, direct)
        self._writer = writer
        writer.start()
        logger.info("recording %s to %s", self._camera.camera_name, writer.path)
        return writer

    def request_stop(self) -> None:
        """Ask for the file to be closed; returns at once."""
        self._request_stop_of(self._writer)

    def _request_stop_of(self, writer: ImageRecorder | None) -> None:
        """End one recording, and none that was begun after it."""
        with self._lock:
            if writer is None or writer is not self._writer:
                return
            self._end_images()
        writer.request_end()

    def _end_images(self) -> None:
        """Hand on no more images; one may be on its way yet."""
        unsubscribe, self._unsubscribe = self._unsubscribe, None
        if unsubscribe is not None:
            unsubscribe()

    def stop(self) -> None:
        """Close the file and wait until it is closed; harmless when nothing is recorded."""
        self.request_stop()
        self._join_last()

    def _join_last(self) -> None:
        writer = self._writer
        if writer is None:
            return
        writer.request_end()
        while not writer.join():
            logger.warning("%s: still writing %d images", writer.path, writer.stats.waiting)

    def _on_recorded(self, _stats: object) -> None:
        self._changed.emit()

    def _on_closed(self, path: Path) -> None:
        self._end_images()  # it may have ended by itself; without the lock, which waits for this
        task, self._task = self._task, None
        writer = self._writer
        error: CosmicError | None = writer.error if writer is not None else None
        if task is not None and not task.done:
            if error is not None:
                task.fail(error)
            else:
                task.finish()
        logger.info("recorded to %s", path)
        self._changed.emit()
