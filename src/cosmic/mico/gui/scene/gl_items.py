"""The bodies as items of pyqtgraph.opengl, drawn by their own camera into any context."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import pyqtgraph.opengl as gl
from OpenGL import GL
from PySide6.QtGui import QMatrix4x4

from cosmic.mico.core.collision.model import Floats
from cosmic.mico.gui.scene.gl_shader import light_shader, set_look
from cosmic.mico.gui.scene.meshes import BodyMesh, Bools

_BUFFERS: Final = ("m_vbo_position", "m_vbo_normal", "m_vbo_color", "m_ibo_faces")
_SOLID: Final = {GL.GL_DEPTH_TEST: True, GL.GL_BLEND: False, GL.GL_CULL_FACE: True}
_BLENDED: Final = (
    GL.GL_SRC_ALPHA,
    GL.GL_ONE_MINUS_SRC_ALPHA,
    GL.GL_ONE,
    GL.GL_ONE_MINUS_SRC_ALPHA,
)
_GLASS: Final = _SOLID | {GL.GL_BLEND: True, "glBlendFuncSeparate": _BLENDED}
"""Back faces are left out of glass too: one layer a body says enough."""


class Stage:
    """Stands where pyqtgraph's items expect their GLViewWidget: tells them the camera."""

    def __init__(self) -> None:
        self.projection = QMatrix4x4()
        self.camera_from_item = QMatrix4x4()
        self._shaders = (light_shader(), light_shader(stripes=True))

    def shader(self, *, stripes: bool) -> Any:
        """Return the program that draws with or without stripes."""
        return self._shaders[stripes]

    def currentModelView(self) -> QMatrix4x4:  # noqa: N802 - pyqtgraph calls it
        """Return where the item being drawn stands before the camera."""
        return self.camera_from_item

    def currentProjection(self) -> QMatrix4x4:  # noqa: N802 - pyqtgraph calls it
        """Return the projection of the camera."""
        return self.projection

    def update(self) -> None:
        """Do nothing: the view knows itself when to paint."""


@dataclass(frozen=True)
class Look:
    """How a body is drawn.

    Attributes
    ----------
    tint : tuple of float
        Red, green, blue, each 0 to 1, laid over the colour of the body.
    share : float
        How much of it: 0 none, 1 nothing else.
    opacity : float
        Of the whole; 1 as the body is.
    stripes : bool
        Tint stripes only.
    """

    tint: tuple[float, float, float] = (0.0, 0.0, 0.0)
    share: float = 0.0
    opacity: float = 1.0
    stripes: bool = False


class BodyItem:
    """One body in OpenGL: what is solid of it, and what can be seen through."""

    def __init__(self, mesh: BodyMesh, stage: Stage) -> None:
        self.body = mesh.body
        self._stage = stage
        low, high = mesh.bounds_mm
        self.middle_mm = (low + high) / 2.0
        self._solid = self._item(mesh, ~mesh.glass)
        self._glass = self._item(mesh, mesh.glass)

    def _item(self, mesh: BodyMesh, which: Bools) -> Any:
        if not which.any():
            return None
        colours = np.repeat(mesh.colours[which][:, None, :], 3, axis=1)
        data = gl.MeshData(vertexes=mesh.corners_mm[which], vertexColors=colours)
        data.faceNormals(indexed="faces")[:] = mesh.normals[which]  # smooth, where it is round
        item = gl.GLMeshItem(meshdata=data, smooth=False)
        item._setView(self._stage)  # noqa: SLF001 - pyqtgraph has no other way to give a camera
        return item

    def draw_solid(self, camera_from_body: Floats, look: Look) -> None:
        """Draw what is solid."""
        self._draw(self._solid, camera_from_body, look, _SOLID)

    def draw_glass(self, camera_from_body: Floats, look: Look) -> None:
        """Draw what can be seen through."""
        self._draw(self._glass, camera_from_body, look, _GLASS)

    def draw_ghost(self, camera_from_body: Floats, look: Look) -> None:
        """Draw all of it as something that can be seen through."""
        self._draw(self._solid, camera_from_body, look, _GLASS)
        self._draw(self._glass, camera_from_body, look, _GLASS)

    def _draw(self, item: Any, camera_from_body: Floats, look: Look, how: Any) -> None:
        if item is None:
            return
        self._stage.camera_from_item = matrix(camera_from_body)
        shader = self._stage.shader(stripes=look.stripes)
        set_look(shader, look.tint, look.share, look.opacity)
        item.setShader(shader)
        item.setGLOptions(how)
        item.paint()

    def release(self) -> None:
        """Give back its buffers; its context must be current."""
        for item in (self._solid, self._glass):
            if item is not None:
                for name in _BUFFERS:
                    getattr(item, name).destroy()


def matrix(values: Floats) -> QMatrix4x4:
    """Return a 4 x 4 array as Qt's matrix."""
    return QMatrix4x4(*(float(value) for value in values.reshape(16)))
