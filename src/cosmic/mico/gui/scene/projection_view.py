"""The scene without OpenGL: seen from above and from the front or the side, as outlines."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import (
    QBrush,
    QColor,
    QPainter,
    QPaintEvent,
    QPen,
    QPixmap,
    QResizeEvent,
    QTransform,
    QWheelEvent,
)
from PySide6.QtWidgets import QWidget

from cosmic.frame.gui.painting import painting, saved
from cosmic.frame.gui.palette import Palette, blend
from cosmic.frame.gui.theme import STEP_PX, number_font, ui_font
from cosmic.frame.overrides import override
from cosmic.mico.core.collision.model import Floats
from cosmic.mico.gui.scene.annotations import (
    draw_annotations,
    draw_ground,
    draw_legend,
    round_length,
)
from cosmic.mico.gui.scene.camera import Sight
from cosmic.mico.gui.scene.content import SceneContent
from cosmic.mico.gui.scene.outlines import FRONT, SIDE, TOP, Outline, Outlines, Plane, eye
from cosmic.mico.gui.scene.picking import Ray, pick
from cosmic.mico.gui.scene.view import SceneView

_TITLES: Final = {TOP: "Top", FRONT: "Front", SIDE: "Side"}
_AXIS_PX: Final = 28
_INSET_PX: Final = 40 * STEP_PX
_RIM_PX: Final = 3.0
"""In less width there is one picture, from above, without rulers: two are too small to read."""


@dataclass(frozen=True)
class Panel:
    """One of the two pictures: where it is on the widget, and what is where in it."""

    plane: Plane
    box: QRectF
    centre_mm: tuple[float, float, float]
    px_mm: float
    cut_mm: float

    @property
    def begins_mm(self) -> float:
        """How far towards the eye the picture begins; what lies wholly before is not filled."""
        return eye(self.plane) * self.centre_mm[self.plane[2]] + self.cut_mm

    def project(self, points_mm: Floats) -> Floats:
        """Return where points of the world are, shape (n, 2), px."""
        right, up = self.plane[:2]
        middle = self.box.center()
        x = middle.x() + (points_mm[:, right] - self.centre_mm[right]) * self.px_mm
        y = middle.y() - (points_mm[:, up] - self.centre_mm[up]) * self.px_mm
        return np.stack([x, y], axis=1)

    @property
    def to_widget(self) -> QTransform:
        """From millimetres in the plane to the widget."""
        right, up = self.plane[:2]
        middle, scale = self.box.center(), self.px_mm
        return QTransform(
            scale,
            0.0,
            0.0,
            -scale,
            middle.x() - self.centre_mm[right] * scale,
            middle.y() + self.centre_mm[up] * scale,
        )

    def ray(self, place: QPointF) -> Ray:
        """Return the line of sight at a place of the widget."""
        right, up, towards = self.plane
        from_middle = place - self.box.center()
        direction, origin = np.zeros(3), np.array(self.centre_mm)
        origin[right] += from_middle.x() / self.px_mm
        origin[up] -= from_middle.y() / self.px_mm
        direction[towards] = -eye(self.plane)
        return Ray(origin - self.cut_mm * direction, direction)


class ProjectionView(SceneView):
    """Shows the scene from above, and below or beside that from the front or the side.

    Parameters
    ----------
    reason : str
        Why this is shown and not the 3D view; stands in the picture.
    """

    def __init__(
        self, content: SceneContent, reason: str = "", parent: QWidget | None = None
    ) -> None:
        super().__init__(content, parent)
        self._reason = reason
        self._sight = Sight()
        self._upright: Plane = FRONT
        self._outlines = Outlines()
        self._image: QPixmap | None = None

    @property
    def reason(self) -> str:
        """Why this is shown and not the 3D view."""
        return self._reason

    @override
    def rebuild(self) -> None:
        self._outlines.clear()
        self.refresh()

    @override
    def refresh(self) -> None:
        self._image = None
        self.update()

    @override
    def look(self, sight: Sight) -> None:
        self._sight = sight
        self._upright = SIDE if abs(sight.azimuth_deg) < 45.0 else FRONT
        self.refresh()

    @property
    def small(self) -> bool:
        """There is room for one picture only."""
        return self.width() < _INSET_PX

    def panels(self) -> tuple[Panel, ...]:
        """Return the two pictures as they lie on the widget now; the one where that is small."""
        width, height = float(self.width()), float(self.height())
        if self.small:
            px_mm = min(width, height) / 2.0 / self._sight.radius_mm
            box = QRectF(0, 0, width, height)
            return (Panel(TOP, box, self._sight.centre_mm, px_mm, self._sight.cut_mm),)
        if width > 1.2 * height:
            half = (width - STEP_PX) / 2.0
            boxes = QRectF(0, 0, half, height), QRectF(half + STEP_PX, 0, half, height)
        else:
            half = (height - STEP_PX) / 2.0
            boxes = QRectF(0, 0, width, half), QRectF(0, half + STEP_PX, width, half)
        inner = [box.adjusted(_AXIS_PX, 0, 0, -_AXIS_PX + STEP_PX) for box in boxes]
        px_mm = min(min(box.width(), box.height()) for box in inner) / 2.0 / self._sight.radius_mm
        centre, cut_mm = self._sight.centre_mm, self._sight.cut_mm
        return (
            Panel(TOP, inner[0], centre, px_mm, cut_mm),
            Panel(self._upright, inner[1], centre, px_mm, cut_mm),
        )

    # Painting

    @override
    def paintEvent(self, event: QPaintEvent) -> None:
        palette, panels = self.theme(), self.panels()
        if self._image is None or self._image.devicePixelRatio() != self.devicePixelRatioF():
            self._image = self._drawn(panels, palette)
            self.frames += 1
        with painting(self) as painter:
            painter.drawPixmap(0, 0, self._image)
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            for panel in panels:
                with saved(painter):
                    painter.setClipRect(panel.box)
                    draw_annotations(painter, self.content, panel.project, palette)
                    _draw_title(painter, panel, palette, short=self.small)
            notes = [f"{self._reason}: projections"] if self._reason and not self.small else []
            room = panels[0].box.adjusted(0, 2.5 * STEP_PX, 0, 0)
            draw_legend(painter, self.content, room, palette, notes)
            self.draw_hovered(painter, palette)

    @override
    def resizeEvent(self, event: QResizeEvent) -> None:
        self._image = None
        super().resizeEvent(event)

    def _drawn(self, panels: tuple[Panel, ...], palette: Palette) -> QPixmap:
        """Return rulers and bodies as they are now: kept, for they take most of the time."""
        ratio = self.devicePixelRatioF()
        image = QPixmap(self.size() * ratio)
        image.setDevicePixelRatio(ratio)
        image.fill(QColor(palette.panel))
        with painting(image) as painter:
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            for panel in panels:
                painter.fillRect(panel.box, QColor(palette.window))
                if not self.small:
                    _draw_rulers(painter, panel, palette)
                with saved(painter):
                    painter.setClipRect(panel.box)
                    self._draw_bodies(painter, panel, palette)
        return image

    def _draw_bodies(self, painter: QPainter, panel: Panel, palette: Palette) -> None:
        shown = self.content.shown
        outlines = [
            outline
            for body, mesh in shown.items()
            for outline in self._outlines.of(mesh, self.content.poses[body], panel.plane)
        ]
        to_widget = panel.to_widget
        for outline in sorted(outlines, key=lambda each: each.nearest_mm):
            place = QTransform.fromTranslate(*outline.shift_mm) * to_widget
            if place.mapRect(outline.shape_mm.boundingRect()).intersects(panel.box):
                painter.setTransform(place)
                self._draw_outline(painter, panel, outline, palette)
        painter.setPen(_pen(palette.refused, 1.5, Qt.PenStyle.DashLine))
        ground = QColor(palette.refused)
        ground.setAlphaF(0.3)
        painter.setBrush(ground)
        ghosts = Outlines()  # of its own: it must not spoil what is known of the live bodies
        for body, pose in self.content.ghosts.items():
            if body in shown:
                for outline in ghosts.of(shown[body], pose, panel.plane):
                    painter.setTransform(QTransform.fromTranslate(*outline.shift_mm) * to_widget)
                    painter.drawPolygon(outline.shape_mm)

    def _draw_outline(
        self, painter: QPainter, panel: Panel, outline: Outline, palette: Palette
    ) -> None:
        red, green, blue, opacity = outline.colour
        if outline.farthest_mm > panel.begins_mm:
            painter.setPen(_pen(palette.border_strong, 1.0, Qt.PenStyle.DotLine))
            painter.setBrush(Qt.BrushStyle.NoBrush)
            painter.drawPolygon(outline.shape_mm)
            return
        fill = QColor.fromRgbF(red, green, blue, 0.8 * opacity)
        edge = blend(QColor.fromRgbF(red, green, blue).name(), palette.text, 0.6)
        painter.setPen(_pen(palette.window, _RIM_PX))  # else jaws are lost over a bright plate
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.drawPolygon(outline.shape_mm)
        painter.setPen(_pen(edge, 1.0))
        painter.setBrush(fill)
        painter.drawPolygon(outline.shape_mm)
        if outline.body in self.content.unwatched:
            hatch = QBrush(QColor(palette.warning), Qt.BrushStyle.BDiagPattern)
            hatch.setTransform(painter.transform().inverted()[0])  # in pixels, not in millimetres
            painter.setBrush(hatch)
            painter.drawPolygon(outline.shape_mm)

    # The mouse

    def _panel_at(self, place: QPointF) -> Panel | None:
        return next((panel for panel in self.panels() if panel.box.contains(place)), None)

    @override
    def body_at(self, place: QPointF) -> str:
        panel = self._panel_at(place)
        if panel is None:
            return ""
        content = self.content
        return pick(content.meshes, content.poses, panel.ray(place), content.hidden)

    @override
    def ray_at(self, place: QPointF) -> Ray | None:
        panel = self._panel_at(place)
        return None if panel is None else panel.ray(place)

    @override
    def drag(self, before: QPointF, now: QPointF, *, turn: bool) -> None:
        panel = self._panel_at(before)
        if panel is None:
            return
        centre, moved = list(self._sight.centre_mm), now - before
        centre[panel.plane[0]] -= moved.x() / panel.px_mm
        centre[panel.plane[1]] += moved.y() / panel.px_mm
        x, y, z = centre
        self._sight = replace(self._sight, centre_mm=(x, y, z))
        self.refresh()

    @override
    def wheelEvent(self, event: QWheelEvent) -> None:
        radius = self._sight.radius_mm * 1.0015 ** -event.angleDelta().y()
        self._sight = replace(self._sight, radius_mm=float(np.clip(radius, 0.2, 5000.0)))
        self.refresh()
        event.accept()


def _pen(colour: str, width: float, style: Qt.PenStyle = Qt.PenStyle.SolidLine) -> QPen:
    """Return a pen as wide as it says, in pixels, however the painter scales."""
    pen = QPen(QColor(colour), width, style)
    pen.setCosmetic(True)
    return pen


def _draw_title(painter: QPainter, panel: Panel, palette: Palette, *, short: bool) -> None:
    painter.setFont(ui_font(12, bold=True))
    axes = ", ".join("xyz"[number] for number in panel.plane[:2])
    box = panel.box.adjusted(STEP_PX, STEP_PX / 2, -STEP_PX, 0)
    text = _TITLES[panel.plane] if short else f"{_TITLES[panel.plane]}  {axes} in mm"
    draw_ground(painter, painter.boundingRect(box, Qt.AlignmentFlag.AlignLeft, text), palette)
    painter.drawText(box, Qt.AlignmentFlag.AlignLeft, text)


def _draw_rulers(painter: QPainter, panel: Panel, palette: Palette) -> None:
    painter.setFont(number_font(11))
    step = round_length(70.0 / panel.px_mm)
    box, middle = panel.box, panel.box.center()
    for across, direction in ((True, panel.plane[0]), (False, panel.plane[1])):
        centre = panel.centre_mm[direction]
        half = (box.width() if across else box.height()) / 2.0 / panel.px_mm
        first, last = np.ceil((centre - half) / step), np.floor((centre + half) / step)
        for number in np.arange(first, last + 1):
            shift = (number * step - centre) * panel.px_mm
            text = f"{number * step + 0.0:.6g}"  # never -0
            painter.setPen(QPen(QColor(palette.border), 1.0))
            if across:
                x = middle.x() + shift
                painter.drawLine(QPointF(x, box.top()), QPointF(x, box.bottom()))
                place = QRectF(x - 30, box.bottom() + 1, 60, 16)
                align = Qt.AlignmentFlag.AlignHCenter
            else:
                y = middle.y() - shift
                painter.drawLine(QPointF(box.left(), y), QPointF(box.right(), y))
                place = QRectF(box.left() - 34, y - 8, 31, 16)
                align = Qt.AlignmentFlag.AlignRight
            painter.setPen(QColor(palette.dim))
            painter.drawText(place, align, text)
