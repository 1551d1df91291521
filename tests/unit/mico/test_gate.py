"""The pure part of the gate: state in, verdict out."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosmic.frame.verdict import ALLOWED, Reason, refuse
from cosmic.mico.core.collision.checker import AxisSpan, NoCollisionModel
from cosmic.mico.core.motion.checks import Limits, PlatformSnapshot, Request, check_move
from cosmic.mico.core.motion.gate import Gate
from cosmic.mico.core.motion.lease import Lease
from cosmic.mico.core.motion.orders import Calibrate, Interval, MoveBy, MoveTo, Reference, Step
from cosmic.mico.core.motion.positioner import Confidence, PositionerState
from cosmic.mico.core.motion.stop_latch import StopLatch
from cosmic.mico.hw.interface import (
    Activity,
    Channel,
    Direction,
    PositionerKind,
    PositionerType,
    ReferenceKind,
)

RULES = Limits(largest_step={"um": 3.0, "deg": 0.05}, stale_s=5.0)


def linear(**changes):
    fields = {
        "name": "x",
        "address": Channel(0, 0),
        "kind": PositionerKind.LINEAR,
        "unit": "um",
        "limits": (-100.0, 100.0),
        "position": 0.0,
        "read_wall_s": 100.0,
        "confidence": Confidence.KNOWN,
    }
    return PositionerState(**(fields | changes))


def picture(*states, **changes):
    fields = {
        "stop_reason": None,
        "token": "t",
        "states": {state.name: state for state in states or (linear(),)},
        "held": {},
        "targets": {},
        "now_wall_s": 100.0,
        "rules": RULES,
    }
    return PlatformSnapshot(**(fields | changes))


def ask(motion, *states, token="t", consent=False, checker=None, **changes):
    request = Request("x", motion, token, consent)
    return check_move([request], picture(*states, **changes), checker or NoCollisionModel())


def reason(*args, **changes):
    verdict = ask(*args, **changes).verdict
    assert verdict.allowed == (verdict.reason is Reason.ALLOWED)
    assert verdict.text
    return verdict.reason


GARBAGE = [math.nan, math.inf, -math.inf, "5", None, True, [1], 5j, {}]


@pytest.mark.parametrize("value", GARBAGE)
def test_what_is_no_finite_number_never_passes(value):
    assert reason(MoveTo(value, "um")) is Reason.NOT_FINITE
    assert reason(MoveBy(value, "um")) is Reason.NOT_FINITE
    assert reason(Step(value, 100.0, 1000)) is Reason.NOT_FINITE
    assert reason(Step(10, value, 1000)) is Reason.NOT_FINITE
    assert reason(Step(10, 100.0, value)) is Reason.NOT_FINITE


def test_the_checks_come_in_their_order():
    bad = MoveTo(math.nan, "deg")
    state = linear(confidence=Confidence.UNKNOWN)
    assert reason(bad, state, stop_reason="because", token="other") is Reason.STOPPED
    assert reason(bad, state, token="other") is Reason.NO_LEASE
    assert reason(bad, state) is Reason.NOT_FINITE
    assert reason(MoveTo(999.0, "deg"), state) is Reason.WRONG_KIND
    assert reason(MoveTo(999.0, "um"), linear(present=False)) is Reason.DEVICE


def test_no_lease_no_move():
    assert reason(MoveTo(1.0, "um"), token="") is Reason.NO_LEASE


def test_an_old_position_is_no_answer():
    assert reason(MoveTo(1.0, "um"), now_wall_s=106.0) is Reason.NO_ANSWER
    assert reason(MoveTo(1.0, "um"), linear(position=None)) is Reason.NO_ANSWER


def test_a_sweep_of_an_unknown_axis_needs_consent():
    unknown = linear(confidence=Confidence.UNKNOWN)
    for motion in (Reference(), Calibrate(), MoveTo(1.0, "um"), Step(1, 100.0, 100)):
        assert reason(motion, unknown) is Reason.POSITION_UNKNOWN
        assert reason(motion, unknown, consent=True) is Reason.ALLOWED


class Explodes:
    available = True

    def check(self, swept, *, advice=True):
        raise RuntimeError("library crashed")


class Records:
    available = True

    def __init__(self, verdict=ALLOWED):
        self.swept = None
        self.verdict = verdict

    def check(self, swept, *, advice=True):
        self.swept = dict(swept)
        return self.verdict


def test_a_collision_check_that_cannot_answer_says_no():
    assert reason(MoveTo(1.0, "um"), checker=Explodes()) is Reason.NO_ANSWER


def test_the_collision_check_sees_what_moves_what_is_in_flight_and_what_rests():
    checker = Records()
    other, third = linear(name="y", position=7.0), linear(name="z", position=1.0)
    ask(
        MoveTo(50.0, "um"),
        linear(),
        other,
        third,
        held={"z": Interval(1.0, 9.0)},
        checker=checker,
    )
    assert checker.swept == {
        "x": AxisSpan(0.0, 50.0, 0.0, moving=True, heading=1),
        "y": AxisSpan(7.0, 7.0, 7.0),
        "z": AxisSpan(1.0, 9.0, 1.0, moving=True),
    }


@pytest.mark.parametrize(
    "unsure",
    [
        {"present": False},
        {"read_wall_s": 100.0 - 2 * RULES.stale_s},
        {"activity": Activity.TARGETING},
        {"confidence": Confidence.UNKNOWN},
        {"position": None},
    ],
)
def test_an_axis_that_is_not_seen_to_stand_somewhere_may_be_anywhere(unsure):
    checker = Records()
    ask(MoveTo(50.0, "um"), linear(), linear(name="y", **unsure), checker=checker)
    span = checker.swept["y"]
    assert (span.low, span.high, span.now) == (-math.inf, math.inf, None)


def test_a_counted_position_is_reported_as_estimated():
    checker = Records()
    gripper = linear(name="g", kind=PositionerKind.OPEN_LOOP, confidence=Confidence.ESTIMATED)
    ask(MoveTo(50.0, "um"), linear(), gripper, checker=checker)
    assert checker.swept["g"] == AxisSpan(0.0, 0.0, 0.0, estimated=True)


def test_an_unknown_axis_is_taken_to_stand_in_its_start_region():
    checker = Records()
    regions = {"y": Interval(-20.0, 30.0)}
    lost = linear(name="y", confidence=Confidence.UNKNOWN)
    ask(MoveTo(50.0, "um"), linear(), lost, checker=checker, regions=regions)
    assert checker.swept["y"] == AxisSpan(-20.0, 30.0, None)


@pytest.mark.parametrize(
    ("direction", "low", "high"),
    [
        (Direction.FORWARD, -20.0, math.inf),
        (Direction.BACKWARD, -math.inf, 30.0),
        (None, -math.inf, math.inf),
    ],
)
def test_a_reference_run_to_an_end_stop_sweeps_towards_that_stop(direction, low, high):
    checker = Records()
    found = PositionerType(1, "linear", PositionerKind.LINEAR, ReferenceKind.END_STOP)
    lost = linear(
        confidence=Confidence.UNKNOWN, positioner=found, safe_direction=direction, position=5.0
    )
    regions = {"x": Interval(-20.0, 30.0)}
    assert ask(Reference(), lost, consent=True, checker=checker, regions=regions).verdict.allowed
    assert checker.swept["x"] == AxisSpan(low, high, None, moving=True)


def test_an_unknown_axis_may_be_wherever_it_was_driven_since():
    state = linear(confidence=Confidence.UNKNOWN, read_wall_s=math.inf)
    checker = Records()
    one = gate(checker, states={"x": state}, regions={"x": Interval(-20.0, 30.0)})
    token = one._lease.holder.token
    for _ in range(2):
        verdict, reservations = one.decide([Request("x", MoveBy(10.0, "um"), token, consent=True)])
        assert verdict.allowed
        one.release(reservations["x"])
    assert checker.swept["x"] == AxisSpan(-20.0, 50.0, None, moving=True)


def test_a_movement_that_goes_on_counts_from_where_it_is_but_holds_where_it_was():
    states = {"x": linear(read_wall_s=math.inf)}
    checker = Records()
    one = gate(checker, states=states)
    token = one._lease.holder.token
    one.decide([Request("x", MoveTo(50.0, "um"), token)])
    states["x"] = linear(read_wall_s=math.inf, position=20.0)
    one.decide([Request("x", MoveTo(60.0, "um"), token)])
    assert checker.swept["x"] == AxisSpan(0.0, 60.0, 20.0, moving=True, heading=1)


def test_a_sweep_takes_the_whole_travel():
    checker = Records()
    ask(Reference(), checker=checker)
    assert checker.swept["x"] == AxisSpan(-math.inf, math.inf, 0.0, moving=True)


@given(
    target=st.floats(allow_nan=True, allow_infinity=True),
    position=st.floats(-100, 100),
)
def test_whatever_is_allowed_stays_within_the_limits(target, position):
    decision = ask(MoveTo(target, "um"), linear(position=position))
    if decision.verdict.allowed:
        interval = decision.intervals["x"]
        assert -100.0 <= interval.low <= interval.high <= 100.0
        assert interval.low <= position <= interval.high
    else:
        assert not decision.intervals
        assert not -100.0 <= target <= 100.0


@given(steps=st.integers(-40000, 40000), position=st.floats(-100, 100))
def test_steps_that_are_allowed_cannot_leave_the_limits(steps, position):
    decision = ask(Step(steps, 100.0, 1000), linear(position=position))
    if decision.verdict.allowed:
        assert -100.0 <= position + steps * 3.0 <= 100.0
        assert abs(steps) < 30000


def gate(checker=None, latch=None, states=None, regions=None):
    states = states or {"x": linear(read_wall_s=math.inf)}
    return Gate(
        latch=latch or StopLatch(),
        lease=Lease(),
        checker=checker or NoCollisionModel(),
        rules=RULES,
        states=lambda: states,
        regions=regions,
    )


def test_what_is_granted_is_held_until_it_is_given_back():
    one = gate()
    token = one._lease.holder.token
    verdict, first = one.decide([Request("x", MoveTo(50.0, "um"), token)])
    assert verdict.allowed
    assert first["x"].target == 50.0
    _, second = one.decide([Request("x", MoveTo(-20.0, "um"), token)])
    assert one.held() == {"x": Interval(-20.0, 50.0)}
    one.release(first["x"])
    assert one.held() == {"x": Interval(-20.0, 50.0)}, "the newer movement starts anywhere there"
    one.release(second["x"])
    one.release(second["x"])
    assert one.held() == {}


def test_a_check_or_a_refusal_holds_nothing():
    one = gate()
    token = one._lease.holder.token
    one.check([Request("x", MoveTo(50.0, "um"), token)])
    verdict, reservations = one.decide([Request("x", MoveTo(500.0, "um"), token)])
    assert not verdict.allowed
    assert reservations == {}
    assert one.held() == {}


def test_a_grant_is_void_after_a_stop_even_when_it_was_reset():
    latch = StopLatch()
    one = gate(latch=latch)
    _, reservations = one.decide([Request("x", MoveTo(50.0, "um"), one._lease.holder.token)])
    assert one.still_valid(reservations["x"])
    latch.set("stop")
    assert not one.still_valid(reservations["x"])
    latch.reset()
    assert not one.still_valid(reservations["x"])


def test_a_refused_collision_names_the_bodies():
    refusal = refuse(Reason.COLLISION, "jaw and plate", axis="x")
    assert reason(MoveTo(1.0, "um"), checker=Records(refusal)) is Reason.COLLISION
