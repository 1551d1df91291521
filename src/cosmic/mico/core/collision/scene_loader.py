"""A scene read from its files and checked: the one way from TOML, URDF, SRDF and meshes."""

import math
from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np

from cosmic.frame.config import load_model
from cosmic.frame.errors import ConfigError
from cosmic.mico.core.collision.model import SceneModel, Shape, ToolFrame
from cosmic.mico.core.collision.scene_checks import check_model
from cosmic.mico.core.collision.scene_drives import make_drives
from cosmic.mico.core.collision.scene_files import SceneFiles
from cosmic.mico.core.collision.scene_findings import Findings
from cosmic.mico.core.collision.scene_pairs import Pairing
from cosmic.mico.core.collision.scene_settings import SceneSettings, ToolFrameSettings
from cosmic.mico.core.collision.scene_shapes import ShapeMaker
from cosmic.mico.core.collision.scene_tree import order_joints
from cosmic.mico.core.collision.scene_urdf import Description, LinkText, turned, understand
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
            drives=make_drives(settings, self._path, joints, self._findings),
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
                self._findings.wrong(where, f"{tool.link!r} is no link of the URDF")
                continue
            frame = np.eye(4)
            frame[:3, :3] = turned(*(math.radians(each) for each in tool.rpy_deg))
            frame[:3, 3] = tool.tip_um
            tools[tool.name] = ToolFrame(tool.name, tool.link, frame)
        return tuple(tools.values())

    def _plate(self, settings: SceneSettings, bodies: Collection[str]) -> str:
        if settings.plate and settings.plate not in bodies:
            text = f"{settings.plate!r} is no link of the URDF"
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
                f"{self._path}: exchange", f"{name!r} is no link of the URDF; is it misspelt?"
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
