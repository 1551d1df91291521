"""The card of an operation on a fibre: as high as what it says."""

import pytest
from pytestqt.qtbot import QtBot

from cosmic.app.panels.operation_card import OperationCard, at_work
from cosmic.autonomy.procedures.tree import OPERATION, NodeEvent, NodeState, NodeView


@pytest.mark.parametrize("words", [3, 12, 30])
def test_the_card_is_as_high_as_what_it_says(qtbot: QtBot, words: int) -> None:
    card = OperationCard(50.0)
    qtbot.addWidget(card)
    card.show_refused("Take with left", " ".join(["calibration"] * words))
    needed_px = card.line.heightForWidth(card.line.width())
    assert needed_px <= card.line.height() <= needed_px + 4
    card.show_refused("Take with left", "no")
    assert card.line.height() <= card.line.fontMetrics().lineSpacing() + 6


@pytest.mark.parametrize(
    ("name", "read"),
    [("push to 50 uN", "push to 50 µN"), ("heights by focus", "heights by focus")],
)
def test_the_card_writes_micronewtons_as_they_are_read(name: str, read: str) -> None:
    event = NodeEvent((), name, OPERATION, NodeState.RUNNING)
    assert at_work(NodeView(event, 1.0)) == read
