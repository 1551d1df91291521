"""The one gate in front of the vendor library: every movement from anywhere is decided here."""

import logging
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from itertools import count
from threading import Lock

from cosmic.frame.clock import WALL
from cosmic.frame.verdict import MoveVerdict, Reason, refuse
from cosmic.mico.core.collision.answer import AxisSpan
from cosmic.mico.core.collision.checker import CollisionChecker
from cosmic.mico.core.lease import Guard, Lease, LeaseHolder
from cosmic.mico.core.orders import Grant, Interval, Motion
from cosmic.mico.core.positioner import Confidence, PositionerState
from cosmic.mico.core.rules import EVERYWHERE, Limits, check_axis, planned_target, swept_interval
from cosmic.mico.core.stop_latch import StopLatch, StopState
from cosmic.mico.hw.interface import PositionerKind

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Request:
    """One axis' part of a question to the gate."""

    axis: str
    motion: Motion
    token: str
    consent: bool = False
    alone: bool = False
    """Move it without the axes that it is linked to."""
    guard: Guard | None = None
    """What watches over a command of another process; None for those of this one."""


@dataclass(frozen=True, slots=True)
class Picture:
    """What the pure part of the gate looks at: the platform at one moment.

    Attributes
    ----------
    held : mapping of Interval
        What axes in flight may sweep.
    begun_at : mapping of (float or None)
        Where axes in flight stood before; None where that was not known.
    regions : mapping of Interval
        Where axes may be whose position is unknown.
    links : mapping of frozenset of str
        By axis, those that must move with it.
    token, holder : str
        Of this process while it may move, otherwise empty; and who may.
    """

    stop_reason: str | None
    token: str
    states: Mapping[str, PositionerState]
    held: Mapping[str, Interval]
    targets: Mapping[str, float]
    now_wall_s: float
    rules: Limits
    begun_at: Mapping[str, float | None] = field(default_factory=dict)
    regions: Mapping[str, Interval] = field(default_factory=dict)
    links: Mapping[str, frozenset[str]] = field(default_factory=dict)
    holder: str = "somebody else"

    def place(self, state: PositionerState) -> Interval:
        """Return where an axis may be, if nobody moves it."""
        place = self.held.get(state.name)
        if state.confidence is Confidence.UNKNOWN:
            region = self.regions.get(state.name, EVERYWHERE)
            return region if place is None else region.hull(place)
        if state.position is None:
            return EVERYWHERE
        here = Interval(state.position, state.position)
        return here if place is None else here.hull(place)


@dataclass(frozen=True, slots=True)
class Decision:
    """The gate's answer with what it would reserve."""

    verdict: MoveVerdict
    intervals: Mapping[str, Interval]
    targets: Mapping[str, float]


def judge(
    requests: Sequence[Request],
    picture: Picture,
    checker: CollisionChecker,
    *,
    advice: bool = True,
) -> Decision:
    """Decide several movements together; pure: state in, answer out, nothing else touched."""
    intervals: dict[str, Interval] = {}
    targets: dict[str, float] = {}
    asked = {request.axis for request in requests}
    for request in requests:
        verdict = _first_refusal(request, picture)
        if verdict is None:
            verdict = _torn_apart(request, asked, picture)
        if verdict is not None:
            return Decision(verdict, {}, {})
        state = picture.states[request.axis]
        target = planned_target(request.motion, state, picture.targets.get(request.axis))
        if target is not None:
            targets[request.axis] = target
        place = picture.place(state)
        intervals[request.axis] = swept_interval(
            request.motion, state, target, place, picture.rules
        )
    verdict = _clear_of_everything(intervals, picture, checker, advice=advice)
    return Decision(verdict, intervals if verdict.allowed else {}, targets)


def _first_refusal(request: Request, picture: Picture) -> MoveVerdict | None:
    axis = request.axis
    if picture.stop_reason is not None:
        return refuse(
            Reason.STOPPED,
            f"{axis}: motion is stopped ({picture.stop_reason}); reset the stop first",
            axis=axis,
        )
    no_right = _no_right(request, picture)
    if no_right:
        return refuse(Reason.NO_LEASE, f"{axis}: {no_right}", axis=axis)
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


def _no_right(request: Request, picture: Picture) -> str:
    """Return why whoever asks may not move anything; empty when they may."""
    if request.guard is not None:
        return request.guard.why if request.guard.expired else ""
    if request.token and request.token == picture.token:
        return ""
    return (
        f"{picture.holder} controls the platform now; take over in the window, "
        "or wait until it is given back"
    )


def _torn_apart(request: Request, asked: Collection[str], picture: Picture) -> MoveVerdict | None:
    """Return why an axis must not move without those that it is linked to, or None."""
    missing = picture.links.get(request.axis, frozenset()).difference(asked)
    if request.alone or not missing:
        return None
    return refuse(
        Reason.WRONG_KIND,
        f"{request.axis}: it is linked to {', '.join(sorted(missing))} and does not move alone; "
        "move it to or by a position, or unlink it first",
        axis=request.axis,
    )


def _clear_of_everything(
    intervals: Mapping[str, Interval],
    picture: Picture,
    checker: CollisionChecker,
    *,
    advice: bool,
) -> MoveVerdict:
    spans = {
        name: _span(state, intervals.get(name), picture) for name, state in picture.states.items()
    }
    try:
        verdict = checker.check(spans, advice=advice)
    except Exception:  # a check that cannot answer says no
        logger.exception("the collision check failed")
        return refuse(
            Reason.NO_ANSWER, "the collision check failed; nothing was moved (see the log)"
        )
    return verdict


