"""Campaigns of two arms on the twin: one fetches while the other's fibre is measured."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from itertools import pairwise
from pathlib import Path
from typing import Final

import pytest

from cosmic.autonomy.campaign.campaign import Campaign, CampaignPhase
from cosmic.autonomy.campaign.records import FibreRecord, Outcome
from cosmic.autonomy.campaign.storage_format import DATABASE
from cosmic.autonomy.campaign.store_read import CampaignReader
from cosmic.frame.clock import WALL
from cosmic.twin.truth import TruthRecord
from system.campaign_bench import GRACE_WALL_S, Bench, Strike, bench, wait_for

RATE: Final = 8.0
PROCEDURE: Final = "bend test with two grippers"
GOOD: Final = 4
LIMIT_UN: Final = 0.8 * 180.0

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]


@pytest.fixture
def plate(tmp_path: Path) -> Iterator[Bench]:
    with bench(tmp_path, rate=RATE) as made:
        yield made


def records(plate: Bench, folder: str) -> list[FibreRecord]:
    reader = CampaignReader(plate.home / folder)
    reader.check()
    return [reader.fibre(each.number) for each in reader.fibres()]


def hand_of(plate: Bench, record: FibreRecord) -> tuple[str, int]:
    """Return by which arm, and which fibre of the twin's, a record is of; by its positions."""
    closes = [each for each in record.operations if each.name == "close the gripper"]
    grasped = [
        (str(each.facts["tool"]), int(each.facts["fibre"]))
        for each in plate.truth.of("grasped")
        if any(close.began_s <= each.time_s <= close.ended_s for close in closes)
    ]
    (one,) = set(grasped)
    return one


def measured(found: list[FibreRecord]) -> list[FibreRecord]:
    """Return those that were pushed to the end, whether or not the fit trusts what came out."""
    return [each for each in found if each.outcome in {Outcome.GOOD, Outcome.DOUBTFUL}]


def arms_that_measured(plate: Bench, found: list[FibreRecord]) -> set[str]:
    return {hand_of(plate, each)[0] for each in measured(found)}


def at_probe_s(record: FibreRecord) -> tuple[float, float]:
    began = min(each.began_s for each in record.operations if each.name == "carry to the probe")
    ended = max(
        each.ended_s for each in record.operations if each.name == "draw back from the probe"
    )
    return began, ended


def good_at_the_time(plate: Bench, folder: str) -> int:
    """Return how many fibres were good as they came in; the fit over all may call others so."""
    asked = "SELECT count(*) FROM fibre WHERE coalesce(nullif(online_outcome, ''), outcome) = ?"
    with closing(sqlite3.connect(plate.home / folder / DATABASE)) as data:
        (count,) = data.execute(asked, (str(Outcome.GOOD),)).fetchone()
    return int(count)


def check_good(plate: Bench, good: list[FibreRecord]) -> None:
    """See that what was measured is true, that no fibre counts twice, and nothing was touched."""
    truth: TruthRecord = plate.truth
    known = {each.number: each for each in truth.fibres}
    numbers = [hand_of(plate, each)[1] for each in good]
    assert len(set(numbers)) == len(numbers), "a fibre was measured twice"
    for record, number in zip(good, numbers, strict=True):
        assert record.bending is not None
        assert record.bending.ei_n_m2 == pytest.approx(known[number].ei_n_m2, rel=0.1)
        assert record.shape.length_um == pytest.approx(known[number].length_um, rel=0.02)
        assert record.peak_force_un <= LIMIT_UN
    assert not [each for each in truth.of("contact over") if not each.facts["meant"]]


def test_both_arms_measure_rightly_and_the_probe_belongs_to_one_at_a_time(plate: Bench) -> None:
    campaign = plate.campaign(plate.recipe(PROCEDURE, good=GOOD), "both")
    campaign.run_here()
    assert campaign.end_reason.endswith(" good fibres")
    assert good_at_the_time(plate, "both") == GOOD
    found = records(plate, "both")
    good = [each for each in found if each.outcome is Outcome.GOOD]
    check_good(plate, good)
    assert arms_that_measured(plate, found) == {"left", "right"}
    turns = sorted(at_probe_s(each) for each in measured(found))
    assert all(one[1] <= other[0] for one, other in pairwise(turns))
    pushes = [(each, op) for each in found for op in each.operations if op.name == "push the spans"]
    fetched_meanwhile = [
        op
        for pushed, push in pushes
        for each in found
        if each is not pushed
        for op in each.operations
        if op.name == "close the gripper" and push.began_s <= op.began_s <= push.ended_s
    ]
    assert fetched_meanwhile, "one fetches while the other measures"
    for record in good:
        (force,) = (each for each in record.series if each.name == "force")
        began, ended = at_probe_s(record)
        assert began - 0.1 <= force.time_s.min() <= force.time_s.max() <= ended + 0.1
        x = {each.name: each for each in record.series}
        assert {"left.x", "right.x", "probe.y", "table.rotation"} <= set(x)
        assert {"geometry", "held"} <= {each.name for each in record.images}
    journal = CampaignReader(plate.home / "both").journal()
    for record in found:
        noted = [each.operation for each in journal if each.fibre == record.number]
        done = [each.name for each in record.operations]
        assert noted == done[-len(noted) :], "what is noted of a fibre is what its arm did"
        assert noted[0] == "turn the table"


