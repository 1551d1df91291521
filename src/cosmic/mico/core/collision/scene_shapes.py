"""Figures of a URDF made into shapes of the model, each one checked."""

from pathlib import Path

import numpy as np

from cosmic.mico.core.collision.model import Shape
from cosmic.mico.core.collision.scene_files import SceneFiles
from cosmic.mico.core.collision.scene_findings import Findings
from cosmic.mico.core.collision.scene_meshes import (
    FORMATS,
    Mesh,
    box_mesh,
    cylinder_mesh,
    mesh_faults,
    parse_mesh,
    sphere_mesh,
)
from cosmic.mico.core.collision.scene_settings import SizeLimits
from cosmic.mico.core.collision.scene_urdf import Figure, LinkText
from cosmic.mico.core.collision.scene_xml import XmlFile


class ShapeMaker:
    """Makes the shapes of links; a mesh that is named several times is read once.

    Parameters
    ----------
    limits : SizeLimits
        Most triangles of a mesh, most bytes of its file.
    """

    def __init__(self, files: SceneFiles, limits: SizeLimits, findings: Findings) -> None:
        self._files = files
        self._limits = limits
        self._findings = findings
        self._meshes: dict[Path, Mesh | None] = {}

    def make(self, file: XmlFile, link: LinkText, body: str) -> tuple[list[Shape], list[Shape]]:
        """Return the collision pieces and the views of `body`, as `link` of `file` has them.

        Where nothing is to be drawn of a body, its pieces are drawn.
        """
        pieces: list[Shape] = []
        views: list[Shape] = []
        for tag, figures, made in (
            ("collision", link.pieces, pieces),
            ("visual", link.views, views),
        ):
            for number, figure in enumerate(figures):
                where = file.place_of(link.name, tag, number)
                mesh = self._mesh(figure, where, file.path.parent, solid=tag == "collision")
                if mesh is not None:
                    name = figure.name or f"{body} {number + 1}"
                    made.append(_placed(figure, mesh, name, body))
        return pieces, views or pieces

    def _mesh(self, figure: Figure, where: str, folder: Path, *, solid: bool) -> Mesh | None:
        if figure.kind == "box":
            x, y, z = figure.size_um
            return box_mesh((x, y, z))
        if figure.kind == "cylinder":
            radius, length = figure.size_um
            return cylinder_mesh(radius, length, around=solid)
        if figure.kind == "sphere":
            return sphere_mesh(figure.size_um[0], around=solid)
        return self._mesh_from_file(figure, where, folder, solid=solid)

    def _mesh_from_file(
        self, figure: Figure, where: str, folder: Path, *, solid: bool
    ) -> Mesh | None:
        path = folder / figure.mesh
        if "://" in figure.mesh or path.suffix.lower() not in FORMATS:
            self._findings.wrong(
                where, f"mesh {figure.mesh!r}: name an {' or '.join(FORMATS)} file beside the URDF"
            )
            return None
        if path not in self._meshes:
            self._meshes[path] = self._read(path, where)
        mesh = self._meshes[path]
        if mesh is None:
            return None
        vertices_um, faces = mesh[0] * np.array(figure.um_per_unit), mesh[1]
        most = self._limits.piece_faces if solid else self._limits.view_faces
        if len(faces) > most:
            self._findings.wrong(
                where, f"{path.name}: {len(faces)} triangles, at most {most}; simplify the mesh"
            )
            return None
        faults = mesh_faults(vertices_um, faces) if solid else []
        for fault in faults:
            self._findings.wrong(where, f"{path.name}: {fault}")
        return None if faults else (vertices_um, faces)

    def _read(self, path: Path, where: str) -> Mesh | None:
        content = self._files.read(path, where)
        if content is None:
            return None
        try:
            return parse_mesh(content, path.suffix.lower())
        except ValueError as exc:
            self._findings.wrong(where, f"{path.name}: {exc}; export it again")
            return None


def _placed(figure: Figure, mesh: Mesh, name: str, body: str) -> Shape:
    pose = figure.body_from_figure
    vertices_um = mesh[0] @ pose[:3, :3].T + pose[:3, 3]
    vertices_um.flags.writeable = False
    mesh[1].flags.writeable = False
    return Shape(name, body, vertices_um, mesh[1], figure.colour)
