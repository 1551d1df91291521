"""Where a camera's handle gets its images: from the camera here, or from another station."""

from abc import abstractmethod
from collections.abc import Callable
from typing import Final, Protocol

from typing_extensions import override

from cosmic.frame.clock import WALL
from cosmic.frame.errors import CosmicError, DeviceTimeout, MoveCancelled, NotAvailable
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.job_queue import JobQueue
from cosmic.frame.operation import Operation
from cosmic.frame.threads import forbid_waiting_here, may_wait_here
from cosmic.vico.api.application import VicoApplication
from cosmic.vico.api.camera_shown import Seen
from cosmic.vico.api.coordinate_transform import CoordinateTransform
from cosmic.vico.api.sent_image import ReceivedImage, SentImage, SentSeen
from cosmic.vico.core.camera_recordings import ImageRecordingState
from cosmic.vico.core.camera_thread import CameraThread
from cosmic.vico.core.camera_unit import CameraUnit
from cosmic.vico.core.image import CameraImage
from cosmic.vico.hw.interface import FrameStatus

IDLE_S: Final = 3.0
"""Wall time after the last look when images of another station need not come any more."""
MISSED_S: Final = 0.3
"""Silence after which an image that the station has did not come."""
CLOSE_S: Final = 30.0
"""How long the end of a recording may make no progress."""
LOOK_S: Final = 0.05


class CameraImages(Protocol):
    """What differs between a camera here and one elsewhere; any thread."""

    @property
    @abstractmethod
    def jobs(self) -> JobQueue:
        """Takes the images of plans."""

    @property
    @abstractmethod
    def transform(self) -> CoordinateTransform | None:
        """What joins pixels and platform."""

    @property
    @abstractmethod
    def newest(self) -> CameraImage | None:
        """The newest image as it came."""

    @property
    @abstractmethod
    def analysis(self) -> Seen | None:
        """The newest result of machine vision."""

    @abstractmethod
    def latest(self) -> CameraImage | None:
        """Return the newest whole image as a view shows it."""

    @abstractmethod
    def since(self, since_s: float) -> CameraImage | None:
        """Return the newest whole image if it was exposed then or later."""

    @abstractmethod
    def next(self, timeout_s: float, since_s: float | None) -> CameraImage:
        """Wait for a whole image exposed from then on."""

    @abstractmethod
    def triggered(self, timeout_s: float) -> CameraImage:
        """Give the software trigger, and wait for its image."""

    @abstractmethod
    def on_image(self, listener: Callable[[], object]) -> Callable[[], None]:
        """Call `listener()` at each whole image."""

    @abstractmethod
    def wait_closed(self) -> None:
        """Wait until the recording is closed."""


class LocalImages(CameraImages):
    """Of a camera of this process."""

    def __init__(self, application: VicoApplication, unit: CameraUnit) -> None:
        self._application, self._unit = application, unit

    @property
    @override
    def jobs(self) -> JobQueue:
        return self._unit.jobs

    @property
    @override
    def transform(self) -> CoordinateTransform | None:
        return self._application.transform

    @property
    @override
    def newest(self) -> CameraImage | None:
        return self._unit.thread.newest

    @property
    @override
    def analysis(self) -> Seen | None:
        newest = self._unit.vision.newest
        return Seen.of(newest) if newest is not None else None

    @override
    def latest(self) -> CameraImage | None:
        return self._unit.shown()

    @override
    def since(self, since_s: float) -> CameraImage | None:
        last = self._unit.thread.last
        if last is None or not last.frame.exposed_s >= since_s:
            return None
        return self._unit.corrected(last)

    @override
    def next(self, timeout_s: float, since_s: float | None) -> CameraImage:
        since = self._application.clock.now_s() if since_s is None else since_s
        return self._unit.thread.next_image(since, timeout_s)

    @override
    def triggered(self, timeout_s: float) -> CameraImage:
        forbid_waiting_here("waiting for an image")  # before anything is exposed
        since_s = self._application.clock.now_s()
        self._unit.thread.trigger()
        return self._unit.thread.next_image(since_s, timeout_s)

    @override
    def on_image(self, listener: Callable[[], object]) -> Callable[[], None]:
        return self._unit.thread.on_newest(listener)

    @override
    def wait_closed(self) -> None:
        self._unit.recordings.stop()


