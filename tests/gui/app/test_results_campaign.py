"""A campaign among the results: its board, the card of a fibre, and its report."""

import os
import sqlite3
from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QTreeWidgetItem
from pytestqt.qtbot import QtBot

from cosmic.app.panels.campaign.fibre_card import FibreCard
from cosmic.app.panels.campaign.table import NUMBER
from cosmic.app.panels.results.panel import ResultsPanel
from cosmic.autonomy.campaign.store import CampaignStore
from cosmic.frame.failure import FailurePolicy
from gui.app.test_workspaces import clipped, overlapping
from unit.autonomy.campaign.sample_records import INFO, failed, good

LEFT = Qt.MouseButton.LeftButton
PAGE = (1358, 630)
"""The room of the results in a window of 1366 x 768."""


def write_campaign(folder: Path, *, ei_n_m2: float = 5e-11, reason: str = "2 fibres done") -> None:
    with CampaignStore.create(folder, INFO) as store:
        first = good(store.begin_fibre(time_s=0.0), ei_n_m2=ei_n_m2)
        store.finish_fibre(first)
        second = store.begin_fibre(time_s=first.ended_s)
        store.finish_fibre(failed(second, "jaw adhesion", began_s=first.ended_s))
        store.end(reason, time_s=first.ended_s + 60.0)


@pytest.fixture
def panel(qtbot: QtBot, tmp_path: Path) -> Iterator[ResultsPanel]:
    made = ResultsPanel(lambda: (tmp_path,), FailurePolicy(), lambda: None)
    qtbot.addWidget(made)
    made.resize(*PAGE)
    made.show()
    yield made
    made.shut_down()


def row_of(panel: ResultsPanel, qtbot: QtBot, name: str) -> QTreeWidgetItem:
    panel.refresh()
    qtbot.waitUntil(lambda: panel.sessions.row_of(name) is not None)
    row = panel.sessions.row_of(name)
    assert row is not None
    return row


def choose(panel: ResultsPanel, qtbot: QtBot, name: str) -> None:
    place = panel.sessions.list.visualItemRect(row_of(panel, qtbot, name)).center()
    qtbot.mouseClick(panel.sessions.list.viewport(), LEFT, pos=place)


def fibres(panel: ResultsPanel) -> str:
    """Return what the board says of the fibres; nothing while it is not seen."""
    board = panel.campaign.board
    return board.fibres.value.text() if board is not None and board.isVisible() else ""


def shown(panel: ResultsPanel, qtbot: QtBot, folder: Path) -> FibreCard:
    """Write a campaign, choose it, and wait for it; returns the card of its fibres."""
    write_campaign(folder)
    choose(panel, qtbot, folder.name)
    qtbot.waitUntil(lambda: fibres(panel) == "1 good, 1 failed")
    card = panel.campaign.card
    assert card is not None
    return card


def test_a_campaign_of_before_shows_how_it_went_and_its_fibres(
    panel: ResultsPanel, qtbot: QtBot, tmp_path: Path
) -> None:
    write_campaign(tmp_path / "pine", reason="stopped: a hand on the button")
    choose(panel, qtbot, "pine")
    qtbot.waitUntil(lambda: fibres(panel) == "1 good, 1 failed")
    board, card = panel.campaign.board, panel.campaign.card
    assert board is not None
    assert card is not None
    assert "a hand on the button" in board.reason.text()
    assert board.indicator.state is None  # nobody knows here whether it did what was asked
    assert clipped(panel) == []
    oldest_last = board.table.model().index(1, NUMBER)
    assert oldest_last.data() == "1"
    board.table.doubleClicked.emit(oldest_last)
    qtbot.waitUntil(lambda: card.isVisible() and card.title.text() == "Fibre 1")
    assert "N m²" in card.value.text()
    assert card.replay.isHidden()
    assert overlapping(panel) == []


