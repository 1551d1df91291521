"""The one gate in front of the vendor library: every movement from anywhere is decided here."""

from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from functools import reduce
from itertools import count
from threading import Lock
from typing import Final

from cosmic.frame.clock import WALL
from cosmic.frame.verdict import MoveVerdict, Reason, refuse
from cosmic.mico.core.collision import words
from cosmic.mico.core.collision.checker import AxisSpan, CollisionChecker, NoCollisionModel
from cosmic.mico.core.motion.checks import (
    Decision,
    Limits,
    PlatformSnapshot,
    Request,
    check_move,
    check_move_promptly,
    origin,
    span_of,
    still_true,
)
from cosmic.mico.core.motion.lease import Lease, LeaseHolder
from cosmic.mico.core.motion.orders import Interval, Motion, Reservation
from cosmic.mico.core.motion.positioner import Confidence, PositionerState
from cosmic.mico.core.motion.stop_latch import StopLatch, StopState
from cosmic.mico.core.motion.straight import StraightLine

SOON_S: Final = 0.05
"""An answer that took no longer is as new as the positions, which are asked for so often."""
PROMPT_S: Final = 0.002
MOST_TRIES: Final = 3
"""How often movements are checked because the platform changed meanwhile."""


@dataclass(frozen=True, slots=True)
class _Hold:
    reservation: Reservation
    interval: Interval
    target: float | None
    begun_at: float | None
    heading: int | None


@dataclass(frozen=True, slots=True)
class _Unused:
    """A reservation that was given and not used yet."""

    reservation: Reservation
    motion: Motion


@dataclass(slots=True)
class GateQuery:
    """What one thread asks the gate for another, which may withdraw it at any time."""

    withdrawn: bool = False
    reservations: tuple[Reservation, ...] = ()


