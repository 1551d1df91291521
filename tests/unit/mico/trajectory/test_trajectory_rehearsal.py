"""Rehearsals through the pure gate on small scenes."""

import pytest

from cosmic.frame.errors import MoveCancelled
from cosmic.frame.verdict import Reason
from cosmic.mico.core.collision.checker import NoCollisionModel
from cosmic.mico.core.collision.collision_manager import CollisionManager
from cosmic.mico.core.motion.checks import Limits
from cosmic.mico.core.motion.positioner import Confidence, PositionerState
from cosmic.mico.core.motion.settings import MotionDefaults
from cosmic.mico.core.trajectory.binding import AxisFacts, PlatformFacts, bind
from cosmic.mico.core.trajectory.clearance import ClearanceSearch
from cosmic.mico.core.trajectory.pure_gate import PureAnswers, pure_copy
from cosmic.mico.core.trajectory.reader import parse
from cosmic.mico.core.trajectory.rehearsal import Rehearsal, RehearsalSetup, rehearse
from cosmic.mico.core.trajectory.timing import LANDING_S, move_s
from cosmic.mico.hw.interface import Channel, PositionerKind
from unit.mico.small_scenes import two_arms

HEAD = "cosmic-trajectory 1\nplatform any\n"
MODEL = two_arms()
ANSWERS = PureAnswers(MODEL)


def states() -> dict[str, PositionerState]:
    return {
        axis: PositionerState(
            name=axis,
            address=Channel(0, 0),
            kind=PositionerKind.LINEAR,
            unit="um",
            limits=(-5000.0, 5000.0),
            position=0.0,
            confidence=Confidence.KNOWN,
        )
        for axis in MODEL.axes
    }


def played(text: str, *, model: bool = True, **options: object) -> Rehearsal:
    now = states()
    facts = PlatformFacts(
        "", {axis: AxisFacts("um", has_sensor=True, limits=s.limits) for axis, s in now.items()},
        MotionDefaults(),
    )  # fmt: skip
    bound = bind(parse(HEAD + text), facts, dict.fromkeys(now, 0.0))
    live = CollisionManager(MODEL, process=ANSWERS)
    setup = RehearsalSetup(
        states=now,
        facts=facts,
        frequencies_hz=dict.fromkeys(now, 5000.0),
        step_um={},
        checker=pure_copy(live, ANSWERS, MODEL.axes) if model else NoCollisionModel(),
        rules=Limits(largest_step={"um": 3.0, "deg": 0.05}, stale_s=5.0),
        clearance=ClearanceSearch(ANSWERS.sweep, bound.trajectory.axes) if model else None,
        **options,  # type: ignore[arg-type]
    )
    return rehearse(bound, setup)


def test_a_line_into_the_other_arm_is_refused_with_its_number() -> None:
    found = played("left.x to 500 um\nleft.y to 10 um\nleft.x to 3000 um\nleft.x to 0 um\n")
    assert not found.allowed
    assert found.line == 5
    assert found.verdict.reason is Reason.COLLISION
    assert found.verdict.bodies == ("left_z", "right_z")
    assert found.end == {"left.x": 500.0, "left.y": 10.0}


def test_the_smallest_clearance_is_found_with_its_line_and_bodies() -> None:
    found = played("left.x to 500 um\nleft.x to 1800 um\nleft.x to 0 um\n")
    assert found.allowed
    assert found.clearance_um == pytest.approx(200.0, abs=3.0)
    assert found.clearance_line == 4
    assert found.clearance_bodies == ("left_z", "right_z")
    assert found.end == {"left.x": 0.0}
    assert [pose["left.x"] for pose in found.poses] == [0.0, 500.0, 1800.0, 0.0]


def test_the_smallest_clearance_is_found_in_the_middle_of_a_line() -> None:
    beside = "left.y to 2500 um\nleft.x to 1900 um\n"
    found = played(f"{beside}left.y to -2500 um\n")
    if not found.allowed:
        pytest.fail(str(found.verdict))
    assert found.clearance_line == 5
    assert found.clearance_um == pytest.approx(100.0, rel=0.05)


def test_the_duration_comes_from_speeds_accelerations_waits_and_times() -> None:
    def took(text: str, **options: object) -> float:
        return played(text, **options).duration_s

    assert took("left.x to 1000 um\n") == pytest.approx(1000 / 7500 + 0.075 + LANDING_S)
    assert took("speed left.x 100 um/s\nleft.x to 1000 um\n") == pytest.approx(
        10.0, abs=0.1 + LANDING_S
    )
    assert took("wait 3 s\n", speed=2.0) == 3.0
    assert took("t=4 s wait 1 s\n") == 5.0
    assert took("t=4 s wait 1 s\n", speed=2.0) == 3.0
    assert took("t=4 s wait 1 s\n", timed=False) == 1.0
    assert move_s(0.0, 100.0, 1000.0) == 0.0
    assert move_s(5.0, 100.0, 1000.0) == pytest.approx(2 * (5.0 / 1000.0) ** 0.5)


def test_it_begins_where_the_trajectory_says() -> None:
    found = played("start left.x 1000 um\nleft.x by 100 um\n")
    assert [pose["left.x"] for pose in found.poses] == [1000.0, 1100.0]
    assert found.clearance_um == pytest.approx(900.0, abs=10.0)


def test_what_is_left_is_reported_for_each_line() -> None:
    found = played("wait 1 s\nwait 2 s\nwait 3 s\n")
    assert found.left_s == ((3, 6.0), (4, 5.0), (5, 3.0))


def test_without_a_collision_model_only_limits_are_looked_at() -> None:
    found = played("left.x to 3000 um\n", model=False)
    assert found.allowed
    assert found.clearance_um is None


def test_a_rehearsal_can_be_left() -> None:
    with pytest.raises(MoveCancelled):
        played("left.x to 5 um\n", cancelled=lambda: True)


def test_a_thousand_lines_are_gone_through_much_faster_than_they_run() -> None:
    found = played("left.x by 20 um\nleft.y by 10 um\nleft.x by -20 um\nleft.y by -10 um\n" * 250)
    assert found.allowed
    assert found.lines == 1000
    assert found.took_s * 10.0 < found.duration_s
