"""Limits on channels, watched sample by sample in the acquisition thread (D7, thesis 5.2)."""

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from threading import Lock, RLock
from typing import Final

import numpy as np

from cosmic.daqco.core.chunk import DataChunk, Values
from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import ConfigError, NotAvailable
from cosmic.frame.listeners import tell

logger = logging.getLogger(__name__)

LOWEST_RATE_HZ: Final = 200.0
STALE_S: Final = 0.1
"""How long data may stay away while a limit is armed, wall time."""
_TOLD_S: Final = 1.0
LAXEST: Final = 10.0
"""A simulation that runs faster than the wall may be silent so much longer: nothing can break."""


@dataclass(frozen=True, slots=True)
class Limit:
    """What a channel must not leave, in its physical unit.

    Attributes
    ----------
    low, high : float
        Infinite where that side is free.
    hysteresis : float
        How far inside the channel must have come back before it can trip again.
    armed : bool
        It is watched.
    tripped : bool
        It was crossed, and nobody has acknowledged that yet.
    beyond : bool
        The channel has not come back inside since.
    """

    channel: str
    low: float = -math.inf
    high: float = math.inf
    hysteresis: float = 0.0
    armed: bool = False
    tripped: bool = False
    beyond: bool = False


@dataclass(frozen=True, slots=True)
class Crossing:
    """A limit was crossed, or nobody can say that it was not.

    Attributes
    ----------
    sample : int
        Number of the first sample beyond; -1 where data stayed away.
    time_s : float
        Its platform time.
    value : float
        What it was, in the unit of the channel; nan where data stayed away.
    reaction_s : float
        From taking that sample to the return of the stop, on the platform clock.
    """

    channel: str
    sample: int
    time_s: float
    value: float
    limit: float
    unit: str
    text: str
    reaction_s: float = math.nan