def test_a_campaign_has_an_image_of_its_first_fibre_in_the_list(
    panel: ResultsPanel, qtbot: QtBot, tmp_path: Path
) -> None:
    write_campaign(tmp_path / "pine")
    CampaignStore.create(tmp_path / "birch", INFO).close()
    row_of(panel, qtbot, "birch")
    greys = set()

    def drawn(name: str) -> bool:
        row = panel.sessions.row_of(name)
        assert row is not None
        image = row.icon(0).pixmap(56, 32).toImage()
        middle = image.height() // 2
        greys.update(image.pixelColor(x, middle).value() for x in range(image.width()))
        return max(greys) > 100

    qtbot.waitUntil(lambda: drawn("pine"))
    greys.clear()
    assert not drawn("birch")


def test_another_campaign_shows_nothing_of_the_one_before(
    panel: ResultsPanel, qtbot: QtBot, tmp_path: Path
) -> None:
    CampaignStore.create(tmp_path / "birch", INFO).close()
    card = shown(panel, qtbot, tmp_path / "pine")
    panel.campaign.show_fibre(1)
    qtbot.waitUntil(card.isVisible)
    choose(panel, qtbot, "birch")
    qtbot.waitUntil(lambda: fibres(panel) == "0")
    assert card.title.text() == "no fibre chosen"


def test_a_fibre_that_comes_when_another_campaign_is_chosen_is_not_shown(
    panel: ResultsPanel, qtbot: QtBot, tmp_path: Path
) -> None:
    CampaignStore.create(tmp_path / "birch", INFO).close()
    card = shown(panel, qtbot, tmp_path / "pine")
    panel.campaign.show_fibre(1)
    panel.campaign.show_campaign(tmp_path / "birch")
    qtbot.waitUntil(lambda: fibres(panel) == "0")
    assert card.title.text() == "no fibre chosen"


def test_what_was_added_is_seen_by_looking_again(
    panel: ResultsPanel, qtbot: QtBot, tmp_path: Path
) -> None:
    with CampaignStore.create(tmp_path / "pine", INFO) as store:
        choose(panel, qtbot, "pine")
        qtbot.waitUntil(lambda: fibres(panel) == "0")
        store.finish_fibre(good(store.begin_fibre(time_s=0.0)))
        qtbot.mouseClick(panel.sessions.again, LEFT)
        qtbot.waitUntil(lambda: fibres(panel) == "1 good")


def test_a_campaign_that_cannot_be_read_says_why(
    panel: ResultsPanel, qtbot: QtBot, tmp_path: Path
) -> None:
    write_campaign(tmp_path / "pine")
    with sqlite3.connect(tmp_path / "pine" / "campaign.sqlite") as connection:
        connection.execute("PRAGMA user_version = 99")
    connection.close()
    choose(panel, qtbot, "pine")
    qtbot.waitUntil(lambda: "version 99" in panel.message.text())


def test_its_report_is_written_where_there_is_none_or_an_old_one(
    panel: ResultsPanel, qtbot: QtBot, tmp_path: Path
) -> None:
    opened: list[Path] = []
    panel.open_file = opened.append
    folder = tmp_path / "pine"
    write_campaign(folder)
    choose(panel, qtbot, "pine")
    page = folder / "report.html"
    for count in (1, 2):
        qtbot.mouseClick(panel.campaign.report, LEFT)
        qtbot.waitUntil(lambda count=count: opened == count * [page])
        words = page.read_text(encoding="utf-8")
        assert words != "old"
        page.write_text("old", encoding="utf-8")
        before = (folder / "campaign.sqlite").stat().st_mtime - 60.0
        os.utime(page, (before, before))
    page.write_text("mine", encoding="utf-8")  # newer than the campaign: somebody's own
    qtbot.mouseClick(panel.campaign.report, LEFT)
    qtbot.waitUntil(lambda: len(opened) == 3)
    assert page.read_text(encoding="utf-8") == "mine"
