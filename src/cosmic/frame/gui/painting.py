"""Painting that ends, whatever happens while it is painted."""

from collections.abc import Iterator
from contextlib import contextmanager

from PySide6.QtGui import QPaintDevice, QPainter


@contextmanager
def painting(device: QPaintDevice) -> Iterator[QPainter]:
    """Paint on a widget, an image or a printer; GUI thread, but for images and printers.

    The painter ends with the block. One that is left to Python ends when nobody knows it any more:
    the traceback of an error keeps it, and Qt then takes the picture away under it, or somebody
    else's painter finds it still at work on the same widget.
    """
    painter = QPainter(device)
    try:
        yield painter
    finally:
        painter.end()


@contextmanager
def saved(painter: QPainter) -> Iterator[None]:
    """Put a painter back as it was at the end of the block, whatever happens in it."""
    painter.save()
    try:
        yield
    finally:
        painter.restore()
