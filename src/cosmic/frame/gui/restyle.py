"""Another palette for widgets that a style sheet has styled: now where they are seen, else later.

Qt keeps the colours of a style sheet's rules for each widget, and takes `palette(...)` in them from
the palette that was in force when it made them. `QApplication.setStyleSheet` makes all of them
anew, at 0.4 ms a widget (Qt 6.11): 0.8 s of 1,900 widgets, of which 150 are seen.
"""

from PySide6.QtCore import QEvent, QObject
from PySide6.QtWidgets import QApplication, QWidget

from cosmic.frame.overrides import override

_NAME = "restyleWhenShown"


class RestyleWhenShown(QObject):
    """Styles widgets that were hidden while the palette changed, when they are shown."""

    def __init__(self, app: QApplication) -> None:
        super().__init__(app)
        self.setObjectName(_NAME)

    def restyle(self, widget: QWidget) -> None:
        """Style a widget and what is shown in it anew, and the rest when that is shown."""
        style = widget.style()
        style.unpolish(widget)
        style.polish(widget)
        widget.update()
        self.restyle_inside(widget)

    def restyle_inside(self, widget: QWidget) -> None:
        """Style what is in a widget."""
        for child in widget.children():
            if not isinstance(child, QWidget):
                continue
            if child.isHidden() or child.isWindow():
                self.watch(child)
            else:
                self.restyle(child)

    def watch(self, widget: QWidget) -> None:
        """Style a widget anew when it is shown."""
        widget.removeEventFilter(self)  # it would be asked twice
        widget.installEventFilter(self)

    @override
    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.Show and isinstance(watched, QWidget):
            watched.removeEventFilter(self)
            self.restyle(watched)
        return False


def restyle_shown(app: QApplication) -> None:
    """Have every widget take its colours from the palette in force; GUI thread."""
    found = app.findChild(RestyleWhenShown, _NAME)
    later = found if isinstance(found, RestyleWhenShown) else RestyleWhenShown(app)
    for window in app.topLevelWidgets():
        if window.isHidden():
            later.watch(window)
        else:
            later.restyle(window)
