"""Remembers where the panels of a main window were, and which theme it had."""

import logging
import zlib
from typing import Final

from PySide6.QtCore import QByteArray, QSettings
from PySide6.QtWidgets import QDockWidget, QMainWindow

from cosmic.frame.gui.palette import ThemeName
from cosmic.frame.gui.theme import is_theme

logger = logging.getLogger(__name__)

_GEOMETRY: Final = "window/geometry"
_DOCKS: Final = "window/docks"
_THEME: Final = "window/theme"


class LayoutStore:
    """Saves and restores geometry, docks and theme; a damaged entry counts as none.

    Parameters
    ----------
    settings : QSettings
        Where they are kept; the owner decides on the place.
    """

    def __init__(self, settings: QSettings) -> None:
        self._settings = settings
        self._default = QByteArray()

    def remember_default(self, window: QMainWindow) -> None:
        """Take the docks as they are now for what `reset` goes back to."""
        self._default = window.saveState(_panels(window))

    def save(self, window: QMainWindow, theme: ThemeName) -> None:
        """Keep the layout of `window` for the next start."""
        self._settings.setValue(_GEOMETRY, window.saveGeometry())
        self._settings.setValue(_DOCKS, window.saveState(_panels(window)))
        self._settings.setValue(_THEME, theme)
        self._settings.sync()

    def restore(self, window: QMainWindow) -> bool:
        """Lay `window` out as it was saved; False where there was nothing usable."""
        self.restore_geometry(window)
        docks = self._bytes(_DOCKS)
        if docks is None:
            return False
        if not window.restoreState(docks, _panels(window)):
            logger.warning(
                "the saved layout of the panels is damaged, or of others; the default is used"
            )
            return False
        return True

    def restore_geometry(self, window: QMainWindow) -> None:
        """Give `window` the size and the place that were saved."""
        geometry = self._bytes(_GEOMETRY)
        if geometry is not None and not window.restoreGeometry(geometry):
            logger.warning("the saved size of the window is damaged; the default is used")

    def reset(self, window: QMainWindow) -> None:
        """Put the docks back to where they are at a first start."""
        window.restoreState(self._default, _panels(window))

    def theme(self) -> ThemeName | None:
        """Return the theme saved, if there is one."""
        name = self._settings.value(_THEME)
        return name if is_theme(name) else None

    def save_theme(self, theme: ThemeName) -> None:
        """Keep `theme` for the next start."""
        self._settings.setValue(_THEME, theme)

    def _bytes(self, key: str) -> QByteArray | None:
        value = self._settings.value(key)
        if isinstance(value, QByteArray) and not value.isEmpty():
            return value
        if value is not None:
            logger.warning("the saved %s is damaged; the default is used", key)
        return None


def _panels(window: QMainWindow) -> int:
    """Return a number for the panels there are: an old layout tears them apart from a new one."""
    names = sorted(each.objectName() for each in window.findChildren(QDockWidget))
    return zlib.crc32("\n".join(names).encode()) & 0x7FFFFFFF
