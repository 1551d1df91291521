"""The limits that another station watches, and what follows from a crossing here."""

import logging
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from threading import Lock
from typing import Final, Protocol

from typing_extensions import override

from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.limits import Crossing, Limit
from cosmic.frame.clock import Clock
from cosmic.frame.declaration import Companion
from cosmic.frame.events import Event, Unsubscribe, notify

logger = logging.getLogger(__name__)

SILENCE_LIMIT_S: Final = 0.5
"""Silence of the station after which nobody can say here that an armed limit holds."""
_REMEMBERED: Final = 100
_SETS_ANEW: Final = ("set_limit", "disarm_limit", "remove_limit", "reset_limit")


class Watched(Protocol):
    """What it needs of `Daqco`."""

    @property
    def clock(self) -> Clock:
        """The clock of the station."""

    @property
    def away(self) -> str:
        """Why the station cannot be reached."""

    @property
    def remote(self) -> str:
        """Where the station is."""

    @property
    def running(self) -> bool:
        """Samples are being acquired."""

    @property
    def latest_chunk(self) -> DataChunk | None:
        """The newest samples."""

    @property
    def limits_there(self) -> tuple[Limit, ...]:
        """The limits as they are watched."""

    @property
    def crossings_there(self) -> tuple[Crossing, ...]:
        """The newest crossings."""

    def watch_crossings(self, receiver: Callable[[Crossing], object]) -> Callable[[], None]:
        """Call `receiver(crossing)` with each crossing."""

    def watch_failures(self, receiver: Callable[[str], object]) -> Callable[[], None]:
        """Call `receiver(text)` with each failure."""


class LimitWatch(Companion):
    """What a `LimitGuard` is where the boards are; any thread.

    A limit is watched at the station where the board is, which stops what it has to stop there.
    Here its crossings are heard of: `trip` and the listeners are called in the thread that
    hears of it. When the station falls silent while a limit is armed, that counts as a crossing.

    Attributes
    ----------
    trip : callable or None
        Called with the reason, before anybody else hears of it, such as the stop of axes here.
    """

    def __init__(self, daqco: Watched) -> None:
        self.trip: Callable[[str], None] | None = None
        self._daqco = daqco
        self._lock = Lock()
        self._known: dict[tuple[str, int, float], Crossing] = {}
        self._crossed: Event[Crossing] = Event()
        self._unheard: dict[str, Crossing] = {}
        self._silent = False

    @property
    def limits(self) -> dict[str, Limit]:
        """The limits by channel, as the station last told; tripped while it is silent."""
        limits = self._daqco.limits_there
        with self._lock:
            return {
                each.channel: replace(each, tripped=True) if each.channel in self._unheard else each
                for each in limits
            }

    @property
    def crossings(self) -> tuple[Crossing, ...]:
        """What was heard of so far, oldest first; the last hundred."""
        with self._lock:
            return tuple(self._known.values())

    def subscribe(self, listener: Callable[[Crossing], object]) -> Unsubscribe:
        """Call `listener(crossing)` after each trip, in the thread that hears of it."""
        return self._crossed.subscribe(listener)

    # What the line tells

    @override
    def on_opened(self) -> None:
        self._daqco.watch_crossings(self.take_crossing)
        self._daqco.watch_failures(self._on_failure)

    @override
    def on_state(self, *, first: bool) -> None:
        """Tell of crossings that nobody here heard of.

        Of what happened before this station was known, only what still is beyond an armed limit
        is told.
        """
        beyond = {each.channel for each in self._daqco.limits_there if each.armed and each.beyond}
        for crossing in self._daqco.crossings_there:
            self._take(crossing, quiet=first and crossing.channel not in beyond)

    @override
    def on_commanded(self, command: str, arguments: Mapping[str, object]) -> None:
        """Forget the silence about a limit that was set anew from here."""
        if command in _SETS_ANEW:
            concerned = arguments.get("channel", getattr(arguments.get("limit"), "channel", ""))
            with self._lock:
                self._unheard.pop(str(concerned), None)

    @override
    def look(self, silent_s: float) -> None:
        """Count it as a crossing when the station is silent for too long."""
        if silent_s <= SILENCE_LIMIT_S:
            self._silent = False
            return
        if self._silent:
            return
        self._silent = True
        for limit in self._daqco.limits_there:
            if limit.armed:
                self._trip_silent(limit)

    @property
    @override
    def ready(self) -> bool:
        return not self._daqco.running or self._daqco.latest_chunk is not None

    def take_crossing(self, crossing: Crossing) -> None:
        """Take a crossing that the station tells."""
        self._take(crossing, quiet=False)

    def _on_failure(self, text: str) -> None:
        logger.error("DAQCo %s: %s", self._daqco.remote, text[:500])

    def _trip_silent(self, limit: Limit) -> None:
        why = self._daqco.away or "it sends nothing"
        text = f"the station that watches the limit of {limit.channel} is silent: {why}"
        now_s = self._daqco.clock.now_s()
        crossing = Crossing(limit.channel, -1, now_s, math.nan, math.nan, "", text)
        with self._lock:
            self._unheard[limit.channel] = crossing
        self._take(crossing, quiet=False)

    def _take(self, crossing: Crossing, *, quiet: bool) -> None:
        key = (crossing.channel, crossing.sample, crossing.time_s)
        with self._lock:
            if key in self._known:
                return
            self._known[key] = crossing
            while len(self._known) > _REMEMBERED:
                del self._known[next(iter(self._known))]
        if quiet:
            return
        if self.trip is not None:
            notify(self.trip, crossing.text)
        logger.warning("%s", crossing.text)
        self._crossed.emit(crossing)
