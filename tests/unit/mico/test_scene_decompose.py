"""A concave mesh becomes convex pieces, once and offline."""

import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from cosmic.app.commands.scene import check_scene, decompose
from cosmic.frame.errors import ConfigError, NotAvailable
from cosmic.mico.core.collision.scene_decompose import decompose_mesh
from cosmic.mico.core.collision.scene_loader import find_scene_mistakes
from unit.mico.scene_writer import MESH, SLIDER_BOX, block, write_part, write_scene


def bracket() -> trimesh.Trimesh:
    """An L of two bars, as one closed concave mesh, mm."""
    outline = np.array([[0, 0], [6, 0], [6, 1], [1, 1], [1, 4], [0, 4]], dtype=float)
    count = len(outline)
    low = np.column_stack((outline, np.zeros(count)))
    cap = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]])
    walls = [[k, (k + 1) % count, k + count] for k in range(count)]
    walls += [[(k + 1) % count, (k + 1) % count + count, k + count] for k in range(count)]
    return trimesh.Trimesh(
        np.vstack((low, np.add(low, (0.0, 0.0, 1.0)))),
        np.vstack((cap[:, ::-1], cap + count, walls)),
        process=False,
    )


def test_the_pieces_are_convex_and_together_as_large_as_the_mesh(tmp_path: Path) -> None:
    write_part(tmp_path, bracket())
    made = decompose_mesh(tmp_path / "part.stl", tmp_path / "pieces")
    assert len(made.files) >= 2
    assert abs(made.volume_error) < 0.1
    assert made.uncovered < 0.1
    for file in made.files:
        assert file.parent == tmp_path / "pieces"
        assert trimesh.load_mesh(file).is_convex


def test_a_scene_takes_the_pieces(tmp_path: Path) -> None:
    write_part(tmp_path, bracket())
    shape = "</geometry></collision>"
    whole = {SLIDER_BOX: f"{MESH}{shape}"}
    assert "not convex" in find_scene_mistakes(write_scene(tmp_path, urdf=whole))[0][0]
    made = decompose_mesh(tmp_path / "part.stl", tmp_path)
    between = f"{shape}<collision><geometry>"
    pieces = between.join(MESH.replace("part.stl", file.name) for file in made.files)
    path = write_scene(tmp_path, urdf={SLIDER_BOX: f"{pieces}{shape}"})
    assert check_scene(path) == ([], [])


def test_the_command_reports_files_and_volume_error(tmp_path: Path) -> None:
    write_part(tmp_path, bracket())
    lines = decompose(tmp_path / "part.stl", tmp_path / "pieces")
    assert lines[0] == str(tmp_path / "pieces" / "part_1.stl")
    assert any("convex pieces of part.stl" in line for line in lines)
    assert any(line.startswith("volume: ") and "than the mesh" in line for line in lines)


def test_an_open_mesh_is_refused(tmp_path: Path) -> None:
    part = block()
    write_part(tmp_path, trimesh.Trimesh(part.vertices, part.faces[1:], process=False))
    with pytest.raises(ConfigError, match=r"part\.stl: it is open"):
        decompose_mesh(tmp_path / "part.stl", tmp_path)


def test_a_missing_mesh_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"none\.stl: cannot be read"):
        decompose_mesh(tmp_path / "none.stl", tmp_path)


def test_another_format_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"name an \.stl or \.obj file"):
        decompose_mesh(tmp_path / "part.step", tmp_path)


def test_a_mesh_that_is_far_too_large_is_refused_unread(tmp_path: Path) -> None:
    with (tmp_path / "part.stl").open("wb") as file:
        file.truncate(1 << 30)
    with pytest.raises(ConfigError, match="simplify it first"):
        decompose_mesh(tmp_path / "part.stl", tmp_path)


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    write_part(tmp_path, bracket())
    with pytest.raises(ConfigError, match=r"part\.stl: cannot be written"):
        decompose_mesh(tmp_path / "part.stl", tmp_path / "part.stl")


def test_without_the_library_it_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_part(tmp_path, bracket())
    monkeypatch.setitem(sys.modules, "vhacdx", None)
    with pytest.raises(NotAvailable, match=r"needs the extra 'decompose'"):
        decompose_mesh(tmp_path / "part.stl", tmp_path)
