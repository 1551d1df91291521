"""Layers over the image that only show: crosshair, scale bar, note, a tool where it would stand."""

import math
from collections.abc import Sequence
from typing import Final

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QFontMetricsF, QPainter, QPainterPath, QPen

from cosmic.frame.gui.palette import ON_IMAGE
from cosmic.frame.gui.theme import STEP_PX, current_palette
from cosmic.frame.overrides import override
from cosmic.vico.api.coordinate_transform import Pixel
from cosmic.vico.gui.image_view import CameraImageView, Layer
from cosmic.vico.gui.ink import GREEN, HALO, ORANGE, SKY, WHITE, ink_font, label, line, pen, stroke

BAR_SHARE: Final = 0.25
EDGE_PX: Final = 2 * STEP_PX


def round_length(most: float) -> float:
    """Return the largest of 1, 2, 5, 10, ... that is at most `most`."""
    if most <= 0.0:
        return 0.0
    power = 10.0 ** math.floor(math.log10(most))
    return max(factor * power for factor in (1.0, 2.0, 5.0) if factor * power <= most * 1.0001)


def _visible(view: CameraImageView) -> QRectF:
    """Return where the image lies on the screen; all of the view where that is too little."""
    width, height = view.size_px
    whole = QRectF(view.rect())
    seen = view.to_screen.mapRect(QRectF(-0.5, -0.5, width, height)).intersected(whole)
    return seen if min(seen.width(), 2.0 * seen.height()) >= 20 * STEP_PX else whole


class Crosshair(Layer):
    """Marks the middle of the image."""

    def __init__(self) -> None:
        self.shown = False

    @override
    def paint(self, painter: QPainter, view: CameraImageView) -> None:
        width, height = view.size_px
        if not self.shown or not width:
            return
        to = view.to_screen
        middle = to.map(QPointF((width - 1) / 2.0, (height - 1) / 2.0))
        box = to.mapRect(QRectF(-0.5, -0.5, width, height))
        painter.setRenderHint(QPainter.RenderHint.Antialiasing, on=False)
        thin = pen(SKY, 1.0 if float(view.devicePixelRatioF()) == 1.0 else 1.5)
        line(painter, QPointF(box.left(), middle.y()), QPointF(box.right(), middle.y()), thin)
        line(painter, QPointF(middle.x(), box.top()), QPointF(middle.x(), box.bottom()), thin)


class ScaleBar(Layer):
    """Says how long something is, by the scale that was in force when the image was taken."""

    def __init__(self) -> None:
        self.shown = True
        self.text = ""
        self.length_px = 0.0
        """Of the bar, on the screen."""
        self.box = QRectF()
        """Where it was drawn; empty where it was not."""

    @override
    def paint(self, painter: QPainter, view: CameraImageView) -> None:
        if not self.shown or view.image is None:
            self.text, self.box = "", QRectF()
            return
        room = _visible(view)
        self._measure(view, room.width())
        ratio = float(view.devicePixelRatioF())
        font = ink_font()
        metrics = QFontMetricsF(font)
        width = max(self.length_px, metrics.horizontalAdvance(self.text)) + 2 * STEP_PX
        height = metrics.height() + 2 * STEP_PX
        # The scene's inset and the bar of the camera lie over the lower edge.
        box = QRectF(room.left() + EDGE_PX, room.top() + EDGE_PX, width, height)
        self.box = box
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(HALO)
        painter.drawRoundedRect(box, 3.0, 3.0)
        painter.setFont(font)
        painter.setPen(WHITE)
        text_box = box.adjusted(0, 2, 0, -STEP_PX - 2)
        painter.drawText(text_box, int(Qt.AlignmentFlag.AlignCenter), self.text)
        left = box.center().x() - self.length_px / 2.0
        y = box.bottom() - STEP_PX
        painter.setRenderHint(QPainter.RenderHint.Antialiasing, on=False)
        painter.setPen(QPen(WHITE, 3.0 / ratio if ratio > 1 else 3.0))
        painter.drawLine(QPointF(left, y), QPointF(left + self.length_px, y))

    def _measure(self, view: CameraImageView, width: float) -> None:
        image = view.image
        scale = image.circumstances.scale_um_px if image is not None else None
        screen_px = abs(view.to_screen.m11())  # for one pixel of the image
        room = BAR_SHARE * width
        if scale is None:
            length = round_length(room / screen_px)
            self.text, self.length_px = f"{length:g} px", length * screen_px
            return
        length = round_length(room / screen_px * scale)
        self.text = f"{length / 1e3:g} mm" if length >= 1e3 else f"{length:g} µm"
        self.length_px = length / scale * screen_px


