"""The platform that ships: where it is free by design, and where it is not."""

import hashlib
import importlib.util
import itertools
import sys
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from cosmic.frame.config import shipped_config_dir
from cosmic.mico.core.collision.kinematics import body_poses
from cosmic.mico.core.collision.model import BodyPair, Floats, SceneModel
from cosmic.mico.core.collision.scene_loader import find_scene_mistakes, load_scene
from cosmic.mico.core.collision.scene_solid import (
    overlapping_pairs,
    placed_corners,
    solid_gap_um,
)

SCENES = shipped_config_dir() / "scenes"
FILE = SCENES / "fiberstation.toml"
TOOL = Path(__file__).resolve().parents[3] / "tools" / "make_scene.py"

Spans = Mapping[str, tuple[float, float]]
REGION: Spans = {
    "left.x": (-3000.0, 3000.0),
    "left.y": (-3000.0, 3000.0),
    "left.z": (-1000.0, 6000.0),
    "left.gripper": (0.0, 1000.0),
    "right.x": (-3000.0, 3000.0),
    "right.y": (-3000.0, 3000.0),
    "right.z": (-1000.0, 6000.0),
    "right.gripper": (0.0, 1000.0),
    "probe.x": (-3000.0, 3000.0),
    "probe.y": (-1000.0, 3000.0),
    "table.rotation": (-170.0, 170.0),
}
GRIPPERS: Spans = {"left.gripper": (0.0, 1000.0), "right.gripper": (0.0, 1000.0)}


@cache
def scene() -> SceneModel:
    return load_scene(FILE)


def axes_of(body: str) -> set[str]:
    """The axes that carry a body."""
    carried: dict[str, set[str]] = {scene().bodies[0]: set()}
    drives = {drive.joint: drive.axis for drive in scene().drives}
    for joint in scene().joints:
        own = {drives[joint.name]} if joint.name in drives else set()
        carried[joint.child] = carried[joint.parent] | own
    return carried[body]


def swept(body: str, spans: Spans, axes: set[str]) -> list[Floats]:
    """The corners of each piece of a body at the ends of all spans, of the table all around."""
    steps = {
        axis: np.linspace(*spans[axis], 137 if axis == "table.rotation" else 2)
        for axis in sorted(axes)
        if axis in spans
    }
    poses = [
        body_poses(scene(), scene().joint_values(dict(zip(steps, place, strict=True))))
        for place in itertools.product(*steps.values())
    ]
    number = scene().body_number[body]
    return [
        np.vstack([p.vertices_um @ pose[number][:3, :3].T + pose[number][:3, 3] for pose in poses])
        for p in scene().pieces
        if p.body == body
    ]


def pairs_that_can_meet(spans: Spans, within_um: float) -> set[BodyPair]:
    """The watched pairs whose swept volumes come closer than `within_um`, none left out.

    Axes that are not named stand at 0. The volumes are hulls: larger than what is swept, but for
    the 2 um by which the table's corners bulge between two of its angles.
    """
    found = set()
    for watched in scene().pairs:
        one, other = watched.bodies
        common = axes_of(one) & axes_of(other)
        ones = swept(one, spans, axes_of(one) - common)
        others = swept(other, spans, axes_of(other) - common)
        for first, second in itertools.product(ones, others):
            apart = np.maximum(
                first.min(axis=0) - second.max(axis=0), second.min(axis=0) - first.max(axis=0)
            ).max()
            if apart <= within_um and solid_gap_um(first, second) <= within_um:
                found.add(watched.bodies)
                break
    return found


def test_it_has_neither_mistakes_nor_warnings() -> None:
    assert find_scene_mistakes(FILE) == ([], [])


def test_it_has_the_axes_of_the_platform_with_their_hard_stops() -> None:
    axes = {axis: scene().travel(axis) for axis in scene().axes}
    turn = axes.pop("table.rotation")
    assert turn == pytest.approx((-170.0, 170.0))
    assert turn[0] <= -170.0
    assert turn[1] >= 170.0
    grippers = {axes.pop(f"{side}.gripper") for side in ("left", "right")}
    assert grippers == {(0.0, 1000.0)}
    stages = [f"{side}.{way}" for side in ("left", "right") for way in "xyz"]
    assert axes == dict.fromkeys([*stages, "probe.x", "probe.y"], (-6000.0, 6000.0))


