"""Campaigns in trouble end safely, say what, where and what to do, and lose nothing."""

import errno
import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from threading import Event
from types import SimpleNamespace

import pytest

import cosmic
from cosmic.autonomy.campaign import campaign as campaign_module
from cosmic.autonomy.campaign.campaign import Campaign, CampaignPhase
from cosmic.autonomy.campaign.records import CampaignError, FibreRecord, Outcome
from cosmic.autonomy.campaign.store import CampaignStore
from cosmic.autonomy.campaign.store_read import CampaignReader
from cosmic.autonomy.handling import sight
from cosmic.twin.truth import TruthRecord, read_truth
from system.campaign_bench import CONFIG, Strike, wait_for

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]

RATE = 20.0
RECIPE = """
procedure = "{procedure}"
[sample]
name = "{sample}"
[stop]
count = {count}
[parameters.push]
stop_un = 0.0
{more}
[output]
html = false
pdf = false
table = false
"""
LONG = """
[samples.long]
single = 1
length_um = 14000.0
length_high_um = 15000.0
length_sigma_ln = 0.01
radius_um = 8000.0
curl_deg = 0.0
faults = false
"""


class Bench(SimpleNamespace):
    rig: cosmic.Rig
    home: Path

    def campaign(
        self,
        sample: str = "three-dry",
        count: int = 1,
        procedure: str = "bend test",
        more: str = "",
    ) -> Campaign:
        recipe = self.home / "recipe.toml"
        recipe.write_text(
            RECIPE.format(procedure=procedure, sample=sample, count=count, more=more), "utf-8"
        )
        return self.rig.campaign(recipe, self.home / "out")

    @property
    def fibres(self) -> tuple[FibreRecord, ...]:
        return CampaignReader(self.home / "out").fibres()

    @property
    def truth(self) -> TruthRecord:
        return read_truth(self.home / "truth.jsonl")

    def check_stands(self) -> None:
        assert not any(axis.details.in_motion for axis in self.rig.mico)

    def check_nothing_ran_into_anything(self) -> None:
        assert not [each for each in self.truth.of("contact over") if not each.facts["meant"]]
        peaks = [float(each.facts.get("peak_un", 0.0)) for each in self.truth.of("left")]
        assert max(peaks, default=0.0) <= 0.8 * 180.0


Make = Callable[..., Bench]


@pytest.fixture
def make(tmp_path: Path) -> Iterator[Make]:
    """Make the platform with a sample; ended and closed after the test."""
    rigs = []

    def made(sample: str = "three-dry", config: Path | None = None, seed: int = 1) -> Bench:
        rig = cosmic.connect(
            config, rate=RATE, seed=seed, sample=sample, truth=tmp_path / "truth.jsonl"
        )
        rigs.append(rig)
        return Bench(rig=rig, home=tmp_path)

    yield made
    for rig in rigs:
        rig.close()


# ---------------------------------------------------------------------- nothing to be taken


@pytest.mark.parametrize(
    ("sample", "message"),
    [
        ("empty", "the plate is empty: put a sample there"),
        ("crossings", r"none on the plate can be grasped \(.*\d+ crossing.*\): spread them"),
        ("long", r"none on the plate can be grasped \(\d out of the field\): spread them"),
    ],
)
def test_where_nothing_can_be_taken_up_the_campaign_ends_and_says_why(
    make: Make, tmp_path: Path, sample: str, message: str
) -> None:
    config = tmp_path / "config"
    shutil.copytree(CONFIG, config)
    with (config / "twin.toml").open("a", encoding="utf-8") as twin:
        twin.write(LONG)
    bench = make(sample, config)
    campaign = bench.campaign(sample)
    campaign.run_here()
    assert campaign.phase is CampaignPhase.STOPPED
    with pytest.raises(AssertionError, match=f"no fibre: {message}"):
        raise AssertionError(campaign.end_reason)
    assert bench.fibres == ()
    assert bench.truth.of("grasped") == ()
    bench.check_stands()


# ---------------------------------------------------------------------- calibration


def test_a_calibration_that_is_refused_ends_it_before_a_fibre_is_touched(make: Make) -> None:
    bench = make()
    campaign = bench.campaign(more="[parameters.calibration]\nresidual_px = 0.001\ntries = 2")
    campaign.run_here()
    assert campaign.phase is CampaignPhase.FAILED
    assert "calibration poor: probe against gripper: residual" in campaign.end_reason
    assert "at most 0.001 is allowed" in campaign.end_reason
    assert bench.fibres == ()
    assert bench.truth.of("grasped") == ()
    bench.check_stands()
    work = campaign.work
    assert work.height_now() >= work.settings.places.travel_um - 2.0


