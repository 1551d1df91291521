"""Publishes what ViCo sees and how it stands; nothing is drawn or sent that nobody receives."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from threading import Condition, Lock
from typing import Final

from PySide6.QtCore import Qt
from typing_extensions import override

from cosmic.frame.clock import WALL
from cosmic.frame.network.delivery import Backlog, InboxReader
from cosmic.frame.network.station import Station
from cosmic.frame.network.transport import Presence, Rule
from cosmic.frame.plan_shape import unix_now_s
from cosmic.frame.threads import WorkerThread
from cosmic.vico.api.application import VicoApplication
from cosmic.vico.api.camera import CameraHandle
from cosmic.vico.api.camera_shown import Seen
from cosmic.vico.api.station_picture import SentPicture, SentSeen
from cosmic.vico.api.station_state import (
    PULSE,
    STATE,
    CameraPulse,
    CameraState,
    SentRecording,
    VicoState,
    pictures_topic,
    seen_topic,
    shown_topic,
)
from cosmic.vico.core.camera_unit import CameraUnit
from cosmic.vico.core.picture import Picture
from cosmic.vico.core.vision.chain import Analysis
from cosmic.vico.hw.interface import FrameStatus

PULSE_S: Final = 0.2
"""Wall time between two publications of what changes with every picture."""
LEAST_S: Final = 0.04
"""Wall time between two states."""


class StateReader:
    """Gathers what there is to know; any thread."""

    def __init__(self, application: VicoApplication) -> None:
        self._application = application
        self._handles = {name: CameraHandle(application, name) for name in application.units}
        self._lock = Lock()
        self._number = round(unix_now_s() * 1e6)  # larger than before a restart

    def handle(self, camera: str) -> CameraHandle:
        """Return a camera; raises `ConfigError` where there is none of that name."""
        self._application.unit(camera)
        return self._handles[camera]

    def state(self) -> VicoState:
        """Return what there is to know but counters, numbered."""
        application = self._application
        peripherals, places = application.peripherals, application.places
        with self._lock:  # a larger number is never an older state
            self._number += 1
            return VicoState(
                number=self._number,
                clock_rate=application.clock.rate,
                directory=str(application.directory),
                cameras=tuple(self._camera(name) for name in application.units),
                found=tuple(application.found),
                lens=application.has_lens,
                light=application.has_light,
                lens_name=peripherals.lens_name,
                light_name=peripherals.light_name,
                zoom_points=application.zoom_scale.points,
                peripherals=peripherals.state,
                tools=tuple(places.targets) if places is not None else (),
                calibrated=tuple(places.calibrated) if places is not None else (),
            )

    def pulse(self, camera: str, newest_id: int | None) -> CameraPulse:
        """Return what changes with every picture of a camera."""
        handle = self._handles[camera]
        return CameraPulse(camera, handle.counters, handle.focus, newest_id)

    def _camera(self, name: str) -> CameraState:
        handle, places = self._handles[name], self._application.places
        unit = self._application.unit(name)
        return CameraState(
            name=name,
            title=handle.title,
            behind_lens=unit.place.behind_lens,
            info=handle.info,
            ranges=handle.ranges,
            settings=handle.settings,
            running=handle.running,
            problem=handle.problem,
            has_background=handle.has_background,
            links=tuple(handle.algorithms),
            formats=tuple(replace(each, name=str(each.name)) for each in handle.formats),
            recording=SentRecording.of(handle.recording),
            axes=dict(unit.recordings.axes),
            rotation=places.rotation_centre(name) if places is not None else None,
        )


class CameraFeed:
    """The pictures of one camera, and what is seen on them, to the topics of a station.

    Attributes
    ----------
    newest_id : int or None
        Number of the newest whole frame.
    """

    def __init__(self, application: VicoApplication, unit: CameraUnit, station: Station) -> None:
        self._application, self._unit, self._station = application, unit, station
        name = self.name = unit.place.name
        self.newest_id: int | None = None
        self._pictures, self._shown = pictures_topic(name), shown_topic(name)
        self._seen = seen_topic(name)
        self._newest: Backlog[Picture] = Backlog(Rule.LATEST)
        self._viewing = InboxReader(f"view of {name}", station.policy, self._newest, self._view)
        self._over = False

    def start(self) -> None:
        """Begin."""
        self._viewing.start()
        self._unsubscribe = self._unit.thread.subscribe(self._on_picture)
        self._unit.vision.subscribe(self._on_analysis, self._analysis_wanted)

    def close(self) -> None:
        """End."""
        self._over = True
        self._unsubscribe()
        self._viewing.request_end()
        self._viewing.join()

    def prepare(self) -> None:
        """Publish nothing, so that it is known from then on who receives."""
        for topic in (self._pictures, self._shown, self._seen):
            self._station.publish(topic, None)

    def _on_picture(self, picture: Picture) -> None:
        """Hand on every frame, in the camera's thread, and so in order."""
        if self._station.wanted(self._pictures):
            sent = SentPicture.of(picture, self._application.places)
            self._station.publish(self._pictures, sent)
        if picture.frame.status is not FrameStatus.COMPLETE:
            return
        self.newest_id = int(picture.frame.frame_id)
        if self._station.wanted(self._shown):
            self._newest.put(picture)

    def _view(self, picture: Picture) -> None:
        shown = self._unit.corrected(picture)
        self._station.publish(self._shown, SentPicture.of(shown, self._application.places))

    def _on_analysis(self, newest: Analysis) -> None:
        self._station.publish(self._seen, SentSeen.of(Seen.of(newest)))

    def _analysis_wanted(self) -> bool:
        return not self._over and self._station.wanted(self._seen)