class ImageWait(Operation[SentImage]):
    """Ends with the first whole image exposed from `since_s` of platform time on; any thread."""

    def __init__(
        self, thread: CameraThread, since_s: float, transform: CoordinateTransform | None
    ) -> None:
        super().__init__(f"next image of {thread.camera_name}")
        self._since_s = since_s
        self._transform = transform
        unsubscribe = thread.subscribe(self._on_image)
        self.add_callback(lambda _ended: unsubscribe())
        self.on_cancel(self._give_up)
        newest = thread.last
        if newest is not None:
            self._on_image(newest)
        forget = thread.on_end(self._on_end)
        self.add_callback(lambda _ended: forget())

    def _give_up(self) -> None:
        self.fail(MoveCancelled(f"{self.title}: it is no longer waited for"))

    def _on_end(self) -> None:
        self.fail(NotAvailable(f"{self.title}: the camera is closed"))

    def _on_image(self, image: CameraImage) -> None:
        frame = image.frame
        if self.done or frame.status is not FrameStatus.COMPLETE:
            return
        if frame.exposed_s >= self._since_s:
            self.finish(SentImage.of(image, self._transform))


class SendingCamera(Protocol):
    """A camera that can be asked for its images over a line."""

    name: str

    @property
    @abstractmethod
    def away(self) -> str:
        """Why its station cannot be reached; empty while it can."""

    @property
    @abstractmethod
    def running(self) -> bool:
        """It takes images."""

    @property
    @abstractmethod
    def problem(self) -> str:
        """Why no images come."""

    @property
    @abstractmethod
    def recording(self) -> ImageRecordingState:
        """The recording that runs, or the last one."""

    @property
    @abstractmethod
    def newest_id(self) -> int | None:
        """Number of the newest whole frame."""

    @abstractmethod
    def sent_latest(self) -> SentImage | None:
        """Return the newest whole image."""

    @abstractmethod
    def await_image(self, since_s: float | None = None) -> ImageWait:
        """Begin to wait for a whole image."""

    @abstractmethod
    def await_triggered(self) -> ImageWait:
        """Give the software trigger and begin to wait for its image."""

    @abstractmethod
    def watch_shown(self, receiver: Callable[[SentImage], object]) -> Callable[[], None]:
        """Have whole images sent."""

    @abstractmethod
    def watch_seen(self, receiver: Callable[[SentSeen], object]) -> Callable[[], None]:
        """Have what machine vision finds sent."""

    @abstractmethod
    def carry_out(
        self,
        action: Callable[[], None],
        on_result: Callable[[None, CosmicError | None], object],
    ) -> None:
        """Do what may have to wait for the line."""


def always() -> bool:
    """Return True: somebody wants it."""
    return True


