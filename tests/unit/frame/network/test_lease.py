"""Who may move, how long it lasts, and what stops a motion whose holder is silent."""

import pytest

from cosmic.frame.clock import ManualClock
from cosmic.frame.errors import MoveRefused
from cosmic.frame.network.caller import MOVE_LIMIT_S
from cosmic.frame.network.dead_man import DeadMan, Pulse
from cosmic.frame.network.lease import LeaseState, StationLease
from cosmic.frame.verdict import Reason


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock()


@pytest.fixture
def lease(clock: ManualClock) -> StationLease:
    return StationLease("the operator", clock=clock)


def test_at_first_the_local_operator_holds_it(lease: StationLease) -> None:
    assert lease.holds(lease.local_token)
    assert not lease.dead_man(lease.local_token).expired
    assert lease.state == LeaseState("the operator", local=True, offered=True)


def test_while_another_holds_it_the_local_operator_may_not_move(lease: StationLease) -> None:
    lease.take("vision", "a")
    assert not lease.holds(lease.local_token)
    with pytest.raises(MoveRefused, match="held by vision") as caught:
        lease.dead_man(lease.local_token)
    assert caught.value.verdict.reason is Reason.NO_LEASE


def test_only_the_token_counts(lease: StationLease) -> None:
    lease.take("vision", "a")
    with pytest.raises(MoveRefused):
        lease.take("vision", "b")
    lease.release("b")
    assert lease.holds("a")
    lease.take("vision", "a")
    lease.release("a")
    assert lease.holds(lease.local_token)


def test_silence_ends_it_for_good(lease: StationLease, clock: ManualClock) -> None:
    lease.take("vision", "a")
    dead_man = lease.dead_man("a")
    clock.advance(1.01)
    assert not lease.holds("a")
    assert "nothing heard from vision for 1.0 s" in dead_man.why
    lease.beat("a", clock.now_s())
    assert not lease.holds("a")
    lease.take("vision", "a")
    assert lease.holds("a")
    assert dead_man.expired, "an old motion stays ended"


def test_a_late_sign_of_life_revives_nothing_even_if_nobody_looked(
    lease: StationLease, clock: ManualClock
) -> None:
    lease.take("vision", "a")
    dead_man = lease.dead_man("a")
    clock.advance(1.5)
    lease.beat("a", clock.now_s())
    assert dead_man.expired


def test_who_may_be_silent_keeps_the_right_and_nothing_that_moves(
    lease: StationLease, clock: ManualClock
) -> None:
    lease.take("assistant", "far", keep_s=30.0)
    moving = lease.dead_man("far")
    clock.advance(MOVE_LIMIT_S + 0.1)
    assert moving.expired
    assert lease.holds("far")
    lease.beat("far", clock.now_s())
    assert moving.expired, "going on needs a new command"
    assert not lease.dead_man("far").expired
    clock.advance(30.1)
    assert not lease.holds("far")


def test_whoever_was_watched_otherwise_and_asks_for_signs_of_life_needs_them(
    lease: StationLease, clock: ManualClock
) -> None:
    lease.take("epics", "a", in_process=True)
    clock.advance(100.0)
    lease.take("epics", "a", keep_s=5.0)
    assert lease.holds("a")
    dead_man = lease.dead_man("a")
    clock.advance(1.01)
    assert dead_man.expired
    clock.advance(4.0)
    assert not lease.holds("a")
    lease.take("epics", "a", keep_s=5.0)
    lease.take("epics", "a", in_process=True)
    dead_man = lease.dead_man("a")
    clock.advance(100.0)
    assert not dead_man.expired


def test_signs_of_life_keep_it(lease: StationLease, clock: ManualClock) -> None:
    lease.take("vision", "a")
    dead_man = lease.dead_man("a", 0.3)
    for _ in range(50):
        clock.advance(0.2)
        lease.beat("a", clock.now_s())
        assert not dead_man.expired
    assert lease.holds("a")


def test_a_jog_stops_before_the_lease_lapses(lease: StationLease, clock: ManualClock) -> None:
    lease.take("vision", "a")
    jog, move = lease.dead_man("a", 0.3), lease.dead_man("a")
    clock.advance(0.31)
    assert jog.expired
    assert not move.expired
    lease.beat("a", clock.now_s())
    assert jog.expired, "a jog that has stopped needs a new command"
    assert not move.expired
    assert not lease.dead_man("a", 0.3).expired


def test_a_sign_of_life_counts_from_when_it_was_sent(clock: ManualClock) -> None:
    pulse = Pulse("vision", limit_s=1.0, clock=clock)
    dead_man = DeadMan(pulse, 0.3)
    clock.advance(0.25)
    pulse.beat(0.05)  # it took 0.2 s on its way
    clock.advance(0.11)
    assert dead_man.expired


@pytest.mark.parametrize("sent_s", [1e9, float("nan"), float("inf"), float("-inf"), -5.0])
def test_a_sign_of_life_from_the_future_or_nowhere_counts_for_nothing(
    clock: ManualClock, sent_s: float
) -> None:
    pulse = Pulse("vision", limit_s=1.0, clock=clock)
    clock.advance(0.2)
    pulse.beat(sent_s)
    clock.advance(0.2)
    assert DeadMan(pulse, 0.3).expired


@pytest.mark.parametrize("how", ["taken over", "released"])
def test_what_moves_by_a_lease_that_is_gone_ends_at_once(lease: StationLease, how: str) -> None:
    lease.take("vision", "a")
    remote = lease.dead_man("a")
    if how == "taken over":
        lease.take_over()
    else:
        lease.release("a")
    assert remote.expired, "without waiting for silence"


def test_what_the_operator_took_over_stays_there_until_offered(lease: StationLease) -> None:
    lease.take("vision", "a")
    lease.take_over()
    assert not lease.state.offered
    with pytest.raises(MoveRefused, match="keeps the right to move to itself"):
        lease.take("vision", "a")
    lease.offer()
    lease.take("vision", "a")
    assert lease.holds("a")


def test_a_session_of_this_process_needs_no_signs_of_life(
    lease: StationLease, clock: ManualClock
) -> None:
    lease.take("script", "a", in_process=True)
    clock.advance(1000.0)
    assert lease.holds("a")
    assert not lease.dead_man("a", 0.3).expired


def test_every_change_is_reported(lease: StationLease, clock: ManualClock) -> None:
    seen: list[LeaseState] = []
    remove = lease.subscribe(seen.append)
    lease.take("vision", "a")
    clock.advance(2.0)
    lease.poll()
    lease.poll()
    lease.take_over()
    remove()
    lease.offer()
    assert [(state.holder, state.offered) for state in seen] == [
        ("the operator", True),
        ("vision", True),
        ("the operator", True),
        ("the operator", False),
    ]
    assert "nothing heard" in seen[2].why


def test_a_stricter_dead_man_for_the_same_holder(lease: StationLease, clock: ManualClock) -> None:
    lease.take("vision", "a")
    strict = lease.dead_man("a").within(0.3)
    assert strict.limit_s == 0.3
    assert strict.within(5.0).limit_s == 0.3
    clock.advance(0.4)
    assert strict.expired