class LimitGuard:
    """Looks at every sample of every armed channel; any thread.

    Parameters
    ----------
    trip : callable
        Called with the reason the moment a limit is crossed, in the acquisition thread, before
        anybody else hears of it. It must return at once.
    """

    def __init__(self, clock: Clock, trip: Callable[[str], None] | None = None) -> None:
        self._clock = clock
        self.trip = trip
        self._stale_s = STALE_S * min(max(clock.rate, 1.0), LAXEST)
        self._lock = Lock()
        self._telling = RLock()
        self._limits: dict[str, Limit] = {}
        self._listeners: tuple[Callable[[Crossing], None], ...] = ()
        self._last_wall_s = -math.inf
        self._rate_hz = 0.0
        self._crossings: tuple[Crossing, ...] = ()

    @property
    def limits(self) -> dict[str, Limit]:
        """The limits by channel; a crossing that stopped something is among them."""
        self.wait_told()
        return dict(self._limits)

    @property
    def armed(self) -> bool:
        """True when any limit is watched."""
        return any(limit.armed for limit in self._limits.values())

    @property
    def crossings(self) -> tuple[Crossing, ...]:
        """What happened so far, oldest first; the last hundred."""
        self.wait_told()
        return self._crossings

    def wait_told(self) -> None:
        """Wait until a crossing under way was told to everybody; it stops motion before that."""
        if self._telling.acquire(timeout=_TOLD_S):
            self._telling.release()

    def subscribe(self, listener: Callable[[Crossing], None]) -> None:
        """Call `listener(crossing)` after each trip, in the thread that saw it."""
        self._listeners = (*self._listeners, listener)

    def set_rate(self, rate_hz: float) -> None:
        """Say how often channels are sampled; 0 while they are not.

        Limits that were armed are disarmed where that is too slow for them.
        """
        with self._lock:
            self._rate_hz = rate_hz
            self._last_wall_s = WALL.now_s()
            if rate_hz < LOWEST_RATE_HZ:
                for name, limit in self._limits.items():
                    if limit.armed:
                        logger.warning("%s: its limit is disarmed at %g Hz", name, rate_hz)
                        self._limits[name] = replace(limit, armed=False)

    def set_limit(self, limit: Limit) -> None:
        """Set the limit of a channel, armed or not.

        Raises
        ------
        ConfigError
            Limits that are no numbers or do not rise, or a hysteresis that leaves nothing between.
        NotAvailable
            It is to be armed, and channels are sampled at less than 200 Hz.
        """
        if not limit.low < limit.high:
            raise ConfigError(f"{limit.channel}: the low limit must lie below the high one")
        if not 0.0 <= limit.hysteresis < (limit.high - limit.low) / 2.0:
            raise ConfigError(
                f"{limit.channel}: a hysteresis of {limit.hysteresis!r} leaves nothing between"
            )
        with self._lock:
            if limit.armed and not self._rate_hz >= LOWEST_RATE_HZ:
                raise NotAvailable(
                    f"{limit.channel}: limits are watched from {LOWEST_RATE_HZ:g} Hz on; it is "
                    f"sampled at {self._rate_hz:g} Hz"
                )
            self._last_wall_s = WALL.now_s()
            self._limits[limit.channel] = replace(limit, tripped=False, beyond=False)

    def acknowledge(self, channel: str) -> None:
        """Forget that the limit of a channel was crossed; it stays armed.

        Raises
        ------
        NotAvailable
            The channel has not come back inside.
        """
        with self._lock:
            limit = self._limits.get(channel)
            if limit is None:
                return
            if limit.armed and limit.beyond:
                raise NotAvailable(
                    f"{channel} is still beyond its limit; bring it back inside, or disarm it"
                )
            self._limits[channel] = replace(limit, tripped=False)

    def remove(self, channel: str) -> None:
        """Forget the limit of a channel."""
        with self._lock:
            self._limits.pop(channel, None)

    # Watching

    def look(self, chunk: DataChunk) -> None:
        """Check a chunk; acquisition thread, before anybody else gets it."""
        self._last_wall_s = WALL.now_s()
        for name, limit in list(self._limits.items()):
            if limit.armed and name in chunk.channels:
                row = chunk.channels.index(name)
                self._check(chunk, row, limit)

    def look_for_silence(self) -> None:
        """Trip when data has stayed away for too long; called again and again by a watcher."""
        if not self.armed or WALL.now_s() - self._last_wall_s <= self._stale_s:
            return
        for limit in list(self._limits.values()):
            if limit.armed and not limit.beyond:
                text = (
                    f"no data of {limit.channel} for {self._stale_s:g} s while its limit is armed"
                )
                now_s = self._clock.now_s()
                self._trip(Crossing(limit.channel, -1, now_s, math.nan, math.nan, "", text), limit)

    def _check(self, chunk: DataChunk, row: int, limit: Limit) -> None:
        scale = chunk.scales[row]
        values = scale.apply(chunk.volts[row])
        inside = self._inside(values, limit)
        if limit.beyond:
            narrow = replace(
                limit, low=limit.low + limit.hysteresis, high=limit.high - limit.hysteresis
            )
            back = np.flatnonzero(self._inside(values, narrow))
            if back.size == 0:
                return
            self._note(limit, beyond=False)
            offset = int(back[0])
            inside = inside[offset:]
        else:
            offset = 0
        beyond = np.flatnonzero(~inside)
        if beyond.size == 0:
            return
        at = offset + int(beyond[0])
        value = float(values[at])
        crossed = limit.high if value >= limit.high else limit.low
        text = f"{limit.channel} reached {value:.4g} {scale.unit}, its limit is {crossed:g}"
        time_s = chunk.time_s + at / chunk.rate_hz
        crossing = Crossing(
            limit.channel, chunk.first_sample + at, time_s, value, crossed, scale.unit, text
        )
        self._trip(crossing, limit)

    @staticmethod
    def _inside(values: Values, limit: Limit) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
        # A value that is no number is not inside.
        return np.asarray((values > limit.low) & (values < limit.high))

    def _note(self, limit: Limit, *, beyond: bool) -> None:
        with self._lock:
            now = self._limits.get(limit.channel)
            if now is not None:
                tripped = beyond or now.tripped
                self._limits[limit.channel] = replace(now, tripped=tripped, beyond=beyond)

    def _trip(self, crossing: Crossing, limit: Limit) -> None:
        with self._telling:
            if self.trip is not None:
                self.trip(crossing.text)
            reaction_s = self._clock.now_s() - crossing.time_s
            crossing = replace(crossing, reaction_s=reaction_s)
            self._note(limit, beyond=True)
            self._crossings = (*self._crossings[-99:], crossing)
            logger.warning("%s; stopped after %.1f ms", crossing.text, 1000.0 * reaction_s)
            tell(self._listeners, crossing)
