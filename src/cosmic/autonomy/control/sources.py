"""Where a control loop gets its measurement from: a channel of DAQCo, or a position."""

import math
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from cosmic.daqco.api.daqco import Daqco
from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.guarded import changed_quantity, measurable
from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import ConfigError, CosmicError, LimitError, NotAvailable
from cosmic.frame.verdict import Reason, refuse
from cosmic.mico.api.mico import Mico

IDLE_POLLS: Final = 2.5
"""A position of a standing axis is read less often: so many polls may pass before it is stale."""


@dataclass(frozen=True, slots=True)
class Sample:
    """The newest value, and when it came: by the wall and by the clock of its source."""

    value: float
    read_wall_s: float
    read_s: float


@dataclass(frozen=True, slots=True)
class Limits:
    """Between which a measurement must lie while a loop runs.

    Raises
    ------
    ConfigError
        The low one does not lie below the high one.
    """

    name: str
    unit: str
    low: float = -math.inf
    high: float = math.inf

    def __post_init__(self) -> None:
        """Refuse limits between which nothing lies."""
        if not self.low < self.high:
            raise ConfigError(f"{self.name}: the low limit must lie below the high one")

    def crossed(self, values: npt.ArrayLike) -> LimitError | None:
        """Return what says that the first value beyond them does; None where none does."""
        given = np.atleast_1d(np.asarray(values, dtype=np.float64))
        beyond = given[~((given > self.low) & (given < self.high))]
        if not beyond.size:
            return None
        value = float(beyond[0])
        limit = self.low if value <= self.low else self.high
        text = f"{self.name} reached {value:.4g} {self.unit}, the loop's limit is {limit:g}"
        return LimitError(refuse(Reason.LIMIT, text, value=value, limit=limit, unit=self.unit))


class Source(Protocol):
    """A measurement that is there at once whenever it is asked for; any thread."""

    @property
    @abstractmethod
    def name(self) -> str:
        """What is measured."""

    @property
    @abstractmethod
    def unit(self) -> str:
        """Its unit."""

    @property
    @abstractmethod
    def measurable(self) -> tuple[float, float]:
        """The least and the most that can be measured; only what lies between can be held."""

    @property
    @abstractmethod
    def clock(self) -> Clock:
        """By which a value is too old; that of a simulated platform waits for a busy computer."""

    @property
    @abstractmethod
    def stale_s(self) -> float:
        """How old a value may be before the loop ends; wall time where `clock` does not wait."""

    @property
    @abstractmethod
    def pause_s(self) -> float:
        """How old a value may be, wall time, before the axis waits for the next."""

    @abstractmethod
    def begin(self, on_limit: Callable[[CosmicError], None]) -> None:
        """Begin to listen; `on_limit` is told of a limit crossed the moment it is seen."""

    @abstractmethod
    def newest(self) -> Sample | None:
        """Return the newest value; None before the first."""

    @abstractmethod
    def end(self) -> None:
        """Stop listening."""