def test_a_calibration_that_is_too_old_is_made_anew(make: Make) -> None:
    bench = make()
    campaign = bench.campaign(
        count=2, procedure="transport", more="[parameters.calibration]\nage_s = 30.0"
    )
    campaign.run_here()
    assert campaign.end_reason == "2 fibres done"
    begun = [
        each.fibre
        for each in CampaignReader(bench.home / "out").journal()
        if each.operation == "calibrate at the plate"
    ]
    assert len(begun) >= 2
    assert {each.outcome for each in bench.fibres} == {Outcome.GOOD}


# ---------------------------------------------------------------------- a full disk


@pytest.fixture
def room(monkeypatch: pytest.MonkeyPatch) -> Event:
    """Cleared, the disk takes nothing more."""
    there, fsync = Event(), os.fsync
    there.set()

    def sync(file: int) -> None:
        if not there.is_set():
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        fsync(file)

    monkeypatch.setattr(os, "fsync", sync)
    return there


def test_a_fibre_that_the_full_disk_does_not_take_is_kept_when_there_is_room(
    make: Make, monkeypatch: pytest.MonkeyPatch, room: Event
) -> None:
    monkeypatch.setattr(campaign_module, "RETRY_INTERVAL_WALL_S", 0.05)
    bench = make()
    campaign = bench.campaign(procedure="transport")
    Strike(campaign, "release", room.clear)
    campaign.start()
    wait_for(
        lambda: campaign.operation == campaign_module.WAITING or campaign.over, "the full disk"
    )
    assert not campaign.over, campaign.end_reason
    assert bench.fibres[0].outcome is Outcome.RUNNING
    room.set()
    wait_for(lambda: campaign.over, "the end", 30.0)
    campaign.join()
    assert campaign.end_reason == "1 fibres done"
    assert [each.outcome for each in bench.fibres] == [Outcome.GOOD]


def test_where_no_room_is_made_it_says_what_is_not_kept_and_can_be_gone_on_with(
    make: Make, monkeypatch: pytest.MonkeyPatch, room: Event
) -> None:
    monkeypatch.setattr(campaign_module, "RETRY_TIMEOUT_WALL_S", 0.0)
    bench = make()
    campaign = bench.campaign(procedure="transport")
    Strike(campaign, "release", room.clear)
    campaign.run_here()
    assert campaign.phase is CampaignPhase.FAILED
    for word in ("the last fibre is not saved", "No space left", "make room", "same folder"):
        assert word in campaign.end_reason
    bench.check_stands()
    room.set()
    again = bench.campaign(procedure="transport")
    again.run_here()
    assert again.end_reason == "1 fibres done"
    assert [each.outcome for each in bench.fibres] == [Outcome.INTERRUPTED, Outcome.GOOD]
    held = [each.facts["fibre"] for each in bench.truth.of("grasped")]
    assert len(set(held)) == 2, "the one in the bin was not taken again"