class RemoteImages(CameraImages):
    """Of a camera of another station; they come while somebody looks.

    Parameters
    ----------
    camera : SendingCamera
        The proxy of the camera.
    """

    def __init__(self, camera: SendingCamera, policy: FailurePolicy) -> None:
        self._camera = camera
        self._jobs = JobQueue(f"images of {camera.name}", policy)
        self._transform: CoordinateTransform | None = None
        self._shown: ReceivedImage | None = None
        self._seen: Seen | None = None
        self._looked: dict[str, float] = {}
        self._ends: dict[str, Callable[[], None]] = {}
        self._came_s = -float("inf")
        self._asked_for: int | None = None

    @property
    def live(self) -> bool:
        """Images are being sent, because somebody looks, and have come."""
        return "shown" in self._ends and self._came_s > 0.0

    def join_transform(self, transform: CoordinateTransform) -> None:
        """Say what joins pixels and platform."""
        self._transform = transform

    # What a handle asks

    @property
    @override
    def jobs(self) -> JobQueue:
        return self._jobs

    @property
    @override
    def transform(self) -> CoordinateTransform | None:
        return self._transform

    @property
    @override
    def newest(self) -> CameraImage | None:
        return self.latest() if may_wait_here() else self._shown

    @property
    @override
    def analysis(self) -> Seen | None:
        self._look("seen", self._camera.watch_seen, self._take_seen)
        return self._seen

    @override
    def latest(self) -> CameraImage | None:
        self._look("shown", self._camera.watch_shown, self._take_shown)
        if "shown" in self._ends and self._came_s > 0.0:
            return self._shown
        if self._camera.away or not may_wait_here():
            return self._shown
        sent = self._camera.sent_latest()
        return sent.received() if sent is not None else None

    @override
    def since(self, since_s: float) -> CameraImage | None:
        newest = self.latest()
        return newest if newest is not None and newest.frame.exposed_s >= since_s else None

    @override
    def next(self, timeout_s: float, since_s: float | None) -> CameraImage:
        forbid_waiting_here("waiting for an image")
        return self._received(self._camera.await_image(since_s), timeout_s)

    @override
    def triggered(self, timeout_s: float) -> CameraImage:
        forbid_waiting_here("waiting for an image")
        # Begun by the camera's station: the clocks of two agree to milliseconds only.
        return self._received(self._camera.await_triggered(), timeout_s)

    def _received(self, wait: ImageWait, timeout_s: float) -> CameraImage:
        try:
            return wait.wait(timeout_s).received()
        except DeviceTimeout:
            self._camera.carry_out(wait.cancel, lambda *_: None)
            camera = self._camera
            reason = camera.problem or ("none arrived" if camera.running else "it is stopped")
            text = f"no image of {camera.name} in {timeout_s:g} s: {reason}"
            raise NotAvailable(text) from None

    @override
    def on_image(self, listener: Callable[[], object]) -> Callable[[], None]:
        return lambda: None  # over a line, who waits for an image looks again and again

    @override
    def wait_closed(self) -> None:
        forbid_waiting_here("waiting for a recording to end")
        until_s, before = WALL.now_s() + CLOSE_S, self._camera.recording
        while (now := self._camera.recording).active:
            if now != before:  # what waits is being written
                until_s, before = WALL.now_s() + CLOSE_S, now
            if WALL.now_s() > until_s:
                text = f"{self._camera.name}: the recording does not end; {now.waiting} wait"
                raise DeviceTimeout(text)
            WALL.sleep(LOOK_S)

    # For whoever follows the station

    def tidy(self) -> None:
        """End what nobody looks at, and ask for an image that did not come; again and again."""
        now_s = WALL.now_s()
        for name, looked_s in list(self._looked.items()):
            if now_s - looked_s > IDLE_S and name in self._ends:
                self._ends.pop(name)()
                if name == "shown":
                    self._came_s = -float("inf")
        newest_id = self._camera.newest_id
        if "shown" not in self._ends or newest_id in (None, self._asked_for):
            return
        last = self._shown
        if now_s - self._came_s < MISSED_S or (
            last is not None and last.frame.frame_id == newest_id
        ):
            return
        self._asked_for = newest_id
        try:
            sent = self._camera.sent_latest()
        except CosmicError:
            return
        if sent is not None:
            self._take_shown(sent)

    def close(self) -> None:
        """Take no more images; any state."""
        self._jobs.request_end()
        self._jobs.join()

    def _look(
        self,
        name: str,
        watch: Callable[[Callable[..., object]], Callable[[], None]],
        take: Callable[..., object],
    ) -> None:
        """Have something sent, from now on for a while."""
        self._looked[name] = WALL.now_s()
        if name not in self._ends:
            self._ends[name] = watch(take)

    def _take_shown(self, sent: SentImage) -> None:
        self._shown, self._came_s = sent.received(), WALL.now_s()

    def _take_seen(self, sent: SentSeen) -> None:
        self._seen = sent.received()
