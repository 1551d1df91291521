"""What a scene looks like after it was read from its files."""

import hashlib
import math
from pathlib import Path

import numpy as np
import pytest
import trimesh

from cosmic.frame.errors import ConfigError
from cosmic.mico.core.collision.kinematics import body_poses
from cosmic.mico.core.collision.model import JointKind
from cosmic.mico.core.collision.scene_loader import find_scene_mistakes, load_scene
from unit.mico.scene_writer import (
    MESH,
    SLIDER_BOX,
    SLIDER_MESH,
    block,
    write_part,
    write_scene,
)


def test_lengths_become_micrometres_and_axes_unit_vectors(tmp_path: Path) -> None:
    scene = load_scene(write_scene(tmp_path))
    assert scene.bodies == ("base", "slider", "table")
    slide, turn = scene.joints
    assert slide.kind is JointKind.PRISMATIC
    assert turn.kind is JointKind.REVOLUTE
    assert (slide.low, slide.high) == (-6000.0, 6000.0)
    assert (turn.low, turn.high) == (-1.5, 1.5)
    assert slide.axis.tolist() == [0.0, 0.0, 1.0]
    slider = scene.pieces[1]
    assert slider.vertices_um.min(axis=0).tolist() == [-2000.0, -1000.0, 1500.0]
    assert slider.vertices_um.max(axis=0).tolist() == [2000.0, 1000.0, 2500.0]


def test_every_pair_that_can_move_is_watched_but_those_of_the_srdf(tmp_path: Path) -> None:
    scene = load_scene(write_scene(tmp_path))
    assert {pair.bodies for pair in scene.pairs} == {("base", "slider"), ("slider", "table")}
    assert {pair.margin_um for pair in scene.pairs} == {5.0}
    (allowed,) = scene.allowed
    assert (allowed.bodies, allowed.reason) == (("base", "table"), "Adjacent")


def test_bodies_fixed_to_each_other_are_no_pair(tmp_path: Path) -> None:
    fixed = {
        'name="slide" type="prismatic"': 'name="slide" type="fixed"',
        '<axis xyz="0 0 2"/>': "",
    }
    toml = {'[[drive]]\naxis = "lift"\njoint = "slide"\n': ""}
    scene = load_scene(write_scene(tmp_path, urdf=fixed, toml=toml))
    assert {pair.bodies for pair in scene.pairs} == {("slider", "table")}


def test_a_drive_of_a_joint_that_turns_is_in_degrees(tmp_path: Path) -> None:
    more = "factor = -2.0\noffset_deg = 10.0\novershoot_deg = 0.5\nuncertainty_deg = 3.0\n"
    drive = load_scene(write_scene(tmp_path, more=more)).drives[1]
    assert drive.factor == pytest.approx(math.radians(-2.0))
    assert drive.offset == pytest.approx(math.radians(10.0))
    assert (drive.overshoot, drive.uncertainty) == (0.5, 3.0)


def test_a_drive_may_be_anywhere_in_its_travel_unless_given(tmp_path: Path) -> None:
    lift = load_scene(write_scene(tmp_path)).drives[0]
    assert (lift.factor, lift.offset, lift.overshoot) == (1.0, 0.0, 0.0)
    assert lift.uncertainty == math.inf


def test_a_cylinder_becomes_a_prism_around_it(tmp_path: Path) -> None:
    table = load_scene(write_scene(tmp_path)).pieces[2]
    across = table.vertices_um[:, :2] - (15000.0, 0.0)
    corners = across[table.faces]
    for angle in np.linspace(0.0, 2.0 * math.pi, 97):
        way = np.array([math.cos(angle), math.sin(angle)])
        assert (corners @ way).max() >= 3000.0 - 1e-6
    assert np.linalg.norm(across, axis=1).max() < 3000.0 * 1.01
    assert np.ptp(table.vertices_um[:, 2]) == pytest.approx(2000.0)


def test_a_sphere_becomes_a_polyhedron_around_it(tmp_path: Path) -> None:
    ball = {'<cylinder radius="0.003" length="0.002"/>': '<sphere radius="0.001"/>'}
    table = load_scene(write_scene(tmp_path, urdf=ball)).pieces[2]
    mesh = trimesh.Trimesh(table.vertices_um - (15000.0, 0.0, 0.0), table.faces)
    inside = np.einsum("ij,ij->i", mesh.face_normals, mesh.triangles_center)
    assert inside.min() >= 1000.0 - 1e-6
    assert np.linalg.norm(mesh.vertices, axis=1).max() < 1040.0


@pytest.mark.parametrize("name", ["part.stl", "part.obj"])
def test_a_mesh_is_read_with_its_scale(tmp_path: Path, name: str) -> None:
    write_part(tmp_path, block(3.0, 2.0, 1.0), name)
    urdf = {SLIDER_BOX: SLIDER_MESH.replace("part.stl", name)}
    slider = load_scene(write_scene(tmp_path, urdf=urdf)).pieces[1]
    assert len(slider.vertices_um) == 8
    assert np.ptp(slider.vertices_um, axis=0) == pytest.approx([3000.0, 2000.0, 1000.0], abs=0.01)


def test_a_link_keeps_its_shapes_apart_as_several_pieces(tmp_path: Path) -> None:
    second = '<collision name="fin"><origin xyz="0 0 0.004" rpy="0 0 1.5707963267948966"/>'
    second += '<geometry><box size="0.004 0.002 0.001"/></geometry></collision></link>'
    urdf = {"</visual>\n  </link>": f"</visual>{second}"}
    scene = load_scene(write_scene(tmp_path, urdf=urdf))
    pieces = [piece for piece in scene.pieces if piece.body == "slider"]
    assert [piece.name for piece in pieces] == ["slider 1", "fin"]
    # A quarter turn leaves the box aligned to the last bit.
    assert np.ptp(pieces[1].vertices_um, axis=0).tolist() == [2000.0, 4000.0, 1000.0]


