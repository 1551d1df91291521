"""The choice of what is appended to a file name (DAQFile.2)."""

from typing import Final

from PySide6.QtWidgets import QButtonGroup, QRadioButton, QWidget

from cosmic.frame.file_names import NameOption
from cosmic.frame.gui.build import tight_row, tipped
from cosmic.frame.gui.theme import STEP_PX

_OPTIONS: Final = {
    NameOption.TIME: ("Append with time", "Append date, hour, minute and second of the start"),
    NameOption.NUMBER: ("Append with number", "Append the next number that is free"),
    NameOption.NONE: ("Don't append", "Keep the name as it is"),
}


def append_row(group: QButtonGroup) -> QWidget:
    """Return the options side by side; their property "append" says which is which."""
    row, layout = tight_row(2 * STEP_PX)
    for option, (text, tip) in _OPTIONS.items():
        button = tipped(QRadioButton(text), tip)
        button.setProperty("append", option.value)
        button.setChecked(option is NameOption.TIME)
        group.addButton(button)
        layout.addWidget(button)
    layout.addStretch(1)
    return row
