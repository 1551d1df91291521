"""A jog whose speed and direction change as it goes: an axis steered by hand."""

import math
from dataclasses import replace
from typing import Final

from typing_extensions import override

from cosmic.frame.clock import WALL
from cosmic.frame.errors import MoveCancelled
from cosmic.mico.core.jog import SHARE, JogRun
from cosmic.mico.core.orders import Motion, MoveTo, Steer
from cosmic.mico.core.positioner import PositionerState
from cosmic.mico.core.settings import MicoSettings

PACKET_PERIOD_S: Final = 0.006
"""Least time between two packets, on the wall clock: a hand is followed more than 100 times/s."""
LOOK_PERIOD_S: Final = 0.04
LOCATE_PERIOD_S: Final = 0.02
NEAR_STEPS: Final = 10.0
"""Closer than so many steps to its target an axis is slow, so that it is let go faster there."""
GLIDE: Final = 1.5
CREEPING_GLIDE: Final = 7.5
_CHANGE: Final = 0.05
"""Part of the speed by which it must change before the axis is told."""
_OLDEST_S: Final = 0.1


class HandLostError(MoveCancelled):
    """Nobody said for too long how fast a steered axis is to go."""


class SteerRun(JogRun):
    """Works out the packets of a steered axis; device thread, except `steer` and `renew`.

    The newest wish counts, and none is queued. `rate` is that of the platform's clock.
    """

    def __init__(
        self, steer: Steer, settings: MicoSettings, top_speed: float, rate: float = 1.0
    ) -> None:
        super().__init__(steer, settings, top_speed)
        self._dead_man_s = steer.dead_man_s
        self._top_speed = top_speed
        self._rate = rate
        self._wanted = steer.direction * steer.speed
        self._limited_to = 0.0
        self._packet_wall_s = self._looked_wall_s = self._located_wall_s = -math.inf
        self._target: float | None = None
        self._target_s = 0.0
        self._velocity = 0.0
        self._lost: HandLostError | None = None

    # Any thread

    def steer(self, velocity: float) -> bool:
        """Say how fast it is to go, with the sign; True when that is a change worth a packet."""
        before, self._wanted = self._wanted, velocity
        self.renew()
        return abs(velocity - before) > _CHANGE * abs(before)

    # Device thread

    @property
    @override
    def pause_s(self) -> float:
        return 0.5 * PACKET_PERIOD_S * self._rate

    @override
    def follow_hand(self) -> None:
        wanted = self._wanted
        direction = 1 if wanted > 0.0 else -1
        if direction != self._jog.direction:
            self._target, self._looked_wall_s = None, -math.inf
        if abs(wanted) > 1.2 * self._jog.speed:
            self._looked_wall_s = -math.inf  # it now needs a longer way to be free
        self._jog = replace(self._jog, direction=direction, speed=abs(wanted))
        self._speed = min(abs(wanted), self._top_speed)

    @override
    def must_look(self) -> bool:
        now_s = WALL.now_s()
        told = abs(self.speed - self._limited_to) <= _CHANGE * self._limited_to
        if told and now_s - self._looked_wall_s < LOOK_PERIOD_S:
            return False
        self._looked_wall_s = now_s
        return True

    def glide(self, step: float) -> float:
        """Return how much faster than asked the axis may go, `step` being its nominal step."""
        reach = SHARE * self.speed * self._settings.jog.packet_s
        return GLIDE if reach > NEAR_STEPS * step else CREEPING_GLIDE

    def must_locate(self) -> bool:
        """Return True when the position should be asked for again."""
        now_s = WALL.now_s()
        due = now_s - self._located_wall_s >= LOCATE_PERIOD_S
        if due:
            self._located_wall_s = now_s
        return due

    @override
    def slow_down(self, share: float) -> bool:
        self._share = share
        changed = abs(self.speed - self._limited_to) > _CHANGE * self._limited_to
        if changed:
            self._limited_to = self.speed
        return changed

    @override
    def due(self, now_s: float) -> bool:
        turned = self._wanted != self._jog.direction * self._jog.speed
        rested = WALL.now_s() - self._packet_wall_s >= PACKET_PERIOD_S
        return super().due(now_s) or (turned and rested)

    @property
    @override
    def lost(self) -> MoveCancelled | None:
        return self._lost

    @override
    def _expired(self) -> bool:
        return WALL.now_s() - self._renewed_wall_s > self._dead_man_s

    @override
    def packet(self, state: PositionerState, now_s: float) -> Motion | None:
        self._packet_wall_s = WALL.now_s()
        if self._expired():
            # Remembered, for a renewal may come between this and the end that it leads to.
            self._lost = HandLostError("nothing steers it any more")
            return None
        return super().packet(state, now_s)

    @override
    def _towards_limit(
        self, state: PositionerState, now_s: float, packet_s: float
    ) -> Motion | None:
        sign, speed = self._jog.direction, self._share * self._speed
        reach = SHARE * speed * packet_s
        here = self._here(state)
        if self._target is None:
            way = reach
        else:
            ahead = sign * (self._target - here) + speed * (now_s - self._target_s)
            way = min(max(ahead, 0.0), reach)  # never more than one packet ahead of the axis
        first = self._target is None and self._velocity == 0.0
        target = here + sign * way
        if state.limits is not None:
            outermost = state.limits[1] if sign > 0 else state.limits[0]
            if sign * (outermost - here) <= 0.1 * min(reach, 1.0) and not first:
                return None
            target = sign * min(sign * target, sign * outermost)
        self._target, self._target_s, self._velocity = target, now_s, sign * speed
        return MoveTo(target, state.unit)

    def _here(self, state: PositionerState) -> float:
        """Return where the axis should be by now, a little after its position was read."""
        if state.position is None:
            return math.nan
        age_s = min(max(0.0, (WALL.now_s() - state.read_wall_s) * self._rate), _OLDEST_S)
        return state.position + self._velocity * age_s
