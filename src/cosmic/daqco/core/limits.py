"""Limits on channels, watched sample by sample in the acquisition thread (D7, thesis 5.2)."""

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from threading import Lock, RLock
from typing import Final

import numpy as np

from cosmic.daqco.core.chunk import DataChunk, Values
from cosmic.daqco.core.scale import Scale
from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import ConfigError, NotAvailable
from cosmic.frame.events import Event, Unsubscribe

logger = logging.getLogger(__name__)

LOWEST_RATE_HZ: Final = 200.0
SILENCE_S: Final = 0.1
"""How long data may stay away while a limit is armed, unless somebody says otherwise."""
_PUBLISHED_S: Final = 1.0
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
    suspended : bool
        It was armed when acquisition ended, and is armed again when acquisition starts.
    """

    channel: str
    low: float = -math.inf
    high: float = math.inf
    hysteresis: float = 0.0
    armed: bool = False
    tripped: bool = False
    beyond: bool = False
    suspended: bool = False

    @property
    def range_text(self) -> str:
        """What it allows, in words."""
        if math.isfinite(self.low) and math.isfinite(self.high):
            return f"{self.low:g} to {self.high:g}"
        return f"above {self.low:g}" if math.isfinite(self.low) else f"below {self.high:g}"


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

    Attributes
    ----------
    check : callable
        Called with a limit before it is armed; what it raises forbids that.
    unit_of : callable
        Returns the unit of a channel, for what is reported.
    """

    def __init__(self, clock: Clock, trip: Callable[[str], None] | None = None) -> None:
        self._clock = clock
        self.trip = trip
        self.check: Callable[[Limit], None] = lambda _limit: None
        self.unit_of: Callable[[str], str] = lambda _channel: ""
        self._lock = Lock()
        self._publishing = RLock()
        self._limits: dict[str, Limit] = {}
        self._crossed: Event[Crossing] = Event()
        self._noted: Event[str, str] = Event()
        self._rate_hz = 0.0
        self._crossings: tuple[Crossing, ...] = ()
        self._scales: dict[str, Scale] = {}
        self.watch_silence(SILENCE_S, simulated=True)

    @property
    def limits(self) -> dict[str, Limit]:
        """The limits by channel; a crossing that stopped something is among them."""
        self.wait_published()
        return dict(self._limits)

    @property
    def armed(self) -> bool:
        """True when any limit is watched."""
        return any(limit.armed for limit in tuple(self._limits.values()))

    @property
    def crossings(self) -> tuple[Crossing, ...]:
        """What happened so far, oldest first; the last hundred."""
        self.wait_published()
        return self._crossings

    def wait_published(self) -> None:
        """Wait until a crossing under way was told to everybody; it stops motion before that."""
        if self._publishing.acquire(timeout=_PUBLISHED_S):
            self._publishing.release()

    def subscribe(self, listener: Callable[[Crossing], object]) -> Unsubscribe:
        """Call `listener(crossing)` after each trip, in the thread that saw it.

        Returns the function that ends it.
        """
        return self._crossed.subscribe(listener)

    def on_note(self, listener: Callable[[str, str], None]) -> None:
        """Call `listener(channel, text)` when a limit is armed, disarmed, suspended or removed."""
        self._noted.subscribe(listener)

    def watch_silence(self, silence_s: float, *, simulated: bool) -> None:
        """Set for how long data may stay away while a limit is armed.

        Parameters
        ----------
        simulated : bool
            True: the platform's clock judges it, which waits when the computer is slow, and then
            no data is due either. False: the wall's does, for real boards wait for nobody.
        """
        rate = max(self._clock.rate, 1.0) if simulated else 1.0
        with self._lock:
            self._watch: Clock = self._clock if simulated else WALL
            self._silence_s = silence_s
            self._most_s = silence_s * rate * min(rate, LAXEST)
            self._seen_s = dict.fromkeys(self._limits, self._watch.now_s())

    def set_rate(self, rate_hz: float) -> None:
        """Say how often channels are sampled; 0 while they are not.

        Limits that are armed are suspended where that is too slow for them, and armed again when
        it is fast enough.
        """
        with self._lock:
            self._rate_hz = rate_hz
            self._scales.clear()
            now_s = self._watch.now_s()
            self._seen_s = dict.fromkeys(self._limits, now_s)
            slow = rate_hz < LOWEST_RATE_HZ
            changed = [
                limit
                for limit in self._limits.values()
                if (limit.armed if slow else limit.suspended)
            ]
            for limit in changed:
                # One that was acknowledged meanwhile is looked at as one that is new: what is still
                # beyond it trips it again.
                beyond = limit.beyond and limit.tripped
                self._limits[limit.channel] = replace(
                    limit, armed=not slow, suspended=slow, beyond=limit.beyond if slow else beyond
                )
        for limit in changed:
            if slow:
                why = (
                    "nothing is acquired" if rate_hz == 0.0 else f"it is sampled at {rate_hz:g} Hz"
                )
                self._publish_note(limit.channel, f"its limit is no longer watched: {why}")
            else:
                self._arm_again(limit)

    def _arm_again(self, limit: Limit) -> None:
        """Arm what was suspended, or say why that cannot be."""
        try:
            self.check(limit)
        except (ConfigError, NotAvailable) as exc:
            with self._lock:
                self._limits[limit.channel] = replace(limit, armed=False, suspended=False)
            self._publish_note(limit.channel, f"its limit is disarmed: {exc}")
        else:
            self._publish_armed(limit)

    def set_limit(self, limit: Limit) -> None:
        """Set the limit of a channel, armed or not.

        Raises
        ------
        ConfigError
            Limits that are no numbers or do not rise, or a hysteresis that leaves nothing between.
        NotAvailable
            It is to be armed, and channels are sampled at less than 200 Hz.
        """
        self._check_numbers(limit)
        if limit.armed:
            self.check(limit)
        with self._lock:
            if limit.armed and not self._rate_hz >= LOWEST_RATE_HZ:
                raise NotAvailable(
                    f"{limit.channel}: limits are watched from {LOWEST_RATE_HZ:g} Hz on; it is "
                    f"sampled at {self._rate_hz:g} Hz"
                )
            before = self._limits.get(limit.channel)
            self._put(replace(limit, tripped=False, beyond=False))
        if limit.armed and limit != before:
            self._publish_armed(limit)
        if not limit.armed and before is not None and (before.armed or before.suspended):
            self._publish_note(limit.channel, "its limit was disarmed")

    def set_suspended(self, limit: Limit) -> None:
        """Set a limit that is armed as soon as channels are sampled; raises as `set_limit`."""
        self._check_numbers(limit)
        with self._lock:
            self._put(replace(limit, armed=False, suspended=True))

    def _check_numbers(self, limit: Limit) -> None:
        if not limit.low < limit.high:
            raise ConfigError(f"{limit.channel}: the low limit must lie below the high one")
        if not 0.0 <= limit.hysteresis < (limit.high - limit.low) / 2.0:
            raise ConfigError(
                f"{limit.channel}: a hysteresis of {limit.hysteresis!r} leaves nothing between"
            )

    def _put(self, limit: Limit) -> None:
        """Put a limit in force; locked."""
        self._seen_s[limit.channel] = self._watch.now_s()
        self._scales.pop(limit.channel, None)
        self._limits[limit.channel] = limit

    def acknowledge(self, channel: str) -> None:
        """Forget that the limit of a channel was crossed; it stays armed.

        Raises
        ------
        NotAvailable
            The channel has not come back inside, or there is no data of it.
        """
        with self._lock:
            limit = self._limits.get(channel)
            if limit is None:
                return
            if limit.armed and limit.beyond:
                if self._watch.now_s() - self._seen_s[channel] > self._most_s:
                    text = f"there is still no data from {channel}; start the acquisition"
                else:
                    text = f"{channel} is still beyond its limit; bring it back inside"
                raise NotAvailable(f"{text}, or disarm its limit")
            self._limits[channel] = replace(limit, tripped=False)

    def remove(self, channel: str, why: str = "") -> None:
        """Forget the limit of a channel."""
        with self._lock:
            limit = self._limits.pop(channel, None)
        if limit is not None:
            self._publish_note(channel, f"its limit was removed{why and ': '}{why}")

    def rename(self, channel: str, name: str) -> None:
        """Have a limit follow its channel to another name."""
        with self._lock:
            limit = self._limits.pop(channel, None)
            if limit is not None:
                self._put(replace(limit, channel=name))

    def _publish_armed(self, limit: Limit) -> None:
        text = f"its limit is armed: {limit.range_text} {self.unit_of(limit.channel)}"
        self._publish_note(limit.channel, text.rstrip())

    def _publish_note(self, channel: str, text: str) -> None:
        logger.warning("%s: %s", channel, text)
        self._noted.emit(channel, text)

    # Watching

    def look(self, chunk: DataChunk) -> None:
        """Check a chunk; acquisition thread, before anybody else gets it."""
        if not self.armed:
            return
        now_s = self._watch.now_s()
        for name, limit in list(self._limits.items()):
            if limit.armed and name in chunk.channels:
                row = chunk.channels.index(name)
                if self._is_same_quantity(name, chunk.scales[row]):
                    self._seen_s[name] = now_s
                    self._check(chunk, row, limit)
                elif not limit.beyond:
                    self._trip_blind(limit, f"the scale of {name} changed under its armed limit")

    def _is_same_quantity(self, name: str, scale: Scale) -> bool:
        """Return False when a channel is scaled otherwise than since its limit was armed."""
        known = self._scales.setdefault(name, scale)
        if known is scale:
            return True
        return (known.unit, known.coefficients) == (scale.unit, scale.coefficients)

    def look_for_silence(self) -> None:
        """Trip when data has stayed away for too long; called again and again by a watcher."""
        if not self.armed:
            return
        now_s = self._watch.now_s()
        for name, limit in list(self._limits.items()):
            if not limit.armed or limit.beyond:
                continue
            if now_s - self._seen_s.get(name, now_s) > self._most_s:
                self._trip_blind(limit, f"no data from {name} for {self._silence_s:g} s")

    def trip_all(self, why: str) -> None:
        """Trip every armed limit: samples are missing, and nobody knows what they were."""
        for limit in list(self._limits.values()):
            if limit.armed and not limit.beyond:
                self._trip_blind(limit, why)

    def _trip_blind(self, limit: Limit, why: str) -> None:
        text = f"{why} while the limit of {limit.channel} is armed"
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
        with self._publishing:
            if self.trip is not None:
                self.trip(crossing.text)
            reaction_s = self._clock.now_s() - crossing.time_s
            crossing = replace(crossing, reaction_s=reaction_s)
            self._note(limit, beyond=True)
            self._crossings = (*self._crossings[-99:], crossing)
            logger.warning("%s; stopped after %.1f ms", crossing.text, 1000.0 * reaction_s)
            self._crossed.emit(crossing)
