"""One application at one station, as it is known and used here: the far side of a proxy."""

import logging
import threading
from collections.abc import Callable, Mapping
from threading import Lock
from typing import Final

from typing_extensions import override

from cosmic.frame.clock import WALL
from cosmic.frame.declaration import (
    Companion,
    Declared,
    declaration_of,
)
from cosmic.frame.errors import CosmicError, ProtocolError
from cosmic.frame.events import Event
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.commands import StationCommands
from cosmic.frame.network.host import NOW, STATE, topic_of
from cosmic.frame.network.known_state import Address, KnownState
from cosmic.frame.network.ongoing import StateMessage
from cosmic.frame.network.remote_stream import RemoteStream
from cosmic.frame.network.station_clock import Reading, StationClock
from cosmic.frame.network.transport import Presence, Rule, Subscription, Transport
from cosmic.frame.threads import WorkerThread

logger = logging.getLogger(__name__)

RETRY_S: Final = 0.5
_DRIFT: Final = 2e-4
_LOOK_S: Final = 0.05
_CLOCK_S: Final = 20.0
_READINGS: Final = 5


class _LinkWatcher(WorkerThread):
    """Calls `look` again and again."""

    def __init__(self, name: str, look: Callable[[], None], policy: FailurePolicy) -> None:
        super().__init__(name, policy)
        self._look = look

    @override
    def run_body(self) -> None:
        while not self._end_requested.wait(_LOOK_S):
            self._look()


