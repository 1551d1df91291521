"""`ImageRecorder`: writes the images of one camera, in a thread of its own."""

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Final

from PySide6.QtCore import Signal
from typing_extensions import override

from cosmic.frame.clock import WALL
from cosmic.frame.errors import CosmicError, RecordingError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.file_names import check_directory, check_space, space_left
from cosmic.frame.threads import WorkerThread
from cosmic.vico.core.image import CameraImage
from cosmic.vico.core.recording.formats import (
    ImageFormat,
    check_pixels,
    image_bytes_per_s,
)
from cosmic.vico.core.recording.image_file import ImageFile
from cosmic.vico.core.recording.side_row import DROPPED, SideRow, row_of
from cosmic.vico.hw.interface import CameraSettings, FrameStatus, Pixels

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class ImageRecordingStats:
    """How a recording of images stands.

    Attributes
    ----------
    path, side_path : Path
        Of the file or the directory, and of the side file.
    written : int
        Images in the file.
    dropped : int
        Images that came while the queue was full, or that waited when writing failed.
    incomplete : int
        Images with parts missing; never in the file.
    lost : int
        Frames that the camera lost between the images that came.
    waiting, waiting_bytes : int
        Images that wait to be written.
    duration_s : float
        Platform time between the first and the last image in the file.
    file_bytes : int
        Size of the file, or of all files of a sequence.
    left_s : float
        How long it may go on before the disk is full.
    paused : bool
        Images that come now are not meant for the file.
    """

    path: Path
    side_path: Path
    written: int = 0
    dropped: int = 0
    incomplete: int = 0
    lost: int = 0
    waiting: int = 0
    waiting_bytes: int = 0
    duration_s: float = 0.0
    file_bytes: int = 0
    left_s: float = 0.0
    paused: bool = False


FLUSH_S: Final = 0.25
QUEUE_BYTES: Final = 256 * 1024 * 1024
LONGEST_QUEUE: Final = 10_000
"""Rows of images dropped wait in the queue as well, and take memory."""


@dataclass(frozen=True, slots=True)
class _Came:
    """An image in the queue; without pixels when it is not to be written."""

    row: SideRow
    data: Pixels | None


