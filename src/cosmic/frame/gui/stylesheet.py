"""The style sheets: of all themes, in the roles of a palette, and of printed pages."""

import re
from pathlib import Path
from string import Template
from typing import Final

from PySide6.QtGui import QPalette

from cosmic.frame.gui.palette import DARK, INK, OKABE_ITO

_ASSETS: Final = Path(__file__).parent / "assets"

_SHEET: Final = """
QMainWindow, QDialog { background: $window; }
QMainWindow::separator { background: $window; width: 6px; height: 6px; }
QMainWindow::separator:hover { background: $accent; }
QToolTip {
    background: $raised; color: $text; border: 1px solid $border_strong; padding: 4px 6px;
}

QPushButton, QToolButton {
    background: $raised; color: $text; border: 1px solid $border; border-radius: 4px;
    padding: 3px 11px; min-height: 20px;
}
QToolButton { padding: 3px 8px; }
QPushButton:hover, QToolButton:hover { background: $hover; border-color: $border_strong; }
QPushButton:pressed, QToolButton:pressed { background: $field; }
QPushButton:checked, QToolButton:checked {
    background: $accent; color: $on_accent; border-color: $accent;
}
QPushButton:focus, QToolButton:focus { border-color: $accent; }
QPushButton:disabled, QToolButton:disabled {
    background: transparent; color: $disabled; border-color: $border;
}
QPushButton:default { border-color: $accent; }

QLineEdit, QPlainTextEdit, QTextEdit {
    background: $field; color: $text; border: 1px solid $border; border-radius: 4px;
    padding: 3px 7px; selection-background-color: $accent; selection-color: $on_accent;
}
QLineEdit { min-height: 20px; }
QLineEdit:hover { border-color: $border_strong; }
QLineEdit:focus, QPlainTextEdit:focus, QTextEdit:focus { border-color: $accent; }
QLineEdit:disabled, QPlainTextEdit:disabled { color: $disabled; background: transparent; }
QLineEdit[refused="true"] { border: 2px solid $refused; padding: 2px 6px; }
QComboBox, QAbstractSpinBox {
    background: $raised; color: $text; border: 1px solid $border; border-radius: 4px;
    padding: 3px 7px; min-height: 20px; selection-background-color: $accent;
    selection-color: $on_accent;
}
QAbstractSpinBox { background: $field; padding: 3px 22px 3px 7px; }
QAbstractSpinBox QLineEdit {
    background: transparent; border: none; padding: 0px; margin: 0px; min-height: 0px;
}
QComboBox:hover, QAbstractSpinBox:hover { border-color: $border_strong; }
QComboBox:focus, QAbstractSpinBox:focus { border-color: $accent; }
QComboBox:disabled, QAbstractSpinBox:disabled { background: transparent; color: $disabled; }
QComboBox::drop-down { border: none; width: 22px; }
QComboBox::down-arrow, QAbstractSpinBox::down-arrow {
    image: url("$assets/down.svg"); width: 10px; height: 10px;
}
QAbstractSpinBox::up-arrow { image: url("$assets/up.svg"); width: 10px; height: 10px; }
QAbstractSpinBox::up-button, QAbstractSpinBox::down-button { border: none; width: 20px; }
QAbstractSpinBox::up-button:hover, QAbstractSpinBox::down-button:hover { background: $hover; }
QComboBox QAbstractItemView {
    background: $raised; color: $text; border: 1px solid $border_strong; outline: none;
    selection-background-color: $accent; selection-color: $on_accent;
}
QCheckBox { spacing: 7px; }
QCheckBox::indicator, QGroupBox::indicator {
    width: 14px; height: 14px; background: $field; border: 1px solid $border_strong;
    border-radius: 3px;
}
QCheckBox::indicator:hover { border-color: $accent; }
QCheckBox::indicator:checked, QGroupBox::indicator:checked {
    background: $accent; border-color: $accent; image: url("$assets/check.svg");
}
QCheckBox::indicator:disabled { background: transparent; border-color: $border; }
QCheckBox::indicator:checked:disabled {
    background: $disabled; border-color: $disabled;
}
QCheckBox:disabled { color: $disabled; }
QProgressBar {
    background: $field; color: $text; border: 1px solid $border; border-radius: 4px;
    text-align: center; min-height: 16px;
}
QProgressBar::chunk { background: $accent; border-radius: 3px; }
QSlider::groove:horizontal { background: $border; height: 4px; border-radius: 2px; }
QSlider::sub-page:horizontal { background: $accent; border-radius: 2px; }
QSlider::handle:horizontal {
    background: $text; width: 14px; height: 14px; margin: -5px 0px; border-radius: 7px;
}

QDockWidget { color: $text; }
QDockWidget > QWidget { background: $panel; }
#dockTitle { background: $raised; border-bottom: 1px solid $border; }
#dockTitle QToolButton {
    background: transparent; border: none; color: $dim; padding: 0px; min-height: 22px;
    min-width: 22px; border-radius: 4px;
}
#dockTitle QToolButton:hover { background: $hover; color: $text; }
#dockBody, QScrollArea#dockScroll, QScrollArea#dockScroll > QWidget > QWidget {
    background: $panel;
}
QScrollArea { border: none; }
#failedBanner { background: $raised; border-bottom: 2px solid $refused; }

QTabBar::tab {
    background: $window; color: $dim; padding: 5px 14px; border: none;
    border-bottom: 2px solid transparent;
}
QTabBar::tab:selected { background: $raised; color: $text; border-bottom: 2px solid $accent; }
QTabBar::tab:hover { color: $text; }
QTabWidget::pane { border: 1px solid $border; }

QGroupBox {
    border: 1px solid $border; border-radius: 4px; margin-top: 11px; padding: 10px 8px 8px 8px;
}
QGroupBox::title { subcontrol-origin: margin; left: 8px; padding: 0px 4px; color: $dim; }

QMenuBar { background: transparent; color: $text; }
QMenuBar::item { background: transparent; padding: 4px 10px; border-radius: 4px; }
QMenuBar::item:selected, QMenuBar::item:pressed { background: $hover; }
QMenu { background: $raised; color: $text; border: 1px solid $border_strong; padding: 4px; }
QMenu::item { padding: 5px 24px 5px 24px; border-radius: 4px; }
QMenu::item:selected { background: $accent; color: $on_accent; }
QMenu::item:disabled { color: $disabled; }
QMenu::separator { height: 1px; background: $border; margin: 4px 8px; }

QScrollBar { background: transparent; border: none; }
QScrollBar:vertical { width: 12px; }
QScrollBar:horizontal { height: 12px; }
QScrollBar::handle { background: $border_strong; border-radius: 4px; margin: 2px; }
QScrollBar::handle:vertical { min-height: 32px; }
QScrollBar::handle:horizontal { min-width: 32px; }
QScrollBar::handle:hover { background: $dim; }
QScrollBar::add-line, QScrollBar::sub-line { width: 0px; height: 0px; }
QScrollBar::add-page, QScrollBar::sub-page { background: transparent; }

QTableView {
    background: $field; color: $text; border: 1px solid $border; border-radius: 4px;
    gridline-color: transparent; selection-background-color: $hover; selection-color: $text;
}
QHeaderView { background: $panel; border: none; }
QHeaderView::section {
    background: $panel; color: $dim; border: none; border-bottom: 1px solid $border;
    padding: 3px 6px;
}

[role="dim"] { color: $dim; }
[role="refused"] { color: $refused; }

QPushButton[look="narrow"] { padding: 3px 6px; }
QToolButton[look="tool"], QToolButton[look="tool menu"] { padding: 1px 5px; }
QToolButton[look="menu"]::menu-indicator, QToolButton[look="tool menu"]::menu-indicator {
    image: none;
}
QToolButton[look="heading"] {
    background: transparent; border: none; color: $text; padding: 0px; text-align: left;
}
QProgressBar[look="bar"] { min-height: 8px; border: none; }
#stopAxis:enabled { color: $alarm; }

#topBar { background: $window; border-bottom: 1px solid $border; }
#topBar[latched="true"] { background: $latched; border-bottom: 1px solid $stop; }
#topBar[latched="true"] QLabel, #topBar[latched="true"] QMenuBar { color: $on_stop; }
#topBar[latched="true"] QMenuBar::item:selected { background: $stop; }
#themeButton { background: transparent; border: none; padding: 0px; min-width: 28px; }
#themeButton:hover { background: $hover; }
#topBar[latched="true"] #themeButton { color: $on_stop; }
#modeButton {
    border-radius: 0px; padding: 3px 9px; margin-left: -1px; min-width: 34px; min-height: 22px;
}
#workspaceButton {
    background: transparent; border: none; border-bottom: 2px solid transparent;
    border-radius: 0px; color: $dim; padding: 3px 5px; min-height: 22px;
}
#workspaceButton:hover, #workspaceButton:focus { color: $text; background: $hover; }
#workspaceButton:checked { color: $text; border-bottom: 2px solid $accent; }
#topBar[latched="true"] #workspaceButton { color: $on_stop; }
#topBar[latched="true"] #workspaceButton:hover { background: $stop; }
#alarmsButton { background: transparent; padding: 1px 6px; }
#alarmsButton[alarming="true"] { background: $alarm; color: $ink; border-color: $alarm; }
#topBar[latched="true"] #alarmsButton[alarming="false"] { color: $on_stop; }
#drawerLine { background: $window; border-top: 1px solid $border; }
#drawerLine QToolButton {
    background: transparent; border: none; border-radius: 0px; color: $dim; padding: 0px 9px;
    min-height: 20px;
}
#drawerLine QToolButton:hover, #drawerLine QToolButton:focus { color: $text; background: $hover; }
#drawerLine QToolButton:checked { color: $text; border-top: 2px solid $accent; }
#drawerBody { background: $panel; border-top: 2px solid $accent; }
#centralView { background: $field; }
#centralInset { background: $panel; border: 1px solid $border_strong; }
#coach { background: $raised; border: 1px solid $border; border-radius: 4px; }
#coachRoom, #coachRoom > QWidget > QWidget { background: transparent; }
#operationCard { background: $raised; border: 1px solid $border_strong; border-radius: 4px; }
#padButton { padding: 0px; min-width: 30px; max-width: 46px; min-height: 26px; }
#axisTable QPushButton, #axisTable QToolButton, #axisTable QLineEdit {
    padding: 1px 5px; min-height: 18px;
}
#axisTable QLineEdit[refused="true"] { padding: 0px 4px; }
#toolButton { padding: 2px 0px; }
#toolPanel QPushButton[look="narrow"] { padding: 3px 3px; }

#resetButton {
    background: $on_stop; color: $ink; border: 1px solid $on_stop; padding: 3px 19px;
    min-height: 22px;
}
#resetButton:hover, #resetButton:focus { background: $hover_on_stop; }
#stopButton {
    background: $stop; color: $on_stop; border: 2px solid $stop; border-radius: 6px;
    padding: 0px 22px; min-height: 46px;
}
#stopButton:hover, #stopButton:focus { background: $stop_hover; border-color: $on_stop; }
#stopButton:pressed { background: $latched; }
#topBar[latched="true"] #stopButton { border-color: $on_stop; }
#chip { border-radius: 4px; padding: 2px 8px; }
#chip[tone="simulated"] {
    background: transparent; color: $accent; border: 1px solid $accent; padding: 1px 7px;
}
#chip[tone="real"] { background: $raised; color: $text; }
#chip[tone="alarm"] { background: $alarm; color: $ink; }
#chip[tone="warning"] { background: $warning; color: $ink; }
#chip[tone="quiet"] { background: $raised; color: $text; }
#topBar[latched="true"] #chip[tone="simulated"] { color: $on_stop; border-color: $on_stop; }
#topBar[latched="true"] #chip[tone="quiet"], #topBar[latched="true"] #chip[tone="real"] {
    color: $text;
}
#topBar[latched="true"] #chip[tone="warning"], #topBar[latched="true"] #chip[tone="alarm"] {
    color: $ink;
}
QPushButton[watched="false"], QPushButton[watched="false"]:hover {
    background: $alarm; color: $ink; border-color: $alarm;
}
#takeOutQuestion {
    background: $raised; border: 2px solid $alarm; border-radius: 4px;
}
#reasonBubble {
    background: $raised; color: $text; border: 2px solid $refused; border-radius: 4px;
    padding: 4px 8px;
}
"""