class ApplicationLink:
    """Knows the state of an application at another station, and has commands given; any thread.

    Whatever is read is known already, as the station last told. While the station is away, `away`
    says why, commands raise `StationAway`, and everything goes on by itself when it is back.

    Parameters
    ----------
    kind : type
        What the application declares.
    transport : Transport
        To the station; whoever made it closes it, after `close`.
    name : str
        Under which the station hosts the application.

    Attributes
    ----------
    state : KnownState
        How things stand there, as it was published last.
    commands : StationCommands
        How commands are given.
    """

    def __init__(
        self, kind: type[Declared], transport: Transport, name: str, policy: FailurePolicy
    ) -> None:
        self.root = Address(kind)
        self.clock = StationClock()
        self._companions: tuple[Companion, ...] = ()
        self._changed: Event[tuple[str, ...]] = Event()
        self.policy = policy
        self._transport = transport
        self._name = name
        self.commands = StationCommands(transport, name, policy, self)
        self._watcher = _LinkWatcher(f"remote {name}", self._look, policy)
        self._lock = Lock()
        self.state = KnownState(self.root)
        self._streams: dict[tuple[str, ...], RemoteStream] = {}
        self._station = ""
        self._away, self._here = "not connected yet", False
        self._heard_wall_s = self._retry_wall_s = self._clock_wall_s = -float("inf")
        self._wall_s: tuple[float, float] | None = None
        self._incomplete = False
        self._ready = threading.Event()
        self._subscription: Subscription | None = None
        self._end_presence: Callable[[], None] = lambda: None

    def join(
        self, companion: Companion | None, on_change: Callable[[tuple[str, ...]], object]
    ) -> None:
        """Tell a proxy of changes, and have its companion keep an eye on the station."""
        self._changed.subscribe(on_change)
        if companion is not None:
            self._companions = (*self._companions, companion)
            if self._subscription is not None:
                companion.on_opened()

    # What is known

    @property
    def ready(self) -> bool:
        """What is known suffices to begin."""
        return all(each.ready for each in self._companions)

    def wall_s_here(self, wall_s: float) -> float:
        """Return what the wall clock here said when that of the station did."""
        known = self._wall_s
        return wall_s if known is None else wall_s + known[0]

    @property
    def transport(self) -> Transport:
        """The way to the station."""
        return self._transport

    @property
    def away(self) -> str:
        """Why the station cannot be reached; empty while it can."""
        return self._away

    @property
    def remote(self) -> str:
        """Where it runs, as the operator is told."""
        return f"at the station {self._station}" if self._station else "at another station"

    @property
    def station(self) -> str:
        """Name of the station; empty before it was heard of."""
        return self._station

    @property
    def missed(self) -> int:
        """How much of all streams did not reach this process."""
        return sum(each.missed for each in list(self._streams.values()))

    def stream(self, address: Address, name: str) -> RemoteStream:
        """Return a stream of an object."""
        with self._lock:
            at = (*address.at, name)
            if at not in self._streams:
                declared = declaration_of(address.kind).streams[name]
                topic = topic_of(self._name, address.at, declared.topic)
                self._streams[at] = RemoteStream(
                    declared, topic, self._transport, lambda: self.publish([address.at])
                )
            return self._streams[at]

    # Beginning and ending

    def open(self) -> None:
        """Begin to use the station; it need not be there yet."""
        topic = topic_of(self._name, (), STATE)
        for each in self._companions:
            each.on_opened()
        for name in declaration_of(self.root.kind).newest.values():
            self.stream(self.root, name).keep()
        self._subscription = self._transport.subscribe(topic, Rule.LATEST, self._on_state)
        self._end_presence = self._transport.presence(self._on_presence)
        self._watcher.start()

    def wait_until_known(self, timeout_s: float) -> bool:
        """Wait until it is known how things stand there; False where it is not in time."""
        return self._ready.wait(timeout_s)

    def let_go(self) -> None:
        """Let nobody wait any longer to know how things stand."""
        self._ready.set()

    def close(self) -> None:
        """Use the station no more; there everything goes on. Any state."""
        self.let_go()
        self._end_presence()
        self.commands.end_motion()
        self._watcher.request_end()
        self.commands.close()
        if not self._watcher.join():
            logger.error("%s does not end", self._watcher.name)
        for companion in self._companions:
            companion.close()
        subscription, self._subscription = self._subscription, None
        if subscription is not None:
            subscription.close()
        for each in list(self._streams.values()):
            each.close()

    # What the station tells

    def _on_state(self, payload: object) -> None:
        self.take(payload)

    def take(self, payload: object) -> bool:
        """Take state unless a newer one is known; any thread.

        False where the rest of it has to be asked for first: of an application that was started
        anew, or of a part that is new.
        """
        if not isinstance(payload, StateMessage):
            raise ProtocolError(f"a {type(payload).__name__} came instead of state")
        published = self.state.checked(payload)
        with self._lock:
            taken = self.state.take(payload, published)
            if taken is None:
                self._incomplete = True
                return False
            if taken.first:
                self._wall_s = None
            self._note_wall(payload.wall_s)
            was_away, self._away = self._away, "" if self._here else self._away
            self._heard_wall_s = WALL.now_s()
        if taken.first:
            self.clock.forget(payload.clock_rate)
            self._clock_wall_s = -float("inf")
        changed = list(taken.changed)
        if taken.newer:
            for each in self._companions:
                each.on_state(first=taken.first)
        if was_away != self._away:
            changed.append(())
        self.publish(changed)
        return True

    def _note_wall(self, wall_s: float) -> None:
        """Reckon by how much the wall clocks differ: a message on its way only adds to it."""
        now_s = WALL.now_s()
        offset_s = now_s - wall_s
        if self._wall_s is not None:
            before_s, noted_s = self._wall_s
            offset_s = min(offset_s, before_s + _DRIFT * (now_s - noted_s))
        self._wall_s = offset_s, now_s

    def _on_presence(self, presence: Presence) -> None:
        self._station = presence.name
        self._here = presence.here
        if presence.here:
            self._retry_wall_s = -float("inf")
        else:
            said = f"{presence.name} is away: "
            self._set_away(said + presence.why.removeprefix(said))

    def _set_away(self, why: str) -> None:
        for each in list(self._streams.values()):
            each.clear()  # nobody shall take old values for those of now
        with self._lock:
            before, self._away = self._away, why
        if before != why:
            self.publish([()])

    def note_command(self, name: str, arguments: Mapping[str, object]) -> None:
        """Have the companions take note that a command was carried out."""
        for each in self._companions:
            each.on_commanded(name, arguments)

    def publish(self, changed: list[tuple[str, ...]]) -> None:
        """Have the proxies at those addresses say that something changed."""
        for at in {*changed, *([()] if changed else [])}:
            self._changed.emit(at)

    # The keeper's thread

    def _look(self) -> None:
        now_s = WALL.now_s()
        streams = list(self._streams.values())
        heard_s = max(self._heard_wall_s, *(each.heard_wall_s for each in streams), -float("inf"))
        for companion in self._companions:
            companion.look(now_s - heard_s)
        for each in streams:
            each.tidy()
        if not self._here:
            return
        if self._incomplete:
            self._incomplete = False
            self.fetch()
        unheard = self._away or now_s - self._heard_wall_s > RETRY_S
        if unheard and now_s - self._retry_wall_s > RETRY_S:
            self._retry_wall_s = now_s
            self.fetch()
        if not self._away and now_s - self._clock_wall_s > _CLOCK_S:
            self._read_clock()

    def fetch(self) -> None:
        """Ask the station how things stand; `away` says where it does not answer."""
        try:
            self.take(self._transport.call(self._name, STATE))
        except CosmicError as exc:
            self._set_away(str(exc))

    def _read_clock(self) -> None:
        self._clock_wall_s = WALL.now_s()
        readings = []
        try:
            for _ in range(_READINGS):
                asked_s = WALL.now_s()
                station_s = self._transport.call(self._name, NOW)
                if isinstance(station_s, float):
                    readings.append(Reading(station_s, asked_s, WALL.now_s()))
        except CosmicError as exc:
            logger.debug("the station's clock could not be read: %s", exc)
        self.clock.take(readings)
        if readings:
            self._ready.set()
