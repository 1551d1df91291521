"""ViCo on another station, usable where a `VicoApplication` is."""

import logging
from collections.abc import Callable, Sequence
from threading import Condition
from typing import Any, Final

from PySide6.QtCore import QObject
from typing_extensions import override

from cosmic.frame.application import CosmicApplicationBase, GuiFactory
from cosmic.frame.errors import ConfigError, CosmicError, NotAvailable
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.listeners import tell
from cosmic.frame.network.transport import Presence, Rule, Subscription, Transport
from cosmic.frame.task import Task
from cosmic.vico.api.places import Places
from cosmic.vico.api.remote_calls import RemoteCalls, StationClock
from cosmic.vico.api.remote_places import RemotePlaces
from cosmic.vico.api.remote_stream import Stream
from cosmic.vico.api.station_state import PULSE, STATE, CameraPulse, CameraState, VicoState
from cosmic.vico.core.job_thread import JobThread
from cosmic.vico.core.zoom_scale import ZoomScale
from cosmic.vico.hw.interface import CameraInfo

logger = logging.getLogger(__name__)

LOOK_S: Final = 0.5
"""Wall time between two looks for streams that nobody looks at."""


class RemoteVicoApplication(CosmicApplicationBase):
    """Mirrors the ViCo of a station and hands commands on to it; any thread.

    What is known is kept here, so that no read goes over the line. While the station is away,
    everything says so, and it comes back by itself. The transport stays whose it is.

    Parameters
    ----------
    transport : Transport
        To the station that hosts a `VicoStationSide` as "vico".
    """

    def __init__(
        self,
        transport: Transport,
        policy: FailurePolicy,
        gui_factory: GuiFactory | None = None,
        parent: QObject | None = None,
    ) -> None:
        super().__init__("ViCo", policy, gui_factory, parent)
        self.policy = policy
        self.calls = RemoteCalls(transport, policy, self.refresh)
        self.clock = StationClock(self.calls, self._rate)
        self._transport = transport
        self._places = RemotePlaces(self)
        self._changed = Condition()
        self._known: VicoState | None = None
        self._shown: VicoState | None = None
        self._away = "not connected yet"
        self._here = False
        self._pulses: dict[str, CameraPulse] = {}
        self._pulse_listeners: dict[str, Callable[[CameraPulse], object]] = {}
        self._streams: list[Stream[Any]] = []
        self._subscriptions: list[Subscription] = []
        self._forget: Callable[[], None] | None = None
        self._refused: dict[str, str] = {}
        self._jobs: dict[str, JobThread] = {}

    # Starting and ending

    @override
    def initialize(self) -> None:
        """Begin to follow the station; nothing is waited for."""
        self.start()
        self.calls.start()
        self._subscriptions = [
            self._transport.subscribe(STATE, Rule.LATEST, self._on_state),
            self._transport.subscribe(PULSE, Rule.LATEST, self._on_pulse),
        ]
        self._forget = self._transport.presence(self._on_presence)

    @override
    def shut_down(self) -> None:
        """Follow it no longer; what goes on there goes on. Any state."""
        forget, self._forget = self._forget, None
        if forget is not None:
            forget()
        self.request_end()
        for job in self._jobs.values():
            job.request_end()
        self.calls.close()
        subscriptions, self._subscriptions = self._subscriptions, []
        for each in subscriptions:
            each.close()
        for stream in self._streams:
            stream.close()
        for job in self._jobs.values():
            job.join()
        self.join()

    def wait_until_known(self, timeout_s: float) -> bool:
        """Wait until it is known what the station has; False when it was not in time."""
        with self._changed:
            return self._changed.wait_for(
                lambda: self._known is not None and not self._away, timeout_s
            )

    @override
    def custom_event_loop(self) -> bool:
        while not self.end_requested:
            self._end_requested.wait(LOOK_S)
            for stream in list(self._streams):
                stream.close_if_idle()
            if self._away and self._here:
                self.calls.later(self._catch_up)
        return True

    # What is known

    @property
    def state(self) -> VicoState | None:
        """What is known now, greyed while the station is away; None before the first contact."""
        return self._shown

    @property
    def problem(self) -> str:
        """Why the station cannot be used; empty when all is well."""
        return self._away

    @property
    def cameras(self) -> Sequence[str]:
        """Names of the cameras, in the order of the platform file there."""
        state = self._shown
        return tuple(each.name for each in state.cameras) if state is not None else ()

    @property
    def first_camera(self) -> str:
        """Name of the camera that is meant where none is named; raises `NotAvailable`."""
        for name in self.cameras:
            return name
        raise NotAvailable(self._away or "the station has no camera")

    @property
    def found(self) -> tuple[CameraInfo, ...]:
        """Every camera there was at the last look for them."""
        state = self._shown
        return state.found if state is not None else ()

    @property
    def places(self) -> Places:
        """What joins pixels and platform, as far as the station does."""
        return self._places

    @property
    def has_lens(self) -> bool:
        """The platform there has a motorised lens."""
        state = self._shown
        return state is not None and state.lens

    @property
    def has_light(self) -> bool:
        """The platform there has a lamp that can be dimmed."""
        state = self._shown
        return state is not None and state.light

    @property
    def zoom_scale(self) -> ZoomScale:
        """Magnification and um per pixel for each position of the zoom."""
        state = self._shown
        return ZoomScale(state.zoom_points if state is not None else ())

    def camera_state(self, name: str) -> CameraState:
        """Return what is known of a camera; raises `ConfigError` where there is none."""
        state = self._shown
        found = state.camera(name) if state is not None else None
        if found is None:
            known = ", ".join(self.cameras) or self._away or "none"
            raise ConfigError(f"there is no camera {name!r}; the station has: {known}")
        return found

    def pulse_of(self, camera: str) -> CameraPulse | None:
        """Return what was last heard of counters and focus."""
        return self._pulses.get(camera)

    def on_pulse(self, camera: str, listener: Callable[[CameraPulse], object]) -> None:
        """Call `listener(pulse)` with what is heard of a camera, in the thread that receives."""
        self._pulse_listeners[camera] = listener

    # Commands

    def rescan(self) -> Task:
        """Begin to look for cameras."""
        return self.calls.begin("Looking for cameras", "rescan")

    def use(self, camera: str, key: str) -> Task:
        """Begin to take the pictures of `camera` with the one of that key."""
        return self.calls.begin(f"{camera}: {key}", "use", camera=camera, key=key)

    def refresh(self) -> None:
        """Ask the station how things stand; raises as `Transport.call`."""
        self._on_state(self.calls.call("state"))

    def keep(self, stream: Stream[Any]) -> None:
        """Have a stream closed while nobody looks at it."""
        self._streams.append(stream)

    def open_soon(self, stream: Stream[Any]) -> None:
        """Have a stream opened in a thread that may wait."""
        self.calls.later(stream.open)

    def note_refusal(self, camera: str, text: str) -> None:
        """Note why a wish of a camera's view was not granted; empty with the next wish."""
        if text:
            logger.warning("%s at another station: %s", camera, text)
        if text != self._refused.get(camera, ""):
            self._refused[camera] = text
            self.status_changed.emit()

    def refused(self, camera: str) -> str:
        """Return why the last wish of a camera's view was not granted; or empty."""
        return self._refused.get(camera, "")

    def jobs(self, camera: str) -> JobThread:
        """Return the thread in which plans take their pictures."""
        if camera not in self._jobs:
            self._jobs[camera] = JobThread(f"pictures of {camera}", self.policy)
        return self._jobs[camera]

    # What comes in

    def _on_presence(self, presence: Presence) -> None:
        self._here = presence.here
        if presence.here:
            self.calls.later(self._catch_up)
            return
        self._away = f"{presence.name} is away: {presence.why}"
        self._show()

    def _catch_up(self) -> None:
        try:
            self.refresh()
        except CosmicError as exc:
            if self._away != str(exc):
                self._away = str(exc)
                self._show()
            return
        if self._here:
            with self._changed:
                self._away = ""
                self._changed.notify_all()
            self._show()

    def _on_state(self, state: object) -> None:
        if not isinstance(state, VicoState):
            return
        with self._changed:
            if self._known is not None and self._known.number >= state.number:
                return
            self._known = state
            self._changed.notify_all()
        self._show()

    def _on_pulse(self, pulses: object) -> None:
        for pulse in pulses if isinstance(pulses, tuple) else ():
            if isinstance(pulse, CameraPulse):
                self._pulses[pulse.name] = pulse
                if pulse.name in self._pulse_listeners:
                    tell([self._pulse_listeners[pulse.name]], pulse)

    def _show(self) -> None:
        with self._changed:
            known, away, before = self._known, self._away, self._shown
            if known is not None:
                now = self._shown = known.greyed(away) if away else known
                if before is not None and now.says_the_same_as(before):
                    return
        self.status_changed.emit()

    def _rate(self) -> float:
        state = self._shown
        return state.clock_rate if state is not None else 1.0
