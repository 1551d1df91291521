"""Tools in space: manipulators at any angle, points in three frames, and why one is out of reach.

Where a tool is, is worked out a second time with scipy's rotations (`oracles.kinematics`).
"""

import math
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import cosmic
from cosmic.frame.verdict import Reason
from cosmic.mico.core.collision.model import Drive, Joint, JointKind, SceneModel, ToolFrame
from cosmic.mico.core.collision.tool_frames import (
    Travel,
    UnreachableError,
    axes_of,
    frame_pose,
    solve,
    tool_pose,
)
from oracles.kinematics import joint_values, place

WIDE = {name: Travel("um", -5000.0, 5000.0) for name in ("x", "y", "z")}


def placed(rotation: Rotation, *xyz: float) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation.as_matrix(), xyz
    return pose


def level(*xyz: float) -> np.ndarray:
    return placed(Rotation.identity(), *xyz)


def angled(turn: Rotation, *, swivel: bool = False) -> SceneModel:
    """Three stages on a base at any angle, with a tool at the end; perhaps a swivel before it."""
    slides = [np.eye(3)[number] for number in range(3)]
    fixed, slide, turns = JointKind.FIXED, JointKind.PRISMATIC, JointKind.REVOLUTE
    joints = [Joint("base", fixed, "world", "base", placed(turn, 9e3, -4e3, 2e3), slides[0])]
    parent = "base"
    for name, axis in zip("xyz", slides, strict=True):
        joints.append(Joint(name, slide, parent, name, level(100, 0, 50), axis, -9e3, 9e3))
        parent = name
    if swivel:
        joints.append(Joint("turn", turns, "z", "turn", level(0, 0, 30), slides[2], -3, 3))
        parent = "turn"
    joints.append(Joint("plate", turns, "world", "plate", level(0, 0, 10), slides[2], -3, 3))
    drives = [Drive(name, name, 1.0, 0.0) for name in "xyz"]
    drives += [Drive("table", "plate", math.pi / 180.0, 0.0)]
    drives += [Drive("swivel", "turn", math.pi / 180.0, 0.0)] if swivel else []
    frame = ToolFrame(
        "tip", parent, placed(Rotation.from_euler("y", 30, degrees=True), 700, 20, -5)
    )
    return SceneModel(
        "angled",
        ("world", *(joint.child for joint in joints)),
        tuple(joints),
        (),
        (),
        tuple(drives),
        (),
        tools=(frame,),
        plate="plate",
    )


def oracle(model: SceneModel, positions: dict[str, float]) -> np.ndarray:
    turn, origin = place(model, joint_values(model, positions))[model.tools[0].body]
    return turn @ model.tools[0].body_from_tool[:3, 3] + origin


angles = st.tuples(*[st.floats(-180, 180)] * 3)
places = st.tuples(*[st.floats(-4000, 4000)] * 3)


@given(angles, places, places)
@hypothesis_settings(max_examples=20)
def test_axes_are_found_that_bring_the_tip_to_a_point_whatever_the_angle(turn, start, there):
    model = angled(Rotation.from_euler("xyz", turn, degrees=True))
    at = dict(zip("xyz", start, strict=True)) | {"table": 0.0}
    goal = oracle(model, dict(zip("xyz", there, strict=True)))
    found = solve(model, model.tools[0], goal.tolist(), at, WIDE)
    assert set(found) == {"x", "y", "z"}
    assert oracle(model, at | found) == pytest.approx(goal, abs=0.06)


@given(angles, places, st.tuples(*[st.floats(-170, 170)] * 2))
@hypothesis_settings(max_examples=10)
def test_forward_kinematics_agree_with_a_second_derivation(turn, start, degrees):
    model = angled(Rotation.from_euler("xyz", turn, degrees=True), swivel=True)
    at = dict(zip("xyz", start, strict=True)) | dict(zip(("swivel", "table"), degrees, strict=True))
    assert tool_pose(model, model.tools[0], at)[:3, 3] == pytest.approx(oracle(model, at), abs=1e-6)


def test_a_turning_axis_is_the_last_resort_and_helps_where_a_slide_ends():
    model = angled(Rotation.identity(), swivel=True)
    at = {"x": 0.0, "y": 0.0, "z": 0.0, "swivel": 0.0}
    travels = WIDE | {"swivel": Travel("deg", -90.0, 90.0)}
    here = oracle(model, at)
    near = solve(model, model.tools[0], np.add(here, [0, 100, 0]).tolist(), at, travels)
    assert near["y"] == pytest.approx(100.0, abs=0.1)
    assert abs(near["swivel"]) < 0.1
    tight = travels | {"y": Travel("um", -50.0, 50.0)}
    turned = solve(model, model.tools[0], np.add(here, [0, 100, 0]).tolist(), at, tight)
    assert abs(turned["swivel"]) > 1.0
    assert -50.0 <= turned["y"] <= 50.0
    assert oracle(model, turned) == pytest.approx(np.add(here, [0, 100, 0]), abs=0.06)


def test_a_point_out_of_reach_says_which_axis_lacks_what():
    model = angled(Rotation.identity())
    at = {"x": 0.0, "y": 0.0, "z": 0.0}
    goal = np.add(oracle(model, at), [0.0, 0.0, 5120.0])
    with pytest.raises(UnreachableError) as caught:
        solve(model, model.tools[0], goal.tolist(), at, WIDE)
    verdict = caught.value.verdict
    assert (verdict.reason, verdict.axis) == (Reason.LIMIT, "z")
    assert (verdict.value, verdict.limit) == (pytest.approx(5120.0, abs=0.1), 5000.0)
    assert "120.0" in verdict.text
    assert "missing" in verdict.text


