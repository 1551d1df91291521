"""Positions and force while a fibre is treated, for its record and for the replay."""

import math
from bisect import bisect_left
from collections.abc import Callable
from threading import Lock
from typing import Final

import numpy as np

from cosmic.autonomy.campaign.records import Series
from cosmic.daqco.api.daqco import Daqco
from cosmic.daqco.core.chunk import DataChunk
from cosmic.frame.clock import Clock
from cosmic.mico.api.mico import Mico
from cosmic.mico.core.positioner import PositionerState

MOST: Final = 20_000
"""Values that are kept of one series; of a longer one the begin is kept."""
LEAST_CHANGE: Final = 0.05
"""In the unit of the axis: what an axis that stands may seem to move."""


class MotionLog:
    """Keeps what axes and force did since the time given to `begin`; any thread.

    Positions are gate coordinates, in um or degrees, at the times they were read; the force is the
    mean of each chunk.
    """

    def __init__(self, mico: Mico, daqco: Daqco, channel: str, clock: Clock) -> None:
        self._channel = channel
        self._clock = clock
        self._lock = Lock()
        self._units = {axis.name: str(axis.unit) for axis in mico}
        self._force_unit = daqco.units[channel]
        self._kept: dict[str, list[tuple[float, float]]] = {}
        self._last: dict[str, float] = {}
        self._forget: list[Callable[[], None]] = [axis.subscribe(self._take) for axis in mico]
        self._forget.append(daqco.subscribe(self._feel))

    def close(self) -> None:
        """Listen no longer; harmless the second time."""
        forget, self._forget = self._forget, []
        for each in forget:
            each()

    def begin(self, since_s: float) -> None:
        """Forget what was before a time, but for where the axes stood then."""
        with self._lock:
            axes = {name: [(since_s, value)] for name, value in self._last.items()}
            kept = {name: _since(values, since_s) for name, values in self._kept.items()}
            self._kept = axes | kept

    def series(
        self, since_s: float = -math.inf, *, felt_s: tuple[float, float] | None = None
    ) -> tuple[Series, ...]:
        """Return what was kept since a time.

        Parameters
        ----------
        felt_s : (float, float), optional
            From when until when the force is wanted.
        """
        low_s, high_s = felt_s or (-math.inf, math.inf)
        with self._lock:
            kept = {name: _since(values, since_s) for name, values in self._kept.items()}
        force = kept.pop(self._channel, [])
        kept[self._channel] = [each for each in force if low_s <= each[0] <= high_s]
        return tuple(
            Series(
                name,
                self._units.get(name, self._force_unit),
                np.array([time_s for time_s, _ in values]),
                np.array([value for _, value in values]),
            )
            for name, values in kept.items()
            if values
        )

    def _take(self, state: PositionerState) -> None:
        if state.position is None:
            return
        before = self._last.get(state.name)
        if before is not None and abs(state.position - before) < LEAST_CHANGE:
            return
        self._last[state.name] = state.position
        self._keep(state.name, self._clock.now_s(), state.position)

    def _feel(self, chunk: DataChunk) -> None:
        values = chunk.values[chunk.channels.index(self._channel)]
        self._keep(self._channel, chunk.end_time_s, float(values.mean()))

    def _keep(self, name: str, time_s: float, value: float) -> None:
        with self._lock:
            values = self._kept.setdefault(name, [])
            if len(values) < MOST:
                values.append((time_s, value))


def _since(values: list[tuple[float, float]], since_s: float) -> list[tuple[float, float]]:
    """Return the values from a time on, the one that held at that time first."""
    first = bisect_left(values, since_s, key=lambda each: each[0])
    if first == 0:
        return list(values)
    return [(since_s, values[first - 1][1]), *values[first:]]