def _span(state: PositionerState, asked: Interval | None, picture: Picture) -> AxisSpan:
    """Return where an axis may be from now on, for the collision model."""
    moving = asked is not None or state.name in picture.held
    sensed = state.kind is not PositionerKind.OPEN_LOOP
    fresh = not sensed or picture.now_wall_s - state.read_wall_s <= picture.rules.stale_s
    sure = state.present and fresh and (moving or state.activity.at_rest)
    place = asked or (picture.place(state) if sure else EVERYWHERE)
    return AxisSpan(
        place.low,
        place.high,
        origin(state, picture.begun_at) if sure else None,
        moving=moving,
        estimated=state.confidence is Confidence.ESTIMATED,
    )


def origin(state: PositionerState, begun_at: Mapping[str, float | None]) -> float | None:
    """Return where an axis stands, or stood before its movement began; None where unknown."""
    if state.confidence is Confidence.UNKNOWN:
        return None
    return begun_at.get(state.name, state.position)


@dataclass(frozen=True, slots=True)
class _Hold:
    interval: Interval
    target: float | None
    begun_at: float | None


class Gate:
    """Keeps what is in flight and asks `judge`; any thread.

    Parameters
    ----------
    states : callable
        Returns the state of every positioner by name.
    regions : mapping of Interval
        Where each axis may stand at power-up; anywhere, where it has none.
    links : callable
        Returns, by axis, those that must move with it.
    """

    def __init__(
        self,
        *,
        latch: StopLatch,
        lease: Lease,
        checker: CollisionChecker,
        rules: Limits,
        states: Callable[[], Mapping[str, PositionerState]],
        regions: Mapping[str, Interval] | None = None,
        links: Callable[[], Mapping[str, frozenset[str]]] = dict,
    ) -> None:
        self._latch = latch
        self._lease = lease
        self._checker = checker
        self._rules = rules
        self._states = states
        self._lock = Lock()
        self._links = links
        self._numbers = count(1)
        self._holds: dict[str, dict[int, _Hold]] = {}
        self._power_up = dict(regions or {})
        self._regions = dict(self._power_up)

    @property
    def checker(self) -> CollisionChecker:
        """The collision model, or the stand-in that says there is none."""
        return self._checker

    def check(self, requests: Sequence[Request], *, advice: bool = True) -> MoveVerdict:
        """Say whether `requests` would be allowed now, without reserving anything.

        `advice` is that of `CollisionChecker.check`.
        """
        holder = self._lease.holder
        with self._lock:
            return judge(requests, self._picture(holder), self._checker, advice=advice).verdict

    def decide(self, requests: Sequence[Request]) -> tuple[MoveVerdict, dict[str, Grant]]:
        """Decide `requests` together; when allowed, hold their intervals and grant each axis."""
        holder = self._lease.holder  # first, for it may tell listeners that it has lapsed
        with self._lock:
            epoch = self._latch.state.epoch
            picture = self._picture(holder)
            decision = judge(requests, picture, self._checker)
            grants: dict[str, Grant] = {}
            for axis, interval in decision.intervals.items():
                target = decision.targets.get(axis)
                grant = Grant(axis, next(self._numbers), epoch, target)
                state = picture.states[axis]
                if state.confidence is Confidence.UNKNOWN:
                    self._regions[axis] = interval  # wherever that ends, it is somewhere there
                hold = _Hold(interval, target, origin(state, picture.begun_at))
                self._holds.setdefault(axis, {})[grant.number] = hold
                grants[axis] = grant
            return decision.verdict, grants

    def spans(self) -> dict[str, AxisSpan]:
        """Return where every axis may be as things are now."""
        holder = self._lease.holder
        with self._lock:
            picture = self._picture(holder)
        return {name: _span(state, None, picture) for name, state in picture.states.items()}

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
                self._holds[grant.axis][grant.number] = replace(hold, target=None)

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

    def targets(self) -> dict[str, float]:
        """Return where the axes in flight go, by axis."""
        with self._lock:
            return self._targets()

    def _held(self) -> dict[str, Interval]:
        return {
            axis: reduce(Interval.hull, (hold.interval for hold in holds.values()))
            for axis, holds in self._holds.items()
            if holds
        }

    def _targets(self) -> dict[str, float]:
        newest = {axis: holds[max(holds)] for axis, holds in self._holds.items() if holds}
        return {axis: hold.target for axis, hold in newest.items() if hold.target is not None}

    def _begun_at(self) -> dict[str, float | None]:
        return {axis: holds[min(holds)].begun_at for axis, holds in self._holds.items() if holds}

    def _regions_now(self, states: Mapping[str, PositionerState]) -> dict[str, Interval]:
        """Return where axes may be that nobody knows, or would be, were their position lost."""
        for name, state in states.items():
            known = state.present and state.confidence is not Confidence.UNKNOWN
            if known and state.position is not None and name in self._power_up:
                here = Interval(state.position, state.position)
                self._regions[name] = self._power_up[name].hull(here)
        return dict(self._regions)

    def _picture(self, holder: LeaseHolder) -> Picture:
        states = self._states()
        return Picture(
            stop_reason=self._latch.state.reason,
            token=holder.token,
            holder=holder.name,
            states=states,
            held=self._held(),
            begun_at=self._begun_at(),
            regions=self._regions_now(states),
            links=self._links(),
            targets=self._targets(),
            now_wall_s=WALL.now_s(),
            rules=self._rules,
        )
