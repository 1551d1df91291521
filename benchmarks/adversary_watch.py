"""Follows where the stages of a simulated platform truly are, and judges what it sees.

Knows the twin's truth and the platform's files; nothing of the gate, the device or the stop.
"""

import math
import pickle
import subprocess
import sys
import threading
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from tests.oracles.clearance import Near, PlatformClearance

from cosmic.frame.clock import Clock
from cosmic.twin.stage import Path as Course
from cosmic.twin.stage import Stage

ROOT: Final = Path(__file__).resolve().parents[1]
STEP_UM: Final = 0.1
"""The finest that a sensor of the platform tells apart, with room; a pair may lack so much."""
BEHIND_S: Final = 0.05
"""The watch looks so far behind the present, s of the platform."""
FORGOTTEN_S: Final = 0.5
"""Attacks wait while the watch is farther behind than this, s of the platform."""
KEPT_S: Final = 300.0
"""Movements that ended so long before what was looked at last are forgotten, s of the platform."""
STANDING_PER_S: Final = 1e-3
COARSEST_S: Final = 0.05
RESTING_S: Final = 0.5


@dataclass
class Findings:
    """What was seen; harmless while the lists are empty."""

    too_near: list[str] = field(default_factory=list)
    late_stops: list[str] = field(default_factory=list)
    outside: list[str] = field(default_factory=list)
    late_plans: int = 0
    least: Near | None = None
    looks: int = 0
    behind_s: float = 0.0

    @property
    def harmless(self) -> bool:
        """True while nothing went wrong."""
        return not (self.too_near or self.late_stops or self.outside)


class Track:
    """Every movement of one stage from now on: a stage itself remembers only the last 64.

    A process that was halted, or has much to catch up with, looks farther back than those.
    """

    def __init__(self, stage: Stage) -> None:
        self._stage = stage
        self._courses = [stage.path]
        self._late_s: list[float] = []
        self._seen_until_s = 0.0
        self._others = stage.planned
        stage.planned = self._planned

    def _planned(self, course: Course) -> None:
        """Take note of a movement; the thread that plans it, with the lock of a controller."""
        cut = course.times_s[0] == self._courses[-1].times_s[0]  # a stop: it is new from there on
        self._courses.append(course)
        from_s = course.times_s[-2 if cut and len(course.times_s) > 1 else 0]
        if from_s < self._seen_until_s:
            self._late_s.append(from_s)
        if self._others is not None:
            self._others(course)

    def look_until(self, time_s: float) -> float:
        """Say that what comes before `time_s` is judged; return from when on it must be anew.

        A movement that began before, and was planned only now, changes what was looked at.
        """
        self._seen_until_s = from_s = time_s
        while self._late_s:
            from_s = min(from_s, self._late_s.pop())
        return from_s

    def forget(self, before_s: float) -> None:
        """Forget what was over before `before_s`."""
        begun = [n for n, each in enumerate(self._courses) if each.times_s[0] <= before_s]
        del self._courses[: begun[-1] if begun else 0]

    def position(self, time_s: float) -> float:
        """Return where the stage was at `time_s`."""
        courses = self._courses
        course = next((c for c in reversed(courses) if c.times_s[0] <= time_s), courses[0])
        low, high = self._stage.bounds
        return min(max(course.at(time_s), low), high)

    def leg(self, time_s: float) -> tuple[float, float]:
        """Return its speed at `time_s` without sign, and until when it stays so."""
        until_s = math.inf
        for course in reversed(self._courses):
            if course.times_s[0] <= time_s:
                speed, end_s = course.leg(time_s)
                return speed, min(end_s, until_s)
            until_s = min(until_s, course.times_s[0])
        return 0.0, until_s


