"""One camera of another station, used as one at home."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final

from typing_extensions import override

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import CosmicError, DeviceTimeout, NotAvailable
from cosmic.frame.network.ongoing import Ongoing
from cosmic.frame.task import Progress, Task
from cosmic.frame.threads import forbid_waiting_here, may_wait_here
from cosmic.vico.api.camera import CameraHandle
from cosmic.vico.api.camera_shown import FormatShown, LinkShown, Seen
from cosmic.vico.api.places import Places
from cosmic.vico.api.remote_application import RemoteVicoApplication
from cosmic.vico.api.remote_pictures import PictureStream
from cosmic.vico.api.remote_stream import Stream
from cosmic.vico.api.station_picture import received, received_seen
from cosmic.vico.api.station_state import CameraState, seen_topic
from cosmic.vico.core.camera_recordings import PictureRecordingState
from cosmic.vico.core.job_thread import JobThread
from cosmic.vico.core.picture import Picture
from cosmic.vico.hw.interface import CameraCounters, CameraInfo, CameraRanges, CameraSettings

CLOSE_S: Final = 30.0
"""How long the end of a recording may make no progress."""
LOOK_S: Final = 0.05


class RemoteCameraHandle(CameraHandle):
    """A camera of another station; any thread. Paths are those of the station's disk."""

    def __init__(self, remote: RemoteVicoApplication, name: str) -> None:
        self._remote, self._calls = remote, remote.calls
        self.name = name
        self._last_known = remote.camera_state(name)
        self._pictures = PictureStream(remote, name)
        self._seen: Stream[Seen] = Stream(
            remote.calls.transport, seen_topic(name), received_seen, remote.open_soon
        )
        remote.keep(self._seen)

    @property
    def _state(self) -> CameraState:
        state = self._remote.state
        found = state.camera(self.name) if state is not None else None
        if found is None:
            return self._last_known.greyed("the station has no such camera any more")
        self._last_known = found
        return found

    # What is in force

    @property
    @override
    def title(self) -> str:
        return self._state.title

    @property
    @override
    def info(self) -> CameraInfo | None:
        return self._state.info

    @property
    @override
    def ranges(self) -> CameraRanges | None:
        return self._state.ranges

    @property
    @override
    def settings(self) -> CameraSettings | None:
        return self._state.settings

    @property
    @override
    def counters(self) -> CameraCounters:
        pulse = self._remote.pulse_of(self.name)
        return pulse.counters if pulse is not None else CameraCounters()

    @property
    @override
    def running(self) -> bool:
        return self._state.running

    @property
    @override
    def problem(self) -> str:
        return self._state.problem

    @property
    @override
    def refused(self) -> str:
        return self._remote.refused(self.name)

    # Pictures

    @property
    def live(self) -> bool:
        """Its pictures are being sent, because somebody looks."""
        return self._pictures.live

    @override
    def latest(self) -> Picture | None:
        newest = self._pictures.newest()
        if self._pictures.live or self._remote.problem or not may_wait_here():
            return newest
        return received(self._calls.call("latest", camera=self.name))

    @override
    def next_picture(self, timeout_s: float = 5.0, since_s: float | None = None) -> Picture:
        forbid_waiting_here("waiting for a picture")
        wait = self._calls.call("next_picture", camera=self.name, since_s=since_s)
        if not isinstance(wait, Ongoing):
            raise NotAvailable(f"no picture of {self.name}: the station does not know how")
        try:
            picture = received(wait.wait(timeout_s))
        except DeviceTimeout:
            self._calls.later(wait.cancel)
            reason = self.problem or ("none arrived" if self.running else "it is stopped")
            text = f"no picture of {self.name} in {timeout_s:g} s: {reason}"
            raise NotAvailable(text) from None
        if picture is None:
            raise NotAvailable(f"no picture of {self.name}: something else came")
        return picture

    @override
    def picture_since(self, since_s: float) -> Picture | None:
        newest = self.latest()
        return newest if newest is not None and newest.frame.exposed_s >= since_s else None

    @override
    def on_picture(self, listener: Callable[[], object]) -> Callable[[], None]:
        return lambda: None  # over a line, who waits for a picture looks again and again

    @property
    @override
    def focus(self) -> float | None:
        pulse = self._remote.pulse_of(self.name)
        return pulse.focus if pulse is not None else None

    @property
    @override
    def has_background(self) -> bool:
        return self._state.has_background

    @override
    def set_background(self) -> None:
        self._do("set_background")

    @override
    def clear_background(self) -> None:
        self._do("clear_background")

    # Commands

    @override
    def configure(self, settings: CameraSettings) -> Task:
        return self._begin(f"Settings of {self.name}", "configure", settings=settings)

    @override
    def start(self) -> Task:
        return self._told(self._begin(f"Starting {self.name}", "start"))

    @override
    def stop(self, success: bool = True) -> Task:
        return self._told(self._begin(f"Stopping {self.name}", "stop"))

    @override
    def software_trigger(self) -> None:
        self._do("software_trigger")

    def _do(self, function: str, **arguments: object) -> None:
        self._remote.note_refusal(self.name, "")
        self._calls.do(function, refused=self._on_refused, camera=self.name, **arguments)

    def _begin(self, title: str, function: str, **arguments: object) -> Task:
        self._remote.note_refusal(self.name, "")
        return self._calls.begin(title, function, camera=self.name, **arguments)

    def _told(self, task: Task) -> Task:
        """Tell how a task failed that no widget follows."""

        def on_progress(progress: Progress) -> None:
            if progress.done and progress.error:
                self._remote.note_refusal(self.name, progress.error)

        task.subscribe(on_progress)
        return task

    def _on_refused(self, error: CosmicError) -> None:
        self._remote.note_refusal(self.name, str(error))

    # Machine vision

    @property
    @override
    def algorithms(self) -> Sequence[LinkShown]:
        return self._state.links

    @override
    def switch(self, algorithm: str, *, on: bool) -> None:
        self._do("switch", algorithm=algorithm, on=on)

    @property
    @override
    def analysis(self) -> Seen | None:
        return self._seen.newest() if any(each.on for each in self._state.links) else None

    # Files, on the station's disk

    @property
    @override
    def elsewhere(self) -> str:
        return "The files are written on the station's disk"

    @property
    @override
    def directory(self) -> Path:
        state = self._remote.state
        return Path(state.directory if state is not None else "")

    @property
    @override
    def formats(self) -> Sequence[FormatShown]:
        return self._state.formats

    @property
    @override
    def recording(self) -> PictureRecordingState:
        return self._state.recording.received()

    @override
    def room_s(self, directory: Path, format_name: str) -> float | None:
        return None  # nobody knows how full a disk elsewhere is

    @override
    def snap(self, path: Path, *, overwrite: bool = False) -> Task:
        return self._begin(f"Saving {path.name}", "snap", path=str(path), overwrite=overwrite)

    @override
    def record(
        self, path: Path | str, format_name: str = "ffv1", *, overwrite: bool = False
    ) -> None:
        self._do("record", path=str(path), format_name=format_name, overwrite=overwrite)

    @override
    def stop_recording(self, *, wait: bool = False) -> None:
        self._do("stop_recording")
        if not wait:
            return
        forbid_waiting_here("waiting for a recording to end")
        until_s, before = WALL.now_s() + CLOSE_S, self.recording
        while (now := self.recording).active:
            if now != before:  # what waits is being written
                until_s, before = WALL.now_s() + CLOSE_S, now
            if WALL.now_s() > until_s:
                raise DeviceTimeout(f"{self.name}: the recording does not end; {now.waiting} wait")
            WALL.sleep(LOOK_S)
            self._remote.refresh()

    @override
    def time_lapse(
        self,
        path: Path,
        format_name: str = "tiff",
        *,
        interval_s: float,
        count: int,
        overwrite: bool = False,
    ) -> Task:
        return self._begin(
            "Time-lapse",
            "time_lapse",
            path=str(path),
            format_name=format_name,
            interval_s=interval_s,
            count=count,
            overwrite=overwrite,
        )

    # For its shape and its places

    @property
    @override
    def _newest(self) -> Picture | None:
        return self.latest() if may_wait_here() else self._pictures.last

    @property
    @override
    def _places(self) -> Places | None:
        return self._remote.places

    @property
    @override
    def _clock(self) -> Clock:
        return self._remote.clock

    @property
    @override
    def _jobs(self) -> JobThread:
        return self._remote.jobs(self.name)

    @property
    @override
    def _axes(self) -> Mapping[str, str]:
        return self._state.axes
