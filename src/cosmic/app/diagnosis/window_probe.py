"""A process of its own that opens Qt, which ends it where no window can be shown.

Prints one line of JSON: the platform plug-in, the screens and who draws OpenGL.
"""

import json
import sys

from PySide6.QtGui import QGuiApplication, QOffscreenSurface, QOpenGLContext

VENDOR, RENDERER, VERSION = 0x1F00, 0x1F01, 0x1F02


def drawn_by() -> str:
    """Return the renderer and version of OpenGL; empty where there is none."""
    surface, context = QOffscreenSurface(), QOpenGLContext()
    surface.create()
    if not context.create() or not context.makeCurrent(surface):
        return ""
    functions = context.functions()
    words = [str(functions.glGetString(each)) for each in (RENDERER, VERSION)]
    context.doneCurrent()
    return ", OpenGL ".join(words)


def main() -> int:
    """Print what is there; returns the exit code."""
    app = QGuiApplication(sys.argv[:1])
    screens = [f"{each.size().width()}x{each.size().height()}" for each in app.screens()]
    seen = {"platform": app.platformName(), "screens": screens, "opengl": drawn_by()}
    sys.stdout.write(json.dumps(seen) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
