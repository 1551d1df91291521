"""Operations on a fibre from the picture: found, right-clicked, taken, bent, put away."""

import logging
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from PySide6.QtCore import QPointF, Qt
from PySide6.QtGui import QAction, QContextMenuEvent
from PySide6.QtWidgets import QApplication, QLabel, QLineEdit, QMenu, QPushButton, QWidget
from pytestqt.qtbot import QtBot

import cosmic
from cosmic.app.panels.operation_card import OperationCard
from cosmic.app.platform import build_platform
from cosmic.app.windows.fibre_menu import FibreOperations
from cosmic.app.windows.operator_window import OperatorWindow
from cosmic.app.windows.tasks import HANDLE, MEASURE, TaskLayout
from cosmic.autonomy.handling.held_fibre import HeldFibre
from cosmic.autonomy.recorded.operations import Surroundings
from cosmic.autonomy.recorded.replay import replay_on
from cosmic.autonomy.recorded.steps import MoveStep, RecordedProcedure, WaitForOperatorStep
from cosmic.daqco.gui.main_widget import make_daqco_gui
from cosmic.frame.gui.quantity_field import QuantityField
from cosmic.frame.gui.theme import State
from cosmic.mico.api.news import AxisBegun
from cosmic.mico.gui.mico_widget import make_mico_gui
from cosmic.twin.truth import read_truth
from cosmic.vico.gui.vico_gui import make_vico_gui
from gui.app.windows import Make, mico

LEFT = Qt.MouseButton.LeftButton
LONG_MS = 600_000


def tasks(window: OperatorWindow) -> TaskLayout:
    assert window.tasks is not None
    return window.tasks


def operations(window: OperatorWindow) -> FibreOperations:
    found = tasks(window).operations
    assert found is not None
    return found


class Hand:
    """Clicks, and counts what it does."""

    def __init__(self, window: OperatorWindow, qtbot: QtBot) -> None:
        self.count = 0
        self._window, self._qtbot = window, qtbot

    def click(self, widget: QWidget) -> None:
        self._qtbot.waitUntil(lambda: widget.isVisible() and widget.isEnabled())
        self.count += 1
        self._qtbot.mouseClick(widget, LEFT)

    def menu_at(self, pixel: tuple[float, float]) -> dict[str, QAction]:
        """Right-click a pixel of the image, and return what the menu offers."""
        self.count += 1
        view = tasks(self._window).central_view.camera.view
        point = view.to_screen.map(QPointF(*pixel)).toPoint()
        QApplication.sendEvent(
            view.viewport(),
            QContextMenuEvent(QContextMenuEvent.Reason.Mouse, point, view.mapToGlobal(point)),
        )
        shown = [each for each in QApplication.topLevelWidgets() if isinstance(each, QMenu)]
        menu = next(each for each in shown if each.isVisible())
        self._menu = menu
        return {each.text(): each for each in menu.actions() if each.text()}

    def choose(self, action: QAction) -> None:
        """Point at an entry of the menu and click it."""
        self.count += 1
        action.hover()
        assert action.isEnabled(), action.toolTip()
        place = self._menu.actionGeometry(action).center()
        self._qtbot.mouseClick(self._menu, LEFT, pos=place)

    def enter(self, field: QLineEdit, text: str) -> None:
        self.count += 1
        self._window.activateWindow()
        self._qtbot.waitUntil(self._window.isActiveWindow)
        field.setFocus()  # else the letters are keys that jog
        field.selectAll()
        self._qtbot.keyClicks(field, text)


def with_fibres(make: Make, qtbot: QtBot, truth: Path | None = None) -> OperatorWindow:
    """Open a window over three dry fibres, and wait for the image."""
    platform = build_platform(
        None,
        applications=("mico", "daqco", "vico"),
        rate=8.0,
        sample="three-dry",
        truth=truth,
        mico_gui=make_mico_gui,
        daqco_gui=make_daqco_gui,
        vico_gui=make_vico_gui,
    )
    window = make(platform, size=(1366, 768))
    assert window.workspaces is not None
    window.workspaces.choose(HANDLE)
    view = tasks(window).central_view.camera.view
    qtbot.waitUntil(lambda: view.image is not None, timeout=15_000)
    return window


