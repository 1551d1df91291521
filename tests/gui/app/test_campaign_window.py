"""A window that is closed while a campaign runs in it: a safe end, and the record stays."""

import sys
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLabel, QPushButton, QWidget
from pytestqt.qtbot import QtBot

from cosmic.app.panels.campaign import dock
from cosmic.app.panels.campaign.dock import CAMPAIGN
from cosmic.app.panels.campaign.panel import CampaignPanel
from cosmic.app.panels.results.panel import ResultsPanel
from cosmic.app.platform import Platform, build_platform
from cosmic.app.windows.closing import CloseDialog
from cosmic.app.windows.operator_window import OperatorWindow
from cosmic.autonomy.campaign.campaign import Campaign
from cosmic.autonomy.campaign.records import Outcome
from cosmic.autonomy.campaign.store import CampaignStore
from cosmic.autonomy.campaign.store_read import CampaignReader
from cosmic.daqco.gui.main_widget import make_daqco_gui
from cosmic.mico.gui.mico_widget import make_mico_gui
from cosmic.vico.gui.vico_gui import make_vico_gui
from gui.app.windows import Make, mico
from system.campaign_bench import Strike

RECIPE = """
procedure = "transport"
[sample]
name = "three-dry"
[stop]
count = 3
"""


def whole_platform() -> Platform:
    return build_platform(
        None,
        applications=("mico", "daqco", "vico"),
        rate=10.0,
        sample="three-dry",
        mico_gui=make_mico_gui,
        daqco_gui=make_daqco_gui,
        vico_gui=make_vico_gui,
    )


def panel_of(window: OperatorWindow, qtbot: QtBot) -> CampaignPanel:
    window.raise_panel(CAMPAIGN)
    qtbot.waitUntil(lambda: window.findChild(CampaignPanel) is not None)
    panel = window.findChild(CampaignPanel)
    assert panel is not None
    return panel


def begun(window: OperatorWindow, qtbot: QtBot, home: Path) -> Campaign:
    """Begin a campaign as the operator does."""
    names = ("left.x", "probe.y", "table.rotation")
    cards = mico(window).cards
    qtbot.waitUntil(
        lambda: all(cards[each].axis.details.position is not None for each in names),
        timeout=30_000,
    )
    recipe = home / "recipe.toml"
    recipe.write_text(RECIPE, encoding="utf-8")
    panel = panel_of(window, qtbot)
    panel.use_recipe(str(recipe))
    panel.folder.setText(str(home / "out"))
    qtbot.mouseClick(panel.procedure.start, Qt.MouseButton.LeftButton)
    assert panel.campaign is not None, panel.procedure.reason.text()
    return panel.campaign


def close_and_check(window: OperatorWindow, campaign: Campaign, home: Path) -> list[Outcome]:
    """Close the window in the middle of its campaign; returns what its fibres came to."""
    assert not campaign.over, campaign.end_reason
    window.close()
    assert window.isVisible()
    question = window.findChild(CloseDialog)
    assert isinstance(question, CloseDialog)
    assert "campaign is running" in question.informativeText()
    question.now.click()
    assert not window.isVisible()
    assert campaign.over
    assert campaign.end_reason == "the window was closed"
    assert campaign.run is not None
    assert campaign.run.not_safe == ""
    reader = CampaignReader(home / "out")
    assert reader.ended()[1] == "the window was closed"
    with CampaignStore.open(home / "out"):
        pass  # nobody holds the folder any more
    return [each.outcome for each in reader.fibres()]


def wait_for_listing(window: OperatorWindow, qtbot: QtBot, folder: Path) -> None:
    """Wait until the results list a campaign, wherever it lies."""
    results = window.findChild(ResultsPanel)
    assert results is not None
    results.refresh()

    def seen() -> bool:
        return any(item.path == folder for each in results.sessions.sessions for item in each.items)

    qtbot.waitUntil(seen, timeout=10_000)


