"""Colours of channels: their names, and how they stay readable on either ground."""

from typing import Final

from PySide6.QtGui import QColor, QIcon, QPixmap

from cosmic.frame.gui.palette import OKABE_ITO, blend, contrast_ratio
from cosmic.frame.gui.theme import current_palette

LEAST_CONTRAST: Final = 3.0
"""What WCAG 2 asks of lines and shapes."""

NAMES: Final = {value.upper(): name for name, value in OKABE_ITO.items()}


def colour_name(colour: str) -> str:
    """Return the name of a colour, or "#RRGGBB" where it has none."""
    return NAMES.get(colour.upper(), colour.upper())


def readable(colour: str, ground: str | None = None) -> str:
    """Return `colour`, drawn towards the colour of text until it stands out from `ground`."""
    palette = current_palette()
    ground = ground or palette.field
    for share in (1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3):
        mixed = blend(colour, palette.text, share)
        if contrast_ratio(mixed, ground) >= LEAST_CONTRAST:
            return mixed
    return palette.text


def swatch(colour: str, size_px: int = 14) -> QIcon:
    """Return a square of that colour, for lists and buttons."""
    image = QPixmap(size_px, size_px)
    image.fill(QColor(colour))
    return QIcon(image)
