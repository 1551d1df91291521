"""The panel that shows a procedure and steers it."""

from collections.abc import Iterator
from itertools import count

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QApplication, QPushButton
from pytestqt.qtbot import QtBot

from cosmic.app.panels.procedure import ChangeBridge, ProcedureTreePanel
from cosmic.app.panels.procedure_tree import CAUSE, PART, STATE, TRY
from cosmic.autonomy.procedures.combinators import Fallback, Parallel, Repeat, Retry, Sequence
from cosmic.autonomy.procedures.operation import SAFE_POINT
from cosmic.autonomy.procedures.procedure import Part, Procedure
from cosmic.autonomy.procedures.run import ProcedureRun, RunState
from cosmic.frame.clock import RatedClock
from cosmic.frame.errors import NotAvailable
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.gui.palette import LIGHT
from cosmic.frame.gui.theme import State, apply_theme
from unit.autonomy.procedures.parts import MOVE, Op, Work, run_of

LEFT = Qt.MouseButton.LeftButton
BUTTONS = ("start", "pause", "step", "resume", "abort")


def timed(part: Part[Work], rate: float = 100.0) -> ProcedureRun[Work]:
    return run_of(part, Work(RatedClock(rate)))


@pytest.fixture(scope="module")
def only_panel(qapp: QApplication) -> Iterator[ProcedureTreePanel]:
    panel = ProcedureTreePanel()
    yield panel
    panel.close()
    panel.deleteLater()


@pytest.fixture
def panel(only_panel: ProcedureTreePanel, qtbot: QtBot) -> Iterator[ProcedureTreePanel]:
    only_panel.resize(640, 480)
    only_panel.show()
    qtbot.waitExposed(only_panel)
    yield only_panel
    only_panel.shut_down()


def shown(qtbot: QtBot, panel: ProcedureTreePanel) -> ProcedureTreePanel:
    qtbot.addWidget(panel)
    panel.resize(640, 480)
    panel.show()
    qtbot.waitExposed(panel)
    return panel


def click(qtbot: QtBot, button: QPushButton) -> None:
    assert button.isEnabled(), button.text()
    qtbot.mouseClick(button, LEFT)


def enabled(panel: ProcedureTreePanel) -> set[str]:
    return {name for name in BUTTONS if getattr(panel, name).isEnabled()}


class Still(ProcedureRun[Work]):
    """A run that is at what a test says."""

    at = RunState.READY

    @property
    def state(self) -> RunState:
        return self.at


RULES = {
    RunState.READY: ({"start", "step"}, None),
    RunState.RUNNING: ({"pause", "abort"}, State.BUSY),
    RunState.PAUSING: ({"resume", "abort"}, State.BUSY),
    RunState.PAUSED: ({"step", "resume", "abort"}, State.REFUSED),
    RunState.ABORTING: ({"abort"}, State.REFUSED),
    RunState.DONE: (set[str](), State.OK),
    RunState.FAILED: (set[str](), State.ERROR),
    RunState.ABORTED: (set[str](), State.REFUSED),
}


def test_only_what_makes_sense_can_be_pressed(panel: ProcedureTreePanel) -> None:
    work = Work()
    run = Still(Procedure("trial", Op("a")), work, work.clock, FailurePolicy())
    panel.follow(run)
    for state, (buttons, sign) in RULES.items():
        run.at = state
        panel.refresh()
        assert enabled(panel) == buttons, state
        assert panel.state.text() == state.value
        assert panel.indicator.state is sign
    assert set(RULES) == set(RunState)


def test_space_after_pause_aborts_nothing(panel: ProcedureTreePanel, qtbot: QtBot) -> None:
    work = Work()
    run = Still(Procedure("trial", Op("a")), work, work.clock, FailurePolicy())
    run.at = RunState.RUNNING
    panel.follow(run)
    panel.activateWindow()
    qtbot.waitUntil(panel.isActiveWindow)
    panel.pause.setFocus()
    for run.at in (RunState.PAUSING, RunState.PAUSED):
        panel.refresh()
        assert QApplication.focusWidget() is panel


