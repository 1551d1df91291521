"""Who moved an axis: one rig by two names, whose runs keep out of each other's way."""

from pathlib import Path
from typing import Any

import pytest

import cosmic
from cosmic.autonomy.control.control import Control
from cosmic.autonomy.control.handle import ControlHandle
from cosmic.autonomy.control.pid import PidGains
from cosmic.autonomy.recorded.operations import Surroundings
from cosmic.autonomy.recorded.replay import replay_on
from cosmic.autonomy.recorded.steps import MoveStep, RecordedProcedure, WaitForOperatorStep
from cosmic.frame.errors import NotAvailable
from cosmic.mico.api.news import AxisBegun

AWAY = RecordedProcedure(name="away", step=[MoveStep(axes={"left.x": -50.0})])
WAITING = RecordedProcedure(name="waiting", step=[WaitForOperatorStep(text="look")])
BACK = RecordedProcedure(name="back", step=[MoveStep(axes={"left.x": 0.0})])


def test_movements_bear_the_name_of_whoever_commanded_them() -> None:
    with cosmic.connect(rate=50.0) as rig:
        console = rig.commanding_as("console")
        sources: list[str] = []

        def note(news: Any) -> None:
            if isinstance(news, AxisBegun):
                sources.append(news.source)

        forget = rig.mico.follow_movements(note)
        console.mico["left.y"].move_by(20.0)
        rig.mico["left.y"].move_by(-20.0)
        assert sources == ["console", "script"]
        sources.clear()
        replay_on(rig.handling, AWAY, Surroundings()).run_here()
        assert set(sources) == {"away (script)"}
        sources.clear()
        replay_on(console.handling, BACK, Surroundings()).run_here()
        assert set(sources) == {"back (console)"}, "the procedure, and who asked for it"
        forget()


def test_what_runs_by_one_name_runs_for_the_other_too(tmp_path: Path) -> None:
    with cosmic.connect(rate=50.0) as rig:
        console = rig.commanding_as("console")
        changes: list[str] = []
        rig.handling.subscribe(lambda: changes.append(rig.running))
        run = replay_on(console.handling, WAITING, Surroundings())
        run.start()
        assert rig.running == console.running == "waiting"
        with pytest.raises(NotAvailable, match="is running"):
            rig.campaign("bend-test", tmp_path)
        with pytest.raises(NotAvailable, match="is running"):
            replay_on(rig.handling, BACK, Surroundings())
        run.abort("enough")
        run.join()
        assert "waiting" in changes
        assert rig.handling.result is not None
        assert rig.handling.result is console.handling.result


def test_a_control_loop_moves_by_the_name_of_whoever_began_it() -> None:
    with cosmic.connect(rate=50.0) as rig:
        console = rig.commanding_as("console")
        sources: set[str] = set()

        def note(news: Any) -> None:
            if isinstance(news, AxisBegun):
                sources.add(news.source)

        rig.mico.follow_movements(note)

        def hold(control: Control) -> ControlHandle:
            return control.hold(
                "left.y", "left.y", 5.0, PidGains(4.0), speed=100.0, travel=200.0, tolerance=2.0
            )

        loop = hold(console.control)
        assert rig.control.loops == (loop,)
        assert rig.control.newest is loop
        with pytest.raises(NotAvailable, match="already uses it"):
            hold(rig.control)
        loop.wait_settled()
        console.control.close()
        assert loop.running, "only who made the platform closes its loops"
        rig.control.stop()
        loop.join()
        assert sources == {"console"}


def test_only_who_made_the_platform_closes_it() -> None:
    with cosmic.connect(rate=50.0) as rig:
        rig.commanding_as("console").close()
        rig.mico["left.y"].move_by(5.0)
