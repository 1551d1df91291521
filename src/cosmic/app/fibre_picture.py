"""One picture of a fibre, as large as there is room."""

import numpy as np
from PySide6.QtCore import QRect, QSize, Qt
from PySide6.QtGui import QColor, QImage, QPainter, QPaintEvent, QPixmap
from PySide6.QtWidgets import QSizePolicy, QWidget

from cosmic.autonomy.campaign.records import Picture
from cosmic.frame.gui.theme import STEP_PX, current_palette
from cosmic.frame.overrides import override


class FibrePicture(QWidget):
    """Shows a `Picture` with a bar that tells its scale; GUI thread."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._pixmap = QPixmap()
        self._scale_um_px = float("nan")
        self._words = ""
        self.setMinimumSize(24 * STEP_PX, 18 * STEP_PX)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)

    @property
    def shown(self) -> QSize:
        """Size of the picture in its own pixels; empty where there is none."""
        return self._pixmap.size()

    def show_picture(self, picture: Picture | None, words: str = "no picture was kept") -> None:
        """Show `picture`, or `words` where there is none."""
        self._words = words
        if picture is None:
            self._pixmap = QPixmap()
        else:
            self._pixmap = QPixmap.fromImage(_image(picture))
            self._scale_um_px = picture.scale_um_px
            self.setAccessibleName(picture.name)
        self.update()

    @override
    def sizeHint(self) -> QSize:
        return QSize(40 * STEP_PX, 30 * STEP_PX)

    @override
    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        palette = current_palette()
        painter.fillRect(self.rect(), QColor(palette.field))
        if self._pixmap.isNull():
            painter.setPen(QColor(palette.dim))
            painter.drawText(self.rect(), int(Qt.AlignmentFlag.AlignCenter), self._words)
            return
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        size = self._pixmap.size().scaled(self.size(), Qt.AspectRatioMode.KeepAspectRatio)
        place = QRect(
            (self.width() - size.width()) // 2,
            (self.height() - size.height()) // 2,
            size.width(),
            size.height(),
        )
        painter.drawPixmap(place, self._pixmap)
        self._paint_bar(painter, place)

    def _paint_bar(self, painter: QPainter, place: QRect) -> None:
        """Draw a bar of a round length, light on dark, which any picture shows."""
        width_um = self._scale_um_px * self._pixmap.width()
        if not 0.0 < width_um < 1e7:
            return
        length_um = round_below(0.35 * width_um)
        length_px = round(length_um / width_um * place.width())
        left, bottom = place.left() + STEP_PX, place.bottom() - STEP_PX
        words = f"{length_um:g} µm"
        height = painter.fontMetrics().height()
        box_px = max(length_px, painter.fontMetrics().horizontalAdvance(words)) + STEP_PX
        ground = QRect(left - 4, bottom - height - 8, box_px, height + 12)
        painter.fillRect(ground, QColor(0, 0, 0, 150))
        painter.fillRect(left, bottom - 3, length_px, 3, Qt.GlobalColor.white)
        painter.setPen(Qt.GlobalColor.white)
        painter.drawText(left, bottom - 7, words)


def round_below(value: float) -> float:
    """Return the largest of 1, 2 and 5 times a power of ten that is not above `value`."""
    size = 10.0 ** np.floor(np.log10(value))
    return float(next(digit for digit in (5.0, 2.0, 1.0) if digit * size <= value) * size)


def _image(picture: Picture) -> QImage:
    pixels = picture.pixels
    eight_bit = (pixels >> 8).astype(np.uint8) if pixels.dtype == np.uint16 else pixels
    grey = np.ascontiguousarray(eight_bit)
    height, width = grey.shape[:2]
    image = QImage(grey.data, width, height, grey.strides[0], QImage.Format.Format_Grayscale8)
    return image.copy()  # the array may go
