"""ViCo as a station offers it to others: flat functions whose arguments are checked."""

from pathlib import Path
from typing import Final

from cosmic.frame.errors import NotAvailable
from cosmic.frame.network.remote import remote
from cosmic.frame.network.station import Station
from cosmic.frame.task import Task
from cosmic.vico.api.application import VicoApplication
from cosmic.vico.api.lens import LensHandle, LightHandle
from cosmic.vico.api.station_feed import StateReader, VicoFeed
from cosmic.vico.api.station_picture import SentPicture, same_place
from cosmic.vico.api.station_state import VicoState
from cosmic.vico.api.station_wait import PictureWait
from cosmic.vico.hw.interface import CameraSettings

WITHIN_UM: Final = 2.0
"""How far two maps may differ for a click still to mean the same place."""


class VicoStationSide:
    """Hosted as "vico" on a `Station`; the other end is a `RemoteVicoApplication`.

    Paths are those of this station's disk. What moves the lens or a tool needs the lease.
    """

    def __init__(self, application: VicoApplication) -> None:
        self._application = application
        self._reader = StateReader(application)
        self._lens, self._light = LensHandle(application), LightHandle(application)
        self._feeds: list[VicoFeed] = []

    def on_hosted(self, station: Station) -> None:
        """Publish pictures and state on this station from now on; `close` ends it."""
        feed = VicoFeed(self._application, self._reader, station)
        feed.start()
        self._feeds.append(feed)

    def close(self) -> None:
        """Publish nothing any more; harmless the second time. Before the application ends."""
        while self._feeds:
            self._feeds.pop().close()

    # What there is

    @remote(reads=True)
    def state(self) -> VicoState:
        """Return what there is to know, but counters."""
        return self._reader.state()

    @remote(reads=True)
    def now_s(self) -> float:
        """Return the platform's time."""
        return self._application.clock.now_s()

    @remote(reads=True)
    def latest(self, camera: str) -> SentPicture | None:
        """Return the newest whole picture, background corrected; None before the first."""
        newest = self._reader.handle(camera).latest()
        return None if newest is None else SentPicture.of(newest, self._application.places)

    @remote(reads=True)
    def next_picture(self, camera: str, since_s: float | None = None) -> PictureWait:
        """Begin to wait for a whole picture exposed from `since_s` on; None is now."""
        application = self._application
        since = application.clock.now_s() if since_s is None else since_s
        return PictureWait(application.unit(camera).thread, since, application.places)

    # Cameras

    @remote
    def rescan(self) -> Task:
        """Begin to look for cameras."""
        return self._application.rescan()

    @remote
    def use(self, camera: str, key: str) -> None:
        """Take the pictures of `camera` with the one of that key."""
        self._application.unit(camera).use(key)

    @remote
    def configure(self, camera: str, settings: CameraSettings) -> Task:
        """Begin to put settings in force."""
        return self._reader.handle(camera).configure(settings)

    @remote
    def start(self, camera: str) -> Task:
        """Begin to take pictures."""
        return self._reader.handle(camera).start()

    @remote
    def stop(self, camera: str) -> Task:
        """End taking pictures; a recording is closed."""
        return self._reader.handle(camera).stop()

    @remote
    def software_trigger(self, camera: str) -> None:
        """Take one picture, with the software trigger."""
        self._reader.handle(camera).software_trigger()

    @remote
    def set_background(self, camera: str) -> None:
        """Correct pictures by the mean of the next few."""
        self._reader.handle(camera).set_background()

    @remote
    def clear_background(self, camera: str) -> None:
        """Show pictures as they come."""
        self._reader.handle(camera).clear_background()

    @remote
    def switch(self, camera: str, algorithm: str, on: bool) -> None:
        """Have an algorithm run on the pictures, or not."""
        self._reader.handle(camera).switch(algorithm, on=on)

    # Files on this station's disk

    @remote
    def snap(self, camera: str, path: str, overwrite: bool = False) -> Task:
        """Begin to write the newest picture."""
        return self._reader.handle(camera).snap(self._on_disk(path), overwrite=overwrite)

    @remote
    def record(self, camera: str, path: str, format_name: str, overwrite: bool = False) -> None:
        """Begin to record."""
        self._reader.handle(camera).record(self._on_disk(path), format_name, overwrite=overwrite)

    @remote
    def stop_recording(self, camera: str) -> None:
        """Ask for the file to be closed."""
        self._reader.handle(camera).stop_recording()

    @remote
    def time_lapse(
        self,
        camera: str,
        path: str,
        format_name: str,
        interval_s: float,
        count: int,
        overwrite: bool = False,
    ) -> Task:
        """Begin to record one picture each `interval_s`."""
        return self._reader.handle(camera).time_lapse(
            self._on_disk(path),
            format_name,
            interval_s=interval_s,
            count=count,
            overwrite=overwrite,
        )

    # Lens and light

    @remote(moves=True)
    def home(self) -> Task:
        """Begin to run both motors to where counting begins."""
        return self._lens.home()

    @remote(moves=True)
    def zoom_to(self, zoom: float) -> Task:
        """Begin to zoom."""
        return self._lens.zoom_to(zoom)

    @remote(moves=True)
    def seek_focus(self, target_counts: int) -> Task:
        """Begin to focus there."""
        return self._lens.seek_focus(target_counts)

    @remote(moves=True)
    def autofocus(self, camera: str = "") -> Task:
        """Begin to look for the sharpest picture."""
        return self._lens.autofocus(camera)

    @remote(at_once=True)
    def abort(self) -> None:
        """Stop both motors and whatever moves them."""
        self._lens.abort()

    @remote
    def reopen(self) -> Task:
        """Begin to connect again what was lost."""
        return self._lens.reopen()

    @remote
    def set_percent(self, percent: float) -> Task:
        """Begin to make the light so bright."""
        return self._light.set_percent(percent)

    # Places

    @remote(moves=True)
    def calibrate_stage(self, camera: str, tool: str) -> Task:
        """Begin to measure a map from platform to picture by moving a tool."""
        return self._reader.handle(camera).calibrate_stage(tool)

    @remote(moves=True)
    def find_rotation_centre(self, camera: str) -> Task:
        """Begin to measure about which place the plate turns."""
        return self._reader.handle(camera).find_rotation_centre()

    @remote(moves=True)
    def click_to_move(
        self, camera: str, place_px: tuple[float, float], place_um: tuple[float, float], what: str
    ) -> str:
        """Begin to move `what` to a pixel of the newest picture, which must lie at `place_um`."""
        handle = self._reader.handle(camera)
        there_um = handle.platform_um(place_px)
        if there_um is None:
            raise NotAvailable(handle.calibration_problem)
        if not same_place(there_um, place_um, WITHIN_UM):
            raise NotAvailable("the picture has changed since the click; click again")
        return handle.click_to_move(place_px, what)

    def _on_disk(self, path: str) -> Path:
        """Return a path on this disk; one without a root begins where pictures go."""
        return self._application.directory / Path(path).expanduser()
