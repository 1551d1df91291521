"""Follows where the stages of a simulated platform truly are, and judges what it sees.

Knows the twin's truth and the platform's files; nothing of the gate, the device or the stop.
"""

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
from cosmic.twin.stage import Stage

ROOT: Final = Path(__file__).resolve().parents[1]
STEP_UM: Final = 0.1
"""The finest that a sensor of the platform tells apart, with room; a pair may lack so much."""
BEHIND_S: Final = 0.05
"""The watch looks so far behind the present, s of the platform."""
FORGOTTEN_S: Final = 0.5
"""Attacks wait while the watch is farther behind than this, s of the platform."""
STANDING_PER_S: Final = 1e-3
COARSEST_S: Final = 0.05
RESTING_S: Final = 0.5


@dataclass
class Findings:
    """What was seen; harmless while the lists are empty."""

    too_near: list[str] = field(default_factory=list)
    late_stops: list[str] = field(default_factory=list)
    outside: list[str] = field(default_factory=list)
    unseen: set[str] = field(default_factory=set)
    least: Near | None = None
    looks: int = 0
    behind_s: float = 0.0

    @property
    def harmless(self) -> bool:
        """True while nothing went wrong."""
        return not (self.too_near or self.late_stops or self.outside or self.unseen)


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
        self._stages = dict(stages)
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
            lost = self._lost_sight_of(at_s)
            if lost:
                # Before, nobody knows where it was: with others of that time it means nothing.
                self.found.unseen.update(lost)
                self._at_s = min(until_s, max(lost.values()))
                continue
            legs = {name: each.leg_then(at_s) for name, each in self._stages.items()}
            knot_s = min(end_s for _, end_s in legs.values())
            # Straight on until the next knot of any stage, a few degrees or a quarter mm.
            moving = any(speed > 0.0 for speed, _ in legs.values())
            longest_s = COARSEST_S if moving else RESTING_S
            self._at_s = min(until_s, max(at_s + 1e-5, min(knot_s, at_s + longest_s)))
            self._judge(at_s, {name: speed for name, (speed, _) in legs.items()})
            self.found.behind_s = max(self.found.behind_s, self._clock.now_s() - self._at_s)

    def _lost_sight_of(self, at_s: float) -> dict[str, float]:
        """Return the stages that have forgotten where they were, and from when on they know."""
        kept = {name: each.paths for name, each in self._stages.items()}
        since = {name: paths[0].times_s[0] for name, paths in kept.items() if len(paths) > 1}
        return {name: from_s for name, from_s in since.items() if at_s < from_s}

    def _judge(self, at_s: float, speeds: Mapping[str, float]) -> None:
        found = self.found
        found.looks += 1
        positions = {name: each.position_then(at_s) for name, each in self._stages.items()}
        after = {name: each.position_then(self._at_s) for name, each in self._stages.items()}
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
