"""The card of an operation on a fibre: as high as what it says."""

from typing import TYPE_CHECKING, cast

import pytest
from PySide6.QtCore import QEvent, QPointF, Qt
from PySide6.QtGui import QMouseEvent
from PySide6.QtWidgets import QApplication, QLabel
from pytestqt.qtbot import QtBot

from cosmic.app.panels.operation_card import OperationCard, at_work
from cosmic.autonomy.procedures.run import RunState
from cosmic.autonomy.procedures.tree import OPERATION, NodeEvent, NodeState, NodeView
from cosmic.autonomy.shipped.single_operation import OperationResult

if TYPE_CHECKING:
    from cosmic.autonomy.handling.context import HandlingContext
    from cosmic.autonomy.procedures.run import ProcedureRun


@pytest.mark.parametrize("words", [3, 12, 30])
def test_the_card_is_as_high_as_what_it_says(qtbot: QtBot, words: int) -> None:
    card = OperationCard(50.0)
    qtbot.addWidget(card)
    card.show_refused("Take with left", " ".join(["calibration"] * words))
    needed_px = card.line.heightForWidth(card.line.width())
    assert needed_px <= card.line.height() <= needed_px + 4
    card.show_refused("Take with left", "no")
    assert card.line.height() <= card.line.fontMetrics().lineSpacing() + 6


class Run:
    """As much of a run as the card looks at; `tree` is what the test says."""

    state = RunState.RUNNING
    tree = NodeView(NodeEvent((), "bend test", OPERATION, NodeState.WAITING), 1.0)

    aborted = ""

    def abort(self, why: str) -> None:
        self.aborted = why

    def work_at(self, name: str) -> None:
        self.tree = NodeView(NodeEvent((), name, OPERATION, NodeState.RUNNING), 1.0)


def test_a_running_card_is_as_high_as_what_it_says_and_can_be_ended(qtbot: QtBot) -> None:
    run = Run()
    card = OperationCard(50.0)
    qtbot.addWidget(card)
    card.follow("Take with left", cast("ProcedureRun[HandlingContext]", run))
    assert card.rect().contains(card.stop.geometry())
    for name in ("heights by focus", " ".join(["calibrate"] * 20)):
        run.work_at(name)
        card.refresh()
        assert card.line.height() >= card.line.heightForWidth(card.line.width())
        assert card.rect().contains(card.stop.geometry())


@pytest.mark.parametrize(
    ("name", "read"),
    [("push to 50 uN", "push to 50 µN"), ("heights by focus", "heights by focus")],
)
def test_the_card_writes_micronewtons_as_they_are_read(name: str, read: str) -> None:
    event = NodeEvent((), name, OPERATION, NodeState.RUNNING)
    assert at_work(NodeView(event, 1.0)) == read


def test_the_second_click_of_a_double_click_ends_nothing(qtbot: QtBot) -> None:
    run = Run()
    card = OperationCard(50.0)
    qtbot.addWidget(card)
    card.follow("Undo", cast("ProcedureRun[HandlingContext]", run))
    # The first was on the button that End has taken the place of.
    for kind in (QEvent.Type.MouseButtonDblClick, QEvent.Type.MouseButtonRelease):
        place = QPointF(card.stop.rect().center())
        button, none = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier
        QApplication.sendEvent(card.stop, QMouseEvent(kind, place, place, button, button, none))
    assert not run.aborted
    qtbot.mouseClick(card.stop, Qt.MouseButton.LeftButton)
    assert run.aborted


def test_values_that_have_no_room_are_counted(qtbot: QtBot) -> None:
    card = OperationCard(50.0)
    qtbot.addWidget(card)
    values = tuple((f"step {number}, force", f"{number} µN") for number in range(1, 7))
    card.show_result(OperationResult("Replay six", good=True, text="Done.", values=values))
    shown = [each.text() for each in card.findChildren(QLabel) if each.isVisibleTo(card)]
    assert "step 3, force" in shown
    assert "step 4, force" not in shown
    assert "and 3 more" in shown
