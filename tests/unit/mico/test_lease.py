"""Who may move: this process, or whoever a station gave the right to."""

from dataclasses import dataclass

from cosmic.frame.errors import MoveCancelled
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.caller import Access, Call, Caller, carrying_out
from cosmic.frame.network.lease import StationLease
from cosmic.frame.network.station import Station
from cosmic.frame.verdict import Reason
from cosmic.mico.core.collision.checker import NoCollisionModel
from cosmic.mico.core.motion.checks import Limits, Request
from cosmic.mico.core.motion.gate import Gate
from cosmic.mico.core.motion.lease import Guard, Lease
from cosmic.mico.core.motion.messages import Order
from cosmic.mico.core.motion.orders import MoveTo
from cosmic.mico.core.motion.positioner import Confidence, PositionerState
from cosmic.mico.core.motion.stop_latch import StopLatch
from cosmic.mico.hw.interface import Channel, PositionerKind
from unit.mico.rigs import mico, wait_until


@dataclass
class ByHand(Guard):
    """A guard that a test ends."""

    why: str = ""

    @property
    def expired(self) -> bool:
        return bool(self.why)


def gate(lease: Lease) -> Gate:
    state = PositionerState(
        "x",
        Channel(0, 0),
        PositionerKind.LINEAR,
        "um",
        limits=(-10.0, 10.0),
        position=0.0,
        read_wall_s=1e12,
        confidence=Confidence.KNOWN,
    )
    return Gate(
        latch=StopLatch(),
        lease=lease,
        checker=NoCollisionModel(),
        rules=Limits(largest_step={"um": 3.0, "deg": 0.05}, stale_s=5.0),
        states=lambda: {"x": state},
    )


def ask(one: Gate, token: str, guard: Guard | None = None) -> tuple[Reason, str]:
    verdict = one.check([Request("x", MoveTo(5.0, "um"), token, guard=guard)])
    return verdict.reason, verdict.text


def test_this_process_moves_while_nobody_else_has_the_right() -> None:
    lease, station = Lease(), StationLease()
    one = gate(lease)
    assert ask(one, lease.local_token)[0] is Reason.ALLOWED
    lease.join(station)
    assert ask(one, lease.local_token)[0] is Reason.ALLOWED
    station.take("vision", "t" * 32, in_process=True)
    reason, text = ask(one, lease.local_token)
    assert reason is Reason.NO_LEASE
    assert "vision controls the platform now; take over" in text
    station.take_over()
    assert ask(one, lease.local_token)[0] is Reason.ALLOWED


def test_no_token_is_never_the_right_one() -> None:
    lease, station = Lease(), StationLease()
    lease.join(station)
    station.take("vision", "t" * 32, in_process=True)
    for token in ("", "t" * 32, station.local_token):
        assert ask(gate(lease), token)[0] is Reason.NO_LEASE


def test_a_guard_decides_for_whoever_has_one() -> None:
    lease, guard = Lease(), ByHand()
    one = gate(lease)
    assert ask(one, "", guard)[0] is Reason.ALLOWED
    guard.why = "vision is silent"
    assert ask(one, lease.local_token, guard) == (Reason.NO_LEASE, "x: vision is silent")


def test_a_motion_begun_in_a_call_is_guarded_by_the_caller() -> None:
    lease, station = Lease(), StationLease()
    lease.join(station)
    assert lease.guard() is None
    caller = Caller("vision", "t" * 32, Access.MOVE)
    with carrying_out(Call(caller)):
        without = lease.guard()
        assert without is not None
        assert without.expired
        assert "held by" in without.why
        station.take("vision", caller.token, in_process=True)
        guard = lease.guard()
    assert guard is not None
    assert not guard.expired
    station.take_over()
    assert guard.expired
    with carrying_out(Call(Caller("here", station.local_token, Access.MOVE, local=True))):
        assert lease.guard() is None


def test_a_call_at_a_station_that_was_not_joined_moves_nothing() -> None:
    lease = Lease()
    with carrying_out(Call(Caller("vision", "t" * 32, Access.MOVE))):
        guard = lease.guard()
    assert guard is not None
    assert guard.expired


def test_a_hosted_application_knows_its_station() -> None:
    class Application:
        station: Station | None = None

        def on_hosted(self, station: Station) -> None:
            self.station = station

    station, application = Station("fibres", FailurePolicy()), Application()
    station.host("stage", application)
    assert application.station is station


def test_a_move_ends_as_soon_as_its_guard_has_expired() -> None:
    guard = ByHand()
    with mico(instant=False) as (rig, controller):
        manager = rig.application.manager
        token = manager.lease.local_token
        order = Order(0, MoveTo(1000.0, "um"), token, "another program", guard=guard)
        manager.devices[0].submit(order)
        wait_until(lambda: bool(controller.of("move_to")))
        assert not controller.of("stop")
        guard.why = "nobody has been heard for 300 ms"
        wait_until(lambda: bool(controller.of("stop")), 5.0)
        error = order.movement.exception(5.0)
        assert isinstance(error, MoveCancelled)
        assert guard.why in str(error)