def corners(body: str, positions: Mapping[str, float]) -> Floats:
    placed = placed_corners(scene(), dict(positions))
    return np.vstack(
        [each for each, piece in zip(placed, scene().pieces, strict=True) if piece.body == body]
    )


@pytest.mark.parametrize("axis", [a for a in REGION if a[-2:] in (".x", ".y", ".z")])
def test_an_axis_moves_its_tip_along_the_world(axis: str) -> None:
    side, _, way = axis.partition(".")
    tip = "probe_tip" if side == "probe" else f"{side}_jaw_a"
    moved = corners(tip, {axis: 1000.0}) - corners(tip, {})
    wanted = np.zeros(3)
    wanted["xyz".index(way)] = 1000.0
    assert moved == pytest.approx(np.broadcast_to(wanted, moved.shape), abs=1e-6)


@pytest.mark.parametrize(("side", "tip_um"), [("left", -4000.0), ("right", 4000.0)])
def test_the_jaws_stand_where_they_are_meant_to(side: str, tip_um: float) -> None:
    closed_a, closed_b = corners(f"{side}_jaw_a", {}), corners(f"{side}_jaw_b", {})
    inward = np.sign(-tip_um)
    for finger in (closed_a, closed_b):
        assert (finger[:, 0] * inward).max() == pytest.approx(tip_um * inward, abs=0.01)
        assert np.ptp(finger[:, 0]) == pytest.approx(6000.0, abs=0.01)
        assert finger[:, 2].min() == pytest.approx(1500.0, abs=0.01)
        assert np.ptp(finger[:, 1]) == pytest.approx(100.0, abs=0.01)
    assert closed_a[:, 1].min() == pytest.approx(0.0, abs=0.01)
    assert closed_b[:, 1].max() == pytest.approx(0.0, abs=0.01)
    opened = {f"{side}.gripper": 800.0}
    assert corners(f"{side}_jaw_a", opened)[:, 1].min() == pytest.approx(400.0, abs=0.01)
    assert corners(f"{side}_jaw_b", opened)[:, 1].max() == pytest.approx(-400.0, abs=0.01)


def test_the_probe_points_at_the_operator_at_the_height_of_its_shaft() -> None:
    shaft = corners("probe_tip", {})
    assert shaft.min(axis=0) == pytest.approx([-25.0, 5000.0, 675.0])
    assert shaft.max(axis=0) == pytest.approx([25.0, 8000.0, 725.0])


def test_the_table_turns_the_plate_about_the_origin() -> None:
    plate = corners("plate", {"table.rotation": 45.0})
    assert plate[:, :2].max() == pytest.approx(12000.0 * np.sqrt(2.0))
    assert corners("plate", {})[:, 2].max() == pytest.approx(0.0)


def test_the_clip_turns_with_the_plate_and_stands_up_from_it() -> None:
    clip = corners("plate_clip", {"table.rotation": 90.0})
    assert clip.min(axis=0) == pytest.approx([-4000.0, 10_000.0, 0.0])
    assert clip.max(axis=0) == pytest.approx([4000.0, 12_000.0, 200.0])


def test_the_region_of_work_is_free_for_every_pair() -> None:
    assert pairs_that_can_meet(REGION, within_um=100.0) == set()


@pytest.mark.parametrize("axis", ["left.x", "left.y", "right.x", "right.y"])
def test_one_axis_is_free_over_its_travel_with_the_others_at_0(axis: str) -> None:
    assert pairs_that_can_meet({**GRIPPERS, axis: (-6000.0, 6000.0)}, within_um=100.0) == set()


def test_raised_arms_travel_freely_above_probe_and_table() -> None:
    spans = {axis: scene().travel(axis) for axis in scene().axes}
    spans |= {"left.z": (6000.0, 6000.0), "right.z": (6000.0, 6000.0)}
    spans |= {"left.x": (-6000.0, 3000.0), "right.x": (-3000.0, 6000.0)}
    assert pairs_that_can_meet(spans, within_um=100.0) == set()


def test_the_height_of_a_detour_is_clear_of_probe_and_table() -> None:
    spans = {axis: scene().travel(axis) for axis in scene().axes}
    for axis, height_um in scene().detour_height.items():
        spans[axis] = (height_um, height_um)
    for pair in pairs_that_can_meet(spans, within_um=100.0):
        assert {name.partition("_")[0] for name in pair} == {"left", "right"}


