"""Continuous movement as a chain of short packets, each kept alive by whoever holds the key."""

import math
from typing import Final

from cosmic.frame.clock import WALL
from cosmic.frame.errors import MoveCancelled
from cosmic.mico.core.orders import LARGEST_STEPS, Jog, Motion, MoveTo, Step
from cosmic.mico.core.positioner import PositionerState
from cosmic.mico.core.settings import MicoSettings
from cosmic.mico.hw.interface import PositionerKind

SHARE: Final = 0.8
"""How much of a packet is travelled at speed; an axis is slower over its last micrometres."""
SLOWER: Final = tuple(0.5**number for number in range(7))
"""Parts of the speed asked for, tried one after the other where something is in the way."""


class JogRun:
    """Works out the packets of one jog; device thread, except `renew`.

    No packet is longer than `packet_s` of motion, so whatever dies, the axis stands soon after.
    The dead-man deadline counts on the wall clock. `top_speed` is what the axis can do at most.
    """

    def __init__(self, jog: Jog, settings: MicoSettings, top_speed: float = math.inf) -> None:
        self._jog = jog
        self._speed = min(jog.speed, top_speed)
        self._settings = settings
        self._renewed_wall_s = WALL.now_s()
        self._started_s: float | None = None
        self._start = 0.0
        self._next_s = 0.0
        self._share = 1.0

    @property
    def speed(self) -> float:
        """Speed now, in the axis' unit per second, or Hz without a sensor."""
        return self._share * self._jog.speed

    @property
    def pause_s(self) -> float:
        """How long may pass before somebody looks whether a packet is due."""
        return 0.2 * self._settings.jog.packet_s

    @property
    def lost(self) -> MoveCancelled | None:
        """Why it ended, where that is no good end; letting go of a key is."""
        return None

    def follow_hand(self) -> None:
        """Take over what is wanted now; a plain jog keeps its speed."""

    def must_look(self) -> bool:
        """Return True when the way ahead must be looked at before the next packet."""
        return True

    def slow_down(self, share: float) -> bool:
        """Go at `share` of the speed asked for; returns True when that is a change."""
        changed = share != self._share
        if changed:
            self._share, self._started_s = share, None
        return changed

    def look_ahead(self, state: PositionerState, share: float) -> Motion:
        """Return the way that must be free for the axis to go on at `share` of its speed."""
        ahead_s = share * self._settings.jog.look_ahead_s
        if state.kind is PositionerKind.OPEN_LOOP:
            steps = max(1, min(LARGEST_STEPS, round(self._jog.speed * ahead_s)))
            return self._step(steps, round(self._jog.speed))
        position = state.position if state.position is not None else math.nan
        target = position + self._jog.direction * self._speed * ahead_s
        if state.limits is not None:
            target = min(max(target, state.limits[0]), state.limits[1])
        return MoveTo(target, state.unit)

    def _step(self, steps: int, frequency_hz: int) -> Step:
        amplitude_v = self._settings.defaults.amplitude_v
        return Step(self._jog.direction * steps, amplitude_v, frequency_hz)

    def renew(self) -> None:
        """Say that the key is still held; any thread."""
        self._renewed_wall_s = WALL.now_s()

    def due(self, now_s: float) -> bool:
        """Return True when the next packet must be sent, or the dead-man deadline has passed."""
        return now_s >= self._next_s or self._expired()

    def _expired(self) -> bool:
        return WALL.now_s() - self._renewed_wall_s > self._settings.jog.dead_man_s

    def packet(self, state: PositionerState, now_s: float) -> Motion | None:
        """Return the next packet, or None when the jog is over: let go, or at the limit."""
        if self._expired():
            return None
        packet_s = self._settings.jog.packet_s
        self._next_s = now_s + 0.4 * packet_s
        if state.kind is PositionerKind.OPEN_LOOP:
            frequency_hz = max(1, round(self.speed))
            return self._step(max(1, math.floor(frequency_hz * packet_s)), frequency_hz)
        return self._towards_limit(state, now_s, packet_s)

    def _towards_limit(
        self, state: PositionerState, now_s: float, packet_s: float
    ) -> Motion | None:
        position = state.position if state.position is not None else math.nan
        if self._started_s is None:
            self._started_s, self._start = now_s, position
        speed = self._share * self._speed
        sign, reach = self._jog.direction, SHARE * speed * packet_s
        ahead = speed * (now_s - self._started_s) + reach
        # Never more than one packet ahead of where the axis really is.
        way = min(ahead, sign * (position - self._start) + reach)
        target = self._start + sign * way
        if state.limits is not None:
            outermost = state.limits[1] if sign > 0 else state.limits[0]
            if sign * (outermost - position) <= 0.1 * min(reach, 1.0):
                return None if now_s > self._started_s else MoveTo(target, state.unit)
            target = sign * min(sign * target, sign * outermost)
        return MoveTo(target, state.unit)
