"""Writes small scenes to disk: a base, a slider with a box on it, and a table that turns."""

from collections.abc import Mapping
from pathlib import Path

import pytest
import trimesh

from cosmic.frame.errors import ConfigError
from cosmic.mico.core.collision.scene_loader import find_scene_mistakes, load_scene

URDF = """<?xml version="1.0"?>
<robot name="small">
  <material name="red"><color rgba="1 0 0 0.5"/></material>
  <link name="base">
    <collision>
      <origin xyz="0 0 -0.01"/><geometry><box size="0.05 0.05 0.01"/></geometry></collision>
  </link>
  <link name="slider">
    <collision>
      <origin xyz="0 0 0.002"/><geometry><box size="0.004 0.002 0.001"/></geometry></collision>
    <visual><geometry><box size="0.004 0.002 0.001"/></geometry><material name="red"/></visual>
  </link>
  <link name="table">
    <collision><origin xyz="0.015 0 0"/>
      <geometry><cylinder radius="0.003" length="0.002"/></geometry></collision>
  </link>
  <joint name="slide" type="prismatic">
    <parent link="base"/><child link="slider"/>
    <axis xyz="0 0 2"/><limit lower="-0.006" upper="0.006" effort="1" velocity="1"/>
  </joint>
  <joint name="turn" type="revolute">
    <parent link="base"/><child link="table"/>
    <axis xyz="0 0 1"/><limit lower="-1.5" upper="1.5" effort="1" velocity="1"/>
  </joint>
</robot>
"""
SRDF = """<robot name="small">
  <disable_collisions link1="base" link2="table" reason="Adjacent"/>
</robot>
"""
TOML = """
urdf = "small.urdf"
srdf = "small.srdf"
margin_um = 5.0

[[drive]]
axis = "lift"
joint = "slide"

[[drive]]
axis = "spin"
joint = "turn"
"""
MESH = '<mesh filename="part.stl" scale="0.001 0.001 0.001"/>'
SLIDER_BOX = '<box size="0.004 0.002 0.001"/></geometry></collision>'
SLIDER_MESH = f"{MESH}</geometry></collision>"


def write_scene(
    folder: Path,
    *,
    urdf: str | Mapping[str, str] = URDF,
    srdf: str | Mapping[str, str] = SRDF,
    toml: str | Mapping[str, str] = TOML,
    more: str = "",
) -> Path:
    """Write a scene; a mapping replaces parts of the usual text. Returns its TOML file."""
    (folder / "small.urdf").write_text(_edited(URDF, urdf), encoding="utf-8")
    (folder / "small.srdf").write_text(_edited(SRDF, srdf), encoding="utf-8")
    path = folder / "small.toml"
    path.write_text(_edited(TOML, toml) + more, encoding="utf-8")
    return path


def write_part(folder: Path, part: trimesh.Trimesh, name: str = "part.stl") -> None:
    """Write a mesh beside the scene, in mm; it is not repaired."""
    kind = name.rpartition(".")[2]
    (folder / name).write_bytes(
        trimesh.exchange.stl.export_stl(part)
        if kind == "stl"
        else trimesh.exchange.obj.export_obj(part, include_normals=False).encode()
    )


def block(x: float = 4.0, y: float = 2.0, z: float = 1.0) -> trimesh.Trimesh:
    """A box in mm, as a mesh."""
    return trimesh.creation.box(extents=(x, y, z))


def mistakes(path: Path) -> str:
    """What is found wrong, which is also what loading raises."""
    found, _ = find_scene_mistakes(path)
    with pytest.raises(ConfigError) as caught:
        load_scene(path)
    assert str(caught.value) == "\n".join(found)
    return "\n".join(found)


def _edited(usual: str, edit: str | Mapping[str, str]) -> str:
    if isinstance(edit, str):
        return edit
    for old, new in edit.items():
        assert old in usual, f"{old!r} is not in the text"
        usual = usual.replace(old, new, 1)
    return usual
