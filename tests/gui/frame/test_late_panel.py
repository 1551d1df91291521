"""A panel behind a tab is made when it is looked at, and not before."""

from PySide6.QtCore import QSettings
from PySide6.QtWidgets import QLabel, QWidget

from cosmic.frame.gui.late_panel import LatePanel, is_seen
from cosmic.frame.gui.server_gui import CosmicServerGui


def make_label(made: list[QLabel]) -> QLabel:
    made.append(QLabel("here"))
    return made[-1]


def test_a_panel_behind_a_tab_is_made_when_its_tab_is_chosen(qtbot, tmp_path):
    settings = QSettings(str(tmp_path / "window.ini"), QSettings.Format.IniFormat)
    window = CosmicServerGui(settings)
    qtbot.addWidget(window)
    made: list[QLabel] = []
    late = LatePanel(lambda: make_label(made))
    window.add_panel("Front", QWidget())
    window.add_panel("Behind", late, scroll=False, beside="Front", tabbed=True)
    window.dock("Front").raise_()
    window.show()
    qtbot.waitExposed(window)
    qtbot.wait(50)
    assert made == []
    assert late.isVisible()  # which is what Qt says of it, and no reason to make anything
    assert not is_seen(late)
    window.raise_panel("Behind")
    qtbot.waitUntil(lambda: bool(made) and is_seen(made[0]))
    assert late.made is made[0]
    assert late.panel is made[0]
    assert len(made) == 1


def test_a_panel_that_is_asked_for_is_made_at_once(qtbot):
    made: list[QLabel] = []
    late = LatePanel(lambda: make_label(made))
    qtbot.addWidget(late)
    assert late.made is None
    assert late.panel is made[0]
    late.show()
    qtbot.waitExposed(late)
    qtbot.wait(20)
    assert len(made) == 1
