"""Who a key belongs to: the widget that text is typed into, or the program."""

from PySide6.QtWidgets import (
    QAbstractSpinBox,
    QComboBox,
    QLineEdit,
    QPlainTextEdit,
    QTextEdit,
    QWidget,
)


def takes_text(widget: QWidget | None) -> bool:
    """Tell whether keys typed into `widget` make text; such a widget swallows jog keys."""
    if isinstance(widget, QComboBox):
        return widget.isEditable()
    return isinstance(widget, (QLineEdit, QPlainTextEdit, QTextEdit, QAbstractSpinBox))


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
