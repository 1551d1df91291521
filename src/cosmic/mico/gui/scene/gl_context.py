"""OpenGL without a window: a context that draws into an image.

A QOpenGLWidget would have Qt compose the whole operator window through OpenGL, which costs every
other panel dearly where OpenGL is software, and it loses its context when its dock is taken out.
"""

import logging
from collections.abc import Callable
from typing import Final

from PySide6.QtCore import QMessageLogContext, QSize, QtMsgType, qInstallMessageHandler
from PySide6.QtGui import (
    QGuiApplication,
    QImage,
    QOffscreenSurface,
    QOpenGLContext,
    QSurfaceFormat,
)
from PySide6.QtOpenGL import QOpenGLFramebufferObject, QOpenGLFramebufferObjectFormat

from cosmic.frame.errors import NotAvailable

logger = logging.getLogger(__name__)

_WITHOUT: Final = ("offscreen", "minimal", "minimalegl", "vnc", "linuxfb")
_SAMPLES: Final = 4
_SOFTWARE: Final = ("llvmpipe", "softpipe", "swrast", "swiftshader", "basic render", "gdi generic")
_GL_RENDERER: Final = 0x1F01


class GLContext:
    """A context of OpenGL 2.1 or later of its own; GUI thread.

    Raises
    ------
    NotAvailable
        There is no OpenGL here.
    """

    def __init__(self) -> None:
        platform = QGuiApplication.platformName()
        if platform in _WITHOUT:
            raise NotAvailable(f"no OpenGL on the display {platform!r}")
        self._frame: QOpenGLFramebufferObject | None = None
        self._samples = 0
        self._renderer = ""
        self._context, self._surface = _make_quietly()
        try:
            self.make_current()
            self._check()
        finally:
            self._context.doneCurrent()

    def _check(self) -> None:
        version = self._context.format().version()
        if not (version >= (2, 1) and not self._context.isOpenGLES()):
            raise NotAvailable(f"OpenGL 2.1 is needed, there is {version[0]}.{version[1]}")
        if not QOpenGLFramebufferObject.hasOpenGLFramebufferObjects():
            raise NotAvailable("OpenGL cannot draw into images here")
        self._renderer = str(self._context.functions().glGetString(_GL_RENDERER))

    @property
    def renderer(self) -> str:
        """What draws: the name of a graphics card, or of a software."""
        return self._renderer

    @property
    def software(self) -> bool:
        """Whether the processor draws."""
        return any(name in self._renderer.lower() for name in _SOFTWARE)

    def make_current(self) -> None:
        """Have what follows go to this context."""
        if not self._context.makeCurrent(self._surface):
            raise NotAvailable("OpenGL does not answer any more")

    def draw(self, size: QSize, paint: Callable[[], None], *, smooth: bool = True) -> QImage:
        """Call `paint` with this context current and return the picture it made.

        Parameters
        ----------
        smooth : bool
            Soften the edges; takes up to four times as long where the processor draws.

        Raises
        ------
        NotAvailable
            The context is lost, or there is no memory for a picture of this size.
        """
        self.make_current()
        try:
            frame = self._frame_of(size, _SAMPLES if smooth else 0)
            if not frame.bind():
                raise NotAvailable(f"OpenGL cannot make {size.width()} x {size.height()} px")
            self._context.functions().glViewport(0, 0, size.width(), size.height())
            paint()
            frame.release()
            return frame.toImage()
        finally:
            self._context.doneCurrent()

    def _frame_of(self, size: QSize, samples: int) -> QOpenGLFramebufferObject:
        if self._frame is None or (self._frame.size(), self._samples) != (size, samples):
            wanted = QOpenGLFramebufferObjectFormat()
            wanted.setAttachment(QOpenGLFramebufferObject.Attachment.CombinedDepthStencil)
            wanted.setSamples(samples)
            self._samples = samples
            self._frame = None  # first give back, then take
            self._frame = QOpenGLFramebufferObject(size, wanted)
        return self._frame

    def release(self, give_back: Callable[[], None]) -> None:
        """Call `give_back` with the context current, and drop the picture."""
        if not self._context.makeCurrent(self._surface):
            return
        give_back()
        self._frame = None
        self._context.doneCurrent()


def _make_quietly() -> tuple[QOpenGLContext, QOffscreenSurface]:
    said: list[str] = []

    def hear(_kind: QtMsgType, _where: QMessageLogContext, text: str) -> None:
        said.append(text)

    before = qInstallMessageHandler(hear)
    try:
        context, surface = QOpenGLContext(), QOffscreenSurface()
        wanted = QSurfaceFormat()
        wanted.setVersion(2, 1)
        wanted.setDepthBufferSize(24)
        context.setFormat(wanted)
        made = context.create()
        if made:
            surface.setFormat(context.format())
            surface.create()
    finally:
        qInstallMessageHandler(before)
    for text in said:
        logger.debug("while looking for OpenGL: %s", text)
    if not (made and surface.isValid()):
        raise NotAvailable("no OpenGL here")
    return context, surface
