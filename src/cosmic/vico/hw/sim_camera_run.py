"""When the frames of a simulated camera are exposed, and which of them find a buffer."""

import math
from collections import deque
from dataclasses import dataclass
from typing import Final

from cosmic.vico.hw.interface import CameraSettings, Trigger

BUFFERS: Final = 16
"""So many frames wait for a receiver that is late."""


@dataclass(frozen=True, slots=True)
class Exposure:
    """One frame on its way: with the settings that were in force when its exposure began."""

    frame_id: int
    exposed_s: float
    settings: CameraSettings


class CameraRun:
    """The frames from `start` to `stop`; its owner holds a lock.

    Parameters
    ----------
    buffers : int
        How many frames may wait or be under way.

    Attributes
    ----------
    underrun : int
        Frames that found no buffer free when their exposure began.
    """

    def __init__(self, settings: CameraSettings, now_s: float, buffers: int) -> None:
        self.settings = settings
        self.underrun = 0
        self._buffers = buffers
        self._waiting: deque[Exposure] = deque()
        self._next_id = 0
        self._next_s = now_s if settings.trigger is Trigger.FREE_RUN else math.inf

    def first(self, now_s: float) -> Exposure | None:
        """Return the frame that is next to be received, or None before its exposure began."""
        self._advance(now_s)
        return self._waiting[0] if self._waiting else None

    @property
    def next_exposed_s(self) -> float:
        """When the next exposure begins that is not under way."""
        return self._next_s

    def take(self) -> None:
        """Give the buffer of the first frame free."""
        self._waiting.popleft()

    def change(self, settings: CameraSettings, now_s: float) -> None:
        """Go on with other settings from the next exposure on."""
        self._advance(now_s)
        before = self._next_s - 1.0 / self.settings.rate_hz
        if math.isfinite(self._next_s):
            self._next_s = max(before + 1.0 / settings.rate_hz, now_s)
        self.settings = settings

    def expose(self, now_s: float, busy_s: float) -> None:
        """Take one picture, when the one before is out of the way.

        Parameters
        ----------
        busy_s : float
            From one exposure's begin to the earliest begin of the next.
        """
        last_s = self._waiting[-1].exposed_s if self._waiting else -math.inf
        self._begin(max(now_s, last_s + busy_s))

    def _advance(self, now_s: float) -> None:
        while self._next_s <= now_s:
            if len(self._waiting) >= self._buffers:
                # Nobody receives: nothing but the count changes.
                missed = int((now_s - self._next_s) * self.settings.rate_hz) + 1
                self.underrun += missed
                self._next_id += missed
                self._next_s += missed / self.settings.rate_hz
            else:
                self._begin(self._next_s)
                self._next_s += 1.0 / self.settings.rate_hz

    def _begin(self, exposed_s: float) -> None:
        if len(self._waiting) < self._buffers:
            self._waiting.append(Exposure(self._next_id, exposed_s, self.settings))
        else:
            self.underrun += 1
        self._next_id += 1