class Gate:
    """Keeps what is in flight and asks `check_move`; any thread.

    A `Reservation` covers one motion of one axis and is used once, with `claim`, when the
    motion is sent. Only the object that the gate gave counts, no copy of it.

    Parameters
    ----------
    states : callable
        Returns the state of every positioner by name.
    regions : mapping of Interval
        Where each axis may be at power-up; anywhere, where it has none.
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
        self._deciding = Lock()  # one decision at a time; what has ended is released meanwhile
        self._lock = Lock()  # of the reservations; never held while somebody waits for an answer
        self._links = links
        self._numbers = count(1)
        self._holds: dict[str, dict[int, _Hold]] = {}
        self._given = 0
        self._sent: dict[str, int] = {}
        # By identity; each read and written in one step, for `claim` takes no lock.
        self._unused: dict[int, _Unused] = {}
        self._power_up = dict(regions or {})
        self._regions = dict(self._power_up)

    @property
    def checker(self) -> CollisionChecker:
        """The collision model, or the stand-in that says there is none."""
        return self._checker

    @property
    def prompt(self) -> bool:
        """True where nothing is asked that may be long in answering."""
        return isinstance(self._checker, NoCollisionModel)

    def check(self, requests: Sequence[Request], *, advice: bool = True) -> MoveVerdict:
        """Say whether `requests` would be allowed now, without reserving anything.

        `advice` is that of `CollisionChecker.check`.
        """
        holder = self._lease.holder
        return check_move(requests, self._snapshot(holder), self._checker, advice=advice).verdict

    def decide(
        self,
        requests: Sequence[Request],
        query: GateQuery | None = None,
        *,
        line: StraightLine | None = None,
    ) -> tuple[MoveVerdict, dict[str, Reservation]]:
        """Decide `requests` together; when allowed, hold their intervals and reserve each axis.

        Nothing is held, or reserved, for a `query` that was withdrawn meanwhile. With a `line`
        that the axes can keep to, the reservations may be `straight`; others see the whole box.
        """
        for _ in range(MOST_TRIES):
            holder = self._lease.holder  # first, for it may emit that it has lapsed
            before = holder.token, self._revision
            verdict, reservations = self._decide(requests, holder, query, line)
            # Looked at when the intervals are held: who changes it later finds them.
            if before == (self._lease.holder.token, self._revision):
                return verdict, reservations
            for reservation in reservations.values():
                self.release(reservation)
        return words.changed(), {}

    def decide_promptly(
        self, requests: Sequence[Request]
    ) -> tuple[MoveVerdict, dict[str, Reservation]] | None:
        """Decide as `decide` where that takes a few milliseconds at most; None where it may not.

        For a thread that has something else to do. None holds nothing.
        """
        holder = self._lease.holder  # first, for it may emit that it has lapsed
        before = holder.token, self._revision
        if not self._deciding.acquire(timeout=PROMPT_S):
            return None
        try:
            epoch = self._latch.state.epoch
            snapshot = self._snapshot(holder)
            decision = check_move_promptly(requests, snapshot, self._checker)
            if decision is None or WALL.now_s() - snapshot.now_wall_s > SOON_S:
                return None
            with self._lock:
                reservations = self._hold(requests, snapshot, decision, epoch)
        finally:
            self._deciding.release()
        if before == (self._lease.holder.token, self._revision):
            return decision.verdict, reservations
        for reservation in reservations.values():
            self.release(reservation)
        return None

    @property
    def _revision(self) -> object:
        return getattr(self._checker, "revision", None)

    def _decide(
        self,
        requests: Sequence[Request],
        holder: LeaseHolder,
        query: GateQuery | None,
        line: StraightLine | None,
    ) -> tuple[MoveVerdict, dict[str, Reservation]]:
        with self._deciding:
            epoch = self._latch.state.epoch
            snapshot, decision = self._check(requests, holder, line)
            with self._lock:
                if query is not None and query.withdrawn:
                    return decision.verdict, {}
                reservations = self._hold(requests, snapshot, decision, epoch)
                if query is not None:
                    query.reservations = tuple(reservations.values())
                return decision.verdict, reservations

    def _hold(
        self,
        requests: Sequence[Request],
        snapshot: PlatformSnapshot,
        decision: Decision,
        epoch: int,
    ) -> dict[str, Reservation]:
        """Reserve what was decided; under both locks."""
        reservations: dict[str, Reservation] = {}
        asked = {request.axis: request.motion for request in requests}
        for axis, interval in decision.intervals.items():
            target = decision.targets.get(axis)
            straight = decision.straight
            reservation = Reservation(axis, next(self._numbers), epoch, target, straight)
            state = snapshot.states[axis]
            if state.confidence is Confidence.UNKNOWN:
                self._regions[axis] = interval  # wherever that ends, it is somewhere there
            heading = decision.headings.get(axis)
            hold = _Hold(reservation, interval, target, origin(state, snapshot.begun_at), heading)
            self._holds.setdefault(axis, {})[reservation.number] = hold
            self._given = reservation.number
            self._unused[id(reservation)] = _Unused(reservation, asked[axis])
            reservations[axis] = reservation
        return reservations

    def _check(
        self, requests: Sequence[Request], holder: LeaseHolder, line: StraightLine | None
    ) -> tuple[PlatformSnapshot, Decision]:
        """Check `requests` by the platform as it still is when the answer comes.

        Meanwhile reservations may be released, and none is added: only who decides adds any.
        """
        snapshot = self._snapshot(holder)
        for _ in range(MOST_TRIES):
            decision = check_move(requests, snapshot, self._checker, line=line)
            soon = WALL.now_s() - snapshot.now_wall_s <= SOON_S
            if soon or not decision.verdict.allowed:
                return snapshot, decision
            now = self._snapshot(holder)
            if still_true(requests, snapshot, now):
                return snapshot, decision
            snapshot = now
        return snapshot, Decision(words.changed(), {}, {}, {})

    def spans(self) -> dict[str, AxisSpan]:
        """Return where every axis may be as things are now."""
        holder = self._lease.holder
        snapshot = self._snapshot(holder)
        return {name: span_of(state, None, snapshot) for name, state in snapshot.states.items()}

    def still_valid(self, reservation: Reservation) -> bool:
        """Return False when a stop came after `reservation`; takes no lock."""
        state = self._latch.state
        return state.reason is None and state.epoch == reservation.epoch

    # Reservations

    def objection(self, reservation: Reservation, axis: str, motion: Motion) -> MoveVerdict | None:
        """Return why `reservation` does not cover sending `motion` to `axis` now; takes no lock."""
        given = self._unused.get(id(reservation))
        if given is None:
            known = type(reservation) is Reservation and reservation.number in range(
                1, self._given + 1
            )
            why = "was used or released before" if known else "was not given by the gate"
        elif given.reservation.axis != axis:
            why = f"is for {given.reservation.axis}"
        elif given.motion is not motion:
            why = "is for another motion"
        elif not self.still_valid(reservation):
            text = f"{axis}: stopped before it was sent; give the order again after the reset"
            return refuse(Reason.STOPPED, text, axis=axis)
        else:
            return None
        text = f"{axis}: its reservation {why}; nothing was sent. Give the order anew"
        return refuse(Reason.NO_LEASE, text, axis=axis)

    def claim(
        self, reservation: Reservation, axis: str, motion: Motion, *, straight: bool = False
    ) -> MoveVerdict | None:
        """Use `reservation` up at the moment at which `motion` is sent to `axis`; takes no lock.

        Returns why it must not be sent, or None, which it does once for each reservation. Whoever
        sends it along a line with the others says `straight`.
        """
        if reservation.straight and not straight:
            text = f"{axis}: it may go along a line with the others only; nothing was sent"
            return refuse(Reason.NO_LEASE, text, axis=axis)
        refused = self.objection(reservation, axis, motion)
        if refused is None and self._unused.pop(id(reservation), None) is None:
            refused = self.objection(reservation, axis, motion)  # another thread came first
        if refused is None:
            self._sent[axis] = reservation.number
        return refused

    def expire(self, axes: Set[str]) -> frozenset[str]:
        """End the unused reservations of `axes`; returns those that hold any. Takes no lock."""
        for key, given in list(self._unused.items()):
            if given.reservation.axis in axes:
                self._unused.pop(key, None)
        return frozenset(axis for axis, holds in list(self._holds.items()) if holds) & axes

    def superseded(self, reservation: Reservation) -> bool:
        """Return True when a movement decided later was sent to the axis; takes no lock."""
        return self._sent.get(reservation.axis, 0) > reservation.number

    def withdraw(self, reservation: Reservation | None) -> None:
        """Release a reservation of an order that is not sent; harmless for any other.

        One in use keeps its interval, for orders come from anybody.
        """
        if self._unused.pop(id(reservation), None) is not None and reservation is not None:
            self.release(reservation)

    def withdraw_query(self, query: GateQuery) -> None:
        """Release what a query has reserved, or have it reserve nothing."""
        with self._lock:
            query.withdrawn = True
            reservations = query.reservations
        for reservation in reservations:
            self.withdraw(reservation)

    def release(self, reservation: Reservation) -> None:
        """Release the interval of a movement that has ended, its position read; or replaced.

        The interval of a movement that replaces another holds the other's as well.
        """
        with self._lock:
            self._unused.pop(id(reservation), None)
            holds = self._holds.get(reservation.axis, {})
            hold = holds.get(reservation.number)
            if hold is not None and hold.reservation is reservation:
                del holds[reservation.number]

    def abandon(self, reservation: Reservation) -> None:
        """Keep the interval, but no longer count on the target: the movement will not get there."""
        with self._lock:
            hold = self._holds.get(reservation.axis, {}).get(reservation.number)
            if hold is not None and hold.reservation is reservation:
                self._holds[reservation.axis][reservation.number] = replace(hold, target=None)

    def release_axis(self, axis: str) -> None:
        """Release all of an axis that is stationary and whose position has just been read."""
        with self._lock:
            for hold in self._holds.pop(axis, {}).values():
                self._unused.pop(id(hold.reservation), None)

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
            axis: reduce(Interval.union, (hold.interval for hold in holds.values()))
            for axis, holds in self._holds.items()
            if holds
        }

    def _headings(self) -> dict[str, int]:
        newest = {axis: holds[max(holds)] for axis, holds in self._holds.items() if holds}
        return {axis: hold.heading for axis, hold in newest.items() if hold.heading is not None}

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
                self._regions[name] = self._power_up[name].union(here)
        return dict(self._regions)

    def _snapshot(self, holder: LeaseHolder) -> PlatformSnapshot:
        with self._lock:
            return self._snapshot_now(holder)

    def _snapshot_now(self, holder: LeaseHolder) -> PlatformSnapshot:
        states = self._states()
        return PlatformSnapshot(
            stop_reason=self._latch.state.reason,
            token=holder.token,
            holder=holder.name,
            states=states,
            held=self._held(),
            begun_at=self._begun_at(),
            headings=self._headings(),
            regions=self._regions_now(states),
            links=self._links(),
            targets=self._targets(),
            now_wall_s=WALL.now_s(),
            rules=self._rules,
        )
