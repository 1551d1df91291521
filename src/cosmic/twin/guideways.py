"""Where stages truly are when their sensors tell a position: scale, yaw, play and lag."""

import math
import random
from collections.abc import Mapping

from cosmic.twin.settings import TwinSettings


class Guideways:
    """The errors of all stages, drawn from the seed; `follow` at one thread at a time.

    Notes
    -----
    A tool's stages are those with the same word before the point: the yaw of "left.x" leads the
    tip aside, along "left.y".
    """

    def __init__(self, settings: TwinSettings, seed: int) -> None:
        self._scale: dict[str, float] = {}
        self._yaw: dict[str, tuple[str, float, float, float]] = {}
        self._loose: dict[str, tuple[float, float, float]] = {}
        for name, stage in settings.stages.items():
            kind = settings.kinds[stage.kind]
            chance = random.Random(f"guideway {name} {seed}")
            scale, phase, side = chance.gauss(0, 1), chance.random(), chance.choice((-1.0, 1.0))
            if kind.scale_error:
                self._scale[name] = 1.0 + kind.scale_error * scale
            across = _across(name)
            if kind.yaw_um and across in settings.stages:
                rate = math.pi / (kind.high - kind.low)
                self._yaw[name] = across, 0.5 * side * kind.yaw_um, rate, math.pi * phase
            if kind.reversal or kind.lag_part:
                self._loose[name] = 0.5 * kind.reversal, kind.lag_part, kind.lag_s
        self._lag_s = {name: lag_s for name, (_, _, lag_s) in self._loose.items()}
        self._play: dict[str, float] = {}
        self._aside: dict[str, float] = {}
        self._lag: dict[str, float] = {}
        self._lagging = 0.0
        self._before: dict[str, float] = {}
        self._played: dict[str, float] = {}
        self._time_s = 0.0

    @property
    def true(self) -> bool:
        """Whether all stages are where their sensors tell."""
        return not (self._scale or self._yaw or self._loose)

    def led(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return where stages are after scale and yaw, which depend on the positions alone."""
        found = dict(values)
        for name, scale in self._scale.items():
            if name in found:
                found[name] *= scale
        for name, (across, half, rate, phase) in self._yaw.items():
            if name in values and across in found:
                found[across] += half * (math.sin(rate * values[name] + phase) - math.sin(phase))
        return found

    def follow(self, values: Mapping[str, float], time_s: float) -> dict[str, float]:
        """Return where stages are after play and lag too, which depend on how they came there.

        Times rise from call to call.
        """
        passed_s, self._time_s = time_s - self._time_s, time_s
        if values != self._before:
            self._move(values)
        found = self._played.copy()
        lagging, kept, kept_for_s = 0.0, 1.0, -1.0
        for name, before in self._lag.items():
            if self._lag_s[name] != kept_for_s:  # mostly all stages have the same
                kept_for_s = self._lag_s[name]
                kept = math.exp(-passed_s / kept_for_s)
            lag = before * kept
            self._lag[name] = lag
            found[name] -= lag
            if abs(lag) > lagging:
                lagging = abs(lag)
        self._lagging = lagging
        return found

    def _move(self, values: Mapping[str, float]) -> None:
        """Take note that stages are led elsewhere: what has play stays behind, the rest lags."""
        before = self._before
        moved = [name for name, at in values.items() if at != before.get(name)]
        for name in moved:
            if name in self._yaw:
                across, half, rate, phase = self._yaw[name]
                self._aside[across] = half * (
                    math.sin(rate * values[name] + phase) - math.sin(phase)
                )
                if across in values and across not in moved:
                    self._lead(across, values[across])
        for name in moved:
            at = values[name]
            self._lead(name, at)
            part = self._loose[name][1] if name in self._loose else 0.0
            lagged = part * (at - before.get(name, at))
            if lagged:
                self._lag[name] = self._lag.get(name, 0.0) + lagged
        self._before = dict(values)

    def _lead(self, name: str, at: float) -> None:
        """Take note of where one stage is with its play, but for its lag."""
        led = at * self._scale.get(name, 1.0) + self._aside.get(name, 0.0)
        half = self._loose[name][0] if name in self._loose else 0.0
        if half:
            play = min(max(self._play.get(name, at), at - half), at + half)
            self._play[name] = play
            led += play - at
        self._played[name] = led

    @property
    def restless_s(self) -> float:
        """For how long nothing creeps that could be felt."""
        return 0.05 if self._lagging > 0.01 else math.inf


def _across(name: str) -> str:
    tool, _, axis = name.partition(".")
    other = {"x": "y", "y": "x"}.get(axis, "")
    return f"{tool}.{other}"
