"""Rehearsal: a trajectory run through the pure gate and kinematics; no threads, no hardware."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

from cosmic.frame.clock import WALL
from cosmic.frame.errors import MoveCancelled
from cosmic.frame.verdict import ALLOWED, MoveVerdict
from cosmic.mico.core.collision.checker import CollisionChecker
from cosmic.mico.core.motion.checks import Limits, PlatformSnapshot, Request, check_move
from cosmic.mico.core.motion.orders import Motion, MoveBy, MoveTo, Step
from cosmic.mico.core.motion.positioner import PositionerState
from cosmic.mico.core.trajectory.binding import Bound, BoundLeg, BoundSpeed, PlatformFacts
from cosmic.mico.core.trajectory.clearance import ClearanceSearch
from cosmic.mico.core.trajectory.model import Wait
from cosmic.mico.core.trajectory.timing import LANDING_S, leg_times_s, scaled_hz
from cosmic.mico.hw.interface import Activity

_LOOK_EVERY = 50
_TOKEN = "rehearsal"
OnProgress = Callable[[float, str], object]


@dataclass(frozen=True, slots=True)
class Rehearsal:
    """What a trajectory would do.

    Attributes
    ----------
    allowed : bool
        The gate would allow every line.
    line : int
        The line that it refuses; 0 where it refuses none.
    verdict : MoveVerdict
        Its answer there.
    lines : int
        How many lines were gone through.
    clearance_um : float or None
        The smallest distance of two bodies that the trajectory moves against each other, on the
        way that the axes take at their speeds; None without a collision model.
    clearance_line : int
        Where that is; 0 where it begins.
    clearance_bodies : tuple of str
        Which two bodies.
    clearance_place_um : tuple of float or None
        The place, x, y, z in world coordinates.
    duration_s : float
        How long it takes once, with waits.
    end : mapping of float
        Where its axes stand in the end, in gate coordinates.
    poses : tuple of mappings of float
        Where all axes stand at the start and after each line, for a preview.
    left_s : tuple of (int, float)
        How long it still takes from each line on.
    took_s : float
        How long the rehearsal took.
    """

    allowed: bool
    line: int
    verdict: MoveVerdict
    lines: int
    clearance_um: float | None
    clearance_line: int
    clearance_bodies: tuple[str, ...]
    clearance_place_um: tuple[float, float, float] | None
    duration_s: float
    end: Mapping[str, float]
    poses: tuple[Mapping[str, float], ...] = ()
    left_s: tuple[tuple[int, float], ...] = ()
    took_s: float = 0.0


@dataclass(frozen=True)
class RehearsalSetup:
    """What a rehearsal is played on.

    Attributes
    ----------
    states : mapping of PositionerState
        All axes as they stand now.
    frequencies_hz : mapping of float
        Closed-loop frequency of each axis in force now.
    step_um : mapping of float
        What a step of an axis without sensor is taken to go.
    """

    states: Mapping[str, PositionerState]
    facts: PlatformFacts
    frequencies_hz: Mapping[str, float]
    step_um: Mapping[str, float]
    checker: CollisionChecker
    rules: Limits
    clearance: ClearanceSearch | None = None
    speed: float = 1.0
    timed: bool = True
    progress: OnProgress = field(default=lambda _part, _text: None)
    cancelled: Callable[[], bool] = field(default=lambda: False)


def rehearse(bound: Bound, setup: RehearsalSetup) -> Rehearsal:
    """Return what `bound` would do; it begins where its start says, or else where axes stand.

    Raises
    ------
    MoveCancelled
        `setup.cancelled` said so.
    """
    return _Play(bound, setup).run()


class _Play:
    """One rehearsal under way."""

    def __init__(self, bound: Bound, setup: RehearsalSetup) -> None:
        self._bound = bound
        self._setup = setup
        now_s = WALL.now_s()
        self._began_s = now_s
        self._states = {
            name: replace(
                state,
                position=bound.start.get(name, state.position),
                read_wall_s=now_s,
                in_motion=False,
                activity=Activity.STOPPED,
            )
            for name, state in setup.states.items()
        }
        self._hertz = dict(setup.frequencies_hz)
        self._time_s = 0.0
        self._lines = 0
        self._began: list[tuple[int, float]] = []
        self._poses = [self._pose()]

    def run(self) -> Rehearsal:
        """Go through all lines, up to the first that is refused."""
        search = self._setup.clearance
        if search is not None:
            search.begin(self._poses[0])
        steps = self._bound.steps
        for number, step in enumerate(steps):
            if number % _LOOK_EVERY == 0:
                self._setup.progress(number / len(steps), f"line {step.line}")
                if self._setup.cancelled():
                    raise MoveCancelled("the rehearsal was cancelled")
            match step:
                case Wait():
                    self._wait_for(step.at_s)
                    self._began.append((step.line, self._time_s))
                    self._time_s += step.duration_s
                case BoundSpeed():
                    usual = self._setup.frequencies_hz.get(step.axis, 0.0)
                    self._hertz[step.axis] = step.frequency_hz or usual
                case BoundLeg():
                    verdict = self._leg(step)
                    if not verdict.allowed:
                        return self._result(step.line, verdict)
            self._lines += 1
        return self._result(0, ALLOWED)

    def _wait_for(self, at_s: float | None) -> None:
        if at_s is not None and self._setup.timed:
            self._time_s = max(self._time_s, at_s / self._setup.speed)

    def _leg(self, leg: BoundLeg) -> MoveVerdict:
        requests = [Request(axis, motion, _TOKEN) for axis, motion in leg.motions.items()]
        snapshot = PlatformSnapshot(
            stop_reason=None,
            token=_TOKEN,
            states=self._states,
            held={},
            targets={},
            now_wall_s=self._began_s,
            rules=self._setup.rules,
        )
        verdict = check_move(requests, snapshot, self._setup.checker).verdict
        if not verdict.allowed:
            return verdict
        self._wait_for(leg.at_s)
        self._began.append((leg.line, self._time_s))
        self._move(leg)
        return verdict

    def _move(self, leg: BoundLeg) -> None:
        """Have the axes go, each at its speed, and look how near they come."""
        before = self._poses[-1]
        targets = {axis: self._target(axis, motion) for axis, motion in leg.motions.items()}
        distances = {axis: target - before.get(axis, target) for axis, target in targets.items()}
        hertz = {
            axis: scaled_hz(value, self._setup.speed, self._states[axis].frequency_range_hz)
            for axis, value in self._hertz.items()
        }
        facts = self._setup.facts
        times_s = leg_times_s(leg.motions, distances, hertz, facts.axes, facts.defaults)
        for axis, target in targets.items():
            self._states[axis] = replace(self._states[axis], position=target)
        self._poses.append({**before, **targets})
        self._time_s += max(times_s.values(), default=0.0) + LANDING_S
        self._look(before, distances, times_s, leg.line)

    def _look(
        self,
        before: Mapping[str, float],
        distances: Mapping[str, float],
        times_s: Mapping[str, float],
        line: int,
    ) -> None:
        """Follow the line, which has a bend wherever one of several axes arrives."""
        search = self._setup.clearance
        if search is None:
            return
        at = before
        for bend_s in sorted({time_s for time_s in times_s.values() if time_s > 0.0}):
            there = {
                axis: before[axis] + length * min(1.0, bend_s / times_s[axis])
                for axis, length in distances.items()
                if times_s[axis] > 0.0 and axis in before
            }
            after = {**at, **there}
            search.follow(at, after, line)
            at = after

    def _target(self, axis: str, motion: Motion) -> float:
        here = self._states[axis].position or 0.0
        match motion:
            case MoveTo():
                return motion.target
            case MoveBy():
                return here + motion.distance
            case Step():
                step_um = self._setup.step_um.get(axis, 1.0)
                return here + motion.steps * motion.amplitude_v / 100.0 * step_um
            case _:
                return here

    def _pose(self) -> dict[str, float]:
        return {
            name: state.position
            for name, state in self._states.items()
            if state.position is not None
        }

    def _result(self, line: int, verdict: MoveVerdict) -> Rehearsal:
        search = self._setup.clearance
        best = search.best if search is not None else None
        axes = self._bound.trajectory.axes
        end = self._poses[-1]
        return Rehearsal(
            allowed=verdict.allowed,
            line=line,
            verdict=verdict,
            lines=self._lines,
            clearance_um=best.distance_um if best is not None else None,
            clearance_line=search.line if search is not None else 0,
            clearance_bodies=best.bodies if best is not None else (),
            clearance_place_um=best.place_um if best is not None else None,
            duration_s=self._time_s,
            end={axis: end[axis] for axis in axes if axis in end},
            poses=tuple(self._poses),
            left_s=tuple((each, self._time_s - began_s) for each, began_s in self._began),
            took_s=WALL.now_s() - self._began_s,
        )
