"""The gate's pure part: the platform at one moment in, an answer out."""

import logging
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

from cosmic.frame.verdict import MoveVerdict, Reason, refuse
from cosmic.mico.core.collision.answer import AxisSpan
from cosmic.mico.core.collision.checker import CollisionChecker
from cosmic.mico.core.estimate import TIMES_STD
from cosmic.mico.core.lease import Guard
from cosmic.mico.core.orders import Interval, Motion
from cosmic.mico.core.positioner import Confidence, PositionerState
from cosmic.mico.core.rules import (
    EVERYWHERE,
    Limits,
    check_axis,
    heading,
    planned_target,
    swept_interval,
)
from cosmic.mico.hw.interface import PositionerKind

logger = logging.getLogger(__name__)

STILL: Final = {"um": 0.1, "deg": 0.001}
"""By unit: a reading that changed by less says that the axis stands."""


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
    headings : mapping of int
        Which way axes in flight go, 1 or -1; those are left out that may go either way.
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
    headings: Mapping[str, int] = field(default_factory=dict)
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
    headings: Mapping[str, int]


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
    headings = dict(picture.headings)
    asked = {request.axis for request in requests}
    for request in requests:
        verdict = _first_refusal(request, picture)
        if verdict is None:
            verdict = _torn_apart(request, asked, picture)
        if verdict is not None:
            return Decision(verdict, {}, {}, {})
        state = picture.states[request.axis]
        target = planned_target(request.motion, state, picture.targets.get(request.axis))
        if target is not None:
            targets[request.axis] = target
        place = picture.place(state)
        way = heading(request.motion, state, target)
        headings.pop(request.axis, None)
        if way is not None:
            headings[request.axis] = way
        intervals[request.axis] = swept_interval(
            request.motion, state, target, place, picture.rules
        )
    verdict = _clear_of_everything(
        intervals, replace(picture, headings=headings), checker, advice=advice
    )
    return Decision(verdict, intervals if verdict.allowed else {}, targets, headings)


def still_true(requests: Sequence[Request], then: Picture, now: Picture) -> bool:
    """Return whether what was judged by the picture `then` may be done by the picture `now`.

    Axes in flight may go on within what they hold; nothing else may have changed. Stops are
    counted by the reservations.
    """
    if (then.token, then.links) != (
        now.token,
        now.links,
    ) or then.states.keys() != now.states.keys():
        return False
    if any(_no_right(request, now) for request in requests):
        return False
    return all(
        _as_judged(state, now.states[name], then, now) for name, state in then.states.items()
    )


def _as_judged(then: PositionerState, now: PositionerState, old: Picture, new: Picture) -> bool:
    known = then.present, then.confidence, then.limits, then.std, then.position is None
    if known != (now.present, now.confidence, now.limits, now.std, now.position is None):
        return False
    sensed = now.kind is not PositionerKind.OPEN_LOOP
    if sensed and now.present and new.now_wall_s - now.read_wall_s > new.rules.stale_s:
        return False
    if then.position is None or now.position is None:
        return True
    place, off = old.place(then), STILL[now.unit]
    return place.low - off <= now.position <= place.high + off


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
        name: span_of(state, intervals.get(name), picture) for name, state in picture.states.items()
    }
    try:
        verdict = checker.check(spans, advice=advice)
    except Exception:  # a check that cannot answer says no
        logger.exception("the collision check failed")
        return refuse(
            Reason.NO_ANSWER, "the collision check failed; nothing was moved (see the log)"
        )
    return verdict


def span_of(state: PositionerState, asked: Interval | None, picture: Picture) -> AxisSpan:
    """Return where an axis may be from now on, for the collision model."""
    moving = asked is not None or state.name in picture.held
    sensed = state.kind is not PositionerKind.OPEN_LOOP
    fresh = not sensed or picture.now_wall_s - state.read_wall_s <= picture.rules.stale_s
    sure = state.present and fresh and (moving or state.activity.at_rest)
    place = asked or (picture.place(state) if sure else EVERYWHERE)
    now = origin(state, picture.begun_at) if sure else None
    way = picture.headings.get(state.name) if moving else None
    if way is not None and now is not None:
        now = state.position  # what lies behind it, it does not go to again
    estimated = state.confidence is Confidence.ESTIMATED
    counted = estimated and state.name in picture.rules.counted and math.isfinite(state.std)
    return AxisSpan(
        place.low,
        place.high,
        now,
        moving=moving,
        estimated=estimated,
        heading=way if now is not None else None,
        spread=TIMES_STD * state.std if counted else None,
    )


def origin(state: PositionerState, begun_at: Mapping[str, float | None]) -> float | None:
    """Return where an axis stands, or stood before its movement began; None where unknown."""
    if state.confidence is Confidence.UNKNOWN:
        return None
    return begun_at.get(state.name, state.position)
