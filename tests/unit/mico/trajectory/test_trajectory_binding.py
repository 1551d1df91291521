"""Checking trajectories against a platform, mirroring them, and counting from poses."""

import pytest
from pydantic import ValidationError

from cosmic.mico.core.motion.orders import MoveBy, MoveTo, Step
from cosmic.mico.core.motion.settings import MotionDefaults
from cosmic.mico.core.poses import Pose
from cosmic.mico.core.trajectory.binding import (
    AxisFacts,
    Bound,
    BoundLeg,
    BoundSpeed,
    PlatformFacts,
    bind,
)
from cosmic.mico.core.trajectory.mirror import mirrored
from cosmic.mico.core.trajectory.model import TrajectoryError
from cosmic.mico.core.trajectory.reader import parse
from cosmic.mico.core.trajectory.settings import MirrorSettings
from cosmic.mico.core.trajectory.writer import to_text

HEAD = "cosmic-trajectory 1\nplatform FiberStation\n"
LINEAR = AxisFacts("um", has_sensor=True, limits=(-5500.0, 5500.0))
FACTS = PlatformFacts(
    name="FiberStation",
    axes={
        "left.x": LINEAR,
        "left.z": LINEAR,
        "right.x": LINEAR,
        "table.rotation": AxisFacts("deg", has_sensor=True, limits=(-160.0, 160.0)),
        "left.gripper": AxisFacts("um", has_sensor=False, limits=None),
        "right.gripper": AxisFacts("um", has_sensor=False, limits=None),
    },
    defaults=MotionDefaults(),
    poses={"fibre": Pose("fibre", {"left.x": 1000.0, "left.z": -50.0})},
)
MIRROR = MirrorSettings.model_validate(
    {
        "pairs": [["left.x", "right.x"], ["left.gripper", "right.gripper"],
                  ["table.rotation", "table.rotation"]],
        "reversed": ["left.x", "right.x", "table.rotation"],
    }
)  # fmt: skip


def bound(statements: str, positions: dict[str, float] | None = None) -> Bound:
    return bind(parse(HEAD + statements), FACTS, positions)


def motions(found: Bound) -> list[object]:
    legs = [step for step in found.steps if isinstance(step, BoundLeg)]
    return [motion for leg in legs for motion in leg.motions.values()]


@pytest.mark.parametrize(
    ("statement", "words"),
    [
        ("left.y to 5 um", "no axis 'left.y'"),
        ("left.gripper to 5 um", "move it by steps"),
        ("left.x to 5 deg", "in um, not in deg"),
        ("table.rotation to 5 um", "in deg, not in um"),
        ("left.x to 5501 um", "outside its limit"),
        ("table.rotation to 161 deg", "outside its limit"),
        ("steps left.gripper 30000", "29999"),
        ("steps left.gripper 10 10 V", "15 to 100 V"),
        ("steps left.gripper 10 100 V 20 kHz", "18500"),
        ("steps nobody 10", "no axis 'nobody'"),
        ("speed left.x 5 deg/s", "um/s or Hz"),
        ("speed left.x 1 m/s", "at most 27750 um/s"),
        ("speed left.gripper 5 Hz", "no sensor"),
        ("start left.x 9 mm", "outside its limit"),
        ("start left.x 5 deg", "counted in um"),
        ("relative to pose nowhere", "known poses: fibre"),
    ],
)
def test_what_does_not_fit_the_platform_is_reported_with_its_line(
    statement: str, words: str
) -> None:
    with pytest.raises(TrajectoryError) as caught:
        bound(f"{statement}\n")
    assert [(each.line, words in each.text) for each in caught.value.problems] == [(3, True)]


def test_a_trajectory_of_another_platform_is_refused() -> None:
    with pytest.raises(TrajectoryError, match="line 2: it is for the platform 'Other'"):
        bind(parse("cosmic-trajectory 1\nplatform Other\n"), FACTS)


def test_a_distance_out_of_the_limits_is_found_where_it_leads_out() -> None:
    with pytest.raises(TrajectoryError) as caught:
        bound("left.x to 5000 um\nleft.x by 300 um\nleft.x by 300 um\n")
    assert [each.line for each in caught.value.problems] == [5]


def test_distances_become_positions_where_it_is_known_where_they_begin() -> None:
    assert motions(bound("left.x by 5 um\n")) == [MoveBy(5.0, "um")]
    assert motions(bound("left.x by 5 um\nleft.x by 5 um\n", {"left.x": 100.0})) == [
        MoveTo(105.0, "um"),
        MoveTo(110.0, "um"),
    ]
    assert motions(bound("start left.x 10 um\nleft.x by 5 um\n", {"left.x": 100.0})) == [
        MoveTo(15.0, "um")
    ]


def test_steps_take_what_they_do_not_say_from_the_platform() -> None:
    assert motions(bound("steps left.gripper -7\n")) == [Step(-7, 100.0, 1000)]


def test_speeds_become_frequencies() -> None:
    steps = bound("speed left.x 300 um/s\nspeed left.x 77 Hz\nspeed left.x usual\n").steps
    assert [each.frequency_hz for each in steps if isinstance(each, BoundSpeed)] == [200, 77, None]


def test_relative_positions_count_from_the_pose() -> None:
    found = bound("relative to pose fibre\nstart left.x 5 um\nleft.x to 10 um\nleft.z by 1 um\n")
    assert found.start == {"left.x": 1005.0}
    assert motions(found) == [MoveTo(1010.0, "um"), MoveBy(1.0, "um")]


def test_an_axis_that_the_pose_does_not_hold_is_refused_and_not_taken_for_absolute() -> None:
    with pytest.raises(TrajectoryError, match=r"line 3: .*right\.x"):
        bound("relative to pose fibre\nright.x to 10 um\n")
    found = bound("relative to pose fibre: left.x\nright.x to 10 um\nleft.x to 10 um\n")
    assert motions(found) == [MoveTo(10.0, "um"), MoveTo(1010.0, "um")]


def test_a_relative_position_out_of_the_limits_is_refused() -> None:
    with pytest.raises(TrajectoryError, match=r"line 4: left\.x: 5600"):
        bound("relative to pose fibre\nleft.x to 4600 um\n")


def test_a_trajectory_is_mirrored_to_the_other_assembly() -> None:
    text = to_text(
        mirrored(
            parse(
                HEAD + "start left.x 3 um\nleft.x to 10 um # out\nsteps left.gripper 5\n"
                "table.rotation by 2 deg\nspeed left.x 10 um/s\n"
            ),
            MIRROR,
        )
    )
    assert text.splitlines()[2:] == [
        "start right.x -3 um",
        "",
        "# out",
        "right.x to -10 um",
        "steps right.gripper 5",
        "table.rotation by -2 deg",
        "speed right.x 10 um/s",
    ]
    assert to_text(mirrored(mirrored(parse(text), MIRROR), MIRROR)) == text


def test_an_axis_without_counterpart_is_not_mirrored() -> None:
    with pytest.raises(TrajectoryError, match=r"line 3: left\.z has no counterpart"):
        mirrored(parse(HEAD + "left.z to 1 um\n"), MIRROR)


@pytest.mark.parametrize(
    "table",
    [
        {"pairs": [["a", "b"], ["b", "c"]]},
        {"pairs": [["a", "b"]], "reversed": ["a"]},
        {"pairs": [["a", "b"]], "reversed": ["c"]},
    ],
)
def test_a_mirror_that_contradicts_itself_is_refused(table: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        MirrorSettings.model_validate(table)
