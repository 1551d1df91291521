"""The limits that another station watches, and what follows from a crossing here."""

import logging
import math
from collections.abc import Callable
from dataclasses import replace
from threading import Lock
from typing import Final

from cosmic.daqco.api.remote_line import Asks
from cosmic.daqco.core.limits import Crossing, Limit
from cosmic.frame.clock import Clock
from cosmic.frame.errors import ProtocolError
from cosmic.frame.listeners import tell

logger = logging.getLogger(__name__)

SILENCE_LIMIT_S: Final = 0.5
"""Silence of the station after which nobody can say here that an armed limit holds."""
_REMEMBERED: Final = 100


class RemoteGuard:
    """What a `LimitGuard` is at home; any thread.

    A limit is watched at the station where the board is, which stops what it has to stop there.
    Here its crossings are heard of: `trip` and the listeners are called in the thread that
    hears of it. When the station falls silent while a limit is armed, that counts as a crossing.

    Attributes
    ----------
    trip : callable or None
        Called with the reason, before anybody else hears of it, such as the stop of axes here.
    """

    def __init__(self, clock: Clock, ask: Asks) -> None:
        self.trip: Callable[[str], None] | None = None
        self._clock = clock
        self._ask = ask
        self._lock = Lock()
        self._limits: dict[str, Limit] = {}
        self._known: dict[tuple[str, int, float], Crossing] = {}
        self._listeners: tuple[Callable[[Crossing], None], ...] = ()
        self._unheard: dict[str, Crossing] = {}
        self._silent = False

    @property
    def limits(self) -> dict[str, Limit]:
        """The limits by channel, as the station last told; tripped while it is silent."""
        with self._lock:
            return {
                name: replace(limit, tripped=True) if name in self._unheard else limit
                for name, limit in self._limits.items()
            }

    @property
    def armed(self) -> bool:
        """True when any limit was watched, as the station last told."""
        return any(limit.armed for limit in self._limits.values())

    @property
    def crossings(self) -> tuple[Crossing, ...]:
        """What was heard of so far, oldest first; the last hundred."""
        with self._lock:
            return tuple(self._known.values())

    def subscribe(self, listener: Callable[[Crossing], None]) -> None:
        """Call `listener(crossing)` after each trip, in the thread that hears of it."""
        self._listeners = (*self._listeners, listener)

    def set_limit(self, limit: Limit) -> None:
        """Set the limit of a channel; raises as `LimitGuard.set_limit`, or `StationAway`."""
        wanted = {
            "channel": limit.channel,
            "low": limit.low,
            "high": limit.high,
            "hysteresis": limit.hysteresis,
            "armed": limit.armed,
        }
        self._ask("set_limit", wanted)
        self._forgive(limit.channel)

    def acknowledge(self, channel: str) -> None:
        """Forget that a limit was crossed; raises as `LimitGuard.acknowledge`, `StationAway`."""
        self._ask("reset_limit", {"channel": channel})
        self._forgive(channel)

    def remove(self, channel: str) -> None:
        """Forget the limit of a channel; raises `StationAway`."""
        self._ask("remove_limit", {"channel": channel})
        self._forgive(channel)

    def _forgive(self, channel: str) -> None:
        with self._lock:
            self._unheard.pop(channel, None)

    # For the application

    def take_limits(
        self, limits: tuple[Limit, ...], crossings: tuple[Crossing, ...], *, first: bool
    ) -> None:
        """Take what a report says; crossings that nobody here heard of are told now.

        Parameters
        ----------
        first : bool
            Nothing was known of this station: of what happened before, only what still is beyond
            an armed limit is told.
        """
        with self._lock:
            self._limits = {each.channel: each for each in limits}
        beyond = {each.channel for each in limits if each.armed and each.beyond}
        for crossing in crossings:
            self._take(crossing, quiet=first and crossing.channel not in beyond)

    def take_crossing(self, payload: object) -> None:
        """Take a crossing from its topic."""
        if not isinstance(payload, Crossing):
            raise ProtocolError(f"a {type(payload).__name__} came instead of a crossing")
        self._take(payload, quiet=False)

    def look_for_silence(self, silent_s: float, why: str) -> None:
        """Count it as a crossing when the station is silent for too long; again and again."""
        if silent_s <= SILENCE_LIMIT_S:
            self._silent = False
            return
        if self._silent:
            return
        self._silent = True
        for limit in list(self._limits.values()):
            if limit.armed:
                self._trip_silent(limit, why)

    def _trip_silent(self, limit: Limit, why: str) -> None:
        text = f"the station that watches the limit of {limit.channel} is silent: {why}"
        crossing = Crossing(limit.channel, -1, self._clock.now_s(), math.nan, math.nan, "", text)
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
            tell([self.trip], crossing.text)
        logger.warning("%s", crossing.text)
        tell(self._listeners, crossing)