class Trial:
    """A campaign that is ended in an operation, and gone on with."""

    def __init__(self, plate: Bench, operation: str, folder: str) -> None:
        self.plate, self.folder = plate, folder
        self.recipe = plate.recipe(PROCEDURE, good=2)
        self.campaign: Campaign = plate.campaign(self.recipe, folder)
        self.strike = Strike(self.campaign, operation, lambda: None)
        self.campaign.start()
        wait_for(lambda: self.strike.struck.is_set() or self.campaign.over, operation)
        assert not self.campaign.over, self.campaign.end_reason

    def ended(self, reason: str) -> None:
        wait_for(lambda: self.campaign.over, f"the end: {reason}", 60.0)
        self.campaign.join()
        assert not self.plate.moving
        assert reason in self.campaign.end_reason
        for each in records(self.plate, self.folder):
            assert each.outcome is not Outcome.RUNNING
            assert each.outcome is not Outcome.INTERRUPTED or reason in each.text

    def goes_on(self) -> None:
        campaign = self.plate.campaign(self.recipe, self.folder)
        campaign.run_here()
        assert campaign.end_reason == "2 good fibres"
        found = records(self.plate, self.folder)
        check_good(self.plate, [each for each in found if each.outcome is Outcome.GOOD])


@pytest.mark.parametrize("operation", ["draw back from the plate", "push the spans", "release"])
def test_a_stop_stops_both_arms_and_nothing_is_lost(plate: Bench, operation: str) -> None:
    trial = Trial(plate, operation, f"stop in {operation}")
    plate.rig.stop("a hand on the button")
    end_s = WALL.now_s() + GRACE_WALL_S
    wait_for(lambda: WALL.now_s() > end_s, "the time of grace")
    places = plate.places()
    trial.ended("a hand on the button")
    assert not plate.wandered(places), "something was commanded after the stop"
    plate.rig.reset_stop()
    trial.goes_on()


def test_an_abort_leaves_both_arms_safe(plate: Bench) -> None:
    trial = Trial(plate, "draw back from the probe", "abort")
    trial.campaign.abort("enough")
    trial.ended("enough")
    work = trial.campaign.work
    assert trial.campaign.run is not None
    assert trial.campaign.run.not_safe == ""
    assert work.tip_now(work.probe)[1] >= work.settings.places.probe_away_y_um - 2.0
    for arm in work.arms:
        assert arm.height_now() >= arm.settings.places.travel_um - 2.0
    trial.goes_on()


def test_a_pause_lets_both_arms_rest_and_go_on(plate: Bench) -> None:
    trial = Trial(plate, "push the spans", "pause")
    trial.campaign.pause()
    wait_for(lambda: trial.campaign.phase is CampaignPhase.PAUSED, "the rest", 60.0)
    assert not plate.moving
    trial.campaign.resume()
    wait_for(lambda: trial.campaign.over, "the end")
    trial.campaign.join()
    assert trial.campaign.end_reason == "2 good fibres"


@pytest.mark.parametrize("fault", ["drop", "jaw_adhesion"])
def test_an_arm_that_fails_gives_its_fibre_up_and_the_other_goes_on(
    plate: Bench, fault: str
) -> None:
    plate.rig.faults.inject(fault)
    campaign = plate.campaign(plate.recipe(PROCEDURE, good=3), f"with {fault}")
    campaign.run_here()
    plate.rig.faults.clear()
    assert campaign.end_reason.endswith(" good fibres")
    assert good_at_the_time(plate, f"with {fault}") == 3
    found = records(plate, f"with {fault}")
    assert arms_that_measured(plate, found) == {"left", "right"}
