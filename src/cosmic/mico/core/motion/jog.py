"""Continuous movement as a chain of short packets, each kept alive by whoever holds the key."""

import math
from dataclasses import replace
from typing import Final

from typing_extensions import override

from cosmic.frame.clock import WALL
from cosmic.frame.errors import MoveCancelled
from cosmic.mico.core.motion.orders import Jog, Motion, MoveTo, Steer, Step
from cosmic.mico.core.motion.positioner import PositionerState
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
            steps = max(1, min(state.most_steps, round(self._jog.speed * ahead_s)))
            return self._step(steps, round(self._jog.speed))
        position = state.position if state.position is not None else math.nan
        target = position + self._jog.direction * self._speed * ahead_s
        if state.limits is not None:
            target = min(max(target, state.limits[0]), state.limits[1])
        return MoveTo(target, state.unit)

    def _step(self, steps: int, frequency_hz: int) -> Step:
        amplitude_v = self._settings.defaults.amplitude_v
        return Step(self._jog.direction * steps, amplitude_v, frequency_hz)

    def let_go(self) -> bool:
        """Return True once it was not renewed for the dead-man time, and must end."""
        return self._expired()

    def renew(self) -> None:
        """Say that the key is still held; any thread."""
        self._renewed_wall_s = WALL.now_s()

    def due(self, now_s: float) -> bool:
        """Return True when the next packet must be sent, or the dead-man deadline has passed."""
        return now_s >= self._next_s or self._expired()

    def _expired(self) -> bool:
        return WALL.now_s() - self._renewed_wall_s > self._settings.jog.dead_man_s

    def packet(self, state: PositionerState, now_s: float) -> Motion | None:
        """Return the next packet, or None when the jog is over: let go, or at the limit.

        Without a sensor it is over at speed 0 as well: no packet has fewer steps than one.
        """
        if self.let_go():
            return None
        packet_s = self._settings.jog.packet_s
        self._next_s = now_s + 0.4 * packet_s
        if state.kind is not PositionerKind.OPEN_LOOP:
            return self._towards_limit(state, now_s, packet_s)
        if self.speed == 0.0:
            return None
        frequency_hz = max(1, round(self.speed))
        # After a whole number of steps, for each packet makes its first one at once.
        whole = math.ceil(0.4 * packet_s * frequency_hz - 1e-9)
        self._next_s = now_s + whole / frequency_hz
        return self._step(max(1, math.floor(frequency_hz * packet_s)), frequency_hz)

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
        travel = min(ahead, sign * (position - self._start) + reach)
        target = self._start + sign * travel
        if state.limits is not None:
            outermost = state.limits[1] if sign > 0 else state.limits[0]
            if sign * (outermost - position) <= 0.1 * min(reach, 1.0):
                return None if now_s > self._started_s else MoveTo(target, state.unit)
            target = sign * min(sign * target, sign * outermost)
        return MoveTo(target, state.unit)


PACKET_PERIOD_S: Final = 0.006
"""Least time between two packets, on the wall clock: a hand is followed more than 100 times/s."""
LOOK_PERIOD_S: Final = 0.04
LOCATE_PERIOD_S: Final = 0.02
NEAR_STEPS: Final = 10.0
"""Closer than so many steps to its target an axis is slow, so that it is let go faster there."""
GLIDE: Final = 1.5
CREEPING_GLIDE: Final = 7.5
_CHANGE: Final = 0.05
"""Part of the speed by which it must change before the axis gets a new limit."""
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
        limited = abs(self.speed - self._limited_to) <= _CHANGE * self._limited_to
        if limited and now_s - self._looked_wall_s < LOOK_PERIOD_S:
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
    def let_go(self) -> bool:
        over = self._lost is not None or self._expired()
        if over and self._lost is None:
            # Remembered, for a renewal may come between this and the end that it leads to.
            self._lost = HandLostError("its input was lost")
        return over

    @override
    def packet(self, state: PositionerState, now_s: float) -> Motion | None:
        self._packet_wall_s = WALL.now_s()
        return super().packet(state, now_s)

    @override
    def _towards_limit(
        self, state: PositionerState, now_s: float, packet_s: float
    ) -> Motion | None:
        sign, speed = self._jog.direction, self._share * self._speed
        reach = SHARE * speed * packet_s
        here = self._here(state)
        if self._target is None:
            travel = reach
        else:
            ahead = sign * (self._target - here) + speed * (now_s - self._target_s)
            travel = min(max(ahead, 0.0), reach)  # never more than one packet ahead of the axis
        first = self._target is None and self._velocity == 0.0
        target = here + sign * travel
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
