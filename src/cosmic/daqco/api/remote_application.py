"""DAQCo at another station, used as if the boards were here."""

import logging
from collections.abc import Callable, Mapping
from threading import Event
from typing import Final, TypeVar

from PySide6.QtCore import QObject
from typing_extensions import override

from cosmic.daqco.api.errands import Errands, Told
from cosmic.daqco.api.remote_buffer import RemoteBuffer
from cosmic.daqco.api.remote_clock import Reading, StationClock
from cosmic.daqco.api.remote_files import RemoteFiles
from cosmic.daqco.api.remote_guard import RemoteGuard
from cosmic.daqco.api.remote_line import DaqcoLine
from cosmic.daqco.api.remote_recorder import RemoteRecorder
from cosmic.daqco.api.remote_view import StationView
from cosmic.daqco.api.station_report import (
    CROSSINGS,
    FAILURES,
    HOSTED_AS,
    REPORTS,
    DaqReport,
    plain_settings,
)
from cosmic.daqco.core.limits import Crossing
from cosmic.daqco.core.scale import Scale
from cosmic.daqco.core.settings import DaqcoSettings
from cosmic.frame.application import GuiFactory
from cosmic.frame.clock import WALL
from cosmic.frame.errors import CosmicError, ProtocolError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.transport import Presence, Rule, Subscription, Transport
from cosmic.frame.task import Task
from cosmic.frame.threads import WorkerThread

logger = logging.getLogger(__name__)
T = TypeVar("T")

FIRST_REPORT_S: Final = 5.0
FIRST_DATA_S: Final = 1.0
RETRY_S: Final = 0.5
_LOOK_S: Final = 0.05
_CLOCK_S: Final = 20.0
_READINGS: Final = 5


class Keeper(WorkerThread):
    """Calls `look` again and again."""

    def __init__(self, look: Callable[[], None], policy: FailurePolicy) -> None:
        super().__init__("DAQCo elsewhere", policy)
        self._look = look

    @override
    def run_body(self) -> None:
        while not self._end_requested.wait(_LOOK_S):
            self._look()


