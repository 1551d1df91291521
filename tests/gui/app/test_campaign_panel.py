"""The panel of campaigns: what is refused is told, what there is can be looked at."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFileDialog

from cosmic.app.panels.campaign.panel import OTHER, CampaignPanel
from cosmic.app.panels.scene_replay import poses_of
from cosmic.app.windows.top_bar import ACM, blocked_modes
from cosmic.autonomy.campaign.campaign import CampaignPhase
from cosmic.autonomy.campaign.recipe import load_recipe
from cosmic.autonomy.campaign.records import CampaignInfo, FibreRecord, Series
from cosmic.autonomy.campaign.statistics import progress
from cosmic.autonomy.campaign.storage_format import DATABASE
from cosmic.autonomy.campaign.store import CampaignStore
from cosmic.autonomy.procedures.procedure import Procedure
from cosmic.autonomy.shipped.bend_test import build_bend_test
from cosmic.frame.clock import ManualClock
from cosmic.frame.errors import CosmicError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.gui.theme import State
from unit.autonomy.campaign.sample_records import good

INFO = CampaignInfo("quick", "bend test", "three", "", "2026-11-21T12:00:00+00:00")


class Work:
    clock = ManualClock()


class StoredCampaign:
    """A campaign that is over, with what it left."""

    def __init__(self, folder: Path) -> None:
        there = (folder / DATABASE).exists()
        self.store = CampaignStore.open(folder) if there else CampaignStore.create(folder, INFO)
        for number in () if there else (1, 2):
            self.store.begin_fibre(time_s=10.0 * number)
            self.store.finish_fibre(good(number))
        self.store.close()
        self.recipe = load_recipe(Path("quick"))
        self.phase = CampaignPhase.READY
        self.procedure: Procedure = build_bend_test()
        self.work = Work()
        self.run = None
        self.end_reason, self.operation, self.left_s = "", "", float("nan")
        self.request = ""
        self.listeners: list = []

    @property
    def over(self) -> bool:
        return self.phase in (CampaignPhase.ENDED, CampaignPhase.STOPPED)

    @property
    def unfinished(self) -> bool:
        return self.phase is CampaignPhase.STOPPED

    @property
    def fibres(self) -> tuple[FibreRecord, ...]:
        return self.store.reader.fibres()

    @property
    def progress(self):
        return progress(self.fibres, 100.0)

    def on_change(self, listener):
        self.listeners.append(listener)
        return lambda: self.listeners.remove(listener)

    def start(self) -> None:
        self.phase, self.end_reason = CampaignPhase.ENDED, "2 fibres done"

    def confirm_plate(self) -> None:
        self.request = ""

    def pause(self) -> None:
        self.phase, self.end_reason = CampaignPhase.PAUSED, ""

    def abort(self, reason: str) -> None:
        self.phase, self.end_reason = CampaignPhase.STOPPED, reason

    def join(self) -> None:
        pass


@pytest.fixture
def opened() -> list[tuple[Path, Path]]:
    return []


@pytest.fixture
def panel(qtbot, tmp_path: Path, opened) -> Iterator[CampaignPanel]:
    def open_campaign(recipe: Path, folder: Path):
        opened.append((recipe, folder))
        if folder.name == "taken":
            raise CosmicError(f"{folder} holds a campaign by another recipe")
        return StoredCampaign(folder)

    panel = CampaignPanel(open_campaign, tmp_path, FailurePolicy())
    qtbot.addWidget(panel)
    panel.resize(520, 700)
    panel.show()
    yield panel
    panel.shut_down()


def press(qtbot, button) -> None:
    qtbot.mouseClick(button, Qt.MouseButton.LeftButton)


def test_a_plate_that_is_waited_for_is_asked_for_and_confirmed(panel, qtbot, tmp_path) -> None:
    panel.folder.setText(str(tmp_path / "plates"))
    press(qtbot, panel.procedure.start)
    assert not panel.plate.isVisibleTo(panel)
    before = panel.tabs.pos()
    panel.campaign.request = "put plate 2 on the table, and confirm it"
    panel.refresh()
    assert panel.plate.isVisibleTo(panel)
    assert "plate 2" in panel.message.toolTip()
    qtbot.wait(50)
    assert panel.tabs.pos() == before
    press(qtbot, panel.plate)
    panel.refresh()
    assert panel.campaign.request == ""
    assert not panel.plate.isVisibleTo(panel)


def test_a_campaign_that_cannot_begin_says_why_and_nothing_runs(panel, qtbot, tmp_path) -> None:
    panel.folder.setText(str(tmp_path / "taken"))
    press(qtbot, panel.procedure.start)
    assert "by another recipe" in panel.procedure.reason.text()
    assert panel.campaign is None
    assert panel.recipe.isEnabled()


@pytest.mark.parametrize("page", range(3))
def test_it_is_begun_and_steered_on_every_page(panel, qtbot, tmp_path, page: int) -> None:
    panel.tabs.setCurrentIndex(page)
    steering = (panel.procedure.start, panel.procedure.pause, panel.procedure.abort)
    assert all(each.isVisible() for each in steering)
    panel.folder.setText(str(tmp_path / "taken"))
    press(qtbot, panel.procedure.start)
    assert panel.procedure.reason.isVisible(), "why it is refused is seen"


def test_its_buttons_follow_it_on_every_page(panel, qtbot, tmp_path) -> None:
    panel.folder.setText(str(tmp_path / "here"))
    press(qtbot, panel.procedure.step)  # begun, and paused
    panel.tabs.setCurrentIndex(1)
    buttons = panel.procedure
    assert (buttons.start.isEnabled(), buttons.abort.isEnabled()) == (False, True)
    panel.campaign.abort("a hand on the button")
    for listener in panel.campaign.listeners:
        listener()
    qtbot.waitUntil(buttons.resume.isEnabled)
    qtbot.waitUntil(lambda: not buttons.abort.isEnabled())


def test_a_recipe_that_is_not_chosen_after_all_leaves_the_one_before(panel, qtbot) -> None:
    panel.recipe.setCurrentText(OTHER)
    panel.recipe.activated.emit(panel.recipe.currentIndex())
    dialog = panel.findChild(QFileDialog)
    dialog.reject()
    assert panel.recipe.currentText() == "quick"
    assert Path(panel.folder.text()).name.startswith("quick-")


def test_start_opens_the_chosen_recipe_in_the_folder_that_is_shown(
    panel, qtbot, tmp_path, opened
) -> None:
    panel.recipe.setCurrentText("transport")
    panel.folder.setText(str(tmp_path / "here"))
    press(qtbot, panel.procedure.start)
    assert opened == [(Path("transport"), tmp_path / "here")]


def test_a_recipe_of_a_file_is_named_and_read_anew_at_the_start(panel, qtbot, tmp_path) -> None:
    file = tmp_path / ("far away " * 5) / "mine.toml"
    file.parent.mkdir()
    file.write_text("nonsense = 1\n", encoding="utf-8")
    panel.use_recipe(str(file))
    assert "nonsense" in panel.about.toolTip() + panel.about.text()
    text = 'procedure = "bend test"\ndescription = "Long ones"\n[stop]\ncount = 1\n'
    file.write_text(f'{text}[sample]\nname = "three-dry"\n', encoding="utf-8")
    press(qtbot, panel.procedure.start)
    assert panel.about.text() == "mine.toml: Long ones"
    assert str(file) in panel.recipe.toolTip()


@pytest.mark.parametrize("typed", ["", "   "])
def test_without_a_folder_nothing_begins_in_the_working_directory(
    panel, qtbot, opened, typed: str
) -> None:
    panel.folder.setText(typed)
    press(qtbot, panel.procedure.start)
    assert opened == []
    assert "no output folder" in panel.procedure.reason.text()


def test_a_relative_folder_lies_where_campaigns_are_made(panel, qtbot, tmp_path, opened) -> None:
    panel.folder.setText(" Größe ä ")
    press(qtbot, panel.procedure.start)
    assert opened == [(Path("quick"), tmp_path / "Größe ä")]
    assert panel.folder.text() == str(tmp_path / "Größe ä")


def test_one_that_was_stopped_is_shown_as_stopped_and_resume_goes_on_in_its_folder(
    panel, qtbot, tmp_path, opened
) -> None:
    panel.recipe.setCurrentText("transport")
    panel.folder.setText(str(tmp_path / "here"))
    press(qtbot, panel.procedure.step)
    first = panel.campaign
    first.abort("a hand on the button")
    panel.refresh()
    panel.procedure.refresh()
    for sign in (panel.board.indicator, panel.procedure.indicator):
        assert sign.state is State.REFUSED
    assert panel.board.state.text() == "stopped"
    assert "a hand on the button" in panel.procedure.reason.text()
    assert panel.procedure.resume.isEnabled()
    assert panel.message.text() == "Resume goes on in here; Start begins a new one beside it"
    assert panel.folder.text() == str(tmp_path / "here"), "the one that Resume goes on in"
    assert panel.message.isVisible()
    panel.recipe.setCurrentText("quick")  # what is chosen meanwhile is for the next one
    press(qtbot, panel.procedure.resume)
    assert opened[-1] == (first.recipe, tmp_path / "here")
    assert panel.campaign is not first
    assert panel.campaign.phase is CampaignPhase.ENDED
    panel.refresh()
    panel.procedure.refresh()
    assert panel.board.state.text() == "ended"
    assert not panel.procedure.resume.isEnabled(), "it did what was asked"
    assert not panel.message.text()


def test_start_after_an_early_end_begins_in_a_folder_of_its_own(
    panel, qtbot, tmp_path, opened
) -> None:
    panel.folder.setText(str(tmp_path / "here"))
    press(qtbot, panel.procedure.step)
    panel.campaign.abort("a hand on the button")
    panel.refresh()
    panel.procedure.refresh()
    press(qtbot, panel.procedure.start)
    assert opened[-1][1] != tmp_path / "here"


def test_a_finished_fibre_is_shown_and_can_be_replayed(panel, qtbot, tmp_path) -> None:
    panel.folder.setText(str(tmp_path / "here"))
    press(qtbot, panel.procedure.start)
    panel.refresh()
    panel.board.fibre_chosen.emit(2)
    assert panel.tabs.currentWidget().isAncestorOf(panel.card)
    assert panel.card.card.number == 2
    with qtbot.waitSignal(panel.replay_requested) as signal:
        press(qtbot, panel.card.replay)
    assert signal.args[0].number == 2


def test_the_report_is_written_where_the_campaign_is(panel, qtbot, tmp_path) -> None:
    panel.folder.setText(str(tmp_path / "here"))
    press(qtbot, panel.procedure.start)
    press(qtbot, panel.report)
    assert not panel.report.isEnabled(), "the press returned before the report was written"
    qtbot.waitUntil(panel.report.isEnabled, timeout=20_000)
    assert (tmp_path / "here" / "report.html").exists()
    assert "report.html" in panel.message.toolTip() or "report.html" in panel.message.text()
    seen: list[Path] = []
    panel.open_file = seen.append
    press(qtbot, panel.message)
    assert seen == [tmp_path / "here" / "report.html"]
    panel.show_report()
    qtbot.waitUntil(lambda: len(seen) == 2, timeout=20_000)


def test_a_replay_goes_from_the_first_to_the_last_position_of_every_axis() -> None:
    times = np.array([10.0, 12.0, 20.0])
    poses = poses_of(
        [
            Series("left.x", "um", times, np.array([0.0, 100.0, 100.0])),
            Series("table.rotation", "deg", times[:1], np.array([5.0])),
        ]
    )
    assert poses[0] == {"left.x": 0.0, "table.rotation": 5.0}
    assert poses[-1] == {"left.x": 100.0, "table.rotation": 5.0}
    assert len(poses) == 50


def test_automatic_mode_is_offered_only_where_all_that_it_needs_runs() -> None:
    assert ACM not in blocked_modes(mico=True, model=True, campaigns=True)
    assert "cameras" in blocked_modes(mico=True, model=True, campaigns=False)[ACM]
