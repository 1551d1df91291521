"""The scene in OpenGL: solid bodies, then glass, then what was refused, then words over it."""

from typing import Final

import numpy as np
from OpenGL import GL
from PySide6.QtCore import QPointF, QRectF, QSize
from PySide6.QtGui import QColor, QImage, QPaintEvent, QWheelEvent
from PySide6.QtWidgets import QWidget

from cosmic.frame.errors import NotAvailable
from cosmic.frame.gui.painting import painting
from cosmic.frame.overrides import override
from cosmic.mico.core.collision.model import Floats
from cosmic.mico.gui.scene.annotations import draw_legend, draw_measured
from cosmic.mico.gui.scene.camera import Camera, Sight
from cosmic.mico.gui.scene.content import SceneContent
from cosmic.mico.gui.scene.gl_context import GLContext
from cosmic.mico.gui.scene.gl_items import BodyItem, ItemsView, Look, matrix
from cosmic.mico.gui.scene.picking import Ray, pick
from cosmic.mico.gui.scene.view import SceneView

_DEG_PX: Final = 0.4
_SMOOTH_PX: Final = 250_000
_SMOOTH_TRIANGLES: Final = 6_000
_PLAIN: Final = Look()


class GLSceneView(SceneView):
    """Draws the scene with OpenGL into an image and paints that; GUI thread.

    Parameters
    ----------
    context : GLContext
        Its own from now on.
    """

    def __init__(
        self, content: SceneContent, context: GLContext, parent: QWidget | None = None
    ) -> None:
        super().__init__(content, parent)
        self._context = context
        self._items_view = ItemsView()
        self._items: dict[str, BodyItem] = {}
        self._camera = Camera()
        self._image: QImage | None = None

    @override
    def rebuild(self) -> None:
        self.release()
        self.refresh()

    @override
    def refresh(self) -> None:
        self._image = None
        self.update()

    @override
    def look(self, sight: Sight) -> None:
        self._camera = Camera(sight)
        self.refresh()

    @override
    def release(self) -> None:
        self._context.release(self._release)
        self._image = None

    def _release(self) -> None:
        for item in self._items.values():
            item.release()
        self._items = {}

    # Painting

    @override
    def paintEvent(self, event: QPaintEvent) -> None:
        ratio = self.devicePixelRatioF()
        size = QSize(round(self.width() * ratio), round(self.height() * ratio))
        if self._image is None or self._image.size() != size:
            try:
                self._image = self._context.draw(size, self._draw_scene, smooth=self._smooth(size))
            except (NotAvailable, GL.GLError, RuntimeError) as exc:  # a shader: RuntimeError
                self.failed.emit(str(exc))
                return
            self._image.setDevicePixelRatio(ratio)
            self.frames += 1
        palette = self.theme()
        with painting(self) as painter:
            painter.drawImage(0, 0, self._image)
            px_mm = self._camera.px_mm(self.width(), self.height())
            draw_measured(painter, self.content, self._project, self._camera.axes, px_mm, palette)
            draw_legend(painter, self.content, QRectF(self.rect()), palette)
            self.draw_hovered(painter, palette)

    def _smooth(self, size: QSize) -> bool:
        """Tell whether soft edges leave 20 pictures per second."""
        few = size.width() * size.height() <= _SMOOTH_PX
        return not self._context.software or (few and self.content.triangles <= _SMOOTH_TRIANGLES)

    def _project(self, points_mm: Floats) -> Floats:
        return self._camera.project(points_mm, self.width(), self.height())[0]

    def _draw_scene(self) -> None:
        if not self._items:
            self._items = {
                body: BodyItem(mesh, self._items_view) for body, mesh in self.content.meshes.items()
            }
        GL.glClearColor(*_rgb(self.theme().window), 1.0)
        GL.glClear(GL.GL_COLOR_BUFFER_BIT | GL.GL_DEPTH_BUFFER_BIT)
        self._items_view.projection = matrix(self._camera.projection(self.width(), self.height()))
        self._draw_solid(self._camera.view())
        GL.glDepthMask(GL.GL_FALSE)
        self._draw_glass(self._camera.view())
        GL.glDepthMask(GL.GL_TRUE)

    def _draw_solid(self, camera_from_world: Floats) -> None:
        poses = self.content.poses
        shown = [self._items[body] for body in self.content.shown]
        # The nearest first: what lies behind it then costs no light.
        shown.sort(key=lambda item: self._distance_mm(item, poses[item.body]))
        for item in shown:
            item.draw_solid(camera_from_world @ poses[item.body], self._look_of(item.body))

    def _draw_glass(self, camera_from_world: Floats) -> None:
        content = self.content
        ghost = Look(_rgb(self.theme().refused), share=0.85, opacity=0.5)
        through: list[tuple[BodyItem, Floats, Look | None]] = [
            (self._items[body], content.poses[body], None)
            for body, mesh in content.shown.items()
            if mesh.glass.any()
        ]
        through += [
            (self._items[body], pose, ghost)
            for body, pose in content.ghosts.items()
            if body not in content.hidden
        ]
        through.sort(key=lambda each: -self._distance_mm(each[0], each[1]))
        for item, pose, look in through:
            if look is not None:
                item.draw_ghost(camera_from_world @ pose, look)
            else:
                item.draw_glass(camera_from_world @ pose, self._look_of(item.body))

    def _distance_mm(self, item: BodyItem, pose: Floats) -> float:
        middle = pose[:3, :3] @ item.middle_mm + pose[:3, 3]
        return float(np.linalg.norm(middle - self._camera.place_mm))

    def _look_of(self, body: str) -> Look:
        if body in self.content.unwatched:
            return Look(_rgb(self.theme().warning), share=0.75, stripes=True)
        return _PLAIN

    # The mouse

    @override
    def body_at(self, place: QPointF) -> str:
        content = self.content
        return pick(content.meshes, content.poses, self.ray_at(place), content.hidden)

    @override
    def ray_at(self, place: QPointF) -> Ray:
        return Ray(*self._camera.ray(place.x(), place.y(), self.width(), self.height()))

    @override
    def drag(self, before: QPointF, now: QPointF, *, turn: bool) -> None:
        right, down = now.x() - before.x(), now.y() - before.y()
        if turn:
            self._camera = self._camera.orbit(-_DEG_PX * right, _DEG_PX * down)
        else:
            px_mm = self._camera.px_mm(self.width(), self.height())
            self._camera = self._camera.pan(-right / px_mm, down / px_mm)
        self.refresh()

    @override
    def wheelEvent(self, event: QWheelEvent) -> None:
        self._camera = self._camera.zoom(1.0015 ** event.angleDelta().y())
        self.refresh()
        event.accept()


def _rgb(colour: str) -> tuple[float, float, float]:
    named = QColor(colour)
    return named.redF(), named.greenF(), named.blueF()
