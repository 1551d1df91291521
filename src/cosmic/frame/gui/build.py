"""Small helpers for putting widgets together."""

from typing import TypeVar

from PySide6.QtCore import QEvent, QObject, Qt
from PySide6.QtWidgets import (
    QAbstractButton,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QSizePolicy,
    QWidget,
)

from cosmic.frame.overrides import override

W = TypeVar("W", bound=QWidget)
B = TypeVar("B", bound=QAbstractButton)


def named(widget: W, name: str) -> W:
    """Give `widget` the name by which the style sheet and tests know it; returns it."""
    widget.setObjectName(name)
    return widget


def styled(widget: W, look: str) -> W:
    """Give `widget` a look that the style sheet defines by its name; returns it."""
    widget.setProperty("look", look)
    return widget


def restyle(*widgets: QWidget) -> None:
    """Have the style sheet read the properties of widgets again; each costs a new layout."""
    for each in widgets:
        each.style().unpolish(each)
        each.style().polish(each)


def set_style_property(widget: QWidget, name: str, value: object) -> None:
    """Set a property that the style sheet looks at, and have the widget styled anew."""
    if widget.property(name) == value:
        return
    widget.setProperty(name, value)
    restyle(widget, *widget.findChildren(QWidget))


def tipped(widget: W, tip: str) -> W:
    """Give `widget` a tooltip; a button that shows a sign only is also named by it."""
    widget.setToolTip(tip)
    if isinstance(widget, QAbstractButton) and not any(c.isalpha() for c in widget.text()):
        widget.setAccessibleName(tip)
    return widget


def retip(widget: QWidget, tip: str) -> None:
    """Give `widget` another tooltip; the one that it has costs nothing, where Qt sends an event."""
    if widget.toolTip() != tip:
        widget.setToolTip(tip)


def push_button(text: str, tip: str) -> QPushButton:
    """Return a button that says what it does."""
    return tipped(QPushButton(text), tip)


class _SecondClick(QObject):
    """Takes the second press of a double click from a button."""

    @override
    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        return event.type() == QEvent.Type.MouseButtonDblClick


def click_once(button: B) -> B:
    """Have `button` take a double click for one click; returns it.

    For what would end again what the first click began, on this button or on the one that it
    has taken the place of.
    """
    button.installEventFilter(_SecondClick(button))
    return button


def wrapped_label() -> QLabel:
    """Return a label for words as they are, in as many lines as they need.

    It takes the width there is: one long word, such as a path, cuts no other off.
    """
    label = QLabel()
    label.setTextFormat(Qt.TextFormat.PlainText)
    label.setWordWrap(True)
    label.setAlignment(Qt.AlignmentFlag.AlignTop | Qt.AlignmentFlag.AlignLeft)
    policy = label.sizePolicy()
    policy.setHorizontalPolicy(QSizePolicy.Policy.Ignored)
    label.setSizePolicy(policy)
    return label


def tight_row(spacing_px: int) -> tuple[QWidget, QHBoxLayout]:
    """Return a widget without margins and the layout that puts things side by side in it."""
    row = QWidget()
    layout = QHBoxLayout(row)
    layout.setContentsMargins(0, 0, 0, 0)
    layout.setSpacing(spacing_px)
    return row, layout
