"""URDF turned into plain data, from metres to um, and its links and joints put in order.

It is read from elements that `check_urdf_text` has found right. Libraries that read URDF load a
mesh library with it, which takes a second at every start; the tests compare with one.
"""

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from cosmic.mico.core.collision.model import Floats, Joint, JointKind
from cosmic.mico.core.collision.scene_findings import Findings
from cosmic.mico.core.collision.scene_xml import XmlFile

_UM_PER_M: Final = 1e6
_GREY: Final = (0.7, 0.7, 0.7, 1.0)
_SIZES: Final = {"box": ("size",), "cylinder": ("radius", "length"), "sphere": ("radius",)}
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


def understand(file: XmlFile) -> Description:
    """Return what a URDF says whose text was checked."""
    colours = {
        each.get("name"): _rgba(each.find("color"))
        for each in file.root.findall("material")
        if each.find("color") is not None
    }
    return Description(
        tuple(_link(each, colours) for each in file.root.findall("link")),
        tuple(_joint(each) for each in file.root.findall("joint")),
    )


def _rgba(colour: Any) -> tuple[float, float, float, float]:
    red, green, blue, opacity = _numbers(colour, "rgba", "1 1 1 1")
    return red, green, blue, opacity


def _link(link: Any, colours: dict[str, tuple[float, float, float, float]]) -> LinkText:
    return LinkText(
        link.get("name"),
        tuple(_figure(each, _GREY) for each in link.findall("collision")),
        tuple(
            _figure(each, _colour(each.find("material"), colours))
            for each in link.findall("visual")
        ),
    )


def _colour(
    material: Any, colours: dict[str, tuple[float, float, float, float]]
) -> tuple[float, float, float, float]:
    if material is None:
        return _GREY
    own = material.find("color")
    return colours.get(material.get("name"), _GREY) if own is None else _rgba(own)


def _figure(element: Any, colour: tuple[float, float, float, float]) -> Figure:
    place, name = _pose_um_from_m(element.find("origin")), element.get("name") or ""
    shape = element.find("geometry")[0]
    if shape.tag == "mesh":
        scale = np.broadcast_to(_numbers(shape, "scale", "1"), 3)
        x, y, z = (float(part) * _UM_PER_M for part in scale)
        return Figure(
            "mesh",
            place,
            mesh=shape.get("filename"),
            um_per_unit=(x, y, z),
            colour=colour,
            name=name,
        )
    sizes_m = [part for key in _SIZES[shape.tag] for part in _numbers(shape, key)]
    sizes_um = tuple(map(_um_from_m, sizes_m))
    return Figure(shape.tag, place, sizes_um, colour=colour, name=name)


def _joint(joint: Any) -> JointText:
    kind = _KINDS[joint.get("type")]
    low = high = 0.0
    if joint.get("type") == "continuous":
        low, high = -np.inf, np.inf
    elif kind is not JointKind.FIXED:
        limit = joint.find("limit")
        (low,), (high,) = _numbers(limit, "lower"), _numbers(limit, "upper")
    if kind is JointKind.PRISMATIC:
        low, high = _um_from_m(low), _um_from_m(high)
    axis = np.array(_numbers(joint.find("axis"), "xyz", "1 0 0"))
    place = _pose_um_from_m(joint.find("origin"))
    parent, child = (joint.find(each).get("link") for each in ("parent", "child"))
    return JointText(joint.get("name"), kind, parent, child, place, axis, low, high)


def _numbers(element: Any, key: str, default: str = "") -> list[float]:
    text = default if element is None else element.get(key, default)
    return [float(word) for word in text.split()]


def _um_from_m(length_m: float) -> float:
    # Rounded to 1e-6 um: 0.0024 m is 2400 um, not 2399.9999999999995.
    return round(length_m * _UM_PER_M, 6)


