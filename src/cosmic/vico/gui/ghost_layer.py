"""Where a tool would stand, drawn over the image before it moves there."""

import math

from PySide6.QtCore import QPointF, QRectF
from PySide6.QtGui import QPainter, QPainterPath

from cosmic.frame.overrides import override
from cosmic.vico.api.coordinate_transform import Pixel
from cosmic.vico.gui.image_view import CameraImageView, Layer
from cosmic.vico.gui.ink import GREEN, ORANGE, label, pen, stroke

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
