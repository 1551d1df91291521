"""URDF as yourdfpy understands it, turned into plain data: the edge from metres to um.

yourdfpy is used here and nowhere else. It is given text that was checked before, and is not
allowed to load meshes: by default it would merge all shapes of a link into one.
"""

import io
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from yourdfpy import URDF

from cosmic.mico.core.collision.model import Floats, JointKind
from cosmic.mico.core.collision.scene_findings import Findings
from cosmic.mico.core.collision.scene_xml import XmlFile

_UM_PER_M: Final = 1e6
_GREY: Final = (0.7, 0.7, 0.7, 1.0)
_KINDS: Final = {
    "fixed": JointKind.FIXED,
    "prismatic": JointKind.PRISMATIC,
    "revolute": JointKind.REVOLUTE,
    "continuous": JointKind.REVOLUTE,
}


@dataclass(frozen=True, eq=False)
class Figure:
    """A shape as the URDF describes it.

    Attributes
    ----------
    kind : str
        "box", "cylinder", "sphere" or "mesh".
    size_um : tuple of float
        The sides of a box; radius and length; radius; empty of a mesh.
    mesh, um_per_unit
        File of a mesh as it is named there, and how many um its unit has along x, y, z.
    """

    kind: str
    body_from_figure: Floats
    size_um: tuple[float, ...] = ()
    mesh: str = ""
    um_per_unit: tuple[float, float, float] = (1.0, 1.0, 1.0)
    colour: tuple[float, float, float, float] = _GREY
    name: str = ""


@dataclass(frozen=True, eq=False)
class LinkText:
    """A link: its collision and its visual shapes."""

    name: str
    pieces: tuple[Figure, ...]
    views: tuple[Figure, ...]


@dataclass(frozen=True, eq=False)
class JointText:
    """A joint as the URDF describes it, in um and rad; axis not normalised yet."""

    name: str
    kind: JointKind
    parent: str
    child: str
    parent_from_child: Floats
    axis: Floats
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class Description:
    """The links and joints of a URDF, in its order."""

    links: tuple[LinkText, ...]
    joints: tuple[JointText, ...]


def understand(file: XmlFile, findings: Findings) -> Description | None:
    """Return what a URDF says whose text was checked; None where yourdfpy gives up."""
    try:
        robot = URDF.load(
            io.BytesIO(file.content()),
            build_scene_graph=False,
            load_meshes=False,
            force_collision_mesh=False,
        ).robot
    except (ValueError, TypeError, KeyError, AttributeError, IndexError) as exc:
        findings.wrong(file.path, f"not understood: {exc}")
        return None
    colours = {each.name: _rgba(each.color) for each in robot.materials if each.color}
    return Description(
        tuple(_link(each, colours) for each in robot.links),
        tuple(_joint(each) for each in robot.joints),
    )


def _rgba(colour: Any) -> tuple[float, float, float, float]:
    red, green, blue, opacity = (float(part) for part in colour.rgba)
    return red, green, blue, opacity


def _link(link: Any, colours: dict[str, tuple[float, float, float, float]]) -> LinkText:
    return LinkText(
        link.name,
        tuple(_figure(each, _GREY) for each in link.collisions),
        tuple(_figure(each, _colour(each.material, colours)) for each in link.visuals),
    )


def _colour(
    material: Any, colours: dict[str, tuple[float, float, float, float]]
) -> tuple[float, float, float, float]:
    if material is None:
        return _GREY
    return _rgba(material.color) if material.color else colours.get(material.name, _GREY)


def _figure(element: Any, colour: tuple[float, float, float, float]) -> Figure:
    geometry, place, name = element.geometry, _pose_um_from_m(element.origin), element.name or ""
    if geometry.box is not None:
        sides = tuple(_um_from_m(float(side)) for side in geometry.box.size)
        return Figure("box", place, sides, colour=colour, name=name)
    if geometry.cylinder is not None:
        sizes = (float(geometry.cylinder.radius), float(geometry.cylinder.length))
        sizes_um = tuple(map(_um_from_m, sizes))
        return Figure("cylinder", place, sizes_um, colour=colour, name=name)
    if geometry.sphere is not None:
        radius_um = _um_from_m(float(geometry.sphere.radius))
        return Figure("sphere", place, (radius_um,), colour=colour, name=name)
    scale = np.broadcast_to(1.0 if geometry.mesh.scale is None else geometry.mesh.scale, 3)
    x, y, z = (float(part) * _UM_PER_M for part in scale)
    file = geometry.mesh.filename
    return Figure("mesh", place, mesh=file, um_per_unit=(x, y, z), colour=colour, name=name)


def _joint(joint: Any) -> JointText:
    kind = _KINDS[joint.type]
    low = high = 0.0
    if joint.type == "continuous":
        low, high = -np.inf, np.inf
    elif kind is not JointKind.FIXED:
        low, high = float(joint.limit.lower), float(joint.limit.upper)
    if kind is JointKind.PRISMATIC:
        low, high = _um_from_m(low), _um_from_m(high)
    axis = np.array([1.0, 0.0, 0.0] if joint.axis is None else joint.axis, dtype=float)
    place = _pose_um_from_m(joint.origin)
    return JointText(joint.name, kind, joint.parent, joint.child, place, axis, low, high)


def _um_from_m(length_m: float) -> float:
    # Rounded to 1e-6 um: 0.0024 m is 2400 um, not 2399.9999999999995.
    return round(length_m * _UM_PER_M, 6)


def _pose_um_from_m(pose_m: Any) -> Floats:
    if pose_m is None:
        return np.eye(4)
    pose = np.array(pose_m, dtype=float)
    pose[:3, 3] = np.round(pose[:3, 3] * _UM_PER_M, 6)
    turn = pose[:3, :3]
    # A quarter turn leaves sines of 1e-16, which would tilt what is meant to be aligned.
    nearest = np.round(turn)
    close = np.abs(turn - nearest) < 1e-12
    turn[close] = nearest[close]
    return pose
