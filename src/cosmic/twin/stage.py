"""Physics of one stick-slip stage: where it truly is at any moment.

A movement is planned when it starts, as a `Path`, and evaluated when somebody looks; nothing runs
in between. Positions, lengths and speeds are in the stage's own unit: um, or degrees of a rotary
stage.
"""

import math
import random
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

from cosmic.frame.units import AxisUnit
from cosmic.twin.settings import StageKind

ENDLESS_S: Final = 1e9
"""How far ahead a movement without end is planned, s."""

PATHS_KEPT: Final = 64
"""So many movements back, instruments that report late still see where a stage was."""


@dataclass(frozen=True, slots=True)
class Path:
    """A position over time: straight between knots, then still or creeping.

    Attributes
    ----------
    times_s, positions : tuple of float
        The knots; times never fall.
    creep_from_s : float
        When creep starts, not before the last knot; inf while the stage is held.
    creep_per_s : float
        Speed of the creep.
    """

    times_s: tuple[float, ...]
    positions: tuple[float, ...]
    creep_from_s: float = math.inf
    creep_per_s: float = 0.0

    @property
    def end_s(self) -> float:
        """When the last knot is passed."""
        return self.times_s[-1]

    def at(self, time_s: float) -> float:
        """Return the position at `time_s`; before the first knot the stage stood there."""
        times_s, positions = self.times_s, self.positions
        if time_s >= times_s[-1]:
            creeping_s = time_s - self.creep_from_s
            return positions[-1] + (self.creep_per_s * creeping_s if creeping_s > 0.0 else 0.0)
        if time_s <= times_s[0]:
            return positions[0]
        after = bisect_right(times_s, time_s)
        start_s, start = times_s[after - 1], positions[after - 1]
        part = (time_s - start_s) / (times_s[after] - start_s)
        return start + part * (positions[after] - start)

    def leg(self, time_s: float) -> tuple[float, float]:
        """Return the speed at `time_s`, per second, and until when it stays so; creep is none."""
        times_s, positions = self.times_s, self.positions
        if time_s >= times_s[-1]:
            return 0.0, math.inf
        if time_s < times_s[0]:
            return 0.0, times_s[0]
        after = bisect_right(times_s, time_s)
        distance = abs(positions[after] - positions[after - 1])
        return distance / (times_s[after] - times_s[after - 1]), times_s[after]

    def cut(self, time_s: float, *, end_s: float, end: float) -> "Path":
        """Return this path up to `time_s` and from there straight to `end` at `end_s`."""
        kept = [(t, x) for t, x in zip(self.times_s, self.positions, strict=True) if t <= time_s]
        times_s = (*(t for t, _ in kept), time_s, max(time_s, end_s))
        return Path(times_s, (*(x for _, x in kept), self.at(time_s), end))


