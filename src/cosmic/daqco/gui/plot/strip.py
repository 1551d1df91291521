"""`StripChartItem`: the ring of pixels as an item of pyqtgraph."""

import logging

import pyqtgraph as pg
from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QColor, QPainter, QPen
from PySide6.QtWidgets import QGraphicsItem, QStyleOptionGraphicsItem, QWidget

from cosmic.daqco.gui.plot.raster import Raster
from cosmic.frame.overrides import override

logger = logging.getLogger(__name__)


class StripChartItem(pg.GraphicsObject):  # type: ignore[misc]
    """Lies over a view box, in its pixels; paints two pieces of an image and thin upright lines.

    The newest column is at the right edge. Measured (32 channels, 15 kHz): a refresh takes
    1-2 ms, where curves of pyqtgraph take 26 ms at best.
    """

    def __init__(self, raster: Raster, view_box: pg.ViewBox) -> None:
        super().__init__()
        self.raster = raster
        self.paints = 0
        """How often it was painted, for benchmarks."""
        self._size = (0.0, 0.0)
        self._uprights: tuple[float, ...] = ()
        self._failed = False
        self.setParentItem(view_box)
        self.setZValue(-50)
        self.setFlag(QGraphicsItem.GraphicsItemFlag.ItemHasNoContents, False)
        self.setAcceptedMouseButtons(Qt.MouseButton.NoButton)

    def set_size(self, width: float, height: float) -> None:
        """Cover that many pixels of the view."""
        self.prepareGeometryChange()
        self._size = (width, height)

    def set_uprights(self, shares: tuple[float, ...]) -> None:
        """Draw upright lines at these parts of the width, 0 to 1."""
        self._uprights = shares
        self.update()

    @override
    def boundingRect(self) -> QRectF:
        return QRectF(0.0, 0.0, *self._size)

    @override
    def paint(
        self,
        painter: QPainter,
        option: QStyleOptionGraphicsItem,
        widget: QWidget | None = None,
    ) -> None:
        # An exception that leaves paint() can end the process, and would come at every frame.
        try:
            self._paint(painter)
        except Exception:
            if not self._failed:
                logger.exception("the strip chart cannot be painted")
            self._failed = True

    def _paint(self, painter: QPainter) -> None:
        self.paints += 1
        raster = self.raster
        width, height = self._size
        per_px = width / raster.width
        oldest = (raster.head + 1) % raster.width
        old_part = raster.width - oldest
        full = float(raster.height)
        painter.drawImage(
            QRectF(0.0, 0.0, old_part * per_px, height),
            raster.image,
            QRectF(oldest, 0.0, old_part, full),
        )
        if oldest:
            painter.drawImage(
                QRectF(old_part * per_px, 0.0, oldest * per_px, height),
                raster.image,
                QRectF(0.0, 0.0, oldest, full),
            )
        colour = QColor(raster.look.line)
        painter.setPen(QPen(colour, 1.0))
        for share in self._uprights:
            x = round(share * (width - 1.0)) + 0.5
            painter.drawLine(pg.Point(x, 0.0), pg.Point(x, height))
