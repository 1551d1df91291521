"""The coach in a low panel: whatever it says, its button can be pressed."""

from PySide6.QtCore import QSettings
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from cosmic.app.panels.coach import Coach, Step
from cosmic.frame.gui.screen_fit import FittedPanel


def test_one_long_word_cuts_off_no_other(qtbot: QtBot, stored: QSettings) -> None:
    words = f"Motion is stopped (/a/{'long' * 20}: it has no room). Look at the tool."
    coach = Coach((lambda: Step(words, "Reset", lambda: None),), stored)
    qtbot.addWidget(coach)
    coach.resize(260, 200)
    coach.show()
    QApplication.processEvents()
    room = coach.words.parentWidget()
    assert room is not None
    assert coach.words.width() <= room.width()


def test_long_words_scroll_and_leave_the_button_in_sight(qtbot: QtBot, stored: QSettings) -> None:
    words = "Bring a tool down to about 50 um above the plate, at this zoom. " * 5
    coach = Coach((lambda: Step(words, "Handle", lambda: None),), stored)
    panel = FittedPanel(coach)
    qtbot.addWidget(panel)
    panel.resize(260, 110)
    panel.show()
    QApplication.processEvents()
    bottom = coach.button.mapTo(panel, coach.button.rect().bottomLeft())
    assert coach.button.isVisible()
    assert panel.rect().contains(bottom)
    assert coach.words.height() > panel.height()
