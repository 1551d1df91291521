"""A dialog in which Enter judges the field it is pressed in, and nothing more."""

from PySide6.QtGui import QIcon, QKeyEvent
from PySide6.QtWidgets import QDialog, QDialogButtonBox

from cosmic.frame.gui.key_focus import ENTER_KEYS
from cosmic.frame.overrides import override


class FieldDialog(QDialog):
    """Is not closed by Enter: a button box would make OK the default again at every show."""

    @override
    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() in ENTER_KEYS:
            event.accept()
            return
        super().keyPressEvent(event)


def button_box(buttons: QDialogButtonBox.StandardButton) -> QDialogButtonBox:
    """Return the buttons of a dialog, without the images that some desktops put on them."""
    box = QDialogButtonBox(buttons)
    for each in box.buttons():
        each.setIcon(QIcon())
    return box
