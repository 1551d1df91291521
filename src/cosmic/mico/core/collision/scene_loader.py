"""A scene read from its files and checked: the one way from TOML, URDF, SRDF and meshes."""

import math
from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np

from cosmic.frame.config import load_model
from cosmic.frame.errors import ConfigError
from cosmic.mico.core.collision.model import (
    Drive,
    Joint,
    JointKind,
    SceneModel,
    Shape,
    ToolFrame,
)
from cosmic.mico.core.collision.scene_checks import check_model
from cosmic.mico.core.collision.scene_files import SceneFiles
from cosmic.mico.core.collision.scene_findings import Findings
from cosmic.mico.core.collision.scene_pairs import Pairing
from cosmic.mico.core.collision.scene_settings import (
    DriveSettings,
    SceneSettings,
    ToolFrameSettings,
)
from cosmic.mico.core.collision.scene_shapes import ShapeMaker
from cosmic.mico.core.collision.scene_urdf import (
    Description,
    LinkText,
    order_joints,
    turned,
    understand,
)
from cosmic.mico.core.collision.scene_xml import (
    XmlFile,
    check_urdf_text,
    read_disabled,
    read_end_effectors,
    read_xml,
)


def load_scene(path: Path) -> SceneModel:
    """Return the scene that the TOML file at `path` describes.

    Raises
    ------
    ConfigError
        A line for every mistake, with file, name, reason and what to do.
    """
    findings = Findings()
    model = _Reading(path, findings).model()
    findings.raise_mistakes()
    if model is None:
        raise ConfigError(f"{path}: the scene could not be read")
    return model


def find_scene_mistakes(path: Path) -> tuple[list[str], list[str]]:
    """Return what is wrong with a scene and what is odd, a line each; both empty if all is well."""
    findings = Findings()
    _Reading(path, findings).model()
    return findings.mistakes, findings.warnings


class _Reading:
    """One pass over the files of a scene."""

    def __init__(self, path: Path, findings: Findings) -> None:
        self._path = path
        self._findings = findings

    def model(self) -> SceneModel | None:
        """Return the model, None where too much is missing to make one."""
        try:
            settings = load_model(self._path, SceneSettings)
        except ConfigError as exc:
            self._findings.mistakes += str(exc).splitlines()
            return None
        folder, limits = self._path.parent, settings.limits
        files = SceneFiles(folder, limits.file_bytes, settings.sha256, self._findings)
        srdf = read_xml(folder / settings.srdf, files, f"{self._path}: srdf", self._findings)
        disabled = [] if srdf is None else read_disabled(srdf, self._findings)
        named = [] if srdf is None else read_end_effectors(srdf, self._findings)
        urdf, described = self._describe(folder / settings.urdf, files, f"{self._path}: urdf")
        if urdf is None or described is None:
            return None
        bodies, joints = order_joints(described, urdf, self._findings)
        shapes = self._shapes(settings, files, urdf, described)
        files.check_hashes_used(self._path)
        pieces = tuple(piece for made, _ in shapes for piece in made)
        if len(joints) != len(bodies) - 1 or len(bodies) != len(described.links):
            return None
        pairing = Pairing(bodies, joints, pieces, self._findings)
        allowed = pairing.allowed(disabled)
        watched = pairing.watched(settings, allowed, self._path, folder / settings.srdf)
        model = SceneModel(
            name=self._path.stem,
            bodies=bodies,
            joints=joints,
            pieces=pieces,
            views=tuple(view for _, seen in shapes for view in seen),
            drives=_drives(settings, self._path, joints, self._findings),
            pairs=watched,
            allowed=allowed,
            contacts=pairing.contacts(settings, watched, self._path),
            park=settings.park,
            detour_height=settings.detour,
            tools=self._tools(settings, named, bodies),
            plate=self._plate(settings, bodies),
        )
        check_model(model, settings, self._path, self._findings)
        return model

    def _tools(
        self,
        settings: SceneSettings,
        named: Sequence[tuple[str, str]],
        bodies: Collection[str],
    ) -> tuple[ToolFrame, ...]:
        """Return the tools of the SRDF, and those of the scene, which replace them by name."""
        tools: dict[str, ToolFrame] = {}
        described = [ToolFrameSettings(name=name, link=link) for name, link in named]
        for tool in (*described, *settings.tool):
            if tool.link not in bodies:
                where = f"{self._path}: tool {tool.name!r}"
                self._findings.wrong(where, f"{tool.link!r} is not a link of the URDF")
                continue
            frame = np.eye(4)
            frame[:3, :3] = turned(*(math.radians(each) for each in tool.rpy_deg))
            frame[:3, 3] = tool.tip_um
            tools[tool.name] = ToolFrame(tool.name, tool.link, frame)
        return tuple(tools.values())

    def _plate(self, settings: SceneSettings, bodies: Collection[str]) -> str:
        if settings.plate and settings.plate not in bodies:
            text = f"{settings.plate!r} is not a link of the URDF"
            self._findings.wrong(f"{self._path}: plate", text)
        return settings.plate

    def _describe(
        self, path: Path, files: SceneFiles, asked_by: str
    ) -> tuple[XmlFile | None, Description | None]:
        file = read_xml(path, files, asked_by, self._findings)
        if file is None:
            return None, None
        before = len(self._findings.mistakes)
        check_urdf_text(file, self._findings)
        if len(self._findings.mistakes) > before:
            return file, None
        return file, understand(file)

    def _shapes(
        self, settings: SceneSettings, files: SceneFiles, urdf: XmlFile, described: Description
    ) -> list[tuple[list[Shape], list[Shape]]]:
        maker = ShapeMaker(files, settings.limits, self._findings)
        names = {link.name for link in described.links}
        for name in settings.exchange.keys() - names:
            self._findings.wrong(
                f"{self._path}: exchange", f"{name!r} is not a link of the URDF; is it misspelt?"
            )
        shapes = []
        for link in described.links:
            source: tuple[XmlFile, LinkText] | None = (urdf, link)
            if link.name in settings.exchange:
                source = self._exchanged(link.name, settings.exchange[link.name], files)
            if source is not None:
                shapes.append(maker.make(*source, link.name))
        return shapes

    def _exchanged(
        self, name: str, file_name: str, files: SceneFiles
    ) -> tuple[XmlFile, LinkText] | None:
        where = f"{self._path}: exchange.{name}"
        file, described = self._describe(self._path.parent / file_name, files, where)
        if file is None or described is None:
            return None
        if len(described.links) != 1 or described.joints:
            self._findings.wrong(where, f"{file.path}: it must hold one link and no joint")
            return None
        return file, described.links[0]


def _drives(
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
            findings.wrong(where, f"{each.joint!r} is not a joint that moves; there are {known}")
            continue
        if each.joint in taken:
            findings.wrong(where, f"joint {each.joint!r} is driven by {taken[each.joint]} already")
            continue
        taken[each.joint] = each.axis
        if kinds.setdefault(each.axis, joint.kind) is not joint.kind:
            findings.wrong(where, "one axis cannot both slide and turn; give it joints of a kind")
        if _drive_fits(each, joint, where, findings):
            drives.append(_drive(each, joint))
    for joint in joints:
        if joint.kind is not JointKind.FIXED and joint.name not in taken:
            findings.odd(path, f"joint {joint.name!r} has no [[drive]]; it stays at 0")
    return tuple(drives)


def _drive_fits(each: DriveSettings, joint: Joint, where: str, findings: Findings) -> bool:
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
