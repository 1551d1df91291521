"""A panel that is made when it is first seen, so that a window need not wait for it."""

from collections.abc import Callable
from typing import Generic, TypeVar

from PySide6.QtCore import QTimer
from PySide6.QtGui import QPaintEvent
from PySide6.QtWidgets import QVBoxLayout, QWidget

from cosmic.frame.overrides import override

W = TypeVar("W", bound=QWidget)


class LatePanel(QWidget, Generic[W]):
    """Keeps the place of a panel and has it made when it is first painted; GUI thread.

    A dock behind another one's tab counts as shown in Qt and gets its `showEvent`; it is painted
    only when its tab is chosen.

    Parameters
    ----------
    make : callable
        Returns the panel; called once.
    """

    def __init__(self, make: Callable[[], W], parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._make = make
        self._panel: W | None = None
        self._asked = False
        self._column = QVBoxLayout(self)
        self._column.setContentsMargins(0, 0, 0, 0)

    @property
    def panel(self) -> W:
        """The panel, made now if need be."""
        self._asked = True
        if self._panel is None:
            self._panel = self._make()
            self._column.addWidget(self._panel)
        return self._panel

    @property
    def made(self) -> W | None:
        """The panel; None before it was made."""
        return self._panel

    @override
    def paintEvent(self, event: QPaintEvent) -> None:
        super().paintEvent(event)
        if not self._asked:
            self._asked = True
            QTimer.singleShot(0, self, lambda: self.panel)  # not while the window is painted


def is_seen(widget: QWidget) -> bool:
    """Return whether anything of `widget` is on a screen; behind a tab or in a fold it is not."""
    return not widget.visibleRegion().isEmpty()