@pytest.mark.parametrize("place", [{"left.x": 5000.0}, {"right.x": -5000.0}])
def test_one_arm_may_come_far_over_while_the_other_stays(place: dict[str, float]) -> None:
    assert overlapping_pairs(scene(), place) == []


def test_both_arms_collide_when_both_come_far_over() -> None:
    met = overlapping_pairs(scene(), {"left.x": 6000.0, "right.x": -6000.0})
    assert ("left_jaw_a", "right_jaw_a") in met


def test_the_jaws_meet_the_plate_when_lowered() -> None:
    assert overlapping_pairs(scene(), {"left.z": -1400.0}) == []
    assert ("left_jaw_a", "plate") in overlapping_pairs(scene(), {"left.z": -1600.0})


def test_over_all_travel_only_the_dangers_that_are_meant_can_meet() -> None:
    hands = [
        f"{side}_{part}"
        for side in ("left", "right")
        for part in ("jaw_a", "jaw_b", "gripper", "arm")
    ]
    dangers = {"plate", "plate_clip", "table", "probe_chip", "probe_tip"}
    for one, other in pairs_that_can_meet({a: scene().travel(a) for a in scene().axes}, 5.0):
        hand, thing = (one, other) if one in hands else (other, one)
        assert hand in hands, (one, other)
        opposite = thing in hands and thing.partition("_")[0] != hand.partition("_")[0]
        assert opposite or thing in dangers, (one, other)


def test_only_arms_reach_over_the_plate() -> None:
    for side, sign in (("left", -1.0), ("right", 1.0)):
        for part in ("base", "x_carriage", "y_carriage", "z_carriage"):
            body = f"{side}_{part}"
            spans = {axis: scene().travel(axis) for axis in axes_of(body)}
            assert (np.vstack(swept(body, spans, axes_of(body)))[:, 0] * sign).min() > 26000.0
    near = [corners(name, {})[:, 1].min() for name in ("probe_y_carriage", "probe_x_carriage")]
    assert min(near) > 26000.0


def test_open_loop_grippers_may_be_anywhere_and_stages_overshoot() -> None:
    for drive in scene().drives:
        assert drive.uncertainty == float("inf")
        wanted = {"gripper": 0.0, "rotation": 0.01}.get(drive.axis.partition(".")[2], 1.0)
        assert drive.overshoot == wanted


def test_intended_contacts_are_of_jaws_with_plate_and_probe() -> None:
    contacts = {contact.name: set(contact.pairs) for contact in scene().contacts}
    jaws = [f"{side}_jaw_{letter}" for side in ("left", "right") for letter in "ab"]
    assert contacts == {
        "grasp": {(jaw, "plate") for jaw in jaws if jaw < "plate"}
        | {("plate", jaw) for jaw in jaws if jaw > "plate"},
        "touch": {(jaw, "probe_tip") for jaw in jaws if jaw < "probe"}
        | {("probe_tip", jaw) for jaw in jaws if jaw > "probe"},
    }


def test_it_can_be_drawn_quickly() -> None:
    assert sum(len(view.faces) for view in scene().views) < 30000
    assert {view.body for view in scene().views} == set(scene().bodies)


def test_nothing_is_drawn_that_is_not_guarded() -> None:
    for view in scene().views:
        out = np.full(len(view.vertices_um), np.inf)
        for piece in scene().pieces:
            if piece.body == view.body:
                triangles = piece.vertices_um[piece.faces]
                normals = np.cross(
                    triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
                )
                normals /= np.linalg.norm(normals, axis=1, keepdims=True)
                planes = np.einsum("ij,ij->i", normals, triangles[:, 0])
                out = np.minimum(out, (view.vertices_um @ normals.T - planes).max(axis=1))
        assert out.max() <= 50.0, f"{view.body}: {out.max()} um"


def test_the_files_are_what_the_script_makes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    spec = importlib.util.spec_from_file_location("make_scene", TOOL)
    assert spec is not None
    assert spec.loader is not None
    tool = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "make_scene", tool)
    spec.loader.exec_module(tool)
    monkeypatch.setattr(tool, "SCENES", tmp_path)
    tool.make_scene()
    for made in sorted(path for path in tmp_path.rglob("*") if path.is_file()):
        shipped = SCENES / made.relative_to(tmp_path)
        digests = [hashlib.sha256(path.read_bytes()).hexdigest() for path in (made, shipped)]
        assert digests[0] == digests[1], f"{shipped} differs from what the script makes"