PRINTED: Final = """
body { font-family: sans-serif; font-size: 11px; color: #202428; }
h1 { font-size: 20px; } h2 { font-size: 15px; margin-top: 14px; margin-bottom: 7px; }
h3 { font-size: 13px; margin-top: 14px; }
h3.long { page-break-before: always; }
table { margin-top: 4px; margin-bottom: 4px; }
th { background-color: #eef1f4; font-size: 11px; } td { font-size: 11px; }
td, th { padding-left: 4px; padding-right: 4px; }
pre { background-color: #f3f5f7; font-size: 10px; } small { font-size: 9px; }
"""
"""Of a printed report: black on white in every theme."""


ROLES: Final = {
    "window": QPalette.ColorRole.Shadow,
    "panel": QPalette.ColorRole.Window,
    "raised": QPalette.ColorRole.Button,
    "hover": QPalette.ColorRole.Light,
    "field": QPalette.ColorRole.Base,
    "border": QPalette.ColorRole.Mid,
    "border_strong": QPalette.ColorRole.Dark,
    "text": QPalette.ColorRole.Text,
    "dim": QPalette.ColorRole.PlaceholderText,
    "disabled": QPalette.ColorRole.Midlight,
    "accent": QPalette.ColorRole.Highlight,
    "on_accent": QPalette.ColorRole.HighlightedText,
    "refused": QPalette.ColorRole.LinkVisited,
}
"""Where the colours of a theme lie in Qt's palette: the sheet names the roles, so that another
theme is another palette, and no widget's rules need be looked for again."""

_CONSTANT: Final = ("stop", "stop_hover", "latched", "on_stop")
"""Colours that are the same in every theme."""


def stylesheet() -> str:
    """Return the style sheet of every theme, in the colours of the palette in force."""
    return Template(_SHEET).substitute(
        {name: f"palette({_word(role)})" for name, role in ROLES.items()},
        **{name: getattr(DARK, name) for name in _CONSTANT},
        ink=INK,
        alarm=OKABE_ITO["vermillion"],
        warning=OKABE_ITO["orange"],
        hover_on_stop="#E3E8ED",
        assets=_ASSETS.as_posix(),
    )


def _word(role: QPalette.ColorRole) -> str:
    """Return how a style sheet spells a role: HighlightedText is "highlighted-text"."""
    return re.sub("(?<=[a-z])(?=[A-Z])", "-", role.name).lower()
