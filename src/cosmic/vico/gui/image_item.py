"""The pixels on the screen: contrast, marks for lost ones, greyed when they are old."""

import pyqtgraph as pg

from cosmic.vico.core.image import CameraImage
from cosmic.vico.gui.levels import (
    Levels,
    colour_image,
    full_scale,
    index_table,
    indices,
    palette,
)
from cosmic.vico.hw.interface import Pixels

_PLAIN = Levels(0.0, 255.0)


class CameraImageItem:
    """Drives pyqtgraph's item; grey images go there as bytes with a palette.

    Attributes
    ----------
    item : ImageItem
        For the scene.
    full : int
        Brightness of an over-exposed pixel.
    """

    def __init__(self) -> None:
        self.item = pg.ImageItem(axisOrder="row-major", autoLevels=False)
        self.item.setPos(-0.5, -0.5)  # the middle of a pixel is where its number says
        self.full = 255
        self.levels = _PLAIN
        self._marks = self._greyed = False
        self._index = index_table(255)
        self._data: Pixels | None = None

    def set_levels(self, levels: Levels) -> None:
        """Change the contrast."""
        if levels != self.levels:
            self.levels = levels
            self._look_changed()

    def set_marks(self, marks: bool) -> None:
        """Colour pixels that are over-exposed or quite black, or not."""
        self._marks = marks
        self._look_changed()

    def set_greyed(self, greyed: bool) -> None:
        """Show that the image is old."""
        if greyed != self._greyed:
            self._greyed = greyed
            self._look_changed()

    def show(self, image: CameraImage) -> bool:
        """Show an image; True when it has another shape than the one before."""
        before, self._data = self._data, image.data
        reshaped = before is None or before.shape != image.data.shape
        full = full_scale(image.frame.pixel_format)
        if full != self.full:
            share = full / self.full
            self.full, self._index = full, index_table(full)
            self.levels = Levels(self.levels.low * share, self.levels.high * share)
            self._look_changed()
        elif reshaped:
            self._look_changed()
        else:
            self._put(image.data)
        return reshaped

    def _look_changed(self) -> None:
        if self._data is None:
            return
        if self._data.ndim == 2:
            table = palette(self.levels, self.full, marks=self._marks, greyed=self._greyed)
            self.item.setLookupTable(table, update=False)
        self._put(self._data)

    def _put(self, data: Pixels) -> None:
        if data.ndim == 2:
            shown: Pixels = data if self._index is None else indices(self._index, data)
        elif self.levels == _PLAIN and not self._marks and not self._greyed:
            shown = data
        else:
            shown = colour_image(data, self.levels, marks=self._marks, greyed=self._greyed)
        self.item.setImage(shown, autoLevels=False)
