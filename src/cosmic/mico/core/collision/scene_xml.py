"""URDF and SRDF as XML: read without entities, and checked as text, with line numbers."""

import math
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from lxml import etree

from cosmic.mico.core.collision.scene_files import SceneFiles
from cosmic.mico.core.collision.scene_findings import Findings

# Numbers wanted in an attribute; those of sizes must be positive.
_NUMBERS: Final = {
    ("origin", "xyz"): (3, False),
    ("origin", "rpy"): (3, False),
    ("axis", "xyz"): (3, False),
    ("limit", "lower"): (1, False),
    ("limit", "upper"): (1, False),
    ("limit", "effort"): (1, False),
    ("limit", "velocity"): (1, False),
    ("box", "size"): (3, True),
    ("cylinder", "radius"): (1, True),
    ("cylinder", "length"): (1, True),
    ("sphere", "radius"): (1, True),
    ("mesh", "scale"): (3, True),
    ("color", "rgba"): (4, False),
}
_NEEDED: Final = {
    "link": ("name",),
    "joint": ("name", "type"),
    "parent": ("link",),
    "child": ("link",),
    "box": ("size",),
    "cylinder": ("radius", "length"),
    "sphere": ("radius",),
    "mesh": ("filename",),
}
_LARGEST: Final = 1e9
_SHAPES: Final = ("box", "cylinder", "sphere", "mesh")
_PARTS: Final = ("link", "joint")
_JOINTS: Final = ("fixed", "prismatic", "revolute", "continuous")


@dataclass(frozen=True)
class Disabled:
    """One `disable_collisions` of an SRDF and where it stands."""

    links: tuple[str, str]
    reason: str
    where: str


class XmlFile:
    """An XML file that was read; `root` is an lxml element."""

    def __init__(self, path: Path, root: Any) -> None:
        self.path = path
        self.root = root

    def where(self, element: Any) -> str:
        """Return file and line, and the link or joint the element belongs to."""
        owner = element
        while owner is not None and owner.tag not in _PARTS:
            owner = owner.getparent()
        named = f" {owner.tag} {owner.get('name')!r}" if owner is not None else ""
        return f"{self.path}:{element.sourceline}:{named}" if named else self.at(element)

    def at(self, element: Any) -> str:
        """Return file and line."""
        return f"{self.path}:{element.sourceline}"

    def place_of(self, link: str, tag: str, number: int) -> str:
        """Return where the shape stands that is the `number`-th of its kind in a link."""
        for element in self.root.findall("link"):
            if element.get("name") == link:
                return f"{self.where(element.findall(tag)[number])} {tag} {number + 1}"
        return f"{self.path}: link {link!r} {tag} {number + 1}"

    def place_of_joint(self, name: str) -> str:
        """Return where a joint stands."""
        for element in self.root.findall("joint"):
            if element.get("name") == name:
                return self.where(element)
        return f"{self.path}: joint {name!r}"


def read_xml(path: Path, files: SceneFiles, asked_by: str, findings: Findings) -> XmlFile | None:
    """Read an XML file whose root is `robot`; None where that failed."""
    content = files.read(path, asked_by)
    if content is None:
        return None
    parser = etree.XMLParser(
        resolve_entities=False,
        no_network=True,
        load_dtd=False,
        huge_tree=False,
        remove_comments=True,
        remove_pis=True,
    )
    try:
        root = etree.fromstring(content, parser)
    except etree.XMLSyntaxError as exc:
        findings.wrong(path, f"not valid XML: {exc}")
        return None
    if root.getroottree().docinfo.doctype:
        findings.wrong(path, "it has a DOCTYPE, which is refused; delete that line")
        return None
    if root.tag != "robot":
        findings.wrong(f"{path}:{root.sourceline}", f"the root is <{root.tag}>, not <robot>")
        return None
    return XmlFile(path, root)


def check_urdf_text(file: XmlFile, findings: Findings) -> None:
    """Check what must be right before a URDF can be understood: names, elements, numbers."""
    if not file.root.get("name"):
        findings.wrong(file.at(file.root), "the robot has no name")
    for tag in _PARTS:
        _check_unique(file, tag, findings)
    for element in file.root.iter(etree.Element):
        _check_element(file, element, findings)
    for shape in file.root.iterfind("link/*"):
        if shape.tag in ("visual", "collision"):
            _check_shape(file, shape, findings)
    for joint in file.root.iterfind("joint"):
        _check_joint(file, joint, findings)


