"""Waiting for the next image on behalf of another station, without keeping any thread."""

from cosmic.frame.errors import MoveCancelled
from cosmic.frame.operation import Operation
from cosmic.vico.api.places import Places
from cosmic.vico.api.sent_image import SentImage
from cosmic.vico.core.camera_thread import CameraThread
from cosmic.vico.core.image import CameraImage
from cosmic.vico.hw.interface import FrameStatus


class ImageWait(Operation[SentImage]):
    """Ends with the first whole image exposed from `since_s` of platform time on; any thread."""

    def __init__(self, thread: CameraThread, since_s: float, places: Places | None) -> None:
        super().__init__(f"next image of {thread.camera_name}")
        self._since_s = since_s
        self._places = places
        unsubscribe = thread.subscribe(self._on_image)
        self.add_callback(lambda _ended: unsubscribe())
        self.on_cancel(self._give_up)
        newest = thread.last
        if newest is not None:
            self._on_image(newest)

    def _give_up(self) -> None:
        self.fail(MoveCancelled(f"{self.title}: nobody waits for it any more"))

    def _on_image(self, image: CameraImage) -> None:
        frame = image.frame
        if self.done or frame.status is not FrameStatus.COMPLETE:
            return
        if frame.exposed_s >= self._since_s:
            self.finish(SentImage.of(image, self._places))
