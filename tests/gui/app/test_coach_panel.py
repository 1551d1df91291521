"""The coach in a low panel: whatever it says, its button can be pressed."""

from PySide6.QtCore import QSettings
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from cosmic.app.panels.coach import Coach, Step
from cosmic.frame.gui.screen_fit import FittedPanel


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