def read_disabled(file: XmlFile, findings: Findings) -> list[Disabled]:
    """Return the pairs an SRDF allows to touch."""
    found = []
    for element in file.root:
        where = file.at(element)
        if element.tag == "end_effector":
            continue
        if element.tag != "disable_collisions":
            text = "is not used, only <disable_collisions> and <end_effector>"
            findings.odd(where, f"<{element.tag}> {text}")
            continue
        one, other = element.get("link1", ""), element.get("link2", "")
        reason = element.get("reason", "").strip()
        if not one or not other:
            findings.wrong(where, "<disable_collisions> needs link1 and link2")
        elif not reason:
            findings.wrong(where, f"{one} and {other} may touch, but no reason is given; say why")
        else:
            found.append(Disabled((one, other), reason, where))
    return found


def read_end_effectors(file: XmlFile, findings: Findings) -> list[tuple[str, str]]:
    """Return name and link of the tools that an SRDF names; the link is their frame."""
    found = []
    for element in file.root:
        if element.tag != "end_effector":
            continue
        name, link = element.get("name", ""), element.get("parent_link", "")
        if name and link:
            found.append((name, link))
        else:
            findings.wrong(file.at(element), "<end_effector> needs name and parent_link")
    return found


def _check_element(file: XmlFile, element: Any, findings: Findings) -> None:
    for name in _NEEDED.get(element.tag, ()):
        if not (element.get(name) or "").strip():
            findings.wrong(file.where(element), f"<{element.tag}> has no {name!r}")
    for name, text in element.attrib.items():
        if (element.tag, name) in _NUMBERS:
            _check_numbers(file, element, name, text, findings)
    if "}" in element.tag:
        findings.wrong(file.where(element), f"<{element.tag}> is not URDF; run xacro first")


def _check_unique(file: XmlFile, tag: str, findings: Findings) -> None:
    names = Counter(element.get("name") for element in file.root.findall(tag))
    for name, count in names.items():
        if name and count > 1:
            findings.wrong(file.path, f"{tag} {name!r} is there {count} times; rename all but one")


def _check_numbers(file: XmlFile, element: Any, name: str, text: str, findings: Findings) -> None:
    wanted, positive = _NUMBERS[element.tag, name]
    where = f"{file.where(element)} <{element.tag} {name}={text!r}>"
    try:
        numbers = [float(word) for word in text.split()]
    except ValueError:
        findings.wrong(where, "not a number")
        return
    alone = element.tag == "mesh" and len(numbers) == 1
    if len(numbers) != wanted and not alone:
        findings.wrong(where, f"{wanted} numbers are wanted")
    if not all(math.isfinite(number) for number in numbers):
        findings.wrong(where, "not finite")
    elif not all(abs(number) <= _LARGEST for number in numbers):
        findings.wrong(where, f"above {_LARGEST:g}; URDF counts in metres and radians")
    elif positive and not all(number > 0.0 for number in numbers):
        what = "a mirrored mesh is inside out; mirror it in the file" if name == "scale" else ""
        findings.wrong(where, f"must be larger than 0{'; ' + what if what else ''}")


def _check_shape(file: XmlFile, shape: Any, findings: Findings) -> None:
    geometries = shape.findall("geometry")
    inner = list(geometries[0]) if len(geometries) == 1 else []
    if len(inner) != 1 or inner[0].tag not in _SHAPES:
        findings.wrong(
            file.where(shape),
            f"<{shape.tag}> needs one <geometry> with one of {', '.join(_SHAPES)}",
        )


def _check_joint(file: XmlFile, joint: Any, findings: Findings) -> None:
    where, kind = file.where(joint), joint.get("type")
    for tag in ("parent", "child"):
        if len(joint.findall(tag)) != 1:
            findings.wrong(where, f"it needs one <{tag}>")
    if kind and kind not in _JOINTS:
        findings.wrong(where, f"type {kind!r} is not known; it may be {', '.join(_JOINTS)}")
    if joint.find("mimic") is not None:
        findings.odd(where, "<mimic> is not used; give the joint a [[drive]] of its own")
    limit = joint.find("limit")
    if kind in ("prismatic", "revolute"):
        ends = (limit.get("lower"), limit.get("upper")) if limit is not None else (None, None)
        if None in ends:
            findings.wrong(where, "it has no limits; add <limit lower= upper=> at its hard stops")