def test_without_a_procedure_nothing_can_be_pressed(qtbot: QtBot) -> None:
    panel = shown(qtbot, ProcedureTreePanel())
    assert enabled(panel) == set()
    assert panel.state.text() == "no procedure"


def test_a_procedure_is_started_paused_stepped_and_finished(
    panel: ProcedureTreePanel, qtbot: QtBot
) -> None:
    part = Sequence("all", Op("a", steps=(20.0, SAFE_POINT)), Op("b"), Op("c"))
    run = timed(part)
    panel.follow(run)
    assert panel.tree.row((1,))[STATE] == "waiting"
    click(qtbot, panel.start)
    qtbot.waitUntil(lambda: panel.title.text() == "trial: a")
    assert panel.tree.topLevelItem(0).child(0).font(PART).bold()
    assert not panel.tree.topLevelItem(0).child(1).font(PART).bold()
    click(qtbot, panel.pause)
    qtbot.waitUntil(lambda: panel.state.text() == "paused")
    click(qtbot, panel.step)
    qtbot.waitUntil(lambda: panel.state.text() == "paused" and _row(panel, 0)[STATE] == "done")
    click(qtbot, panel.step)
    qtbot.waitUntil(lambda: panel.state.text() == "paused" and _row(panel, 1)[STATE] == "done")
    assert _row(panel, 2)[STATE] == "waiting"
    click(qtbot, panel.resume)
    qtbot.waitUntil(lambda: panel.state.text() == "done")
    assert _row(panel, 2)[STATE] == "done"
    assert not panel.tree.topLevelItem(0).child(2).font(PART).bold()
    assert panel.title.text() == "trial"


def _row(panel: ProcedureTreePanel, number: int) -> tuple[str, ...]:
    return panel.tree.row((number,))


def test_tries_times_and_causes_are_shown(panel: ProcedureTreePanel, qtbot: QtBot) -> None:
    grasp = Retry(Op("close", fails_in="verify", times=1), 3)
    part = Sequence("all", grasp, Fallback("measure", Op("bend", fails_in="run"), Op("give up")))
    run = timed(part)
    panel.follow(run)
    click(qtbot, panel.start)
    qtbot.waitUntil(lambda: panel.state.text() == "done")
    assert panel.tree.row((0, 0))[TRY] == "2"
    assert panel.tree.row((1, 0))[CAUSE] == "missed grasp"
    assert panel.tree.row((1, 0))[STATE] == "undone"
    assert panel.tree.row((1, 1))[3].endswith(" s")
    item = panel.tree.topLevelItem(0).child(1).child(0)
    assert "nothing between the jaws" in item.toolTip(CAUSE)


def test_a_tree_of_other_parts_takes_the_place_of_the_one_before(
    panel: ProcedureTreePanel,
) -> None:
    fibre = run_of(Sequence("fibre", Op("find"), Op("grasp")), Work())
    standard = run_of(Sequence("standard", Op("take"), Sequence("bend", Op("push"))), Work())
    panel.follow(fibre)
    panel.tree.show_view(standard.tree)
    assert panel.tree.row((1, 0))[PART] == "push"
    assert panel.tree.topLevelItem(0).text(PART) == "standard"
    panel.tree.show_view(fibre.tree)
    assert panel.tree.row((1,))[PART] == "grasp"
    assert panel.tree.topLevelItemCount() == 1


def test_why_it_failed_stays_in_the_panel(panel: ProcedureTreePanel, qtbot: QtBot) -> None:
    panel.follow(timed(Op("close", fails_in="run")))
    click(qtbot, panel.start)
    qtbot.waitUntil(lambda: panel.state.text() == "failed")
    assert panel.reason.text().startswith("missed grasp: nothing between the jaws")