class RemoteDaqcoApplication(StationView):
    """Stands where a `DaqcoApplication` does, over a transport; any thread.

    Everything that is read is known here already, as the station last told; every command goes
    there and returns when it was carried out. While the station is away, `away` says why,
    commands raise `StationAway`, and everything goes on by itself when it is back.

    Parameters
    ----------
    transport : Transport
        To the station with the boards; whoever made it closes it, after `shut_down`.
    name : str
        Under which DAQCo is hosted there.
    """

    def __init__(
        self,
        transport: Transport,
        policy: FailurePolicy,
        *,
        name: str = HOSTED_AS,
        gui_factory: GuiFactory | None = None,
        parent: QObject | None = None,
    ) -> None:
        super().__init__(policy, gui_factory, parent)
        self._transport = transport
        self._errands = Errands(policy)
        self._line = DaqcoLine(transport, name, self._errands)
        self._keeper = Keeper(self._keep, policy)
        self._ready = Event()
        self._retry_wall_s = self._clock_wall_s = -float("inf")
        self._subscriptions: list[Subscription] = []
        self._end_presence: Callable[[], None] = lambda: None
        self.clock = StationClock()
        self.buffer = RemoteBuffer(transport, self._tell)
        self.guard = RemoteGuard(self.clock, self.command)
        self.recorder = RemoteRecorder(self.command)
        self.files = RemoteFiles(self._line)

    # What there is

    @property
    def transport(self) -> Transport:
        """The way to the station."""
        return self._transport

    # Starting and ending

    @override
    def initialize(self) -> None:
        """Begin to use the station; stays open with `away` set where it cannot be reached.

        Returns when it is known how things stand there, and there are first values.
        """
        self._begin()
        if self._ready.wait(FIRST_REPORT_S) and self.running:
            self.buffer.wait_for_data(FIRST_DATA_S)

    def initialize_later(self) -> Task:
        """Do what `initialize` does without waiting."""
        self._begin()

        def job(task: Task) -> None:
            self._ready.wait(FIRST_REPORT_S)
            task.finish()

        return self.begin("Connecting to DAQCo", job)

    def _begin(self) -> None:
        self.start()
        self.buffer.open()
        subscribe = self._transport.subscribe
        self._subscriptions = [
            subscribe(REPORTS, Rule.LATEST, self._on_report),
            subscribe(CROSSINGS, Rule.ALL, self.guard.take_crossing),
            subscribe(FAILURES, Rule.ALL, self._on_failure),
        ]
        self._end_presence = self._transport.presence(self._on_presence)
        self._keeper.start()

    @override
    def request_end(self) -> None:
        super().request_end()
        self._ready.set()  # nobody waits for it any more

    @override
    def shut_down(self) -> None:
        """Use the station no more; there everything goes on. Any state."""
        self.request_end()
        self._end_presence()
        for thread in (self._keeper, self._errands):
            thread.request_end()
        for thread in (self._keeper, self._errands):
            if not thread.join():
                logger.error("%s does not end", thread.name)
        for each in self._subscriptions:
            each.close()
        self._subscriptions = []
        self.buffer.close()
        self.join()

    # Commands

    def look_for_boards(self) -> None:
        """Look for boards there and open those there are; raises as at home, or `StationAway`."""
        self.command("look_for_boards")

    def start_acquisition(self) -> None:
        """Begin to acquire there; raises as at home, or `StationAway`."""
        self.command("start_acquisition")

    def stop_acquisition(self) -> None:
        """End acquiring there, for everybody; raises `StationAway`."""
        self.command("stop_acquisition")

    def apply(self, settings: DaqcoSettings) -> None:
        """Put `settings` in force there; raises as at home, or `StationAway`."""
        self.command("apply", {"settings": plain_settings(settings)})

    def set_scale(self, channel: str, scale: Scale) -> None:
        """Give a channel a scale; raises as at home, or `StationAway`."""
        wanted = {
            "channel": channel,
            "name": scale.name,
            "unit": scale.unit,
            "coefficients": scale.coefficients,
        }
        self.command("set_scale", wanted)

    def on_crossing(self, listener: Callable[[Crossing], object]) -> None:
        """Call `listener(crossing)` when a limit was crossed, or nobody can say it was not.

        The station has stopped what it has to stop by then. It is called in the thread that
        hears of it, which may wait: join the stop of another station to it.
        """
        self.guard.subscribe(lambda crossing: (listener(crossing), None)[1])

    def carry_out(self, action: Callable[[], T], told: Told[T], *, slow: bool = False) -> None:
        """Do what may have to wait for the line; aside where this thread must not wait."""
        del slow  # everything may be
        self._line.carry_out(action, told)

    def command(self, function: str, arguments: Mapping[str, object] | None = None, /) -> object:
        """Call a function of `DaqcoStationSide` and take the report it returns, if it does.

        Raises
        ------
        StationAway, StationTimeout
            The station cannot be reached, or did not answer in time.
        CosmicError
            What the function raised there.
        """
        result = self._line.call(function, arguments)
        if isinstance(result, DaqReport):
            self._take(result)
        return result

    # What the station tells

    def _on_report(self, payload: object) -> None:
        if not isinstance(payload, DaqReport):
            raise ProtocolError(f"a {type(payload).__name__} came instead of a report")
        self._take(payload)

    def _on_failure(self, payload: object) -> None:
        logger.error("DAQCo at %s: %s", self.files.elsewhere, str(payload)[:500])

    def _on_presence(self, presence: Presence) -> None:
        self.files.station = presence.name
        self.note_presence(presence.here)
        if presence.here:
            self._retry_wall_s = -float("inf")
        else:
            said = f"{presence.name} is away: "
            self._set_away(said + presence.why.removeprefix(said))

    def _take(self, report: DaqReport) -> None:
        """Take a report unless a newer one is known; any thread."""
        taken = self.take_report(report)
        if taken is None:
            return
        if taken.first:
            self.clock.forget(report.clock_rate)
            self._clock_wall_s = -float("inf")
        self.guard.take_limits(report.limits, report.crossings, first=taken.first)
        self.recorder.take(report.recording.state())
        if taken.changed:
            self._tell()

    def _set_away(self, why: str) -> None:
        self.buffer.clear()  # nobody shall take old values for those of now
        if self.note_away(why):
            self._tell()

    def _tell(self) -> None:
        self.status_changed.emit()

    # The keeper's thread

    def _keep(self) -> None:
        now_s = WALL.now_s()
        heard_s = max(self.heard_wall_s, self.buffer.heard_wall_s)
        self.guard.look_for_silence(now_s - heard_s, self.away or "nothing comes from it")
        self.buffer.tidy()
        if not self.here:
            return
        unheard = self.away or now_s - self.heard_wall_s > RETRY_S
        if unheard and now_s - self._retry_wall_s > RETRY_S:
            self._retry_wall_s = now_s
            self._fetch()
        if not self.away and now_s - self._clock_wall_s > _CLOCK_S:
            self._read_clock()

    def _fetch(self) -> None:
        try:
            self.command("report")
        except CosmicError as exc:
            self._set_away(str(exc))

    def _read_clock(self) -> None:
        self._clock_wall_s = WALL.now_s()
        readings = []
        try:
            for _ in range(_READINGS):
                asked_s = WALL.now_s()
                station_s = self._line.call("now_s")
                if isinstance(station_s, float):
                    readings.append(Reading(station_s, asked_s, WALL.now_s()))
        except CosmicError as exc:
            logger.debug("the station's clock could not be read: %s", exc)
        self.clock.take(readings)
        if readings:
            self._ready.set()