def test_what_cannot_be_written_in_the_journal_is_not_done(
    make: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = make()
    campaign = bench.campaign(procedure="transport")
    note = CampaignStore.note

    def full(*_args: object, **_more: object) -> None:
        raise CampaignError("campaign.sqlite cannot be written: disk is full; make room")

    def full_at_the_carrying(store: CampaignStore, operation: str, *args, **more) -> None:
        if operation == "carry to the probe":
            full()
        note(store, operation, *args, **more)

    with monkeypatch.context() as patch:
        patch.setattr(CampaignStore, "note", full_at_the_carrying)
        patch.setattr(CampaignStore, "end", full)
        campaign.run_here()
    assert campaign.phase is CampaignPhase.FAILED
    assert campaign.end_reason.count("disk is full; make room") == 1
    bench.check_stands()
    assert not bench.truth.of("released") + bench.truth.of("dropped")
    again = bench.campaign(procedure="transport")
    again.run_here()
    assert again.end_reason == "1 fibres done"
    assert [each.outcome for each in bench.fibres] == [Outcome.INTERRUPTED, Outcome.GOOD]


# ---------------------------------------------------------------------- closed in the middle


def test_a_platform_that_is_closed_ends_its_campaign_first(make: Make) -> None:
    bench = make()
    campaign = bench.campaign(procedure="transport")
    strike = Strike(campaign, "carry to the probe", lambda: None)
    campaign.start()
    wait_for(lambda: strike.struck.is_set() or campaign.over, "the carrying")
    bench.rig.close()
    assert campaign.over
    assert campaign.end_reason == "the platform is closed"
    (record,) = bench.fibres
    assert (record.outcome, record.cause) == (Outcome.INTERRUPTED, "interrupted")
    assert bench.truth.complete
    assert not bench.truth.of("released") + bench.truth.of("dropped")


def test_a_stop_ends_a_campaign_that_pauses(
    make: Make,
) -> None:
    bench = make()
    campaign = bench.campaign(procedure="transport")
    strike = Strike(campaign, "turn the table", campaign.pause)
    campaign.start()
    wait_for(lambda: campaign.phase is CampaignPhase.PAUSED or campaign.over, "the pause")
    assert strike.struck.is_set()
    bench.rig.stop("a hand on the button")
    wait_for(lambda: campaign.over, "the end", 10.0)
    assert "a hand on the button" in campaign.end_reason
    bench.check_stands()
    assert [each.outcome for each in bench.fibres] == [Outcome.INTERRUPTED]
    bench.rig.reset_stop()


def test_a_stop_that_is_reset_at_once_ends_a_campaign_that_only_looks(make: Make) -> None:
    bench = make()
    campaign = bench.campaign(procedure="transport")

    def stop_and_reset() -> None:
        bench.rig.stop("a hand on the button")
        bench.rig.reset_stop()

    strike = Strike(campaign, "find it again", stop_and_reset)
    campaign.run_here()
    assert strike.struck.is_set()
    assert "it was stopped" in campaign.end_reason
    bench.check_stands()
    assert [each.outcome for each in bench.fibres] == [Outcome.INTERRUPTED]
    assert bench.truth.of("grasped") == ()


# ---------------------------------------------------------------------- instruments that fail


@pytest.fixture
def soon(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have an image that does not come given up sooner; it is asked for six times."""
    monkeypatch.setattr(sight, "LIMIT_WALL_S", 3.0)


@pytest.mark.usefixtures("soon")
@pytest.mark.parametrize(
    ("fault", "where", "operation", "message", "cause"),
    [
        (
            "controller unplugged",
            {"device": 0},
            "lift and see that it follows",
            "left",
            "does not answer",
        ),
        ("controller overheated", {"device": 0}, "carry to the probe", "too hot", "too hot"),
        (
            "controller sensor_lost",
            {"device": 0, "channel": 2},
            "carry to the probe",
            "left.z",
            "has no sensor",
        ),
        ("camera unplugged", {}, "carry to the probe", "microscope", "cannot open a camera"),
        ("board unplugged", {}, "push the spans", "force", "Dev1"),
        ("sensor_saturated", {}, "carry to the probe", "force", "180 uN"),
        ("sensor_dead", {}, "push the spans", "dead", "dead"),
    ],
)
def test_what_fails_in_mid_lift_leads_to_a_safe_end_that_names_it(
    make: Make, fault: str, where: dict[str, int], operation: str, message: str, cause: str
) -> None:
    bench = make()
    campaign = bench.campaign(count=3)
    strike = Strike(campaign, operation, lambda: bench.rig.faults.inject(fault, **where))
    campaign.start()
    wait_for(lambda: campaign.over, "the end", 580.0)
    campaign.join()
    assert strike.struck.is_set(), campaign.end_reason
    bench.check_stands()
    said = [campaign.end_reason, *(each.text for each in bench.fibres)]
    assert any(message in each for each in said), said
    assert cause in campaign.end_reason
    assert not [each for each in bench.fibres if each.outcome in (Outcome.RUNNING, Outcome.GOOD)]
    bench.check_nothing_ran_into_anything()


@pytest.mark.usefixtures("soon")
@pytest.mark.parametrize(
    ("fault", "message", "phase"),
    [
        # The limit of the probe, which is armed, stops everything before the campaign looks.
        ("board unplugged", "force", CampaignPhase.STOPPED),
        ("sensor_saturated", "force", CampaignPhase.STOPPED),
        ("sensor_dead", "dead", CampaignPhase.FAILED),
        ("camera unplugged", "camera", CampaignPhase.FAILED),
    ],
)
def test_an_instrument_that_is_dead_from_the_start_is_found_before_a_fibre_is_touched(
    make: Make, fault: str, message: str, phase: CampaignPhase
) -> None:
    bench = make()
    bench.rig.faults.inject(fault)
    campaign = bench.campaign(count=3)
    campaign.run_here()
    assert campaign.phase is phase
    assert message in campaign.end_reason
    assert bench.truth.of("grasped") == ()
    assert bench.fibres == ()
    bench.check_stands()


# ---------------------------------------------------------------------- the force limit


def test_a_limit_that_is_disarmed_in_a_push_ends_the_push(make: Make) -> None:
    bench = make()
    daqco = bench.rig.daqco
    campaign = bench.rig.campaign("quick", bench.home / "out")

    def watched() -> bool:
        (limit,) = [each.settings for each in daqco.limits if each.settings.channel == "force"]
        return campaign.operation == "push the spans" and limit.armed and limit.high == 140.0

    campaign.start()
    wait_for(watched, "a push")
    daqco.disarm_limit("force")
    wait_for(lambda: any(each.cause for each in bench.fibres), "a fibre that failed")
    campaign.abort()
    campaign.join()
    assert bench.fibres[0].outcome is Outcome.FAILED
    assert bench.fibres[0].cause == "no force limit"
    assert daqco.limits[0].settings.armed
    bench.check_nothing_ran_into_anything()
