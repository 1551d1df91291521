"""Takes the workplace through time whenever somebody looks, and remembers the last seconds."""

import math
from collections import deque
from collections.abc import Mapping
from threading import Lock
from typing import Final

import numpy as np
import numpy.typing as npt

from cosmic.twin.felt import Felt, Moment
from cosmic.twin.stage import Path, Stage
from cosmic.twin.workplace import Workplace

Floats = npt.NDArray[np.float64]

KEPT: Final = 20_000
"""So many looks are remembered: 20 s while something moves, much longer while nothing does."""

MOST_LOOKS: Final = 20_000
"""Looks for one question; after a longer journey unseen the rest lie further apart."""

LONGEST_WAY: Final = 0.25
"""A slow stage goes so far between two looks, um or degrees; a fast one as far as it must."""

SLACK_PART: Final = 0.25
"""Where nothing is near, stages go this part of the way to what is: two may meet, and obliquely."""

LONGEST_REST_S: Final = 0.5
"""Stages that stand creep by nanometres; they are looked at again after this time."""


class Timeline:
    """What the probe felt and feels; any thread.

    Looks lie on a grid of time, close where something moves fast, so that the answer hardly depends
    on who asked when. Between two looks the force goes straight.
    """

    def __init__(self, workplace: Workplace, stages: Mapping[str, Stage], step_s: float) -> None:
        self._workplace = workplace
        self._stages = tuple(stages[name] for name in sorted(workplace.stages))
        self._step_s = step_s
        self._lock = Lock()
        self._felt = Felt()
        self._values: dict[str, float] = {}
        self._resting: dict[str, Path] = {}
        self._creep_from_s = 0.0
        self._at = -1
        self._times_s: deque[float] = deque(maxlen=KEPT)
        self._forces_un: deque[float] = deque(maxlen=KEPT)
        for stage in self._stages:
            stage.remember = self.catch_up

    def catch_up(self, time_s: float) -> None:
        """Go on to `time_s` though nobody asked: a stage is about to forget where it was."""
        with self._lock:
            self._advance(time_s)

    def force_un(self, times_s: Floats) -> Floats:
        """Return the force on the probe, uN, positive when it is pushed back.

        Parameters
        ----------
        times_s : ndarray, shape (n,), float64
            Rising; not later than now, and not more than some seconds ago.
        """
        if not times_s.size:
            return np.empty(0)
        with self._lock:
            self._advance(float(times_s[-1]))
            times, forces = self._looks_since(float(times_s[0]))
        return np.asarray(np.interp(times_s, times, forces))

    def moment(self, time_s: float) -> Moment:
        """Return the whole truth at `time_s`, or at the latest look if that is later."""
        with self._lock:
            self._advance(time_s)
            return self._workplace.moment(self._times_s[-1], self._values, self._felt)

    def finish(self, time_s: float) -> None:
        """Go on to the end, and have the workplace tell what lasts until then."""
        with self._lock:
            self._advance(time_s)
            self._workplace.finish()

    def _looks_since(self, time_s: float) -> tuple[list[float], list[float]]:
        """Return times and forces from the last look before `time_s` on."""
        times: list[float] = []
        forces: list[float] = []
        for look_s, force in zip(reversed(self._times_s), reversed(self._forces_un), strict=True):
            times.append(look_s)
            forces.append(force)
            if look_s <= time_s:
                break
        return times[::-1], forces[::-1]

    def _advance(self, time_s: float) -> None:
        if self._at < 0:
            self._look(0)
        last = math.ceil(time_s / self._step_s - 1e-9)
        looks, coarse = 0, 0
        while self._at < last:
            looks += 1
            if looks == MOST_LOOKS:
                coarse = (last - self._at) // MOST_LOOKS
            until_s, at_rest = self._next_s()
            if at_rest and until_s > time_s:
                break  # what was felt last is felt still
            further = min(math.floor(until_s / self._step_s + 1e-9), last)
            self._look(max(further, min(self._at + 1 + coarse, last)))

    def _look(self, number: int) -> None:
        self._at = number
        time_s = number * self._step_s
        if time_s >= self._creep_from_s:
            self._resting.clear()
            self._creep_from_s = time_s + LONGEST_REST_S
        for stage in self._stages:
            path = stage.path
            stage.seen()
            if self._resting.get(stage.name) is not path:
                self._values[stage.name] = stage.position_then(time_s)
                if path.end_s <= time_s:
                    self._resting[stage.name] = path
        self._felt = self._workplace.look(self._values, time_s)
        self._times_s.append(time_s)
        self._forces_un.append(self._felt.total_un)

    def _next_s(self) -> tuple[float, bool]:
        """Return when to look next, and whether all stages stand until then."""
        now_s = self._at * self._step_s
        until_s = now_s + LONGEST_REST_S
        at_rest = True
        felt, grippers = self._felt, self._workplace.gripper_stages
        way = max(LONGEST_WAY, SLACK_PART * felt.slack_um)
        gap = max(LONGEST_WAY, SLACK_PART * min(felt.slack_um, felt.gap_um))
        for stage in self._stages:
            speed, end_s = stage.leg_then(now_s)
            if speed > 0.0:
                at_rest = False
                longest = gap if stage.name in grippers else way
                end_s = min(end_s, now_s + longest / speed)
            until_s = min(until_s, end_s)
        return until_s, at_rest
