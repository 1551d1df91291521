"""The twin's own reading of the URDF."""

import math
from pathlib import Path

import numpy as np
import pytest

from cosmic.frame.errors import ConfigError
from cosmic.twin.kinematics import Drive, Skeleton

ROBOT = """
<robot name="small">
  <link name="base"/><link name="slide"/><link name="turn"/><link name="tip"/>
  <joint name="slide" type="prismatic">
    <parent link="base"/><child link="slide"/>
    <origin xyz="0.001 0 0" rpy="0 0 1.5707963267948966"/><axis xyz="2 0 0"/>
  </joint>
  <joint name="turn" type="revolute">
    <parent link="slide"/><child link="turn"/><axis xyz="0 0 1"/>
  </joint>
  <joint name="tip" type="fixed">
    <parent link="slide"/><child link="tip"/><origin xyz="0 0 0.0005" rpy="0.3 -0.4 2.0"/>
  </joint>
</robot>
"""
DRIVES = {"slide": Drive("x", 0.5), "turn": Drive("phi")}


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    path = tmp_path / "robot.urdf"
    path.write_text(ROBOT, encoding="utf-8")
    return path


def changed(path: Path, old: str, new: str) -> Path:
    assert old in ROBOT
    path.write_text(ROBOT.replace(old, new), encoding="utf-8")
    return path


def test_a_joint_carries_its_child_along_its_axis_in_its_own_frame(robot: Path) -> None:
    pose = Skeleton(robot, DRIVES).pose("slide", {"x": 100.0})
    assert pose[:3, 3] == pytest.approx([1000.0, 50.0, 0.0])
    assert pose[:3, 0] == pytest.approx([0.0, 1.0, 0.0])


def test_a_stage_in_degrees_turns_a_revolute_joint(robot: Path) -> None:
    pose = Skeleton(robot, DRIVES).pose("turn", {"x": 0.0, "phi": 30.0})
    angle = math.radians(120.0)
    assert pose[:3, 0] == pytest.approx([math.cos(angle), math.sin(angle), 0.0])


def test_roll_pitch_and_yaw_are_about_fixed_axes(robot: Path) -> None:
    pose = Skeleton(robot, DRIVES).pose("tip", {"x": 0.0})
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    cr, sr, cp, sp = math.cos(0.3), math.sin(0.3), math.cos(-0.4), math.sin(-0.4)
    cy, sy = math.cos(2.0), math.sin(2.0)
    expected = quarter @ [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    assert pose[:3, :3] == pytest.approx(expected)


def test_a_tool_that_slides_is_a_point_and_a_vector_for_each_stage(robot: Path) -> None:
    skeleton = Skeleton(robot, DRIVES)
    slide = skeleton.slide("tip", (1.0, 2.0, 3.0))
    for x in (-77.0, 0.0, 1234.5):
        pose = skeleton.pose("tip", {"x": x})
        expected = (pose @ [1.0, 2.0, 3.0, 1.0])[:3]
        assert slide.at({"x": x}) == pytest.approx(expected, abs=1e-9)
    with pytest.raises(ConfigError, match="joint turn turns turn"):
        skeleton.slide("turn")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("</robot>", "", "not valid XML"),
        ('type="revolute"', 'type="floating"', "joint turn: the twin knows no floating"),
        ('type="prismatic"', 'type="fixed"', "joint slide is fixed"),
        ('name="turn" type', 'name="other" type', "no joint 'turn'"),
        ('xyz="2 0 0"', 'xyz="2 0"', "not written as URDF"),
        ('xyz="2 0 0"', 'xyz="0 0 0"', "joint slide: its axis has no direction"),
        ('<parent link="slide"/><child link="tip"/>', '<child link="tip"/>', "no parent"),
        ('<parent link="base"/>', '<parent link="tip"/>', "form a ring"),
        ('<child link="tip"/>', '<child link="top"/>', "no link 'tip'"),
    ],
)
def test_a_wrong_file_is_reported_with_what_is_wrong(
    robot: Path, old: str, new: str, words: str
) -> None:
    with pytest.raises(ConfigError, match=words):
        Skeleton(changed(robot, old, new), DRIVES).slide("tip")


def test_a_missing_file_is_reported(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"gone\.urdf"):
        Skeleton(tmp_path / "gone.urdf", {})
