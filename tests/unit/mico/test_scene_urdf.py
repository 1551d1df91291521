"""A URDF read by us and by a library that others use says the same."""

import io
import math
from pathlib import Path

import numpy as np
import pytest
import yourdfpy
from lxml import etree

from cosmic.mico.core.collision.scene_urdf import Figure, understand
from cosmic.mico.core.collision.scene_xml import XmlFile
from unit.mico.scene_writer import URDF

SHIPPED = Path(__file__).parents[3] / "config" / "scenes" / "fiberstation.urdf"
TURNED = URDF.replace('<origin xyz="0 0 -0.01"/>', '<origin xyz="1 2 -3" rpy="0.3 -1.1 2.5"/>')
AS_A_MESH = URDF.replace(
    '<box size="0.004 0.002 0.001"/></geometry><material',
    '<mesh filename="a.stl" scale="0.001"/></geometry><material',
)


def pose_um(pose_m: np.ndarray | None) -> np.ndarray:
    pose = np.eye(4) if pose_m is None else np.array(pose_m)
    pose[:3, 3] *= 1e6
    return pose


def sizes_m(geometry: object) -> list[float]:
    for kind, keys in (("cylinder", ("radius", "length")), ("sphere", ("radius",))):
        shape = getattr(geometry, kind)
        if shape is not None:
            return [getattr(shape, key) for key in keys]
    return [] if geometry.box is None else list(geometry.box.size)  # type: ignore[attr-defined]


def assert_same_figure(ours: Figure, theirs: object) -> None:
    assert ours.name == (theirs.name or "")  # type: ignore[attr-defined]
    assert np.allclose(ours.body_from_figure, pose_um(theirs.origin), rtol=0.0, atol=1e-6)  # type: ignore[attr-defined]
    geometry = theirs.geometry  # type: ignore[attr-defined]
    assert ours.size_um == pytest.approx([1e6 * each for each in sizes_m(geometry)])
    if ours.kind == "mesh":
        assert ours.mesh == geometry.mesh.filename
        scale = 1.0 if geometry.mesh.scale is None else geometry.mesh.scale
        assert ours.um_per_unit == pytest.approx(tuple(np.broadcast_to(scale, 3) * 1e6))


@pytest.mark.parametrize(
    "text",
    [URDF, TURNED, AS_A_MESH, SHIPPED.read_text(encoding="utf-8")],
    ids=["small", "turned", "mesh", "shipped"],
)
def test_a_urdf_is_understood_as_a_library_understands_it(text: str) -> None:
    root = etree.fromstring(text.encode(), etree.XMLParser(remove_comments=True))
    ours = understand(XmlFile(Path("small.urdf"), root))
    theirs = yourdfpy.URDF.load(
        io.BytesIO(text.encode()),
        build_scene_graph=False,
        load_meshes=False,
        force_collision_mesh=False,
    ).robot
    assert [each.name for each in ours.links] == [each.name for each in theirs.links]
    assert [each.name for each in ours.joints] == [each.name for each in theirs.joints]
    for link, other in zip(ours.links, theirs.links, strict=True):
        for figure, shape in zip(link.pieces, other.collisions, strict=True):
            assert_same_figure(figure, shape)
        for figure, shape in zip(link.views, other.visuals, strict=True):
            assert_same_figure(figure, shape)
    for joint, other in zip(ours.joints, theirs.joints, strict=True):
        assert (joint.parent, joint.child) == (other.parent, other.child)
        assert joint.axis == pytest.approx(other.axis)
        pose = pose_um(other.origin)
        assert np.allclose(joint.parent_from_child, pose, rtol=0.0, atol=1e-6)
        if other.limit is not None and other.type == "prismatic":
            limits = (other.limit.lower, other.limit.upper)
            assert (joint.low, joint.high) == pytest.approx(tuple(1e6 * end for end in limits))


def test_a_visual_has_the_colour_of_the_material_it_names_and_else_is_grey() -> None:
    links = understand(XmlFile(Path("small.urdf"), etree.fromstring(URDF.encode()))).links
    assert links[1].views[0].colour == (1.0, 0.0, 0.0, 0.5)
    assert links[1].pieces[0].colour == (0.7, 0.7, 0.7, 1.0)


def test_a_quarter_turn_is_exact() -> None:
    text = TURNED.replace("0.3 -1.1 2.5", f"0 {math.pi / 2} 0")
    links = understand(XmlFile(Path("small.urdf"), etree.fromstring(text.encode()))).links
    assert set(np.abs(links[0].pieces[0].body_from_figure[:3, :3]).ravel()) == {0.0, 1.0}
