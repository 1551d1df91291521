"""Whichever way a command comes in, the same gate says the same words."""

from collections.abc import Callable

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QPushButton
from pytestqt.qtbot import QtBot

from cosmic.app.rig import Rig
from cosmic.app.windows.operator_window import OperatorWindow
from cosmic.frame.errors import MoveRefused
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.overrides import override
from cosmic.frame.threads import WorkerThread
from cosmic.frame.verdict import MoveVerdict, Reason
from cosmic.mico.core.collision.answer import Approach
from cosmic.mico.gui.positioner_gui import PositionerBaseGUI
from gui.app.windows import Make
from gui.app.windows import mico as panel
from gui.mico.panels import click, enter, field, part, position, wait_for_position

AXIS = "left.z"
NEAR_UM = 30.0
"""How far in front of the end of its free way the axis stands at first."""
BEYOND_UM = 60.0
"""How far behind that end it is sent: there is one pair of bodies only that can meet."""


@pytest.fixture
def window(make: Make, qtbot: QtBot) -> OperatorWindow:
    window = make(rate=10.0, console=True)
    forward = part(panel(window).cards[AXIS], "MiCoCL_6", QPushButton)
    qtbot.waitUntil(forward.isEnabled, timeout=8000)
    return window


class Script(WorkerThread):
    """Moves from a thread of its own, as a script does that runs beside the window."""

    def __init__(self, act: Callable[[], object]) -> None:
        super().__init__("script", FailurePolicy())
        self._act = act
        self.verdict: MoveVerdict | None = None

    @override
    def run_body(self) -> None:
        try:
            self._act()
        except MoveRefused as exc:
            self.verdict = exc.verdict


class Guard:
    """Keeps asking for the real clearance, so that nobody comes too near unseen."""

    def __init__(self, rig: Rig) -> None:
        self._rig = rig
        self.smallest: Approach = rig.mico.clearance()

    def look(self) -> bool:
        now = self._rig.mico.clearance()
        if now.distance_um < self.smallest.distance_um:
            self.smallest = now
        return True


def by_field(card: PositionerBaseGUI, qtbot: QtBot, target: float) -> None:
    enter(qtbot, field(card, "target"), f"{target:.1f}")
    click(qtbot, card, "MiCoCL_9")


def by_button(card: PositionerBaseGUI, qtbot: QtBot, target: float) -> None:
    enter(qtbot, field(card, "MiCoCL_8"), f"{position(card) - target:.1f}")
    click(qtbot, card, "MiCoCL_7")


def test_every_entry_meets_the_same_verdict(window: OperatorWindow, qtbot: QtBot) -> None:
    mico, rig, card = panel(window).mico, Rig(window.platform), panel(window).cards[AXIS]
    start = free_end(window) + NEAR_UM
    mico[AXIS].move_to(start, wait=False)
    wait_for_position(qtbot, card, start)
    target = start - NEAR_UM - BEYOND_UM
    expected = mico.check({AXIS: target})
    assert expected.reason is Reason.COLLISION
    guard, heard = Guard(rig), list[MoveVerdict]()
    mico[AXIS].commander.movement_refused.connect(heard.append, Qt.ConnectionType.DirectConnection)

    entries = {by_field: field(card, "target"), by_button: field(card, "MiCoCL_8")}
    for give in entries:
        heard.clear()
        give(card, qtbot, target)
        entry = entries[give]
        qtbot.waitUntil(lambda entry=entry: bool(heard) and str(heard[-1]) in entry.reason)
        same(heard[-1], expected)

    console = window.console
    assert console is not None
    heard.clear()
    console.run(f'rig.mico["{AXIS}"].move_to({target})')
    qtbot.waitUntil(lambda: bool(heard) and str(heard[-1]) in " ".join(console.text().split()))
    same(heard[-1], expected)

    way = target - start
    scripts: list[Callable[[], object]] = [
        lambda: rig.mico[AXIS].move_to(target),
        lambda: rig.mico[AXIS].move_by(f"{way} um"),
        lambda: rig.mico.move({AXIS: target}),
        lambda: rig.mico.move_by({AXIS: way, "left.x": 1.0}),
    ]
    for script in scripts:
        same(refused(script, qtbot), expected)
    assert position(card) == pytest.approx(start, abs=1.0)
    assert position(panel(window).cards["left.x"]) == 0.0

    same(hold_down(window, qtbot, guard), expected)
    assert target + BEYOND_UM - 1.0 <= position(card) < start
    assert guard.smallest.distance_um >= guard.smallest.margin_um
    assert "plate" in guard.smallest.bodies


def free_end(window: OperatorWindow) -> float:
    """Return how far the axis may go down."""
    verdict = panel(window).mico.check({AXIS: -5000.0})
    assert verdict.reason is Reason.COLLISION
    assert verdict.limit is not None
    return verdict.limit


def refused(act: Callable[[], object], qtbot: QtBot) -> MoveVerdict:
    script = Script(act)
    script.start()
    qtbot.waitUntil(script.isFinished)
    script.join()
    assert script.verdict is not None
    return script.verdict


def same(verdict: MoveVerdict, expected: MoveVerdict) -> None:
    assert not verdict.allowed
    assert verdict.reason is Reason.COLLISION
    assert verdict.bodies == expected.bodies
    assert all(body in str(verdict) for body in verdict.bodies)


def hold_down(window: OperatorWindow, qtbot: QtBot, guard: Guard) -> MoveVerdict:
    """Hold the key of the axis until it is stopped in front of the other body."""
    verdicts: list[MoveVerdict] = []
    card = panel(window).cards[AXIS]
    panel(window).verdict_given.connect(verdicts.append)
    part(panel(window), "initialise", QPushButton).setFocus()
    qtbot.keyPress(panel(window).focusWidget(), Qt.Key.Key_F)
    qtbot.waitUntil(lambda: guard.look() and bool(verdicts), timeout=8000)
    qtbot.waitUntil(lambda: guard.look() and not card.axis.details.in_motion)
    qtbot.keyRelease(panel(window).focusWidget(), Qt.Key.Key_F)
    return verdicts[-1]