class Watch(threading.Thread):
    """Marches behind the platform's time, as far at a step as no pair can come inside its margin.

    Parameters
    ----------
    limits : mapping of (float, float)
        Soft limits by axis, for those that have any.
    """

    def __init__(
        self,
        scene: Path,
        stages: Mapping[str, Stage],
        clock: Clock,
        limits: Mapping[str, tuple[float, float]],
    ) -> None:
        super().__init__(name="oracle", daemon=True)
        self.found = Findings()
        command = [sys.executable, "-m", "benchmarks.adversary_watch", str(scene)]
        self._oracle = subprocess.Popen(
            command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )
        assert self._oracle.stdin is not None
        self._to_oracle = self._oracle.stdin
        self._tracks = {name: Track(stage) for name, stage in stages.items()}
        self._clock = clock
        self._limits = dict(limits)
        self._lock = threading.Lock()
        self._stopped_from_s: float | None = None
        self._swept: set[str] = set()
        self._end = threading.Event()
        self._at_s = clock.now_s()

    def must_stand(self, from_s: float) -> None:
        """Have everything stand from `from_s` of the platform on, until `may_move`."""
        with self._lock:
            self._stopped_from_s = from_s

    def may_move(self) -> None:
        """Let things move again: a stop is about to be reset."""
        with self._lock:
            self._stopped_from_s = None

    def may_leave_limits(self, axis: str) -> None:
        """Excuse an axis that is calibrated, referenced or driven to its end stop."""
        with self._lock:
            self._swept.add(axis)

    @property
    def behind(self) -> bool:
        """True while it has to catch up before more may happen."""
        return self._clock.now_s() - self._at_s > FORGOTTEN_S * max(self._clock.rate, 1.0)

    def end(self) -> None:
        """Come up to the present and end."""
        self._end.set()
        self.join()
        self._to_oracle.close()
        assert self._oracle.stdout is not None
        self.found.too_near, self.found.least = pickle.load(self._oracle.stdout)
        self._oracle.wait()

    def run(self) -> None:
        """March until the end."""
        while not self._end.wait(0.002):
            self._march(self._clock.now_s() - BEHIND_S)
        self._march(self._clock.now_s())

    def _march(self, until_s: float) -> None:
        while self._at_s < until_s:
            at_s = self._at_s
            legs = {name: each.leg(at_s) for name, each in self._tracks.items()}
            knot_s = min(end_s for _, end_s in legs.values())
            # Straight on until the next knot of any stage, a few degrees or a quarter mm.
            moving = any(speed > 0.0 for speed, _ in legs.values())
            longest_s = COARSEST_S if moving else RESTING_S
            self._at_s = min(until_s, max(at_s + 1e-5, min(knot_s, at_s + longest_s)))
            late_s = min(each.look_until(self._at_s) for each in self._tracks.values())
            if late_s < at_s:
                self._at_s = late_s
                self.found.late_plans += 1
                continue
            self._judge(at_s, {name: speed for name, (speed, _) in legs.items()})
            self.found.behind_s = max(self.found.behind_s, self._clock.now_s() - self._at_s)
        for each in self._tracks.values():
            each.forget(self._at_s - KEPT_S)

    def _judge(self, at_s: float, speeds: Mapping[str, float]) -> None:
        found = self.found
        found.looks += 1
        positions = {name: each.position(at_s) for name, each in self._tracks.items()}
        after = {name: each.position(self._at_s) for name, each in self._tracks.items()}
        pickle.dump((at_s, positions, after), self._to_oracle)
        with self._lock:
            stopped_from_s, swept = self._stopped_from_s, set(self._swept)
        if stopped_from_s is not None and at_s > stopped_from_s:
            moving = {name: speed for name, speed in speeds.items() if speed > STANDING_PER_S}
            if moving and len(found.late_stops) < 100:
                found.late_stops.append(
                    f"{at_s:.4f} s, {at_s - stopped_from_s:.4f} s after it had to stand: {moving}"
                )
        for name, (low, high) in self._limits.items():
            left = name not in swept and not low - 2.0 <= positions[name] <= high + 2.0
            if left and len(found.outside) < 100:
                found.outside.append(f"{at_s:.4f} s: {name} at {positions[name]:.3f}")


def oracle(scene: Path) -> None:
    """Judge every piece of the way that comes in; say at the end what was too near, and least."""
    clearance = PlatformClearance(scene)
    too_near: list[str] = []
    least: Near | None = None
    while True:
        try:
            at_s, start, end = pickle.load(sys.stdin.buffer)
        except EOFError:
            break
        near = clearance.nearest_on_way(start, end)
        if least is None or near.spare_um < least.spare_um:
            least = near
        if near.spare_um < -STEP_UM and len(too_near) < 100:
            too_near.append(f"{at_s:.4f} s: {near} from {start} to {end}")
    pickle.dump((too_near, least), sys.stdout.buffer)


if __name__ == "__main__":
    oracle(Path(sys.argv[1]))
