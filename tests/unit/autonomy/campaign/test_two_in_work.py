"""Two fibres in work at once: each has its own record, its own events, and its own force."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cosmic.autonomy.campaign.campaign import Campaign, Treatment
from cosmic.autonomy.campaign.recipe import load_recipe
from cosmic.autonomy.campaign.recorder import FibreRecorder
from cosmic.autonomy.campaign.records import Outcome
from cosmic.autonomy.campaign.resume import resume
from cosmic.autonomy.campaign.store import CampaignStore
from cosmic.autonomy.handling.context import Calibration, HandlingContext
from cosmic.autonomy.handling.held_fibre import HeldFibre
from cosmic.autonomy.handling.plate import Candidate, Reach
from cosmic.autonomy.handling.prepare import MakeReady
from cosmic.autonomy.handling.settings import HandlingSettings, of_arm
from cosmic.autonomy.procedures.procedure import Procedure
from cosmic.autonomy.procedures.tree import OPERATION, NodeEvent, NodeState
from cosmic.frame.clock import ManualClock
from cosmic.frame.failure import FailurePolicy
from unit.autonomy.campaign.sample_records import INFO
from unit.autonomy.campaign.test_recipe import Parameters


class Force:
    """An acquisition that a test makes samples of."""

    def __init__(self) -> None:
        self.units = {"force": "uN"}
        self._take: Callable[[Any], object] = lambda _chunk: None

    def subscribe(self, take: Callable[[Any], object]) -> Callable[[], None]:
        self._take = take
        return lambda: None

    def feel(self, time_s: float, force_un: float) -> None:
        self._take(
            SimpleNamespace(channels=("force",), values=np.array([[force_un]]), end_time_s=time_s)
        )


class Desk:
    """A recorder of fibres, and two arms of which nothing moves."""

    def __init__(self, folder: Path) -> None:
        none: Any = None
        self.clock, self.force = ManualClock(), Force()
        axes: Any = []
        force: Any = self.force
        self.work = HandlingContext(axes, force, none, HandlingSettings(), self.clock, none)
        for name in ("left", "right"):
            self.work.shared.arms[name] = replace(
                self.work,
                settings=of_arm(self.work.settings, name),
                calibration=Calibration(),
                failures=[],
            )
        self.store = CampaignStore.create(folder, INFO, time_s=0.0)
        self.recorder = FibreRecorder(self.work, self.store, measures=False, images=False)

    def take(self, arm: str, number: int) -> HeldFibre:
        way = np.linspace(-600.0, 600.0, 20)
        line = np.column_stack([way + 3000.0 * number, way * 0.0])
        candidate = Candidate(line, 1200.0, 30.0, 0.0, 60.0)
        fibre = HeldFibre(number, Reach(candidate, 0.0, line, (0.0, 0.0)), arm=arm)
        fibre.found_s = self.clock.now_s()
        self.work.shared.arms[arm].fibre = fibre
        return fibre

    def does(self, arm: str, operation: str, seconds: float = 1.0) -> None:
        begun_s = self.clock.now_s()
        event = NodeEvent((), operation, OPERATION, NodeState.RUNNING, role=arm)
        event = replace(event, started_s=begun_s)
        self.recorder.note(event)
        self.clock.advance(seconds)
        self.recorder.note(replace(event, state=NodeState.DONE, ended_s=self.clock.now_s()))

    def finish(self, fibre: HeldFibre) -> None:
        fibre.done_s = self.clock.now_s()
        self.work.shared.arms[fibre.arm].fibre = None
        self.recorder.record(fibre)


@pytest.fixture
def desk(tmp_path: Path) -> Iterator[Desk]:
    made = Desk(tmp_path / "campaign")
    yield made
    made.store.close()


def test_each_fibre_has_the_operations_of_its_arm_and_no_others(desk: Desk) -> None:
    first = desk.take("left", 1)
    desk.does("left", "close the gripper")
    second = desk.take("right", 2)
    desk.does("right", "turn the table")
    desk.does("left", "push the spans")
    desk.does("right", "stand by")
    desk.finish(first)
    desk.does("right", "push the spans")
    desk.finish(second)
    read = desk.store.reader
    names = {number: [each.name for each in read.fibre(number).operations] for number in (1, 2)}
    assert names == {
        1: ["close the gripper", "push the spans"],
        2: ["turn the table", "stand by", "push the spans"],
    }
    assert {each.outcome for each in read.fibres()} == {Outcome.GOOD}
    assert [(each.fibre, each.operation) for each in read.journal()] == [
        (1, "close the gripper"),
        (2, "turn the table"),
        (1, "push the spans"),
        (2, "stand by"),
        (2, "push the spans"),
    ]


def test_the_force_of_a_fibre_is_that_of_the_time_when_its_arm_had_the_probe(desk: Desk) -> None:
    first, second = desk.take("left", 1), desk.take("right", 2)
    desk.does("left", "close the gripper")
    desk.does("right", "close the gripper")
    first.probe_from_s, first.probe_until_s = 5.0, 15.0
    second.probe_from_s, second.probe_until_s = 16.0, 30.0
    for time_s in range(31):
        desk.force.feel(float(time_s), 10.0 if time_s <= 15 else 50.0)
    desk.clock.advance(30.0)
    desk.finish(first)
    third = desk.take("left", 3)
    desk.does("left", "turn the table")
    desk.finish(second)
    desk.finish(third)
    series = {
        number: {each.name: each for each in desk.store.reader.fibre(number).series}
        for number in (1, 2, 3)
    }
    assert set(series[1]["force"].values) == {10.0}
    assert set(series[2]["force"].values) == {50.0}
    assert (series[2]["force"].time_s.min(), series[2]["force"].time_s.max()) == (16.0, 30.0)
    assert "force" not in series[3], "it never was at the probe"


def test_both_that_were_in_work_when_the_program_was_killed_are_interrupted(desk: Desk) -> None:
    done = desk.take("left", 1)
    desk.does("left", "release")
    desk.finish(done)
    desk.take("left", 2)
    desk.does("left", "push the spans")
    desk.take("right", 3)
    desk.does("right", "close the gripper")
    plan = resume(desk.store)
    assert plan.interrupted == (2, 3)
    assert plan.finished == 1
    assert [each.number for each in plan.known] == [1]


def test_the_time_of_a_campaign_that_is_over_stands_still(desk: Desk) -> None:
    desk.does("left", "close the gripper", seconds=90.0)
    desk.recorder.close("enough")
    desk.clock.advance(3600.0)
    assert desk.recorder.progress().elapsed_s == 90.0
    assert desk.store.reader.elapsed_s() == 90.0


def test_a_fibre_is_kept_once(desk: Desk) -> None:
    fibre = desk.take("left", 1)
    desk.does("left", "release")
    assert desk.recorder.in_work == (fibre,)
    desk.finish(fibre)
    desk.finish(fibre)
    desk.does("left", "choose a fibre")
    assert desk.recorder.in_work == ()
    assert len(desk.store.reader.fibres()) == 1


def test_an_arm_that_has_begun_counts_as_one_more_before_it_has_chosen(
    desk: Desk, tmp_path: Path
) -> None:
    (tmp_path / "two.toml").write_text('procedure = "bend test"\n[stop]\ngood = 2\n')
    recipe = load_recipe(tmp_path / "two.toml", procedures={"bend test": Parameters})
    treatment = Treatment(Procedure("bend test", MakeReady()), measures=False)
    Campaign(desk.work, treatment, recipe, desk.store, policy=FailurePolicy(), stopped=lambda: None)
    shared = desk.work.shared
    shared.seeking.add("left")
    assert not shared.enough()
    shared.seeking.add("right")
    assert shared.enough(), "two are wanted, and two are at work"
    shared.seeking.discard("right")
    assert not shared.enough()


def test_what_is_known_of_fibres_is_what_is_written_whichever_ends_first(desk: Desk) -> None:
    def told() -> list[tuple[int, Outcome]]:
        return [(each.number, each.outcome) for each in desk.recorder.fibres]

    def written() -> list[tuple[int, Outcome]]:
        return [(each.number, each.outcome) for each in desk.store.reader.fibres()]

    left, right = desk.take("left", 1), desk.take("right", 2)
    desk.does("left", "look")
    desk.does("right", "look")
    desk.finish(right)
    assert told() == written() == [(1, Outcome.RUNNING), (2, Outcome.GOOD)]
    third = desk.take("right", 3)
    desk.does("right", "look")
    desk.finish(left)
    assert told() == written()
    assert desk.recorder.progress().done == 2
    desk.clock.advance(5.0)
    before_s = desk.recorder.progress().elapsed_s
    desk.clock.advance(5.0)
    assert desk.recorder.progress().elapsed_s == before_s + 5.0
    desk.finish(third)
    assert told() == written()
    assert desk.recorder.progress().done == 3
    desk.recorder.worked_off += 1
    assert desk.recorder.progress().plates == 1
