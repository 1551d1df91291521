"""The drives of a scene file, in the units of the model."""

import math
from pathlib import Path

from cosmic.mico.core.collision.model import Drive, Joint, JointKind
from cosmic.mico.core.collision.scene_findings import Findings
from cosmic.mico.core.collision.scene_settings import DriveSettings, SceneSettings


def make_drives(
    settings: SceneSettings, path: Path, joints: tuple[Joint, ...], findings: Findings
) -> tuple[Drive, ...]:
    """Return the drives; what names no joint, or does not fit its joint, is a mistake."""
    by_name = {joint.name: joint for joint in joints}
    taken: dict[str, str] = {}
    kinds: dict[str, JointKind] = {}
    drives: list[Drive] = []
    for number, each in enumerate(settings.drive):
        where = f"{path}: drive[{number}] ({each.axis})"
        joint = by_name.get(each.joint)
        if joint is None or joint.kind is JointKind.FIXED:
            known = ", ".join(j.name for j in joints if j.kind is not JointKind.FIXED)
            findings.wrong(where, f"{each.joint!r} is no joint that moves; there are {known}")
            continue
        if each.joint in taken:
            findings.wrong(where, f"joint {each.joint!r} is driven by {taken[each.joint]} already")
            continue
        taken[each.joint] = each.axis
        if kinds.setdefault(each.axis, joint.kind) is not joint.kind:
            findings.wrong(where, "one axis cannot both slide and turn; give it joints of a kind")
        if _fits(each, joint, where, findings):
            drives.append(_drive(each, joint))
    for joint in joints:
        if joint.kind is not JointKind.FIXED and joint.name not in taken:
            findings.odd(path, f"joint {joint.name!r} has no [[drive]]; it stays at 0")
    return tuple(drives)


def _fits(each: DriveSettings, joint: Joint, where: str, findings: Findings) -> bool:
    turns = joint.kind is JointKind.REVOLUTE
    foreign = "um" if turns else "deg"
    named = [
        name
        for name in (f"offset_{foreign}", f"overshoot_{foreign}", f"uncertainty_{foreign}")
        if getattr(each, name) is not None
    ]
    for name in named:
        kind = "turns: write _deg" if turns else "slides: write _um"
        findings.wrong(where, f"{name}: joint {joint.name!r} {kind}")
    if each.factor == 0.0:
        findings.wrong(where, "factor: 0 would move nothing; 1, -1 or the ratio of a gear")
    return not named and each.factor != 0.0


def _drive(each: DriveSettings, joint: Joint) -> Drive:
    if joint.kind is JointKind.REVOLUTE:
        ratio, offset = math.radians(each.factor), math.radians(each.offset_deg or 0.0)
        overshoot, uncertainty = each.overshoot_deg, each.uncertainty_deg
    else:
        ratio, offset = each.factor, each.offset_um or 0.0
        overshoot, uncertainty = each.overshoot_um, each.uncertainty_um
    return Drive(
        each.axis,
        each.joint,
        ratio,
        offset,
        overshoot or 0.0,
        math.inf if uncertainty is None else uncertainty,
    )
