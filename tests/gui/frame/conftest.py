"""Windows, settings and a theme for the tests of the shared widgets."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QSettings
from PySide6.QtWidgets import QApplication, QLineEdit, QPushButton, QVBoxLayout, QWidget
from pytestqt.qtbot import QtBot

from cosmic.frame.gui.server_gui import CosmicServerGui
from cosmic.frame.gui.theme import apply_theme


@pytest.fixture(autouse=True)
def _themed(qapp: QApplication) -> Iterator[None]:
    apply_theme(qapp, "dark")
    yield
    qapp.setStyleSheet("")


@pytest.fixture
def settings(tmp_path: Path) -> QSettings:
    return QSettings(str(tmp_path / "layout.ini"), QSettings.Format.IniFormat)


@pytest.fixture
def gui(qtbot: QtBot, settings: QSettings) -> CosmicServerGui:
    window = CosmicServerGui(settings)
    qtbot.addWidget(window)
    return window


@pytest.fixture
def form(qtbot: QtBot) -> QWidget:
    """A window with a text field "line" and a button "button", shown and active."""
    window = QWidget()
    column = QVBoxLayout(window)
    line, button = QLineEdit(), QPushButton("press me")
    line.setObjectName("line")
    button.setObjectName("button")
    column.addWidget(button)
    column.addWidget(line)
    qtbot.addWidget(window)
    window.show()
    with qtbot.waitActive(window):
        window.activateWindow()
    return window