def test_views_have_the_colour_of_their_material(tmp_path: Path) -> None:
    views = {view.body: view for view in load_scene(write_scene(tmp_path)).views}
    assert views["slider"].colour == (1.0, 0.0, 0.0, 0.5)


def test_what_has_no_visual_shape_is_drawn_by_its_pieces(tmp_path: Path) -> None:
    scene = load_scene(write_scene(tmp_path))
    assert {view.body for view in scene.views} == {"base", "slider", "table"}


def test_margins_contacts_park_and_detour_are_taken_over(tmp_path: Path) -> None:
    more = """
[[margin]]
bodies = ["table", "slider"]
margin_um = 50.0
[[contact]]
operation = "press"
pairs = [["table", "slider"]]
reason = "it is pressed on"
[park]
lift = 5000.0
[detour]
lift = 4000.0
"""
    scene = load_scene(write_scene(tmp_path, more=more))
    margins = {pair.bodies: pair.margin_um for pair in scene.pairs}
    assert margins == {("base", "slider"): 5.0, ("slider", "table"): 50.0}
    (contact,) = scene.contacts
    assert (contact.name, contact.pairs) == ("press", (("slider", "table"),))
    assert contact.reason == "it is pressed on"
    assert scene.park == {"lift": 5000.0}
    assert scene.detour_height == {"lift": 4000.0}


def test_another_body_replaces_a_link(tmp_path: Path) -> None:
    folder = tmp_path / "bodies"
    folder.mkdir()
    write_part(folder, block(1.0, 1.0, 1.0))
    shape = f"<geometry>{MESH}</geometry>"
    (folder / "tool.urdf").write_text(
        f'<robot name="tool"><link name="tool"><collision>{shape}</collision></link></robot>'
    )
    path = write_scene(tmp_path, more='[exchange]\nslider = "bodies/tool.urdf"\n')
    scene = load_scene(path)
    assert scene.bodies == ("base", "slider", "table")
    for shapes in (scene.pieces, scene.views):
        (tool,) = (shape for shape in shapes if shape.body == "slider")
        assert np.ptp(tool.vertices_um, axis=0) == pytest.approx([1000.0] * 3, abs=0.01)


def test_a_file_with_the_hash_that_is_written_down_is_taken(tmp_path: Path) -> None:
    write_part(tmp_path, block())
    digest = hashlib.sha256((tmp_path / "part.stl").read_bytes()).hexdigest()
    path = write_scene(
        tmp_path,
        urdf={SLIDER_BOX: SLIDER_MESH},
        more=f'[sha256]\n"part.stl" = "{digest}"\n',
    )
    assert find_scene_mistakes(path) == ([], [])


def test_a_file_that_was_changed_is_refused(tmp_path: Path) -> None:
    path = write_scene(tmp_path, more=f'[sha256]\n"small.srdf" = "{"0" * 64}"\n')
    with pytest.raises(ConfigError, match=r"small\.srdf: its content has changed"):
        load_scene(path)


def test_a_mesh_only_to_be_drawn_may_be_concave_and_open(tmp_path: Path) -> None:
    write_part(tmp_path, trimesh.creation.annulus(r_min=1.0, r_max=2.0, height=1.0))
    urdf = {
        '<visual><geometry><box size="0.004 0.002 0.001"/>': f"<visual><geometry>{MESH}",
    }
    assert find_scene_mistakes(write_scene(tmp_path, urdf=urdf)) == ([], [])


def test_the_shapes_of_a_scene_cannot_be_changed(tmp_path: Path) -> None:
    piece = load_scene(write_scene(tmp_path)).pieces[0]
    with pytest.raises(ValueError, match="read-only"):
        piece.vertices_um[0, 0] = 1.0


def test_a_mesh_may_be_scaled_differently_along_its_axes(tmp_path: Path) -> None:
    write_part(tmp_path, block(1.0, 1.0, 1.0))
    urdf = {SLIDER_BOX: SLIDER_MESH.replace("0.001 0.001 0.001", "0.004 0.002 0.001")}
    slider = load_scene(write_scene(tmp_path, urdf=urdf)).pieces[1]
    assert np.ptp(slider.vertices_um, axis=0) == pytest.approx([4000.0, 2000.0, 1000.0], abs=0.01)


def test_a_shape_is_turned_counter_clockwise_about_its_own_place(tmp_path: Path) -> None:
    urdf = {'<origin xyz="0 0 0.002"/>': '<origin xyz="0 0 0.002" rpy="0 0 0.5235987755982988"/>'}
    slider = load_scene(write_scene(tmp_path, urdf=urdf)).pieces[1]
    cosine, sine = math.cos(math.radians(30.0)), 0.5
    corner = (2000.0 * cosine - 1000.0 * sine, 2000.0 * sine + 1000.0 * cosine, 2500.0)
    assert np.abs(slider.vertices_um - corner).max(axis=1).min() < 1e-6


def test_a_joint_moves_along_its_axis_in_the_frame_of_the_child(tmp_path: Path) -> None:
    joint = '<child link="slider"/>'
    urdf = {
        joint: f'{joint}<origin xyz="0 0 0.001" rpy="0 0 0.5235987755982988"/>',
        'xyz="0 0 2"': 'xyz="1 0 0"',
    }
    scene = load_scene(write_scene(tmp_path, urdf=urdf))
    pose = body_poses(scene, scene.joint_values({"lift": 1000.0}))[scene.body_number["slider"]]
    assert pose[:3, 3] == pytest.approx([1000.0 * math.cos(math.radians(30.0)), 500.0, 1000.0])
