"""Takes the workplace through time whenever somebody looks, and remembers the last seconds."""

import math
from collections import deque
from collections.abc import Callable, Mapping
from threading import Lock
from typing import Final

import numpy as np

from cosmic.frame.arrays import Floats
from cosmic.twin.felt import Felt, Moment
from cosmic.twin.guideways import Guideways
from cosmic.twin.stage import Path, Stage
from cosmic.twin.workspace import Workspace

KEPT: Final = 20_000
"""So many looks are remembered: 20 s while something moves, much longer while nothing does."""

MOST_LOOKS: Final = 20_000
"""Looks for one question; after a longer journey unseen the rest lie further apart."""

LONGEST_TRAVEL: Final = 0.25
"""A slow stage goes so far between two looks, um or degrees; a fast one as far as it must."""

SLACK_PART: Final = 0.25
"""Where nothing is near, stages go this part of the way to what is: two may meet, and obliquely."""

LONGEST_REST_S: Final = 0.5
"""Stages that stand creep by nanometres; they are looked at again after this time."""

BEHIND: Final = 64
"""So many movements of a stage may wait to be seen before somebody should keep up."""


class Track:
    """The movements of one stage from the last look on; its stage may add one at any time.

    Whoever plans a movement only puts it down here; the rest is called with the timeline's lock
    held.

    Attributes
    ----------
    rests : bool
        It is where `position` had it last, but for creep, until it is planned to move.
    """

    def __init__(self, stage: Stage) -> None:
        self.stage = stage
        self._new: deque[Path] = deque()
        self._paths: list[Path] = [stage.path]
        self._current = 0
        self.rests = False
        stage.planned = self._new.append

    @property
    def unseen(self) -> int:
        """How many movements wait to be seen."""
        return len(self._new) + len(self._paths) - self._current - 1

    def take_note(self) -> None:
        """Learn of the movements planned so far; what one of them replaced is forgotten."""
        if not self._new:
            return
        self.rests = False
        paths = self._paths
        del paths[: self._current]
        self._current = 0
        while self._new:
            path = self._new.popleft()
            while paths and paths[-1].times_s[0] >= path.times_s[0]:
                paths.pop()
            paths.append(path)

    def path(self, time_s: float) -> Path:
        """Return the movement in force at `time_s`, which never falls."""
        paths, after = self._paths, self._current + 1
        if after == len(paths):
            return paths[-1]
        while after < len(paths) and paths[after].times_s[0] <= time_s:
            after += 1
        self._current = after - 1
        return paths[self._current]

    def position(self, time_s: float) -> float:
        """Return where the stage is at `time_s`, which never falls."""
        low, high = self.stage.bounds
        path = self.path(time_s)
        self.rests = path.times_s[-1] <= time_s and self._current + 1 == len(self._paths)
        at = path.at(time_s)
        return low if at < low else min(at, high)

    def leg(self, time_s: float) -> tuple[float, float]:
        """Return its speed at `time_s` without sign, and until when it stays so."""
        speed, end_s = self.path(time_s).leg(time_s)
        after = self._current + 1
        if after < len(self._paths):
            end_s = min(end_s, self._paths[after].times_s[0])
        return speed, end_s