class Stage:
    """One stage; made by the scene, moved by its controller, looked at by anybody.

    Parameters
    ----------
    name : str
        Its name on the platform, such as "left.x".
    kind : StageKind
        Its constants.
    start : float
        Where it stands.
    seed : int
        Of its randomness.

    Attributes
    ----------
    planned : callable or None
        Given every path when it is planned, with the lock of a controller held: it may take note,
        and must not compute.
    step_share : float
        How much of each step it makes; less than 1 when something is worn.

    Notes
    -----
    Any thread may read; one at a time may move it. A path is never changed, only replaced.
    """

    def __init__(self, name: str, kind: StageKind, *, start: float, seed: int) -> None:
        if not kind.low <= start <= kind.high:
            raise ValueError(f"{name} cannot stand at {start}: {kind.low} to {kind.high}")
        self.name = name
        self.kind = kind
        self.random = random.Random(f"stage {name} {seed}")
        self._paths: tuple[Path, ...] = (Path((0.0,), (start,)),)
        self._wall: tuple[float, int] | None = None
        self.step_share = 1.0
        self.planned: Callable[[Path], None] | None = None
        creep_per_min = self.random.uniform(kind.drift_per_min_low, kind.drift_per_min_high)
        self._creep_per_s = creep_per_min * self.random.choice((-1, 1)) / 60.0

    @property
    def unit(self) -> AxisUnit:
        """Unit of every position of this stage."""
        return self.kind.unit

    @property
    def path(self) -> Path:
        """The movement planned last; ended long ago when the stage stands."""
        return self._paths[-1]

    @property
    def paths(self) -> tuple[Path, ...]:
        """The last movements, the newest at the end; a new tuple whenever one is planned."""
        return self._paths

    def position(self, time_s: float) -> float:
        """Return where the stage truly is at `time_s`."""
        low, high = self.bounds
        return min(max(self.path.at(time_s), low), high)

    def position_then(self, time_s: float) -> float:
        """Return where the stage was at `time_s`, though newer movements began since."""
        for path in reversed(self._paths):
            if path.times_s[0] <= time_s:
                break
        else:
            path = self._paths[0]
        low, high = self.bounds
        return min(max(path.at(time_s), low), high)

    def leg_then(self, time_s: float) -> tuple[float, float]:
        """Return its speed at `time_s` without sign, and until when it stays so."""
        until_s = math.inf
        for path in reversed(self._paths):
            if path.times_s[0] <= time_s:
                speed, end_s = path.leg(time_s)
                return speed, min(end_s, until_s)
            until_s = min(until_s, path.times_s[0])
        return 0.0, until_s

    def step_size(self, amplitude_v: float, direction: int) -> float:
        """Return the mean length of one step, positive, at `amplitude_v` in `direction` (+-1)."""
        kind = self.kind
        part = (amplitude_v - kind.threshold_v) / (100.0 - kind.threshold_v)
        factor = kind.backward_factor if direction < 0 else 1.0
        return kind.step_at_100v * factor * max(part, 0.0)

    def noisy_steps(self, steps: int, amplitude_v: float) -> float:
        """Return the signed way that `steps` steps will go.

        The noise of many independent steps is drawn once, on their sum.
        """
        if steps == 0:
            return 0.0
        count, direction = abs(steps), (1 if steps > 0 else -1)
        share = self.step_share
        noise = self.kind.step_noise * self.random.gauss(0.0, 1.0) / math.sqrt(count)
        return (
            share
            * direction
            * count
            * self.step_size(amplitude_v, direction)
            * max(1.0 + noise, 0.0)
        )

    @property
    def bounds(self) -> tuple[float, float]:
        """How far the stage can go down and up: its stops, or a wall in front of one."""
        wall = self._wall
        if wall is None:
            return self.kind.low, self.kind.high
        position, side = wall
        if side > 0:
            return self.kind.low, min(self.kind.high, position)
        return max(self.kind.low, position), self.kind.high

    def obstruct(self, position: float, side: int) -> None:
        """Put a wall on the side of the stage (+1 above, -1 below) at `position`."""
        self._wall = (position, side)

    def clear_obstruction(self) -> None:
        """Take the wall away."""
        self._wall = None

    @property
    def obstructed(self) -> bool:
        """Whether there is a wall in the travel."""
        return self._wall is not None

    def route(self, time_s: float) -> "Route":
        """Return an empty route that starts where the stage is at `time_s`."""
        return Route(self, time_s)

    def follow(self, route: "Route", *, held_until_s: float) -> None:
        """Move along `route`, and creep once it is over and the stage is not held any more."""
        path = route.path()
        self._plan(replace(path, creep_from_s=max(path.end_s, held_until_s)))

    def halt(self, time_s: float, *, coast_s: float, within_s: float) -> float:
        """Leave the path at `time_s`, finish the step in hand, and return when it stands.

        Parameters
        ----------
        coast_s : float
            How much of the planned movement the step in hand still is.
        within_s : float
            The most time that the rest of the step takes.
        """
        end = self.position(time_s + coast_s)
        end_s = time_s + min(coast_s, within_s)
        cut = self.path.cut(time_s, end_s=end_s, end=end)
        self._plan(replace(cut, creep_from_s=end_s))
        return end_s

    def _plan(self, path: Path) -> None:
        path = replace(path, creep_per_s=self._creep_per_s)
        self._paths = (*self._paths[1 - PATHS_KEPT :], path)
        if self.planned is not None:
            self.planned(path)


class Route:
    """A path being planned, leg by leg; walls end a leg early."""

    def __init__(self, stage: Stage, time_s: float) -> None:
        self._stage = stage
        self._times_s = [time_s]
        self._positions = [stage.position(time_s)]

    @property
    def end_s(self) -> float:
        """When the legs so far are over."""
        return self._times_s[-1]

    @property
    def position(self) -> float:
        """Where the legs so far lead."""
        return self._positions[-1]

    def path(self) -> Path:
        """Return the path of all legs."""
        return Path(tuple(self._times_s), tuple(self._positions))

    def wait(self, duration_s: float) -> None:
        """Stand still for `duration_s`."""
        self._add(self.end_s + duration_s, self.position)

    def go(self, target: float, speed: float) -> bool:
        """Go towards `target` at `speed` per second; False when a wall ended the leg."""
        low, high = self._stage.bounds
        end = min(max(target, low), high)
        distance = abs(end - self.position)
        if distance > 0.0:
            # No speed means never: the amplitude is too small for any step.
            duration_s = min(distance / speed, ENDLESS_S) if speed > 0.0 else ENDLESS_S
            end = self.position + math.copysign(
                min(distance, speed * duration_s), end - self.position
            )
            self._add(self.end_s + duration_s, end)
        return low <= target <= high

    def settle(self, position: float, duration_s: float) -> None:
        """Come to rest at `position`, or at the wall in front of it, within `duration_s`."""
        low, high = self._stage.bounds
        self._add(self.end_s + duration_s, min(max(position, low), high))

    def _add(self, time_s: float, position: float) -> None:
        self._times_s.append(time_s)
        self._positions.append(position)
