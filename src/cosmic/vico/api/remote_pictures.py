"""The live pictures of a camera of another station."""

from typing import Final

from cosmic.vico.api.remote_application import RemoteVicoApplication
from cosmic.vico.api.remote_stream import Stream
from cosmic.vico.api.station_picture import ReceivedPicture, received
from cosmic.vico.api.station_state import CameraPulse, shown_topic

MISSED_S: Final = 0.3
"""Silence after which a picture that the station has did not come."""


class PictureStream(Stream[ReceivedPicture]):
    """The newest picture, also where a full line dropped it and no other follows; any thread."""

    def __init__(self, remote: RemoteVicoApplication, camera: str) -> None:
        super().__init__(remote.calls.transport, shown_topic(camera), received, remote.open_soon)
        self._calls, self._camera = remote.calls, camera
        self._asked_for: int | None = None
        remote.keep(self)
        remote.on_pulse(camera, self._on_pulse)

    def _on_pulse(self, pulse: CameraPulse) -> None:
        """Ask for the newest picture where it did not come."""
        newest_id, last = pulse.newest_id, self.last
        if not self.wanted or self.silent_s < MISSED_S or newest_id in (None, self._asked_for):
            return
        if last is None or last.frame.frame_id != newest_id:
            self._asked_for = newest_id
            self._calls.later(lambda: self.take(self._calls.call("latest", camera=self._camera)))
