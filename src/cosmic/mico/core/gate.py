"""The one gate in front of the vendor library: every movement from anywhere is decided here."""

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from threading import Lock

from cosmic.frame.clock import WALL
from cosmic.frame.verdict import MoveVerdict, Reason, refuse
from cosmic.mico.core.collision import CollisionChecker
from cosmic.mico.core.lease import Lease
from cosmic.mico.core.orders import Grant, Interval, Motion
from cosmic.mico.core.positioner import PositionerState
from cosmic.mico.core.rules import Limits, check_axis, planned_target, swept_interval
from cosmic.mico.core.stop_latch import StopLatch

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
        age_s=picture.now_wall_s - state.read_wall_s,
        rules=picture.rules,
    )


def _clear_of_everything(
    intervals: Mapping[str, Interval], picture: Picture, checker: CollisionChecker
) -> MoveVerdict:
    swept = {
        name: Interval(state.position, state.position)
        for name, state in picture.states.items()
        if state.position is not None
    }
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
        self._held: dict[str, Interval] = {}
        self._targets: dict[str, float] = {}

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
            if not decision.verdict.allowed:
                return decision.verdict, {}
            self._held.update(decision.intervals)
            for name in decision.intervals:
                self._targets.pop(name, None)
            self._targets.update(decision.targets)
            grants = {name: Grant(epoch, decision.targets.get(name)) for name in decision.intervals}
            return decision.verdict, grants

    def still_valid(self, grant: Grant) -> bool:
        """Return False when a stop came after `grant`; takes no lock."""
        state = self._latch.state
        return not state.latched and state.epoch == grant.epoch

    def release(self, axis: str) -> None:
        """Give up the interval of an axis at rest whose position has been read back."""
        with self._lock:
            self._held.pop(axis, None)
            self._targets.pop(axis, None)

    def held(self) -> dict[str, Interval]:
        """Return the intervals in flight, for windows and tests."""
        with self._lock:
            return dict(self._held)

    def _picture(self) -> Picture:
        return Picture(
            stop_reason=self._latch.state.reason,
            token=self._lease.holder.token,
            states=self._states(),
            held=self._held,
            targets=self._targets,
            now_wall_s=WALL.now_s(),
            rules=self._rules,
        )