class ChannelSource(Source):
    """The newest sample of a channel, in its unit; every sample is held against the limits.

    Parameters
    ----------
    low, high : float
        Limits: a sample that does not lie between them ends the loop, in the thread that acquires.
    """

    def __init__(
        self,
        daqco: Daqco,
        channel: str,
        *,
        stale_s: float,
        pause_s: float,
        low: float = -math.inf,
        high: float = math.inf,
    ) -> None:
        if channel not in daqco.channels:
            raise ConfigError(
                f"there is no active channel {channel!r}; there are {', '.join(daqco.channels)}"
            )
        self._daqco = daqco
        self._clock = daqco.clock
        self._channel = channel
        self._unit = daqco.units[channel]
        # Values by another scale, or of another input, are not of the quantity that is held.
        self._settings = daqco.settings
        self._stale_s, self._pause_s = stale_s, min(pause_s, stale_s)
        self._limits = Limits(channel, self._unit, low, high)
        self._newest: Sample | None = None
        self._on_limit: Callable[[CosmicError], None] | None = None
        self._forget: Callable[[], None] | None = None

    @property
    @override
    def name(self) -> str:
        return self._channel

    @property
    @override
    def unit(self) -> str:
        return self._unit

    @property
    @override
    def measurable(self) -> tuple[float, float]:
        return measurable(self._channel, self._settings)

    @property
    @override
    def clock(self) -> Clock:
        return self._clock

    @property
    @override
    def stale_s(self) -> float:
        return self._stale_s

    @property
    @override
    def pause_s(self) -> float:
        return self._pause_s

    @override
    def begin(self, on_limit: Callable[[CosmicError], None]) -> None:
        if not self._daqco.running:
            why = self._daqco.problem or "start it first"
            raise NotAvailable(f"{self._channel}: nothing is acquired; {why}")
        self._on_limit = on_limit
        self._forget = self._daqco.subscribe(self._on_chunk)

    @override
    def newest(self) -> Sample | None:
        return self._newest

    @override
    def end(self) -> None:
        if self._forget is not None:
            self._forget()
            self._forget = None

    def _on_chunk(self, chunk: DataChunk) -> None:
        """Take a chunk; acquisition thread."""
        if (changed := self._changed(chunk)) is not None:
            self._report(ConfigError(f"{changed}; begin the loop again"))
            return
        row = chunk.channels.index(self._channel)
        values = chunk.scales[row].apply(chunk.volts[row])
        self._newest = Sample(float(values[-1]), WALL.now_s(), self._clock.now_s())
        if (crossed := self._limits.crossed(values)) is not None:
            self._report(crossed)

    def _changed(self, chunk: DataChunk) -> str | None:
        """Return what is no longer as when the loop was made; None where all is."""
        begun, now = self._settings, self._daqco.settings
        name = self._channel
        if now is not begun:
            if changed := changed_quantity(name, begun, now):
                return changed
            self._settings = now  # of the same quantity: it is compared once
        if name not in chunk.channels:
            return f"there is no channel {name} any more: renamed, or switched off"
        scale = chunk.scales[chunk.channels.index(name)]
        if scale.unit != self._unit:
            return f"{name} is no longer measured in {self._unit}"
        return None

    def _report(self, error: CosmicError) -> None:
        if self._on_limit is not None:
            self._on_limit(error)


class PositionSource(Source):
    """The position of an axis, in gate coordinates; about 20 values a second while it moves.

    Parameters
    ----------
    low, high : float
        Limits: a position that does not lie between them ends the loop; the gate has its own.
    """

    def __init__(
        self,
        mico: Mico,
        axis: str,
        *,
        stale_s: float,
        low: float = -math.inf,
        high: float = math.inf,
    ) -> None:
        self._axis = mico[axis]
        self._limits = Limits(self._axis.key, self._axis.unit, low, high)
        settings = mico.settings.watch
        self._stale_s = max(stale_s, IDLE_POLLS * settings.idle_poll_s)
        self._on_limit: Callable[[CosmicError], None] | None = None

    @property
    @override
    def name(self) -> str:
        return self._axis.key

    @property
    @override
    def unit(self) -> str:
        return self._axis.unit

    @property
    @override
    def measurable(self) -> tuple[float, float]:
        return -math.inf, math.inf

    @property
    @override
    def clock(self) -> Clock:
        return WALL

    @property
    @override
    def stale_s(self) -> float:
        return self._stale_s

    @property
    @override
    def pause_s(self) -> float:
        return self._stale_s

    @override
    def begin(self, on_limit: Callable[[CosmicError], None]) -> None:
        """Remember whom to tell; MiCo reads positions anyway."""
        self._on_limit = on_limit

    @override
    def newest(self) -> Sample | None:
        state = self._axis.details
        if state.position is None:
            return None
        crossed = self._limits.crossed(state.position)
        if crossed is not None and self._on_limit is not None:
            self._on_limit(crossed)
        return Sample(state.position, state.read_wall_s, state.read_wall_s)

    @override
    def end(self) -> None:
        """Nothing to do."""
