"""Waiting for the next picture on behalf of another station, without keeping any thread."""

from collections.abc import Callable
from threading import Condition

from cosmic.frame.errors import DeviceTimeout, MoveCancelled
from cosmic.frame.listeners import tell
from cosmic.frame.threads import forbid_waiting_here
from cosmic.vico.api.places import Places
from cosmic.vico.api.station_picture import SentPicture
from cosmic.vico.core.camera_thread import CameraThread
from cosmic.vico.core.picture import Picture
from cosmic.vico.hw.interface import FrameStatus


class PictureWait:
    """Ends with the first whole picture exposed from `since_s` of platform time on; any thread."""

    def __init__(self, thread: CameraThread, since_s: float, places: Places | None) -> None:
        self.title = f"next picture of {thread.camera_name}"
        self._since_s = since_s
        self._places = places
        self._changed = Condition()
        self._picture: SentPicture | None = None
        self._over = False
        self._callbacks: list[Callable[[PictureWait], None]] = []
        with self._changed:  # a picture that comes at once waits until this is known
            self._unsubscribe = thread.subscribe(self._on_picture)
        newest = thread.newest
        if newest is not None:
            self._on_picture(newest)

    @property
    def done(self) -> bool:
        """True when the picture is there, or nobody waits for it any more."""
        return self._over

    def wait(self, timeout_s: float | None = None) -> SentPicture:
        """Return the picture.

        Raises
        ------
        DeviceTimeout
            There was none after `timeout_s`.
        MoveCancelled
            It was cancelled.
        """
        if not self._over:
            forbid_waiting_here("waiting for a picture")
        with self._changed:
            if not self._changed.wait_for(lambda: self._over, timeout_s):
                raise DeviceTimeout(f"{self.title}: none after {timeout_s:g} s")
        if self._picture is None:
            raise MoveCancelled(f"{self.title}: nobody waits for it any more")
        return self._picture

    def cancel(self) -> None:
        """Wait no longer."""
        self._end(None)

    def add_callback(self, callback: "Callable[[PictureWait], None]") -> None:
        """Call `callback(self)` at the end, or now if it has ended."""
        with self._changed:
            if not self._over:
                self._callbacks.append(callback)
                return
        tell([callback], self)

    def _on_picture(self, picture: Picture) -> None:
        frame = picture.frame
        if self._over or frame.status is not FrameStatus.COMPLETE:
            return
        if frame.exposed_s >= self._since_s:
            self._end(SentPicture.of(picture, self._places))

    def _end(self, picture: SentPicture | None) -> None:
        with self._changed:
            if self._over:
                return
            self._picture, self._over = picture, True
            callbacks, self._callbacks = self._callbacks, []
            self._changed.notify_all()
        self._unsubscribe()
        tell(callbacks, self)