class CornerText(Layer):
    """One line in the upper left corner of the view, on a dark ground.

    The scene's inset and the bar of the camera lie over the lower edge.

    Parameters
    ----------
    beside : ScaleBar, optional
        What has that corner, where it is shown: it is drawn before, and this at its right.
    below : sequence of ScaleBar or CornerText
        What is drawn before, and this below it.
    """

    def __init__(
        self, *, beside: ScaleBar | None = None, below: "Sequence[ScaleBar | CornerText]" = ()
    ) -> None:
        self.text = ""
        self.box = QRectF()
        """Where it was drawn; empty where it was not."""
        self._beside, self._below = beside, tuple(below)

    @override
    def paint(self, painter: QPainter, view: CameraImageView) -> None:
        self.box = QRectF()
        if not self.text:
            return
        font = ink_font(bold=False)
        metrics = QFontMetricsF(font)
        room = QRectF(view.rect()).adjusted(STEP_PX, STEP_PX, -STEP_PX, -STEP_PX)
        if self._beside is not None and not self._beside.box.isEmpty():
            room.setLeft(self._beside.box.right() + STEP_PX)
        above = [each.box for each in self._below if not each.box.isEmpty()]
        if above:
            room.setTop(max(box.bottom() for box in above) + STEP_PX)
            room.setLeft(min(box.left() for box in above))
        most = room.width() - 2 * STEP_PX
        flags = int(Qt.AlignmentFlag.AlignLeft | Qt.TextFlag.TextWordWrap)
        needed = metrics.boundingRect(QRectF(0.0, 0.0, most, room.height()), flags, self.text)
        box = QRectF(room.left(), room.top(), needed.width() + 2 * STEP_PX, needed.height() + 6)
        self.box = box
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(ON_IMAGE["text"]))
        painter.drawRoundedRect(box, 3.0, 3.0)
        painter.setFont(font)
        painter.setPen(WHITE)
        painter.drawText(box.adjusted(STEP_PX, 3, -STEP_PX + 2, -3), flags, self.text)


class Note(Layer):
    """One line across the image, for why it is not live."""

    def __init__(self) -> None:
        self.text = ""

    @override
    def paint(self, painter: QPainter, view: CameraImageView) -> None:
        if not self.text:
            return
        font = ink_font(15)
        metrics = QFontMetricsF(font)
        room = QRectF(view.rect()).adjusted(STEP_PX, STEP_PX, -STEP_PX, -STEP_PX)
        flags = int(Qt.AlignmentFlag.AlignCenter | Qt.TextFlag.TextWordWrap)
        needed = metrics.boundingRect(room.adjusted(24, 16, -24, -16), flags, self.text)
        box = needed.adjusted(-16, -10, 16, 10)
        box.moveCenter(room.center())
        painter.setPen(pen(QColor(current_palette().refused), 2.0))
        painter.setBrush(QColor(ON_IMAGE["notice"]))
        painter.drawRoundedRect(box, 4.0, 4.0)
        painter.setFont(font)
        painter.setPen(WHITE)
        painter.drawText(box.adjusted(8, 4, -8, -4), flags, self.text)


_BACK = 3.0
"""How far back a tool is outlined, in its widths."""
_CROSS_PX = 10.0


class GhostLayer(Layer):
    """Outlines a tool where it is aimed to; a refused target is dashed, with the reason."""

    def __init__(self) -> None:
        self.target_px: Pixel | None = None
        self.text = ""
        self.allowed = True
        self._from_px: Pixel | None = None
        self._forward: Pixel = (1.0, 0.0)
        self._width_px = 0.0
        self._gap_px = 0.0

    def aim(
        self,
        target_px: Pixel | None,
        *,
        from_px: Pixel | None = None,
        forward: Pixel = (1.0, 0.0),
        width_px: float = 0.0,
        gap_px: float = 0.0,
    ) -> None:
        """Show a tool with its tip at a pixel; None: none.

        Parameters
        ----------
        from_px : Pixel or None
            Where its tip is now; None where that is not known.
        forward : Pixel
            Which way the tool points.
        width_px, gap_px : float
            How wide it is, or each of its jaws, and how far these are apart.
        """
        self.target_px, self._from_px = target_px, from_px
        self._forward, self._width_px, self._gap_px = forward, width_px, gap_px

    def show_answer(self, text: str, *, allowed: bool) -> None:
        """Say what the gate answers."""
        self.text, self.allowed = text, allowed

    @override
    def paint(self, painter: QPainter, view: CameraImageView) -> None:
        if self.target_px is None:
            return
        to = view.to_screen
        tip = to.map(QPointF(*self.target_px))
        colour = GREEN if self.allowed else ORANGE
        made = pen(colour, 2.0, dashed=not self.allowed)
        path = QPainterPath()
        if self._from_px is not None:
            path.moveTo(to.map(QPointF(*self._from_px)))
            path.lineTo(tip)
        for across, up in ((_CROSS_PX, 0.0), (0.0, _CROSS_PX)):
            path.moveTo(tip - QPointF(across, up))
            path.lineTo(tip + QPointF(across, up))
        stroke(painter, path, made)
        if self._width_px > 0.0:
            stroke(painter, self._outline(view), made)
        if self.text:
            label(painter, tip, self.text, colour, QRectF(view.rect()), gap=14.0)

    def _outline(self, view: CameraImageView) -> QPainterPath:
        """Return the front of the tool or of its jaws, as far back as it is wide, three times."""
        off = (self._gap_px + self._width_px) / 2.0 if self._gap_px > 0.0 else 0.0
        path = QPainterPath()
        for middle in (-off, off) if off else (0.0,):
            self._add_front(path, view, middle)
        return path

    def _add_front(self, path: QPainterPath, view: CameraImageView, middle: float) -> None:
        x, y = self.target_px or (0.0, 0.0)
        length = math.hypot(*self._forward) or 1.0
        ahead, aside = self._forward[0] / length, self._forward[1] / length
        half, back = self._width_px / 2.0, _BACK * self._width_px
        sides = (middle - half, middle + half)
        places = ((sides[0], back), (sides[0], 0.0), (sides[1], 0.0), (sides[1], back))
        corners = [
            (x - side * aside - far * ahead, y + side * ahead - far * aside) for side, far in places
        ]
        path.moveTo(view.to_screen.map(QPointF(*corners[0])))
        for corner in corners[1:]:
            path.lineTo(view.to_screen.map(QPointF(*corner)))
