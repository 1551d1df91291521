"""The bodies as items of pyqtgraph.opengl, drawn by their own camera into any context."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import pyqtgraph.opengl as gl
from OpenGL import GL
from pyqtgraph.opengl.items.GLMeshItem import DirtyFlag
from pyqtgraph.opengl.shaders import FragmentShader, ShaderProgram, VertexShader
from PySide6.QtGui import QMatrix4x4

from cosmic.mico.core.collision.model import Floats
from cosmic.mico.gui.scene.meshes import BodyMesh, Bools

_VERTEX: Final = """
    uniform mat4 u_mvp;
    uniform mat3 u_normal;
    uniform float u_look[5];  // red, green, blue of a tint, its share, opacity of the whole
    attribute vec4 a_position;
    attribute vec3 a_normal;
    attribute vec4 a_color;
    varying vec4 v_color;
    #ifdef STRIPES
    varying vec4 v_own;
    #endif
    void main() {
        float sky = 0.5 + 0.5 * dot(normalize(u_normal * a_normal), vec3(-0.36, 0.74, 0.57));
        float light = mix(0.34, 1.08, sky * sky * (3.0 - 2.0 * sky));
        vec3 tint = vec3(u_look[0], u_look[1], u_look[2]);
        v_color = vec4(light * mix(a_color.rgb, tint, u_look[3]), a_color.a * u_look[4]);
    #ifdef STRIPES
        v_own = vec4(light * a_color.rgb, v_color.a);
    #endif
        gl_Position = u_mvp * a_position;
    }
"""

_FRAGMENT: Final = """
    #ifdef GL_ES
    precision mediump float;
    #endif
    varying vec4 v_color;
    #ifdef STRIPES
    varying vec4 v_own;
    #endif
    void main() {
    #ifdef STRIPES
        bool own = fract((gl_FragCoord.x + gl_FragCoord.y) / 12.0) < 0.5;
        gl_FragColor = own ? v_own : v_color;
    #else
        gl_FragColor = v_color;
    #endif
    }
"""


def light_shader(*, stripes: bool = False) -> Any:
    """Return a new program, which tints what it draws, or stripes it; one a context."""
    head = "#define STRIPES\n" if stripes else ""
    return ShaderProgram(None, [VertexShader(head + _VERTEX), FragmentShader(head + _FRAGMENT)])


def set_look(
    shader: Any,
    tint: tuple[float, float, float] = (0.0, 0.0, 0.0),
    share: float = 0.0,
    opacity: float = 1.0,
) -> None:
    """Have what is drawn next with `shader` look so."""
    shader["u_look"] = (*tint, share, opacity)


_BUFFERS: Final = ("m_vbo_position", "m_vbo_normal", "m_vbo_color", "m_ibo_faces")
_ALL: Final = DirtyFlag.POSITION | DirtyFlag.NORMAL | DirtyFlag.COLOR | DirtyFlag.FACES
_SOLID: Final = {GL.GL_DEPTH_TEST: True, GL.GL_BLEND: False, GL.GL_CULL_FACE: True}
_BLENDED: Final = (
    GL.GL_SRC_ALPHA,
    GL.GL_ONE_MINUS_SRC_ALPHA,
    GL.GL_ONE,
    GL.GL_ONE_MINUS_SRC_ALPHA,
)
_GLASS: Final = _SOLID | {GL.GL_BLEND: True, "glBlendFuncSeparate": _BLENDED}
"""Back faces are left out of glass too: one layer a body says enough."""


class ItemsView:
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
    """One body in OpenGL: what is solid of it, and what can be seen through.

    Its context must be current when it is made.
    """

    def __init__(self, mesh: BodyMesh, items_view: ItemsView) -> None:
        self.body = mesh.body
        self._items_view = items_view
        low, high = mesh.bounds_mm
        self.middle_mm = (low + high) / 2.0
        self._solid = self._item(mesh, ~mesh.glass)
        self._glass = self._item(mesh, mesh.glass)

    def _item(self, mesh: BodyMesh, which: Bools) -> Any:
        if not which.any():
            return None
        item = gl.GLMeshItem()
        # Handed over ready: pyqtgraph's own normals are made in a loop, and are soft at edges.
        item.vertexes, item.normals, item.colors, item.faces = indexed(mesh, which)
        item._setView(self._items_view)  # noqa: SLF001 - pyqtgraph has no other way to give a camera
        item.upload_vertex_buffers(_ALL)
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
        self._items_view.camera_from_item = matrix(camera_from_body)
        shader = self._items_view.shader(stripes=look.stripes)
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


def indexed(
    mesh: BodyMesh, which: Bools
) -> tuple[
    npt.NDArray[np.float32],
    npt.NDArray[np.float32],
    npt.NDArray[np.float32],
    npt.NDArray[np.uint32],
]:
    """Return vertices, normals, colours and faces of some triangles, each vertex once.

    A processor that draws works out the light at every vertex: three a triangle would be six times
    as many as there are.
    """
    colours = np.repeat(mesh.colours[which][:, None, :], 3, axis=1)
    corners = np.concatenate([mesh.corners_mm[which], mesh.normals[which], colours], axis=2)
    rows = np.round(corners.reshape(-1, 10), 6)
    vertices, faces = np.unique(rows, axis=0, return_inverse=True)
    place, normals, shades = (
        np.ascontiguousarray(part, dtype=np.float32) for part in np.split(vertices, (3, 6), axis=1)
    )
    return place, normals, shades, faces.astype(np.uint32).reshape(-1, 3)


def matrix(values: Floats) -> QMatrix4x4:
    """Return a 4 x 4 array as Qt's matrix."""
    return QMatrix4x4(*(float(value) for value in values.reshape(16)))