def test_an_abort_is_there_while_it_runs(panel: ProcedureTreePanel, qtbot: QtBot) -> None:
    run = timed(Parallel("both", Op("a", steps=(MOVE,) * 99), Op("b", steps=(9999.0,))))
    panel.follow(run)
    click(qtbot, panel.start)
    qtbot.waitUntil(lambda: bool(run.work.moving))
    click(qtbot, panel.abort)
    qtbot.waitUntil(lambda: panel.state.text() == "aborted")
    assert not run.work.moving
    assert panel.reason.text() == "trial: aborted by the operator"
    assert _row(panel, 0)[STATE] == "ended"


def test_a_new_run_is_made_when_there_is_none_to_begin(qtbot: QtBot) -> None:
    runs = [timed(Op("a")), timed(Op("b"))]
    left = iter(runs)
    panel = shown(qtbot, ProcedureTreePanel(lambda: next(left)))
    click(qtbot, panel.start)
    qtbot.waitUntil(lambda: panel.state.text() == "done")
    click(qtbot, panel.step)
    qtbot.waitUntil(lambda: panel.state.text() == "paused")
    assert panel.run is runs[1]
    click(qtbot, panel.resume)
    qtbot.waitUntil(lambda: panel.state.text() == "done")
    panel.shut_down()


def test_why_none_could_be_made_is_shown(qtbot: QtBot) -> None:
    def refuse() -> ProcedureRun[Work]:
        raise NotAvailable("the platform is not calibrated; run the calibration first")

    panel = shown(qtbot, ProcedureTreePanel(refuse))
    click(qtbot, panel.start)
    assert panel.state.text() == "refused"
    assert "not calibrated" in panel.reason.text()
    assert enabled(panel) == {"start", "step"}


def test_many_changes_are_drawn_a_few_times(
    panel: ProcedureTreePanel, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn = count()
    tree = panel.tree
    real = tree.show_view
    monkeypatch.setattr(tree, "show_view", lambda view: (next(drawn), real(view)))
    rounds = iter(range(2000))
    run = timed(Repeat(Op("a", steps=(0.0,)), lambda _work: next(rounds) == 1999), 1e5)
    received, signalled = count(), count()
    run.on_change(lambda: next(received))
    panel._bridge.changed.connect(lambda: next(signalled))
    panel.follow(run)
    click(qtbot, panel.start)
    with qtbot.waitSignal(panel._redraw.timeout):
        pass
    qtbot.waitUntil(lambda: panel.state.text() == "done")
    assert next(received) > 4000
    assert next(drawn) < 200
    assert 0 < next(signalled) < 200
    assert panel.tree.row(())[STATE] == "done"


def test_what_changes_after_a_drawing_is_reported_again(qtbot: QtBot) -> None:
    panel = shown(qtbot, ProcedureTreePanel())
    bridge = ChangeBridge(panel)
    received = count()
    bridge.changed.connect(lambda: next(received))
    for _ in range(3):
        bridge.publish()
    bridge.take()
    bridge.publish()
    assert next(received) == 2


def test_closing_the_panel_aborts_the_run_begun_there_and_no_other(qtbot: QtBot) -> None:
    mine, other = (timed(Op("a", steps=(9999.0,)), 10.0) for _ in range(2))
    panel = shown(qtbot, ProcedureTreePanel())
    panel.follow(mine)
    click(qtbot, panel.start)
    other.start()
    panel.follow(other)
    qtbot.waitUntil(lambda: panel.state.text() == "running")
    panel.close()
    qtbot.waitUntil(lambda: mine.state == "aborted")
    panel.shut_down()
    assert other.state == "running"
    other.abort()
    other.join()


def test_its_tree_follows_the_theme(panel: ProcedureTreePanel, qapp: QApplication) -> None:
    run = run_of(Op("a"))
    panel.follow(run)
    run.run_here()
    panel.refresh()
    apply_theme(qapp, "light")
    try:
        panel.refresh()
        colour = panel.tree.topLevelItem(0).foreground(PART).color()
        assert colour == QColor(LIGHT.text)
    finally:
        apply_theme(qapp, "dark")