class ImageRecorder(WorkerThread):
    """Writes one recording; made for it, and gone with it.

    The files are created at once, so that what forbids them is raised here. Then `start`; `put`
    from the thread of the camera; at the end `request_end` and `join`, which takes as long as
    writing what waits.

    Parameters
    ----------
    path : Path
        Of the file, with or without its ending, or of the directory of a sequence.
    settings : CameraSettings
        In force at the camera: pixel format, size and rate.
    axes : mapping of str to str
        Unit of each axis, "um" or "deg", by its name.
    queue_bytes : int
        How many bytes of images may wait before images are dropped.

    Raises
    ------
    RecordingExistsError
        There is such a recording, and `overwrite` is False.
    RecordingError
        Its name, its directory, the room on the disk, the camera's pixel format or a missing
        codec forbid it.

    Notes
    -----
    Signals: ``recorded`` (`ImageRecordingStats`, some four times a second), ``failed``
    (`CosmicError`; the recording ends early, the camera goes on), ``closed`` (`Path`).
    """

    recorded = Signal(object)
    failed = Signal(object)
    closed = Signal(object)

    def __init__(
        self,
        path: Path,
        image_format: ImageFormat,
        settings: CameraSettings,
        policy: FailurePolicy,
        *,
        axes: Mapping[str, str] | None = None,
        overwrite: bool = False,
        queue_bytes: int = QUEUE_BYTES,
    ) -> None:
        check_pixels(image_format, settings.pixel_format)
        self._bytes_per_s = image_bytes_per_s(image_format, settings)
        space = check_space(check_directory(path.parent), self._bytes_per_s)
        super().__init__(f"recorder {path.name}", policy)
        self._file = ImageFile(
            path, image_format, axes=axes, rate_hz=settings.rate_hz, overwrite=overwrite
        )
        self._left_s = space.left_s
        self._queue: SimpleQueue[_Came | None] = SimpleQueue()
        self._limit_bytes = queue_bytes
        # Written by the thread of the camera alone:
        self._given = self._given_bytes = 0
        self._dropped = self._incomplete = self._lost = 0
        # Written by this thread alone:
        self._taken = self._taken_bytes = 0
        self._logged_dropped = 0
        self._in_hand: _Came | None = None
        self._times_s: tuple[float, float] | None = None
        self._error: CosmicError | None = None
        self._paused = False
        self._ended = False

    @property
    def path(self) -> Path:
        """Where the recording lies."""
        return self._file.path

    @property
    def side_path(self) -> Path:
        """Where its side file lies."""
        return self._file.side_path

    @property
    def error(self) -> CosmicError | None:
        """Why the recording ended early; None when it did not."""
        return self._error

    @property
    def stats(self) -> ImageRecordingStats:
        """How it stands now; any thread."""
        first_s, last_s = self._times_s or (0.0, 0.0)
        left, left_bytes = self._given - self._taken, self._given_bytes - self._taken_bytes
        ended = self._ended
        return ImageRecordingStats(
            path=self._file.path,
            side_path=self._file.side_path,
            written=self._file.count,
            dropped=self._dropped + (left if ended else 0),
            incomplete=self._incomplete,
            lost=self._lost,
            waiting=0 if ended else left,
            waiting_bytes=0 if ended else left_bytes,
            duration_s=last_s - first_s,
            file_bytes=self._size_bytes(),
            left_s=self._left_s,
            paused=self._paused,
        )

    def pause(self) -> None:
        """Let the images that come from now on pass; any thread."""
        self._paused = True

    def resume(self) -> None:
        """Write images again; any thread."""
        self._paused = False

    def put(self, image: CameraImage) -> bool:
        """Have `image` written; returns at once whether it will be. One thread."""
        if self._paused or self._ended or self._error is not None or self.end_requested:
            return False
        self._lost += image.lost_before
        row = row_of(image, datetime.now(UTC))
        good = image.frame.status is FrameStatus.COMPLETE
        room = not good or self._has_room(image.data.nbytes)
        if not good:
            self._incomplete += 1
        elif not room:
            self._dropped += 1
            row = replace(row, status=DROPPED)
        row = replace(row, dropped=self._dropped)
        accepted = good and room
        if accepted:
            self._given += 1
            self._given_bytes += image.data.nbytes
            self._queue.put(_Came(row, image.data))
        elif self._queue.qsize() < LONGEST_QUEUE:
            self._queue.put(_Came(row, None))
        return accepted

    def _has_room(self, size_bytes: int) -> bool:
        """Return whether an image may wait; one always may, however large."""
        waiting = self._given_bytes - self._taken_bytes
        few = self._queue.qsize() < LONGEST_QUEUE
        return waiting == 0 or (few and waiting + size_bytes <= self._limit_bytes)

    @override
    def request_end(self) -> None:
        super().request_end()
        self._queue.put(None)

    @override
    def run_body(self) -> None:
        try:
            if not self._survived(self._write_all):
                self._survived(self._abandon)
            self._survived(self._close)
        finally:
            self._ended = True
            self.recorded.emit(self.stats)
            self.closed.emit(self.path)

    def _survived(self, action: Callable[[], None]) -> bool:
        """Do it; return whether it went well."""
        try:
            action()
        except RecordingError as exc:
            self._fail(exc)
        except OSError as exc:
            self._fail(
                RecordingError(
                    f"{self.path}: writing failed ({exc.strerror or exc}); the recording ends here "
                    "with what was written before, and the camera goes on. Is the disk full, or "
                    "gone?"
                )
            )
        else:
            return True
        return False

    def _write_all(self) -> None:
        due_s = WALL.now_s() + FLUSH_S
        while True:
            try:
                came = self._queue.get(timeout=max(0.0, due_s - WALL.now_s()))
                if came is None:
                    return
                self._write(came)
            except Empty:
                pass
            if WALL.now_s() >= due_s:
                self._flush()
                due_s = WALL.now_s() + FLUSH_S

    def _write(self, came: _Came) -> None:
        if came.data is None:
            self._file.note(came.row)
            return
        self._in_hand = came
        self._file.append(came.data, came.row)
        self._in_hand = None
        first_s = self._times_s[0] if self._times_s else came.row.time_s
        self._times_s = (first_s, came.row.time_s)
        self._taken += 1
        self._taken_bytes += came.data.nbytes

    def _flush(self) -> None:
        self._file.flush()
        for path in (self._file.path, self._file.side_path):
            if not path.exists():  # a file that was deleted takes everything without a word
                raise RecordingError(
                    f"{path}: was taken away while it was written; the recording ends here and "
                    "the camera goes on. Record to another directory"
                )
        directory = self.path.parent
        self._left_s = space_left(directory, self._bytes_per_s).left_s
        check_space(directory, self._bytes_per_s * FLUSH_S)
        if self._dropped > self._logged_dropped:
            logger.warning(
                "%s: %d images dropped so far: they arrive faster than they can be written",
                self.path,
                self._dropped,
            )
            self._logged_dropped = self._dropped
        self.recorded.emit(self.stats)

    def _abandon(self) -> None:
        """Say of the images that wait that they are not in the file."""
        left = [self._in_hand, *(self._queue.get() for _ in range(self._queue.qsize()))]
        abandoned = 0
        for came in left:
            if came is not None:
                abandoned += came.data is not None
                status = came.row.status if came.data is None else DROPPED
                dropped = came.row.dropped + abandoned
                self._file.note(replace(came.row, status=status, dropped=dropped))

    def _close(self) -> None:
        self._file.close(complete=self._error is None)

    def _size_bytes(self) -> int:
        try:
            return self._file.size_bytes
        except OSError:  # taken away; `_flush` tells
            return 0

    def _fail(self, error: CosmicError) -> None:
        if self._error is None:
            self._error = error
            self._policy.report(error, self.name)
            self.failed.emit(error)
        else:
            logger.error("%s: %s", self.name, error)