def test_a_campaign_is_stopped_gone_on_with_and_ended_safely_with_its_window(
    make: Make, qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = make(whole_platform())
    assert window.tasks is not None
    assert window.tasks.operations is not None
    before = window.tasks.operations.card
    before.show_refused("Put away", "left is empty")
    campaign = begun(window, qtbot, tmp_path)
    assert before.isHidden(), "what it says holds no longer"
    cards = mico(window).cards.values()

    def moves(campaign: Campaign) -> bool:
        return any(each.axis.details.in_motion for each in cards) or campaign.over

    coach = window.findChild(QWidget, "coach")
    assert coach is not None
    words = coach.findChild(QLabel)
    assert words is not None
    qtbot.waitUntil(lambda: moves(campaign), timeout=30_000)
    # Between pushes its force limit is disarmed on purpose: nobody is to arm it meanwhile.
    qtbot.waitUntil(lambda: words.text().startswith("A campaign runs"), timeout=10_000)
    button = coach.findChild(QPushButton, "coachButton")
    assert isinstance(button, QPushButton)
    assert mico(window).busy == "a campaign moves the axes; end or pause it first"
    panel = panel_of(window, qtbot)
    qtbot.mouseClick(panel.procedure.pause, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: words.text().startswith("The campaign is paused"), timeout=60_000)
    assert mico(window).busy == ""
    qtbot.mouseClick(button, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: words.text().startswith("A campaign runs"), timeout=10_000)
    assert "a campaign is running" in mico(window).undoing.doubt()
    asked = ["put plate 2 on the table, and confirm it"]
    with monkeypatch.context() as patch:
        patch.setattr(Campaign, "request", property(lambda campaign: "".join(asked)))
        patch.setattr(Campaign, "confirm_plate", lambda campaign: asked.clear())
        qtbot.waitUntil(lambda: button.text() == "Plate is there", timeout=10_000)
        assert "waits for a person: put plate 2" in words.text()
        qtbot.mouseClick(button, Qt.MouseButton.LeftButton)
        assert not asked
        qtbot.waitUntil(lambda: words.text().startswith("A campaign runs"), timeout=10_000)
    window.stop("a hand on the button")
    qtbot.waitUntil(lambda: campaign.over, timeout=30_000)
    qtbot.waitUntil(lambda: panel.board.state.text() == "stopped", timeout=5_000)
    qtbot.waitUntil(panel.procedure.resume.isEnabled, timeout=5_000)
    wait_for_listing(window, qtbot, tmp_path / "out")
    window.top_bar.reset_requested.emit()
    qtbot.waitUntil(lambda: button.isVisible() and button.text() == "Resume", timeout=5_000)
    qtbot.mouseClick(button, Qt.MouseButton.LeftButton)
    again = panel.campaign
    assert again is not None
    assert again is not campaign, panel.procedure.reason.text()
    assert campaign.progress.elapsed_s <= again.progress.elapsed_s
    qtbot.waitUntil(lambda: moves(again), timeout=30_000)
    assert close_and_check(window, again, tmp_path) == []


def test_a_window_that_was_closed_soon_loads_no_panel_any_more(
    make: Make, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else its thread ran while the program ended, which ended in an abort."""
    monkeypatch.setattr(dock, "LOAD_AFTER_MS", 3000)
    monkeypatch.delitem(sys.modules, dock.PANEL)
    window = make(whole_platform())
    window.close_now()
    assert dock.PANEL not in sys.modules
    qtbot.wait(4000)
    assert dock.PANEL not in sys.modules


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_closing_the_window_keeps_the_record_of_the_fibre_in_the_jaws(
    make: Make, qtbot: QtBot, tmp_path: Path
) -> None:
    window = make(whole_platform())
    campaign = begun(window, qtbot, tmp_path)
    carried = Strike(campaign, "carry to the probe", lambda: None)
    qtbot.waitUntil(lambda: carried.struck.is_set() or campaign.over, timeout=500_000)
    assert close_and_check(window, campaign, tmp_path) == [Outcome.INTERRUPTED]
