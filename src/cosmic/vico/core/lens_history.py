"""Where the lens was and how bright the light, at moments past: circumstances of a frame."""

from collections import deque
from dataclasses import dataclass
from itertools import pairwise
from threading import Lock
from typing import Final

from cosmic.vico.hw.peripherals import LensAxis, LensState

KEPT: Final = 1_200
"""A minute of movement, twenty of rest."""


@dataclass(frozen=True, slots=True)
class _Look:
    """What was heard at a time: counts or percent, None where it means nothing."""

    time_s: float
    value: float | None
    moving: bool


class _Looks:
    """Looks at one thing in order of time; one thread adds, any thread asks."""

    def __init__(self) -> None:
        self._looks: deque[_Look] = deque(maxlen=KEPT)
        self._lock = Lock()

    def add(self, look: _Look) -> None:
        with self._lock:
            self._looks.append(look)

    def at(self, time_s: float) -> float | None:
        before, after = self._around(time_s)
        if before is None:
            return None
        if time_s == before.time_s:
            return before.value
        if after is None:
            return None if before.moving else before.value
        if before.value is None or after.value is None:
            return None
        if not before.moving:
            # Every movement of ours begins with a look; another hand's began nobody knows when.
            return before.value if before.value == after.value else None
        part = (time_s - before.time_s) / (after.time_s - before.time_s)
        return before.value + part * (after.value - before.value)

    def _around(self, time_s: float) -> tuple[_Look | None, _Look | None]:
        """Return the last look up to `time_s` and the first after it."""
        with self._lock:
            looks = tuple(self._looks)
        if not looks or time_s < looks[0].time_s:
            return None, None
        if time_s >= looks[-1].time_s:
            return looks[-1], None
        for after, before in pairwise(reversed(looks)):
            if before.time_s <= time_s:
                return before, after
        return None, None


class LensHistory:
    """What was known of both motors and the light, and when; any thread asks."""

    def __init__(self) -> None:
        self._motors = {axis: _Looks() for axis in LensAxis}
        self._light = _Looks()

    def add_motor(
        self, axis: LensAxis, time_s: float, state: LensState | None, *, starts: bool = False
    ) -> None:
        """Add a look at a motor; None: it cannot be asked. `starts`: it was told to move then."""
        known = state is not None and state.homed
        value = float(state.position_counts) if state is not None and known else None
        moving = starts or (state is not None and state.moving)
        self._motors[axis].add(_Look(time_s, value, moving))

    def add_light(self, time_s: float, percent: float | None) -> None:
        """Add a look at the light; None: it cannot be asked."""
        self._light.add(_Look(time_s, percent, moving=False))

    def counts_at(self, axis: LensAxis, time_s: float) -> float | None:
        """Return where a motor was at `time_s` of platform time, straight between two looks.

        None where nobody knows: before the first look, not homed, the line lost, moving and not
        looked at since, or moved by somebody else between two looks.
        """
        return self._motors[axis].at(time_s)

    def light_at(self, time_s: float) -> float | None:
        """Return how bright it was at `time_s` of platform time; None where nobody knows."""
        return self._light.at(time_s)
