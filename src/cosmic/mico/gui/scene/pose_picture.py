"""Small pictures of poses: the platform from above as it would stand there."""

from typing import Final

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPen, QPixmap, QTransform

from cosmic.frame.gui.painting import painting
from cosmic.frame.gui.palette import Palette, blend
from cosmic.frame.gui.theme import current_palette
from cosmic.mico.core.collision.model import SceneModel
from cosmic.mico.core.poses import Pose
from cosmic.mico.gui.scene.arms import moving_ends
from cosmic.mico.gui.scene.content import SceneContent
from cosmic.mico.gui.scene.outlines import TOP, Outline, Outlines

SIZE: Final = QSize(64, 44)


class PosePictures:
    """Draws poses from above, and keeps what it drew; GUI thread.

    The bodies that the axes of a pose move are in its colours, the others are outlines, where they
    stand with all axes at 0.
    """

    def __init__(self, model: SceneModel) -> None:
        self._model = model
        self._content: SceneContent | None = None
        self._outlines = Outlines()
        self._drawn: dict[tuple[object, ...], QPixmap] = {}

    def of(self, pose: Pose) -> QPixmap:
        """Return the picture of a pose, drawn now if need be."""
        palette = current_palette()
        key = (palette.name, *sorted(pose.positions.items()))
        if key not in self._drawn:
            self._drawn[key] = self._draw(pose, palette)
        return self._drawn[key]

    def _draw(self, pose: Pose, palette: Palette) -> QPixmap:
        content = self._content
        if content is None:
            content = self._content = SceneContent()
            content.set_model(self._model)
        ends = moving_ends(self._model)
        content.set_positions(dict.fromkeys(self._model_axes(), 0.0) | dict(pose.positions))
        arms = {axis.split(".")[0] for axis in pose.positions}
        own = {each.body for each in ends if each.arm in arms}
        home = next(each for each in content.presets if each.name == "home")
        sight = content.sight(home)
        picture = QPixmap(SIZE * 2)
        picture.setDevicePixelRatio(2.0)
        picture.fill(QColor(palette.window))
        px_mm = SIZE.height() / 2.0 / sight.radius_mm
        x_mm, y_mm, _ = sight.centre_mm
        to_picture = QTransform(px_mm, 0.0, 0.0, -px_mm, SIZE.width() / 2.0, SIZE.height() / 2.0)
        to_picture = QTransform.fromTranslate(-x_mm, -y_mm) * to_picture
        outlines = [
            outline
            for body, mesh in content.meshes.items()
            for outline in self._outlines.of(mesh, content.poses[body], TOP)
        ]
        with painting(picture) as painter:
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            for outline in sorted(outlines, key=lambda each: each.nearest_mm):
                painter.setTransform(QTransform.fromTranslate(*outline.shift_mm) * to_picture)
                _draw_outline(painter, outline, palette, filled=outline.body in own)
            painter.resetTransform()
            painter.setPen(QColor(palette.border_strong))
            painter.setBrush(Qt.BrushStyle.NoBrush)
            painter.drawRect(QRectF(0.5, 0.5, SIZE.width() - 1.0, SIZE.height() - 1.0))
        return picture

    def _model_axes(self) -> tuple[str, ...]:
        return tuple(drive.axis for drive in self._model.drives)


def _draw_outline(painter: QPainter, outline: Outline, palette: Palette, *, filled: bool) -> None:
    red, green, blue, _ = outline.colour
    colour = QColor.fromRgbF(red, green, blue)
    edge = blend(colour.name(), palette.text, 0.6) if filled else palette.border_strong
    pen = QPen(QColor(edge), 1.0)
    pen.setCosmetic(True)
    painter.setPen(pen)
    painter.setBrush(colour if filled else Qt.BrushStyle.NoBrush)
    painter.drawPolygon(outline.shape_mm)
