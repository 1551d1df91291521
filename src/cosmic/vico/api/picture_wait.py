"""Waiting for the next picture on behalf of another station, without keeping any thread."""

from cosmic.frame.errors import MoveCancelled
from cosmic.frame.operation import Operation
from cosmic.vico.api.places import Places
from cosmic.vico.api.sent_picture import SentPicture
from cosmic.vico.core.camera_thread import CameraThread
from cosmic.vico.core.picture import Picture
from cosmic.vico.hw.interface import FrameStatus


class PictureWait(Operation[SentPicture]):
    """Ends with the first whole picture exposed from `since_s` of platform time on; any thread."""

    def __init__(self, thread: CameraThread, since_s: float, places: Places | None) -> None:
        super().__init__(f"next picture of {thread.camera_name}")
        self._since_s = since_s
        self._places = places
        unsubscribe = thread.subscribe(self._on_picture)
        self.add_callback(lambda _ended: unsubscribe())
        self.on_cancel(self._give_up)
        newest = thread.last
        if newest is not None:
            self._on_picture(newest)

    def _give_up(self) -> None:
        self.fail(MoveCancelled(f"{self.title}: nobody waits for it any more"))

    def _on_picture(self, picture: Picture) -> None:
        frame = picture.frame
        if self.done or frame.status is not FrameStatus.COMPLETE:
            return
        if frame.exposed_s >= self._since_s:
            self.finish(SentPicture.of(picture, self._places))