def _pose_um_from_m(origin: Any) -> Floats:
    pose = np.eye(4)
    place_m = np.array(_numbers(origin, "xyz", "0 0 0"))
    pose[:3, 3] = np.round(place_m * _UM_PER_M, 6)
    turn = pose[:3, :3]
    turn[:] = turned(*_numbers(origin, "rpy", "0 0 0"))
    # A quarter turn leaves sines of 1e-16, which would tilt what is meant to be aligned.
    nearest = np.round(turn)
    close = np.abs(turn - nearest) < 1e-12
    turn[close] = nearest[close]
    return pose


def turned(roll: float, pitch: float, yaw: float) -> Floats:
    """Return the rotation about the fixed axes x, y, z, one after the other, in radians."""
    (cr, cp, cy), (sr, sp, sy) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def order_joints(
    described: Description, file: XmlFile, findings: Findings
) -> tuple[tuple[str, ...], tuple[Joint, ...]]:
    """Return the bodies, parents first, and the joint of each but the first."""
    before = len(findings.mistakes)
    links = [link.name for link in described.links]
    _check_ends(described, set(links), file, findings)
    by_child: dict[str, JointText] = {}
    for text in described.joints:
        if text.child in by_child:
            other = by_child[text.child].name
            findings.wrong(
                file.place_of_joint(text.name),
                f"link {text.child!r} has two parents, by this joint and by {other!r}; keep one",
            )
        by_child.setdefault(text.child, text)
    roots = [name for name in links if name not in by_child]
    if len(roots) != 1:
        roots_text = (
            f"{len(roots)} roots: {', '.join(roots)}" if roots else "no root: its joints loop"
        )
        findings.wrong(file.path, f"{roots_text}; one link must be fixed and carry all others")
    ordered = _outwards(roots[:1], described.joints)
    for name in links:
        if len(roots) == 1 and name != roots[0] and name not in ordered:
            findings.wrong(
                file.place_of_joint(by_child[name].name), f"link {name!r} hangs in a loop of joints"
            )
    joints = [_checked_joint(by_child[name], file, findings) for name in ordered[1:]]
    if len(findings.mistakes) > before:
        return tuple(ordered), ()
    return tuple(ordered), tuple(joint for joint in joints if joint is not None)


def _check_ends(described: Description, links: set[str], file: XmlFile, findings: Findings) -> None:
    for text in described.joints:
        for role, name in (("parent", text.parent), ("child", text.child)):
            if name not in links:
                findings.wrong(file.place_of_joint(text.name), f"its {role} {name!r} is not a link")
        if text.parent == text.child:
            findings.wrong(file.place_of_joint(text.name), "its parent is its own child")


def _outwards(roots: list[str], joints: tuple[JointText, ...]) -> list[str]:
    ordered, waiting = list(roots), list(roots)
    while waiting:
        parent = waiting.pop(0)
        for text in joints:
            if text.parent == parent and text.child not in ordered:
                ordered.append(text.child)
                waiting.append(text.child)
    return ordered


def _checked_joint(text: JointText, file: XmlFile, findings: Findings) -> Joint | None:
    where = file.place_of_joint(text.name)
    length = float(np.linalg.norm(text.axis))
    if text.kind is not JointKind.FIXED and not (math.isfinite(length) and length > 1e-9):
        findings.wrong(where, "its axis has no length; give the direction, as in xyz='1 0 0'")
        return None
    turn = text.parent_from_child[:3, :3]
    if not (
        np.isfinite(text.parent_from_child).all()
        and np.allclose(turn @ turn.T, np.eye(3), rtol=0.0, atol=1e-9)
        and np.linalg.det(turn) > 0.0
    ):
        findings.wrong(where, "its origin is not a rotation and translation")
        return None
    if text.kind is not JointKind.FIXED and not text.low < text.high:
        findings.wrong(where, "its lower limit is not below its upper one")
        return None
    axis = text.axis / length if length > 0.0 else text.axis
    return Joint(
        text.name,
        text.kind,
        text.parent,
        text.child,
        text.parent_from_child,
        axis,
        text.low,
        text.high,
    )
