"""The board of a campaign and the card of a fibre."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import QModelIndex, QPoint, QRect, Qt
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QApplication, QWidget
from pytestqt.qtbot import QtBot

from cosmic.app.panels.campaign.board import CampaignBoard
from cosmic.app.panels.campaign.fibre_card import FibreCard, round_below
from cosmic.app.panels.campaign.table import CAUSE, EI, INTERVAL, NUMBER, OUTCOME, TIME
from cosmic.autonomy.campaign.records import FibreImage, FibreRecord, Outcome, Shape
from cosmic.autonomy.campaign.snapshot import (
    CampaignSnapshot,
    FibreRow,
    SpanCurve,
    card_of,
    snapshot_of,
)
from cosmic.autonomy.campaign.statistics import progress
from cosmic.frame.gui.palette import LIGHT
from cosmic.frame.gui.theme import State, apply_theme
from unit.autonomy.campaign.sample_records import failed, good, image

LEFT = Qt.MouseButton.LeftButton
FIBRES = [good(1), failed(2), good(3, ei_n_m2=2e-11, seed=1), failed(4, "slipped"), failed(5)]


def state(fibres: list[FibreRecord], word: str = "running", **more: object) -> CampaignSnapshot:
    return snapshot_of("quick", word, fibres, progress(fibres, 200.0), left_s=90.0, **more)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def only_board(qapp: QApplication) -> Iterator[CampaignBoard]:
    board = CampaignBoard()
    yield board
    board.close()
    board.deleteLater()


@pytest.fixture(scope="module")
def only_card(qapp: QApplication) -> Iterator[FibreCard]:
    card = FibreCard()
    yield card
    card.close()
    card.deleteLater()


@pytest.fixture
def board(only_board: CampaignBoard, qtbot: QtBot) -> CampaignBoard:
    only_board.set_state(CampaignSnapshot())
    only_board.resize(900, 700)
    only_board.show()
    qtbot.waitExposed(only_board)
    return only_board


@pytest.fixture
def card(only_card: FibreCard, qtbot: QtBot) -> FibreCard:
    only_card.clear()
    only_card.resize(820, 640)
    only_card.show()
    qtbot.waitExposed(only_card)
    return only_card


def cell(board: CampaignBoard, row: int, column: int) -> str:
    rows = board.table.rows
    return str(rows.data(rows.index(row, column)))


def test_the_board_reports_how_a_campaign_stands(board: CampaignBoard) -> None:
    board.set_state(state(FIBRES, operation="lift"))
    assert board.state.text() == "running"
    assert board.indicator.state is State.BUSY
    assert board.title.text() == "quick: lift"
    assert board.fibres.value.text() == "2 good, 3 failed"
    assert board.success.value.text() == "40 %"
    assert board.rate.value.text() == "36"
    assert board.left.value.text() == "90 s"
    assert "to" in board.mean.value.text()
    assert board.causes.texts() == [("missed grasp", "2"), ("slipped", "1")]
    assert not board.reason.isVisible()
    board.set_state(state(FIBRES, "ended", reason="2 good fibres"))
    assert board.reason.text() == "2 good fibres"
    assert board.indicator.state is State.OK


def test_the_table_has_the_newest_fibre_on_top(board: CampaignBoard) -> None:
    board.set_state(state(FIBRES))
    assert [cell(board, row, NUMBER) for row in range(5)] == ["5", "4", "3", "2", "1"]
    assert cell(board, 1, CAUSE) == "slipped"
    assert cell(board, 1, EI) == "–"
    assert float(cell(board, 4, EI)) == pytest.approx(50.0, rel=0.1)
    low, high = map(float, cell(board, 4, INTERVAL).split(" to "))
    assert low < 50.0 < high
    assert cell(board, 4, OUTCOME) == "good"


def test_a_new_fibre_leaves_the_selection_where_it_is(board: CampaignBoard, qtbot: QtBot) -> None:
    board.set_state(state(FIBRES[:3]))
    board.table.selectRow(1)
    running = replace(failed(4, ""), outcome=Outcome.RUNNING, ended_s=math.nan)
    board.set_state(state([*FIBRES[:3], running]))
    assert board.table.currentIndex().row() == 2
    assert cell(board, 0, OUTCOME) == "running"
    assert cell(board, 0, TIME) == "–"
    with qtbot.waitSignal(board.table.rows.dataChanged) as changed:
        board.set_state(state(FIBRES[:4]))
    assert changed.args is not None
    assert [index.row() for index in changed.args[:2]] == [0, 0]
    assert cell(board, 0, OUTCOME) == "failed"
    assert board.table.currentIndex().row() == 2
    board.set_state(state(FIBRES[:1]))
    assert board.table.rows.rowCount() == 1


def test_a_double_click_or_enter_chooses_a_fibre(board: CampaignBoard, qtbot: QtBot) -> None:
    board.set_state(state(FIBRES))
    chosen: list[int] = []
    board.fibre_chosen.connect(chosen.append)
    place = board.table.visualRect(board.table.rows.index(1, EI)).center()
    qtbot.mouseClick(board.table.viewport(), LEFT, pos=place)
    qtbot.mouseDClick(board.table.viewport(), LEFT, pos=place)
    board.table.selectRow(4)
    qtbot.keyClick(board.table, Qt.Key.Key_Return)
    assert chosen == [4, 1]


def test_the_histogram_counts_every_fibre_that_was_measured(board: CampaignBoard) -> None:
    rows = [
        FibreRow(n, Outcome.GOOD, "", _measured(n, 1e-11 * 1.3**n), Shape(), 30.0, 1)
        for n in range(12)
    ]
    measured = tuple(row.ei for row in rows if row.ei is not None)
    measured = (*measured[:-2], *(replace(each, trusted=False) for each in measured[-2:]))
    board.set_state(replace(state(FIBRES), measured=measured))
    histogram = board.histogram
    assert sum(histogram.bars.opts["height"]) == 10
    assert sum(histogram.doubtful.opts["height"]) == 2
    assert len(histogram.values.getData()[0]) == 12
    assert len(histogram.intervals.getData()[0]) == 24
    assert len(histogram.mean.getData()[0]) == 2
    board.set_state(state([]))
    assert len(histogram.values.getData()[0]) == 0


def _measured(number: int, ei_n_m2: float) -> object:
    from cosmic.autonomy.campaign.snapshot import MeasuredEi

    return MeasuredEi(number, ei_n_m2, 0.95 * ei_n_m2, 1.05 * ei_n_m2, trusted=True)


def test_causes_that_do_not_fit_are_added_up(board: CampaignBoard) -> None:
    causes = {f"cause {number}": 20 - number for number in range(9)}
    board.set_state(replace(state(FIBRES), causes=causes))
    shown = board.causes.texts()
    assert len(shown) == 6
    assert shown[-1] == ("others", str(15 + 14 + 13 + 12))


def test_the_board_follows_the_theme(board: CampaignBoard, qapp: QApplication) -> None:
    board.set_state(state(FIBRES))
    apply_theme(qapp, "light")
    try:
        brush = board.histogram.values.opts["brush"]
        assert brush.color() == QColor(LIGHT.text)
    finally:
        apply_theme(qapp, "dark")


def test_a_card_shows_image_curves_and_numbers(card: FibreCard, qtbot: QtBot) -> None:
    record = good(12, seed=3)
    record = replace(record, images=(image(3), replace(image(4, (60, 80)), name="held")))
    card.set_card(card_of(record))
    assert card.title.text() == "Fibre 12"
    assert card.indicator.state is State.OK
    assert (card.image.shown.width(), card.image.shown.height()) == (320, 240)
    card.images.setCurrentText("held")
    assert (card.image.shown.width(), card.image.shown.height()) == (80, 60)
    assert len(card.curves.labels) == len(record.spans)
    texts = _texts(card)
    assert any(" to " in text and "N m²" in text for text in texts)
    assert sum("±" in text for text in texts) == 2 + len(record.spans), "length, clamp, spans"
    assert "Force scale not verified." in card.doubts.toolTip() + card.doubts.text()
    replayed: list[int] = []
    card.replay_requested.connect(replayed.append)
    qtbot.mouseClick(card.replay, LEFT)
    assert replayed == [12]


@pytest.mark.parametrize(("width", "height"), [(1100, 480), (780, 320)])
def test_what_was_measured_is_seen_without_scrolling(
    card: FibreCard, qtbot: QtBot, width: int, height: int
) -> None:
    """The room of the card in the window of 1366 x 768, and of 1024 x 600."""
    card.resize(width, height)
    card.set_card(card_of(good(1)))
    assert "N m²" in card.value.text()
    for widget in (card.value, card.curves):
        qtbot.waitUntil(lambda seen=widget: _all_seen(seen, card), timeout=2_000)


@pytest.mark.parametrize("width", [800, 400])
def test_no_place_of_a_span_is_written_over_another(
    card: FibreCard, qtbot: QtBot, width: int
) -> None:
    push_um = np.array([-90.0, 0.0, 1.0])
    loading = np.array([True, True, True])
    curves = [
        SpanCurve(
            place_um=100.0 + 7.0 * number,
            used=number > 0,
            probe_um=push_um * (1.0 + 0.5 * number),
            force_un=np.array([0.0, 0.0, 70.0 - number]),
            fitted_un=np.array([0.0, 0.0, 70.0 - number]),
            loading=loading,
        )
        for number in range(5)
    ]
    card.set_card(card_of(good(1)))
    card.curves.show_curves(curves)
    card.curves.resize(width, 240)
    qtbot.wait(100)
    places = [each.mapRectToScene(each.boundingRect()) for each in card.curves.labels]
    for number, place in enumerate(places):
        assert not any(place.intersects(other) for other in places[:number]), number


def _all_seen(widget: QWidget, card: FibreCard) -> bool:
    place = QRect(widget.mapTo(card, QPoint()), widget.size())
    return widget.isVisible() and card.rect().contains(place)


def _texts(card: FibreCard) -> list[str]:
    found = []
    for grid in (card.numbers, card.spans):
        for place in range(grid.count()):
            item = grid.itemAt(place)
            assert item is not None
            found.append(item.widget().text())  # type: ignore[union-attr]
    return found


def test_a_card_of_a_failed_fibre_says_why(card: FibreCard) -> None:
    card.set_card(card_of(good(1)))
    card.set_card(card_of(failed(13)))
    assert card.indicator.state is State.ERROR
    assert card.outcome.text() == "failed: missed grasp"
    assert "did not follow" in card.text.text()
    assert card.failures.text() == "Failed operations: close: missed grasp, close: missed grasp"
    assert not card.curves.isVisible()
    assert card.value.text() == ""
    assert not any("N m²" in text for text in _texts(card))


def test_a_card_says_what_is_doubtful(card: FibreCard) -> None:
    record = good(1)
    assert record.bending is not None
    doubtful = replace(
        record.bending, trusted=False, reasons=("the jaws slipped at 191 um",), used=(0, 1)
    )
    card.set_card(card_of(replace(record, bending=doubtful)))
    assert "the jaws slipped at 191 µm" in card.doubts.text()
    assert any("not trusted" in text for text in _texts(card))
    assert card.curves.labels[2].toPlainText().endswith("not used")


def test_an_empty_card_shows_nothing_of_the_last_fibre(card: FibreCard) -> None:
    card.set_card(card_of(good(1)))
    card.clear()
    assert card.title.text() == "no fibre chosen"
    assert card.image.shown.isEmpty()
    assert not _texts(card)
    assert not card.replay.isEnabled()


def test_a_narrow_card_has_its_curves_below_the_image(card: FibreCard, qtbot: QtBot) -> None:
    card.set_card(card_of(good(1)))
    assert card.curves.x() > card.image.width() // 2
    card.resize(420, 640)
    qtbot.waitUntil(lambda: card.curves.x() < 50)


def test_an_image_of_16_bit_is_shown(card: FibreCard) -> None:
    deep = FibreImage("deep", np.full((80, 100), 0x8012, dtype=np.uint16), 0.0)
    card.set_card(card_of(replace(good(1), images=(deep,))))
    assert (card.image.shown.width(), card.image.shown.height()) == (100, 80)
    middle = card.image.grab().toImage().pixelColor(card.image.rect().center())
    assert middle.value() == 0x80


@pytest.mark.parametrize(("value", "round_one"), [(1.0, 1.0), (4.9, 2.0), (730.0, 500.0)])
def test_the_bar_of_the_scale_has_a_round_length(value: float, round_one: float) -> None:
    assert round_below(value) == pytest.approx(round_one)


def test_a_row_that_is_not_there_has_no_rows_below_it(board: CampaignBoard) -> None:
    rows = board.table.rows
    board.set_state(state(FIBRES))
    assert rows.rowCount(rows.index(0, 0)) == 0
    assert rows.rowCount(QModelIndex()) == 5