class Timeline:
    """What the probe felt and feels; any thread.

    Looks lie on a grid of time, close where something moves fast, so that the answer hardly depends
    on who asked when. Between two looks the force goes straight.

    Who moves a stage waits for nothing here: movements are put down, and looked at in the threads
    that ask, or that keep up when nobody does.
    """

    def __init__(
        self,
        workspace: Workspace,
        stages: Mapping[str, Stage],
        step_s: float,
        *,
        guideways: Guideways,
        sense: Callable[[Felt], float] | None = None,
    ) -> None:
        self._workspace = workspace
        self._guideways = guideways
        self._sense = sense
        self._encoders: dict[str, float] = {}
        self._signals_un: deque[float] = deque(maxlen=KEPT)
        self._tracks = tuple(Track(stages[name]) for name in sorted(workspace.stages))
        self._step_s = step_s
        self._lock = Lock()
        self._felt = Felt()
        self._values: dict[str, float] = {}
        self._creep_from_s = 0.0
        self._at = -1
        self._times_s: deque[float] = deque(maxlen=KEPT)
        self._forces_un: deque[float] = deque(maxlen=KEPT)

    @property
    def unseen(self) -> int:
        """How many movements of one stage wait to be looked at, at most."""
        return max(track.unseen for track in self._tracks)

    def keep_up(self, time_s: float) -> None:
        """Go some way towards `time_s` if nobody has asked for long; hold no lock meanwhile.

        The longer nobody asked the further it goes, so that what waits to be seen stays bounded.
        """
        unseen = self.unseen
        if unseen < BEHIND or not self._lock.acquire(blocking=False):
            return
        try:
            self._advance(time_s, most=unseen // 4)
        finally:
            self._lock.release()

    def force_un(self, times_s: Floats) -> Floats:
        """Return the true force on the probe, uN, positive when it is pushed back.

        Parameters
        ----------
        times_s : ndarray, shape (n,), float64
            Rising; not later than now, and not more than some seconds ago.
        """
        if not times_s.size:
            return np.empty(0)
        with self._lock:
            self._advance(float(times_s[-1]))
            times, forces = self._looks_since(float(times_s[0]), self._forces_un)
        return np.asarray(np.interp(times_s, times, forces))

    def signal_un(self, times_s: Floats) -> Floats:
        """Return what the sensor behind the probe believes in; times as for `force_un`."""
        if not times_s.size:
            return np.empty(0)
        with self._lock:
            self._advance(float(times_s[-1]))
            times, signals = self._looks_since(float(times_s[0]), self._signals_un)
        return np.asarray(np.interp(times_s, times, signals))

    def moment(self, time_s: float) -> Moment:
        """Return the whole truth at `time_s`: force, what touches where, each fibre's state.

        At the latest look, if that is later.
        """
        with self._lock:
            self._advance(time_s)
            return self._workspace.moment(self._times_s[-1], self._values, self._felt)

    def change(self, time_s: float, change: Callable[[Mapping[str, float]], None]) -> None:
        """Go on to `time_s`, and change the workspace there; given where all stages are."""
        with self._lock:
            self._advance(time_s)
            change(self._values)

    def finish(self, time_s: float) -> None:
        """Go on to the end, and have the workplace tell what lasts until then."""
        with self._lock:
            self._advance(time_s)
            self._workspace.finish()

    def _looks_since(self, time_s: float, kept: deque[float]) -> tuple[list[float], list[float]]:
        """Return times and forces from the last look before `time_s` on."""
        times: list[float] = []
        forces: list[float] = []
        for look_s, force in zip(reversed(self._times_s), reversed(kept), strict=True):
            times.append(look_s)
            forces.append(force)
            if look_s <= time_s:
                break
        return times[::-1], forces[::-1]

    def _advance(self, time_s: float, most: float = math.inf) -> None:
        """Look until `time_s`, or `most` times."""
        for track in self._tracks:
            track.take_note()
        if self._at < 0:
            self._look(0)
        last = math.ceil(time_s / self._step_s - 1e-9)
        looks, coarse = 0, 0
        while self._at < last and looks < most:
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
        creeps = time_s >= self._creep_from_s
        if creeps:
            self._creep_from_s = time_s + LONGEST_REST_S
        for track in self._tracks:
            if creeps or not track.rests:
                self._encoders[track.stage.name] = track.position(time_s)
        self._values = self._encoders
        if not self._guideways.true:
            self._values = self._guideways.follow(self._encoders, time_s)
        self._felt = self._workspace.look(self._values, time_s)
        self._times_s.append(time_s)
        total = self._felt.total_un
        self._forces_un.append(total)
        self._signals_un.append(total if self._sense is None else self._sense(self._felt))

    def _next_s(self) -> tuple[float, bool]:
        """Return when to look next, and whether all stages stand until then."""
        now_s = self._at * self._step_s
        until_s = now_s + min(
            LONGEST_REST_S, self._workspace.restless_s, self._guideways.restless_s
        )
        at_rest = True
        for track in self._tracks:
            if track.rests:
                continue
            speed, end_s = track.leg(now_s)
            if speed > 0.0:
                at_rest = False
                end_s = min(end_s, now_s + self._longest(track) / speed)
            if end_s < until_s:
                until_s = end_s
        return until_s, at_rest

    def _longest(self, track: Track) -> float:
        """Return how far a stage that moves goes until the next look."""
        felt = self._felt
        slack = felt.slack_um
        if track.stage.name in self._workspace.gripper_stages:
            slack = min(slack, felt.gap_um)
        return max(LONGEST_TRAVEL, SLACK_PART * slack)