def fibre_px(window: OperatorWindow, qtbot: QtBot) -> tuple[float, float]:
    """Wait until a fibre is found, and return the middle of the longest that is certain."""
    camera = tasks(window).central_view.camera.camera

    def found() -> bool:
        seen = camera.analysis
        return seen is not None and any(each.certain for each in seen.fibres)

    qtbot.waitUntil(found, timeout=15_000)
    seen = camera.analysis
    assert seen is not None
    fibre = max((each for each in seen.fibres if each.certain), key=lambda each: each.length_px)
    x, y = fibre.centre_line_px[len(fibre.centre_line_px) // 2]
    return float(x), float(y)


def coach_button(window: OperatorWindow) -> QPushButton:
    found = window.findChild(QPushButton, "coachButton")
    assert isinstance(found, QPushButton)
    return found


def done(window: OperatorWindow, qtbot: QtBot, title: str) -> OperationCard:
    """Wait until an operation has ended well, and its card says so."""
    card = operations(window).card
    qtbot.waitUntil(
        lambda: card.badge.state is not State.BUSY and not operations(window).running,
        timeout=LONG_MS,
    )
    assert card.title.toolTip() == title, card.line.text()
    assert card.badge.state is State.OK, card.line.text()
    return card


def test_what_cannot_be_done_with_a_fibre_says_why_and_moves_nothing(
    make: Make, qtbot: QtBot
) -> None:
    window = with_fibres(make, qtbot)
    hand = Hand(window, qtbot)
    assert window.platform.mico is not None
    manager = window.platform.mico.manager
    before = {name: each.position for name, each in manager.states().items()}
    menu = hand.menu_at((10.0, 10.0))
    assert "no fibre is marked" in menu["Take with left"].toolTip()
    assert "take one first" in menu["Bring to the probe"].toolTip()
    assert not menu["Put away"].isEnabled()
    hand.choose(menu["Find fibres"])
    pixel = fibre_px(window, qtbot)
    menu = hand.menu_at(pixel)
    view = tasks(window).central_view.camera
    on = {each.name for each in view.camera.algorithms if each.on}
    assert on >= {"fibres", "tips", "held fibre"}
    menu["Take with left"].hover()
    assert view.mark.line_px is not None
    assert "Take with left" in view.message.text
    assert menu["Take with right"].isEnabled()
    qtbot.keyClick(QApplication.activePopupWidget(), Qt.Key.Key_Escape)
    assert view.mark.line_px is None
    operations(window).push(20.0)
    card = operations(window).card
    assert card.badge.state is State.REFUSED
    assert "take one first" in card.line.text()
    assert {name: each.position for name, each in manager.states().items()} == before


def test_a_gripper_closes_gently_and_says_how_far_it_is_open(make: Make, qtbot: QtBot) -> None:
    window = with_fibres(make, qtbot)
    tool = tasks(window).tool
    gently = window.findChild(QPushButton, "gripperGently")
    opening = window.findChild(QLabel, "gripperOpening")
    assert isinstance(gently, QPushButton)
    assert isinstance(opening, QLabel)
    assert window.platform.mico is not None
    manager = window.platform.mico.manager
    qtbot.waitUntil(lambda: manager.state("left.gripper").present)
    qtbot.waitUntil(lambda: opening.text() == "30 ± ? µm")
    tool.move_once("left.gripper", 1)  # by 10 um: a known beginning
    qtbot.waitUntil(lambda: not manager.state("left.gripper").in_motion)
    before = manager.state("left.gripper").position or 0.0
    told: list[str] = []
    mico(window).mico.follow_movements(
        lambda news: told.append(news.source) if isinstance(news, AxisBegun) else None
    )
    hand = Hand(window, qtbot)
    hand.click(gently)
    card = done(window, qtbot, "Close gently")
    assert told[-1] == "close gently (window)"
    assert (manager.state("left.gripper").position or 0.0) < before
    assert "0 ± 49 µm" in card.findChildren(QLabel, "operationValue")[0].text()
    qtbot.waitUntil(lambda: opening.text() == "0 ± 49 µm")
    assert window.platform.mico.collision is not None
    assert window.platform.mico.collision.allowed_contacts == frozenset()


def test_the_log_keeps_the_values_that_a_card_shows(
    make: Make, qtbot: QtBot, caplog: pytest.LogCaptureFixture
) -> None:
    window = with_fibres(make, qtbot)
    gently = window.findChild(QPushButton, "gripperGently")
    assert isinstance(gently, QPushButton)
    assert window.platform.mico is not None
    manager = window.platform.mico.manager
    qtbot.waitUntil(lambda: manager.state("left.gripper").present)
    caplog.set_level(logging.INFO)
    Hand(window, qtbot).click(gently)
    card = done(window, qtbot, "Close gently")
    value = card.findChildren(QLabel, "operationValue")[0].text()
    lines = [each.getMessage() for each in caplog.records]
    line = next(each for each in lines if each.startswith("Close gently: "))
    assert value in line
    undo = tasks(window).tool.undo
    qtbot.waitUntil(lambda: not undo.isEnabled())
    assert "on its card" in undo.toolTip(), "much has moved, and is not undone here"


def test_jaws_opened_in_the_panel_leave_the_fibre_in_doubt(make: Make, qtbot: QtBot) -> None:
    window = with_fibres(make, qtbot)
    found = operations(window)
    assert window.platform.mico is not None
    manager = window.platform.mico.manager
    qtbot.waitUntil(lambda: manager.state("left.gripper").present)
    still = RecordedProcedure(name="still", step=[MoveStep(axes={"left.x": 0.0})])
    replay_on(found.handling, still, Surroundings()).run_here()
    candidate = cast("Any", SimpleNamespace(candidate=SimpleNamespace(width_um=20.0)))
    found.handling.context("left").fibre = HeldFibre(number=1, reach=candidate, held=True)
    assert found.next_request() is not None
    qtbot.mouseClick(tasks(window).tool.choices["left"], LEFT)
    width = window.findChild(QuantityField, "gripperWidth")
    assert width is not None
    Hand(window, qtbot).enter(width, "150")
    qtbot.keyClick(width, Qt.Key.Key_Return)
    card = found.card
    qtbot.waitUntil(lambda: "were opened" in card.line.text())
    assert card.badge.word == "IN DOUBT"
    assert "whether they still hold fibre 1 is not known" in card.line.text()
    assert card.next.isVisible()
    assert card.next.text() == "Put away"
    assert not card.undo.isVisible()
    assert (found.handling.held_by, found.handling.may_hold) == ("", "left")
    menu = Hand(window, qtbot).menu_at((10.0, 10.0))
    assert not menu["Bring to the probe"].isEnabled()
    assert menu["Put away"].isEnabled()


def take(window: OperatorWindow, qtbot: QtBot) -> OperationCard:
    """Have the left gripper begin to take a fibre, and wait until something moves."""
    hand = Hand(window, qtbot)
    hand.choose(hand.menu_at((10.0, 10.0))["Find fibres"])
    hand.choose(hand.menu_at(fibre_px(window, qtbot))["Take with left"])
    found = operations(window)
    assert window.platform.mico is not None
    manager = window.platform.mico.manager
    qtbot.waitUntil(lambda: any(each.in_motion for each in manager.states().values()))
    assert found.running
    return found.card


def test_an_operation_that_the_operator_ends_is_no_error(make: Make, qtbot: QtBot) -> None:
    window = with_fibres(make, qtbot)
    card = take(window, qtbot)
    assert card.rect().contains(card.stop.geometry())
    qtbot.mouseClick(card.stop, LEFT)
    assert card.badge.state is State.BUSY  # nothing was refused: it is being made safe
    qtbot.waitUntil(lambda: not operations(window).running, timeout=60_000)
    qtbot.waitUntil(card.close_button.isVisible)
    assert card.badge.word == "ENDED"
    assert card.line.text() == "It was ended by the operator."


def test_what_is_asked_for_while_an_operation_runs_is_refused_and_leaves_its_card(
    make: Make, qtbot: QtBot, tmp_path: Path
) -> None:
    window = with_fibres(make, qtbot)
    found = operations(window)
    card = take(window, qtbot)
    view = tasks(window).central_view.camera
    found.replay(RecordedProcedure(name="again", step=[]), lambda: tmp_path)
    assert view.message.text == "Replay again: take with left is running; end it first"
    found.close_gently("right")
    assert "is running" in view.message.text
    assert (card.badge.state, card.title.text()) == (State.BUSY, "Take with left")
    assert card.stop.isVisible()
    assert found.title == "Take with left"
    qtbot.mouseClick(card.stop, LEFT)
    qtbot.waitUntil(lambda: not found.running, timeout=60_000)
    qtbot.waitUntil(card.close_button.isVisible)
    assert view.message.text == ""
    assert found.title == ""


def test_a_key_moves_no_axis_under_an_operation_and_may_while_a_replay_waits(
    make: Make, qtbot: QtBot, tmp_path: Path
) -> None:
    window = with_fibres(make, qtbot)
    found = operations(window)
    card = take(window, qtbot)
    refusals: list[str] = []
    commands = mico(window).cards["left.y"].commands
    commands.refused.connect(lambda _field, why: refusals.append(why))
    qtbot.keyPress(window, Qt.Key.Key_W)
    qtbot.keyRelease(window, Qt.Key.Key_W)
    assert refusals == ["take with left moves the axes; end or pause it first"]
    assert window.top_bar.message == refusals[0]
    qtbot.waitUntil(lambda: not window.top_bar.message, timeout=15_000)
    assert found.running
    qtbot.mouseClick(card.stop, LEFT)
    qtbot.waitUntil(lambda: not found.running, timeout=60_000)
    waiting = RecordedProcedure(name="by hand", step=[WaitForOperatorStep()])
    found.replay(waiting, lambda: tmp_path)
    qtbot.waitUntil(lambda: found.waits)
    axis = mico(window).cards["left.y"].axis
    before = axis.position_um
    qtbot.keyPress(window, Qt.Key.Key_W)
    qtbot.waitUntil(lambda: axis.position_um > before + 5.0)
    qtbot.keyRelease(window, Qt.Key.Key_W)
    found.go_on()
    qtbot.waitUntil(lambda: not found.running, timeout=60_000)
    assert len(refusals) == 1


def test_after_an_operation_that_failed_the_coach_zooms_out(make: Make, qtbot: QtBot) -> None:
    window = with_fibres(make, qtbot)
    card = take(window, qtbot)
    qtbot.mouseClick(card.stop, LEFT)
    qtbot.waitUntil(lambda: not operations(window).running, timeout=60_000)
    assert window.platform.vico is not None
    lens = cosmic.Rig(window.platform).vico.lens
    assert lens is not None
    lens.zoom_to(5.0)
    qtbot.waitUntil(lambda: (lens.zoom or 0.0) > 4.9, timeout=30_000)
    coach = coach_button(window)
    qtbot.waitUntil(lambda: coach.isVisible() and coach.text() == "Zoom out")
    qtbot.mouseClick(coach, LEFT)
    qtbot.waitUntil(lambda: (lens.zoom or 9.0) < 0.6, timeout=30_000)
    qtbot.waitUntil(lambda: not coach.isVisible())


def test_a_fibre_found_at_a_high_zoom_is_refused_before_anything_is_calibrated(
    make: Make, qtbot: QtBot
) -> None:
    window = with_fibres(make, qtbot)
    lens = cosmic.Rig(window.platform).vico.lens
    assert lens is not None
    hand = Hand(window, qtbot)
    hand.choose(hand.menu_at((10.0, 10.0))["Find fibres"])
    lens.zoom_to(2.0)
    qtbot.waitUntil(lambda: abs((lens.zoom or 0.0) - 2.0) < 0.01, timeout=30_000)
    coach = coach_button(window)
    qtbot.waitUntil(lambda: coach.isVisible() and coach.text() == "Zoom out")
    camera = tasks(window).central_view.camera.camera

    def at_zoom() -> bool:
        seen = camera.analysis
        counts = seen.image.circumstances.zoom_counts if seen is not None else None
        return counts is not None and lens.scale.zoom(counts) > 1.9

    qtbot.waitUntil(at_zoom, timeout=15_000)
    menu = hand.menu_at(fibre_px(window, qtbot))
    assert not menu["Take with left"].isEnabled()
    assert "zoom out" in menu["Take with left"].toolTip()
    qtbot.keyClick(QApplication.activePopupWidget(), Qt.Key.Key_Escape)


def test_while_stopped_card_and_menu_say_what_to_do(make: Make, qtbot: QtBot) -> None:
    window = with_fibres(make, qtbot)
    card = take(window, qtbot)
    window.stop("STOP button")
    qtbot.waitUntil(lambda: not operations(window).running, timeout=60_000)
    qtbot.waitUntil(card.close_button.isVisible)
    assert card.badge.word == "STOPPED"
    assert "Motion was stopped: STOP button." in card.line.text()
    assert "press Reset" in card.line.text()
    menu = Hand(window, qtbot).menu_at(fibre_px(window, qtbot))
    assert "press Reset" in menu["Take with left"].toolTip()
    qtbot.keyClick(QApplication.activePopupWidget(), Qt.Key.Key_Escape)
    operations(window).push(20.0)
    assert card.badge.state is State.REFUSED
    assert "press Reset" in card.line.text()


@pytest.mark.slow
@pytest.mark.timeout(1500)
def test_a_fibre_is_picked_up_and_bent_and_recorded_by_fifteen_actions(
    make: Make, qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    truth = tmp_path / "truth.jsonl"
    window = with_fibres(make, qtbot, truth)
    monkeypatch.setattr(tasks(window).folder, "_folder", tmp_path)
    hand = Hand(window, qtbot)
    coach = coach_button(window)
    qtbot.waitUntil(lambda: coach.isVisible() and bool(coach.text()))
    while coach.text() != "Find fibres":  # what is missing first, such as the lens at home
        hand.click(coach)
        qtbot.wait(200)
        qtbot.waitUntil(lambda: coach.isVisible() and bool(coach.text()), timeout=30_000)
        assert hand.count < 5, coach.text()
    hand.click(coach)
    menu = hand.menu_at(fibre_px(window, qtbot))
    hand.choose(menu["Take with left"])
    card = done(window, qtbot, "Take with left")
    assert "±" in card.findChildren(QLabel, "operationValue")[0].text()
    hand.click(card.next)
    done(window, qtbot, "Bring to the probe")
    buttons = window.top_bar.workspaces
    force = tasks(window).force
    assert buttons is not None
    assert force is not None
    hand.click(buttons.buttons[MEASURE])
    hand.enter(force.name, "first fibre")
    hand.click(force.record)
    hand.click(card.push)
    done(window, qtbot, "Push to 50 µN")
    values = [each.text() for each in card.findChildren(QLabel, "operationValue")]
    assert float(values[0].split(" ")[0]) == pytest.approx(50.0, abs=1.5)
    assert "±" in values[0]
    hand.click(force.record)
    assert hand.count <= 15
    qtbot.waitUntil(lambda: "written" in force.message.text())

    assert window.platform.mico is not None
    collision = window.platform.mico.collision
    assert collision is not None
    for _ in range(3):  # the push, the way to the probe, the grasp
        qtbot.waitUntil(card.undo.isVisible)
        hand.click(card.undo)
        done(window, qtbot, "Undo")
        assert collision.allowed_contacts == frozenset()
    assert operations(window).handling.held_by == ""
    window.close()
    record = read_truth(truth)
    jaws = {"left_jaw_a", "left_jaw_b", "plate"}
    pairs = {frozenset(each.facts["bodies"]) for each in record.of("contact")}
    assert {pair for pair in pairs if not pair <= jaws} == set()
    assert len({each.facts["fibre"] for each in record.of("grasped")}) == 1
    assert record.of("released")
