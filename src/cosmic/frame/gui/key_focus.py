"""Who a key belongs to: the widget that text is typed into, or the program."""

from typing import Final

from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QAbstractItemView,
    QAbstractSpinBox,
    QApplication,
    QComboBox,
    QDialog,
    QLineEdit,
    QMenuBar,
    QPlainTextEdit,
    QTextEdit,
    QWidget,
)

ENTER_KEYS: Final = (Qt.Key.Key_Return, Qt.Key.Key_Enter)
"""Enter of the letters and of the number pad."""


def takes_text(widget: QWidget | None) -> bool:
    """Tell whether keys typed into `widget` make text; such a widget swallows jog keys."""
    if isinstance(widget, QComboBox):
        return widget.isEditable()
    return isinstance(widget, (QLineEdit, QPlainTextEdit, QTextEdit, QAbstractSpinBox))


def set_shown(widget: QWidget, owner: QWidget, *, shown: bool) -> None:
    """Show or hide a widget; what has the focus when it goes leaves it to `owner`.

    Qt would give it to the next widget of the window, and Space would press that.
    """
    if not shown and widget.hasFocus():
        owner.setFocus()
    widget.setVisible(shown)


def set_usable(widget: QWidget, owner: QWidget, *, usable: bool) -> None:
    """Enable or disable a widget; what has the focus when it is disabled leaves it to `owner`.

    Qt would give it to the next widget that can be used, and Space would press that.
    """
    if not usable and widget.hasFocus():
        owner.setFocus()
    widget.setEnabled(usable)


def escape_is_for(widget: QWidget | None) -> bool:
    """Tell whether Escape has something to cancel that `widget`, with the focus, belongs to.

    A menu, the list of a combo box, a dialog, a panel that is being dragged, an entry in a
    field or in a table, or what says so by a bool attribute `is_editing`.
    """
    if QApplication.activePopupWidget() is not None or QApplication.activeModalWidget() is not None:
        return True
    if isinstance(QApplication.activeWindow(), QDialog) or QWidget.mouseGrabber() is not None:
        return True
    if isinstance(widget, QMenuBar) or is_being_edited(widget) or _is_item_editor(widget):
        return True
    return any(getattr(each, "is_editing", False) is True for each in _ancestors(widget))


def _ancestors(widget: QWidget | None) -> list[QWidget]:
    found: list[QWidget] = []
    at = widget.parentWidget() if widget is not None else None
    while at is not None:
        found.append(at)
        at = at.parentWidget()
    return found


def _is_item_editor(widget: QWidget | None) -> bool:
    """Tell whether a cell of a table or a list is open for editing there."""
    views = [each for each in _ancestors(widget) if isinstance(each, QAbstractItemView)]
    return any(view.state() == QAbstractItemView.State.EditingState for view in views)


def is_being_edited(widget: QWidget | None) -> bool:
    """Tell whether `widget` holds a change that Escape should take back.

    A widget that knows better says so by a bool attribute `is_editing`.
    """
    said = getattr(widget, "is_editing", None)
    if isinstance(said, bool):
        return said
    if isinstance(widget, (QPlainTextEdit, QTextEdit)):
        return not widget.isReadOnly() and widget.document().isModified()
    line = widget if isinstance(widget, QLineEdit) else _line_of(widget)
    return line is not None and not line.isReadOnly() and line.isModified()


def _line_of(widget: QWidget | None) -> QLineEdit | None:
    """Return the line that a spin box or an editable combo box is typed into."""
    if isinstance(widget, QAbstractSpinBox):
        return widget.lineEdit()
    if isinstance(widget, QComboBox):
        return widget.lineEdit() if widget.isEditable() else None
    return None