class StateFeed(WorkerThread):
    """Publishes state when it changed, and counters now and then, in a thread of its own."""

    def __init__(
        self,
        application: VicoApplication,
        reader: StateReader,
        cameras: Sequence[CameraFeed],
        station: Station,
    ) -> None:
        super().__init__("state of ViCo", station.policy)
        self._reader, self._cameras, self._station = reader, cameras, station
        self._changed = Condition()
        self._woken = False
        direct = Qt.ConnectionType.DirectConnection
        application.status_changed.connect(self.wake, direct)

    def wake(self) -> None:
        """Have it look at once; any thread."""
        with self._changed:
            self._woken = True
            self._changed.notify_all()

    @override
    def run_body(self) -> None:
        last: VicoState | None = None
        pulsed_s = -PULSE_S
        while not self.end_requested:
            last = self._tell(last) if self._station.wanted(STATE) else None
            if WALL.now_s() - pulsed_s >= PULSE_S and self._station.wanted(PULSE):
                pulsed_s = WALL.now_s()
                read = self._reader.pulse
                pulses = tuple(read(each.name, each.newest_id) for each in self._cameras)
                self._station.publish(PULSE, pulses)
            self._rest()

    def _tell(self, last: VicoState | None) -> VicoState:
        now = self._reader.state()
        if last is not None and now.says_the_same_as(last):
            return last
        self._station.publish(STATE, now)
        return now

    def _rest(self) -> None:
        self._end_requested.wait(LEAST_S)
        with self._changed:
            self._changed.wait_for(lambda: self._woken, PULSE_S - LEAST_S)
            self._woken = False

    @override
    def request_end(self) -> None:
        super().request_end()
        self.wake()


class VicoFeed:
    """All that ViCo publishes on one station."""

    def __init__(self, application: VicoApplication, reader: StateReader, station: Station) -> None:
        self._station = station
        self._cameras = [
            CameraFeed(application, unit, station) for unit in application.units.values()
        ]
        self._state = StateFeed(application, reader, self._cameras, station)
        self._forget: Callable[[], None] = _nothing

    def start(self) -> None:
        """Begin."""
        for each in self._cameras:
            each.start()
        self._state.start()
        self._forget = self._station.presence(self._on_client)

    def close(self) -> None:
        """End; nothing is published any more."""
        self._forget()
        self._state.request_end()
        self._state.join()
        for each in self._cameras:
            each.close()

    def _on_client(self, client: Presence) -> None:
        if client.here:
            for topic in (STATE, PULSE):
                self._station.publish(topic, None)
            for each in self._cameras:
                each.prepare()


def _nothing() -> None:
    """Do nothing."""
