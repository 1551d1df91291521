"""Links and joints put in order, from the root outwards; what is no tree is named."""

import math

import numpy as np

from cosmic.mico.core.collision.model import Joint, JointKind
from cosmic.mico.core.collision.scene_findings import Findings
from cosmic.mico.core.collision.scene_urdf import Description, JointText
from cosmic.mico.core.collision.scene_xml import XmlFile


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
    joints = [_joint(by_child[name], file, findings) for name in ordered[1:]]
    if len(findings.mistakes) > before:
        return tuple(ordered), ()
    return tuple(ordered), tuple(joint for joint in joints if joint is not None)


def _check_ends(described: Description, links: set[str], file: XmlFile, findings: Findings) -> None:
    for text in described.joints:
        for role, name in (("parent", text.parent), ("child", text.child)):
            if name not in links:
                findings.wrong(file.place_of_joint(text.name), f"its {role} {name!r} is no link")
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


def _joint(text: JointText, file: XmlFile, findings: Findings) -> Joint | None:
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
        findings.wrong(where, "its origin is no rotation and translation")
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