def test_a_direction_in_which_nothing_moves_the_tool_is_said():
    model = angled(Rotation.identity())
    at = {"x": 0.0, "y": 0.0, "z": 0.0}
    flat = {name: WIDE[name] for name in ("x", "y")}
    with pytest.raises(UnreachableError, match=r"35.* missing at the nearest point") as caught:
        goal = np.add(oracle(model, at), [10.0, 0.0, 35.0])
        solve(model, model.tools[0], goal.tolist(), at, flat)
    assert caught.value.verdict.reason is Reason.WRONG_KIND


def test_the_frame_of_the_plate_turns_with_it():
    model = angled(Rotation.identity())
    pose = frame_pose(model, model.tools[0], "plate", {"table": 90.0})
    assert (pose @ [100.0, 0.0, 0.0, 1.0])[:3] == pytest.approx([0.0, 100.0, 10.0])
    assert axes_of(model, model.tools[0]) == ("x", "y", "z")


# On the platform


@pytest.fixture(scope="module")
def rig() -> Iterator[cosmic.Rig]:
    with cosmic.connect(applications=("mico",), rate=20.0) as opened:
        opened.mico.move({"left.z": 1000.0, "right.z": 1000.0})
        yield opened


def test_the_scene_names_the_tools_and_knows_where_they_are(rig):
    assert set(rig.mico.tools) == {"left", "right", "probe"}
    right = rig.mico.tools["right"]
    assert right.axes == ("right.x", "right.y", "right.z")
    at = rig.mico.positions()
    expected = (4000.0 + at["right.x"], at["right.y"], 1500.0 + at["right.z"])
    assert right.position() == pytest.approx(expected, abs=0.01)


def test_an_unknown_tool_axis_or_position_is_named(rig):
    with pytest.raises(cosmic.UnknownToolError, match="'foo'; known tools: left"):
        rig.mico.tools["foo"]
    assert rig.mico.tools.get("foo") is None
    with pytest.raises(cosmic.UnknownAxisError, match="'foo'"):
        rig.mico.nearest({"foo": 0.0})
    for value in ("5 um", math.nan):
        with pytest.raises(cosmic.ConfigError, match=r"left\.x: a position is a finite number"):
            rig.mico.nearest({"left.x": value})


def test_a_jog_that_is_too_fast_says_how_fast_it_may_be(rig):
    with pytest.raises(cosmic.MoveRefused, match="above 0 and up to 18500 um/s, not 20000"):
        rig.mico["left.x"].jog(1, speed=20000.0)


def test_a_pose_that_was_read_does_not_change_the_one_kept(rig):
    taught = rig.mico.poses.teach("kept", ["left.x"])
    where = dict(taught.positions)
    taught.positions["left.x"] = 1234.0
    rig.mico.poses["kept"].positions["left.x"] = 1234.0
    assert rig.mico.poses["kept"].positions == where
    rig.mico.poses.remove("kept")


def test_a_tool_that_looks_the_other_way_moves_forward_in_its_own_frame(rig):
    right = rig.mico.tools["right"]
    before = right.position()
    right.move_by((-40.0, 0.0, 0.0))
    after = right.position()
    assert np.subtract(after, before) == pytest.approx([40.0, 0.0, 0.0], abs=1.0)
    right.move_to(before)
    assert right.position() == pytest.approx(before, abs=1.0)


def test_a_point_on_the_plate_is_the_same_point_of_the_sample_however_it_is_turned(rig):
    left = rig.mico.tools["left"]
    rig.mico["table.rotation"].move_to(10.0)
    x, y, z = left.position("world")
    turned = left.position("plate")
    angle = math.radians(-10.0)
    assert turned[0] == pytest.approx(x * math.cos(angle) - y * math.sin(angle), abs=2.0)
    assert turned[2] == pytest.approx(z, abs=0.1)
    left.move_to((turned[0] - 20.0, turned[1], turned[2]), "plate")
    assert left.position("plate") == pytest.approx((turned[0] - 20.0, *turned[1:]), abs=1.0)


def test_a_point_out_of_reach_is_refused_and_nothing_moves(rig):
    left = rig.mico.tools["left"]
    before = rig.mico.positions()
    with pytest.raises(cosmic.LimitError, match=r"left\.x would have to be at"):
        left.move_to((-90_000.0, 0.0, 3000.0))
    with pytest.raises(cosmic.MoveRefused):
        left.move_by((math.nan, 0.0, 0.0))
    probe = rig.mico.tools["probe"]
    with pytest.raises(cosmic.MoveRefused, match="do not move it in that direction"):
        probe.move_by((0.0, 0.0, 50.0))
    assert rig.mico.positions() == pytest.approx(before, abs=0.5)


def test_the_gate_has_the_last_word(rig):
    left = rig.mico.tools["left"]
    x, y, _ = left.position()
    assert left.check((x, y, -200.0)).reason in (Reason.COLLISION, Reason.LIMIT)
    rig.stop("a test")
    assert left.check((x, y, 2500.0)).reason is Reason.STOPPED
    with pytest.raises(cosmic.StoppedError):
        left.move_by((5.0, 0.0, 0.0))
    rig.reset_stop()


def test_an_unknown_tool_or_frame_is_named_with_those_that_there_are(rig):
    with pytest.raises(KeyError, match="left"):
        rig.mico.tools["third"]
    with pytest.raises(cosmic.CosmicError, match="world"):
        rig.mico.tools["left"].position("moon")
