"""The one gate in front of the vendor library: every movement from anywhere is decided here."""

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import count
from threading import Lock

from cosmic.frame.clock import WALL
from cosmic.frame.verdict import MoveVerdict, Reason, refuse
from cosmic.mico.core.collision.checker import CollisionChecker
from cosmic.mico.core.lease import Lease
from cosmic.mico.core.orders import Grant, Interval, Motion
from cosmic.mico.core.positioner import Confidence, PositionerState
from cosmic.mico.core.rules import EVERYWHERE, Limits, check_axis, planned_target, swept_interval
from cosmic.mico.core.stop_latch import StopLatch, StopState

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Request:
    """One axis' part of a question to the gate."""

    axis: str
    motion: Motion
    token: str
    consent: bool = False


@dataclass(frozen=True, slots=True)
class Picture:
    """What the pure part of the gate looks at: the platform at one moment."""

    stop_reason: str | None
    token: str
    states: Mapping[str, PositionerState]
    held: Mapping[str, Interval]
    targets: Mapping[str, float]
    now_wall_s: float
    rules: Limits


@dataclass(frozen=True, slots=True)
class Decision:
    """The gate's answer with what it would reserve."""

    verdict: MoveVerdict
    intervals: Mapping[str, Interval]
    targets: Mapping[str, float]


def judge(requests: Sequence[Request], picture: Picture, checker: CollisionChecker) -> Decision:
    """Decide several movements together; pure: state in, answer out, nothing else touched."""
    intervals: dict[str, Interval] = {}
    targets: dict[str, float] = {}
    for request in requests:
        verdict = _first_refusal(request, picture)
        if verdict is not None:
            return Decision(verdict, {}, {})
        state = picture.states[request.axis]
        target = planned_target(request.motion, state, picture.targets.get(request.axis))
        if target is not None:
            targets[request.axis] = target
        intervals[request.axis] = swept_interval(
            request.motion, state, target, picture.held.get(request.axis), picture.rules
        )
    verdict = _clear_of_everything(intervals, picture, checker)
    return Decision(verdict, intervals if verdict.allowed else {}, targets)


def _first_refusal(request: Request, picture: Picture) -> MoveVerdict | None:
    axis = request.axis
    if picture.stop_reason is not None:
        return refuse(
            Reason.STOPPED,
            f"{axis}: motion is stopped ({picture.stop_reason}); reset the stop first",
            axis=axis,
        )
    if request.token != picture.token:
        return refuse(
            Reason.NO_LEASE, f"{axis}: somebody else controls the platform now", axis=axis
        )
    state = picture.states.get(axis)
    if state is None:
        return refuse(Reason.DEVICE, f"{axis}: there is no such axis", axis=axis)
    return check_axis(
        request.motion,
        state,
        consent=request.consent,
        running_target=picture.targets.get(axis),
        held=picture.held.get(axis),
        age_s=picture.now_wall_s - state.read_wall_s,
        rules=picture.rules,
    )


def _clear_of_everything(
    intervals: Mapping[str, Interval], picture: Picture, checker: CollisionChecker
) -> MoveVerdict:
    swept = {name: _resting_place(state) for name, state in picture.states.items()}
    swept.update(picture.held)
    swept.update(intervals)
    try:
        verdict = checker.check(swept)
    except Exception:  # a check that cannot answer says no
        logger.exception("the collision check failed")
        return refuse(
            Reason.NO_ANSWER, "the collision check failed; nothing was moved (see the log)"
        )
    return verdict


def _resting_place(state: PositionerState) -> Interval:
    """Return where an axis without a movement of ours may be."""
    placed = state.present and state.confidence is not Confidence.UNKNOWN
    if state.position is None or not placed or not state.activity.at_rest:
        return EVERYWHERE
    return Interval(state.position, state.position)


@dataclass(frozen=True, slots=True)
class _Hold:
    interval: Interval
    target: float | None


class Gate:
    """Keeps what is in flight and asks `judge`; any thread.

    Parameters
    ----------
    states : callable
        Returns the state of every positioner by name.
    """

    def __init__(
        self,
        *,
        latch: StopLatch,
        lease: Lease,
        checker: CollisionChecker,
        rules: Limits,
        states: Callable[[], Mapping[str, PositionerState]],
    ) -> None:
        self._latch = latch
        self._lease = lease
        self._checker = checker
        self._rules = rules
        self._states = states
        self._lock = Lock()
        self._numbers = count(1)
        self._holds: dict[str, dict[int, _Hold]] = {}

    @property
    def checker(self) -> CollisionChecker:
        """The collision model, or the stand-in that says there is none."""
        return self._checker

    def check(self, requests: Sequence[Request]) -> MoveVerdict:
        """Say whether `requests` would be allowed now, without reserving anything."""
        with self._lock:
            return judge(requests, self._picture(), self._checker).verdict

    def decide(self, requests: Sequence[Request]) -> tuple[MoveVerdict, dict[str, Grant]]:
        """Decide `requests` together; when allowed, hold their intervals and grant each axis."""
        with self._lock:
            epoch = self._latch.state.epoch
            decision = judge(requests, self._picture(), self._checker)
            grants: dict[str, Grant] = {}
            for axis, interval in decision.intervals.items():
                target = decision.targets.get(axis)
                grant = Grant(axis, next(self._numbers), epoch, target)
                self._holds.setdefault(axis, {})[grant.number] = _Hold(interval, target)
                grants[axis] = grant
            return decision.verdict, grants

    def still_valid(self, grant: Grant) -> bool:
        """Return False when a stop came after `grant`; takes no lock."""
        state = self._latch.state
        return not state.latched and state.epoch == grant.epoch

    def release(self, grant: Grant) -> None:
        """Give back the interval of a movement that has ended, its position read; or replaced.

        The interval of a movement that replaces another holds the other's as well.
        """
        with self._lock:
            self._holds.get(grant.axis, {}).pop(grant.number, None)

    def abandon(self, grant: Grant) -> None:
        """Keep the interval, but no longer count on the target: the movement will not get there."""
        with self._lock:
            hold = self._holds.get(grant.axis, {}).get(grant.number)
            if hold is not None:
                self._holds[grant.axis][grant.number] = _Hold(hold.interval, None)

    def release_axis(self, axis: str) -> None:
        """Give back all of an axis that stands and whose position has just been read."""
        with self._lock:
            self._holds.pop(axis, None)

    @property
    def stop_state(self) -> StopState:
        """State of the stop latch; takes no lock."""
        return self._latch.state

    def held(self) -> dict[str, Interval]:
        """Return the intervals in flight by axis."""
        with self._lock:
            return self._held()

    def _held(self) -> dict[str, Interval]:
        return {
            axis: reduce(Interval.hull, (hold.interval for hold in holds.values()))
            for axis, holds in self._holds.items()
            if holds
        }

    def _targets(self) -> dict[str, float]:
        newest = {axis: holds[max(holds)] for axis, holds in self._holds.items() if holds}
        return {axis: hold.target for axis, hold in newest.items() if hold.target is not None}

    def _picture(self) -> Picture:
        return Picture(
            stop_reason=self._latch.state.reason,
            token=self._lease.holder.token,
            states=self._states(),
            held=self._held(),
            targets=self._targets(),
            now_wall_s=WALL.now_s(),
            rules=self._rules,
        )
