"""Meshes that are no convex closed bodies are refused, and so are files that are no meshes."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from cosmic.mico.core.collision.scene_loader import find_scene_mistakes
from cosmic.mico.core.collision.scene_meshes import box_mesh, mesh_faults, parse_mesh, volume_um3
from unit.mico.scene_writer import (
    SLIDER_BOX,
    SLIDER_MESH,
    block,
    mistakes,
    write_part,
    write_scene,
)


def with_part(folder: Path, part: trimesh.Trimesh) -> Path:
    write_part(folder, part)
    return write_scene(folder, urdf={SLIDER_BOX: SLIDER_MESH})


def concave() -> trimesh.Trimesh:
    return trimesh.creation.annulus(r_min=1.0, r_max=2.0, height=1.0)


def dented() -> trimesh.Trimesh:
    """A fine box with one corner of its top pressed in by 1 um."""
    part = block().subdivide()
    middle = np.argmin(np.linalg.norm(part.vertices - (0.0, 0.0, 0.5), axis=1))
    vertices = part.vertices.copy()
    vertices[middle, 2] -= 0.001
    return trimesh.Trimesh(vertices, part.faces, process=False)


def without_faces(part: trimesh.Trimesh, count: int) -> trimesh.Trimesh:
    return trimesh.Trimesh(part.vertices, part.faces[count:], process=False)


def flat() -> trimesh.Trimesh:
    part = block()
    return trimesh.Trimesh(part.vertices * (1.0, 1.0, 0.0), part.faces, process=False)


def with_a_line_for_a_face() -> trimesh.Trimesh:
    part = block()
    return trimesh.Trimesh(part.vertices, [*part.faces, [0, 1, 1]], process=False)


def doubled() -> trimesh.Trimesh:
    return trimesh.util.concatenate([block(), block()])


def in_two_parts() -> trimesh.Trimesh:
    return trimesh.util.concatenate([block(), block().apply_translation((6.0, 0.0, 0.0))])


def hollow() -> trimesh.Trimesh:
    inner = block(1.0, 1.0, 0.5)
    inner.invert()
    return trimesh.util.concatenate([block(), inner])


def inside_out() -> trimesh.Trimesh:
    part = block()
    part.invert()
    return part


def one_face_turned() -> trimesh.Trimesh:
    part = block()
    faces = part.faces.copy()
    faces[0] = faces[0][::-1]
    return trimesh.Trimesh(part.vertices, faces, process=False)


def with_nan() -> trimesh.Trimesh:
    part = block()
    vertices = part.vertices.copy()
    vertices[3, 1] = np.nan
    return trimesh.Trimesh(vertices, part.faces, process=False)


def far_away() -> trimesh.Trimesh:
    part = block()
    return trimesh.Trimesh(part.vertices + 1e38, part.faces, process=False)


PARTS = {
    "concave": (concave, "not convex.*cosmic scene decompose"),
    "dented by a micrometre": (dented, "not convex, by [0-9.]+ um"),
    "in two parts": (in_two_parts, "not convex"),
    "hollow": (hollow, "not convex"),
    "open": (lambda: without_faces(block(), 1), "open: 3 edges"),
    "inside out": (inside_out, "inside out"),
    "with a face turned": (one_face_turned, "face both directions"),
    "doubled": (doubled, "twice"),
    "flat": (flat, "no area|no volume|twice"),
    "with a face that is a line": (with_a_line_for_a_face, "no area"),
    "beyond all sense": (far_away, "a coordinate is above 1e.09"),
    "with a vertex that is nan": (with_nan, "not finite"),
}


@pytest.mark.parametrize("name", PARTS)
def test_a_mesh_is_refused_that_is(tmp_path: Path, name: str) -> None:
    make, wanted = PARTS[name]
    text = mistakes(with_part(tmp_path, make()))
    assert re.search(wanted, text), text
    assert "link 'slider' collision 1" in text
    assert "part.stl" in text


def test_a_fine_ball_as_a_mesh_is_convex_in_spite_of_rounding(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(subdivisions=3, radius=2.0)
    assert find_scene_mistakes(with_part(tmp_path, ball)) == ([], [])


def test_a_missing_mesh_is_refused(tmp_path: Path) -> None:
    text = mistakes(write_scene(tmp_path, urdf={SLIDER_BOX: SLIDER_MESH}))
    assert re.search("link 'slider'.*part.stl: there is no such file", text)


@pytest.mark.parametrize("scale", ["-0.001 0.001 0.001", "0 0.001 0.001", "0.001 nan 1"])
def test_a_mesh_with_a_scale_that_is_not_positive_is_refused(tmp_path: Path, scale: str) -> None:
    write_part(tmp_path, block())
    urdf = {SLIDER_BOX: SLIDER_MESH.replace("0.001 0.001 0.001", scale)}
    assert "scale" in mistakes(write_scene(tmp_path, urdf=urdf))


def test_a_mesh_of_a_gigabyte_is_refused_unread(tmp_path: Path) -> None:
    with (tmp_path / "part.stl").open("wb") as file:
        file.truncate(1 << 30)
    text = mistakes(write_scene(tmp_path, urdf={SLIDER_BOX: SLIDER_MESH}))
    assert re.search("part.stl: 1073741824 bytes are too many", text)


def test_a_urdf_of_a_gigabyte_is_refused_unread(tmp_path: Path) -> None:
    path = write_scene(tmp_path)
    with (tmp_path / "small.urdf").open("r+b") as file:
        file.truncate(1 << 30)
    assert "small.urdf: 1073741824 bytes are too many" in mistakes(path)


def test_a_mesh_of_too_many_triangles_is_refused(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(subdivisions=3, radius=2.0)
    write_part(tmp_path, ball)
    path = write_scene(
        tmp_path, urdf={SLIDER_BOX: SLIDER_MESH}, more="[limits]\npiece_faces = 500\n"
    )
    assert "1280 triangles, at most 500" in mistakes(path)


@pytest.mark.parametrize("content", [b"", b"solid nothing\nendsolid\n", b"\0" * 84, b"\xff" * 400])
def test_a_file_that_is_no_mesh_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "part.stl").write_bytes(content)
    text = mistakes(write_scene(tmp_path, urdf={SLIDER_BOX: SLIDER_MESH}))
    assert re.search("link 'slider'.*part.stl", text)


@pytest.mark.parametrize("name", ["part.dae", "http://example.org/part.stl", "part"])
def test_a_mesh_in_another_format_or_of_another_folder_is_refused(
    tmp_path: Path, name: str
) -> None:
    urdf = {SLIDER_BOX: SLIDER_MESH.replace("part.stl", name)}
    assert "name an .stl or .obj file" in mistakes(write_scene(tmp_path, urdf=urdf))


def test_a_folder_instead_of_a_mesh_is_refused(tmp_path: Path) -> None:
    (tmp_path / "part.stl").mkdir()
    assert "is not a file" in mistakes(write_scene(tmp_path, urdf={SLIDER_BOX: SLIDER_MESH}))


def volume_and_corners(vertices: Any, faces: Any) -> tuple[float, int, set[tuple[float, ...]]]:
    whole = trimesh.Trimesh(vertices, faces, process=False)
    return float(whole.volume), len(faces), {tuple(each) for each in np.round(vertices, 6)}


def test_a_binary_stl_is_read_as_the_mesh_library_reads_it() -> None:
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.7)
    vertices, faces = parse_mesh(trimesh.exchange.stl.export_stl(ball), ".stl")
    read, wanted = (
        volume_and_corners(vertices, faces),
        volume_and_corners(ball.vertices, ball.faces),
    )
    assert read[0] == pytest.approx(wanted[0], rel=1e-6)
    assert read[1] == wanted[1]
    assert len(vertices) == len(ball.vertices)
    assert mesh_faults(1e3 * vertices, faces) == []


def test_a_text_stl_gives_the_same_mesh_as_a_binary_one() -> None:
    part = block()
    binary = parse_mesh(trimesh.exchange.stl.export_stl(part), ".stl")
    text = parse_mesh(trimesh.exchange.stl.export_stl_ascii(part).encode(), ".stl")
    assert np.allclose(binary[0], text[0], atol=1e-6)
    assert (binary[1] == text[1]).all()


def test_a_box_is_a_closed_body_of_its_size() -> None:
    vertices_um, faces = box_mesh((2.0, 4.0, 6.0))
    assert mesh_faults(vertices_um, faces) == []
    assert volume_um3(vertices_um, faces) == pytest.approx(48.0)
    assert np.ptp(vertices_um, axis=0).tolist() == [2.0, 4.0, 6.0]
