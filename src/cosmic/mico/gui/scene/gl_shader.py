"""The light of the 3D view: a bright sky, a darker ground, seen with the camera.

The shader "shaded" of pyqtgraph leaves faces that look upwards almost black. Light is worked out at
the vertices: without a graphics card the time of a picture goes into its pixels.
"""

from typing import Any, Final

from pyqtgraph.opengl.shaders import FragmentShader, ShaderProgram, VertexShader

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
