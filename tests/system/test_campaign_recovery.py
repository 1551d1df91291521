"""Campaigns whose program was killed or whose sensor fails: on again, or safe and told why."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

import cosmic
from cosmic.app.rig import Rig
from cosmic.autonomy.campaign.campaign import CampaignPhase
from cosmic.autonomy.campaign.records import Outcome, Pose
from cosmic.autonomy.campaign.storage_format import DATABASE
from cosmic.autonomy.campaign.store import CampaignStore
from cosmic.autonomy.campaign.store_read import CampaignReader
from cosmic.frame.clock import WALL
from cosmic.mico.core.motion.positioner import Confidence
from unit.autonomy.campaign.sample_records import INFO
from unit.mico.rigs import wait_until

RATE = 20.0
AXES = ("left.x", "left.y", "left.z", "right.z", "probe.x", "probe.y", "table.rotation")
RECIPE = """
procedure = "{procedure}"
[sample]
name = "three-dry"
[stop]
count = {count}
"""


def recipe(folder: Path, procedure: str = "transport", count: int = 1) -> Path:
    path = folder / "one.toml"
    path.write_text(RECIPE.format(procedure=procedure, count=count), encoding="utf-8")
    return path


def cut_off(folder: Path, text: str) -> None:
    """Leave a campaign as a killed program leaves it, with a fibre in hand."""
    with CampaignStore.create(folder, replace(INFO, recipe_text=text, seed=0)) as store:
        number = store.begin_fibre(Pose(0.0, 0.0, 0.0), time_s=1.0)
        store.note("carry to the probe", "begins", time_s=2.0, fibre=number)


# Before the platform of this file is there: one that only waits costs a third of a core.
@pytest.mark.skipif(os.name != "posix", reason="no SIGKILL there")
def test_a_campaign_that_was_killed_goes_on_and_has_each_fibre_once(tmp_path: Path) -> None:
    """Killed with the second fibre in the jaws; the first is there afterwards as it was."""
    out = tmp_path / "out"
    path = recipe(tmp_path, count=2)
    command = [sys.executable, "-m", "cosmic", "campaign", str(path), "--out", str(out)]
    command += ["--rate", "30", "--seed", "3"]
    reader = CampaignReader(out)

    def carried() -> bool:
        WALL.sleep(0.05)  # to read it costs the program that writes it
        journal = reader.journal() if (out / DATABASE).exists() and reader.version() else ()
        return [each.operation for each in journal].count("carry to the probe") == 2

    with subprocess.Popen(command, stderr=subprocess.DEVNULL) as program:
        try:
            wait_until(carried, timeout_s=100.0)
        finally:
            program.send_signal(signal.SIGKILL)
    assert program.returncode == -signal.SIGKILL, "it was over before"
    first = repr(reader.fibre(1))
    subprocess.run(command, check=True, timeout=100.0, capture_output=True)
    assert reader.cut_off()
    reader.check()
    outcomes = [each.outcome for each in reader.fibres()]
    assert outcomes == [Outcome.GOOD, Outcome.INTERRUPTED, Outcome.GOOD]
    assert repr(reader.fibre(1)) == first
    after = [each.operation for each in reader.journal() if each.fibre != 1]
    assert "initialise again" in after, "no position was believed"


@pytest.fixture(scope="module")
def rig() -> Iterator[Rig]:
    with cosmic.connect(rate=RATE, sample="three-dry", cold=True) as rig:
        yield rig


@pytest.mark.slow
def test_after_an_end_without_warning_no_position_is_believed(rig: Rig, tmp_path: Path) -> None:
    path, folder = recipe(tmp_path), tmp_path / "out"
    cut_off(folder, path.read_text(encoding="utf-8"))
    assert rig.mico["left.x"].details.confidence is Confidence.UNKNOWN
    campaign = rig.campaign(path, folder)
    campaign.start()
    wait_until(lambda: campaign.over or campaign.operation == "make ready", timeout_s=60.0)
    campaign.abort("seen")
    campaign.join()
    assert {rig.mico[name].details.confidence for name in AXES} == {Confidence.KNOWN}
    reader = CampaignReader(folder)
    assert [each.outcome for each in reader.fibres()] == [Outcome.INTERRUPTED]
    begun = [each.operation for each in reader.journal()]
    assert begun[:3] == ["carry to the probe", "initialise again", "clear up"]


def test_a_campaign_that_ended_in_order_goes_on_without_it(rig: Rig, tmp_path: Path) -> None:
    path, folder = recipe(tmp_path), tmp_path / "out"
    text = path.read_text(encoding="utf-8")
    with CampaignStore.create(folder, replace(INFO, recipe_text=text, seed=0)) as store:
        store.end("ended by the operator", time_s=5.0)
    campaign = rig.campaign(path, folder)
    assert not CampaignReader(folder).cut_off()
    campaign.abort("seen")


@pytest.mark.slow
def test_a_sensor_that_stays_at_its_end_lets_no_fibre_be_taken_and_is_reported(
    tmp_path: Path,
) -> None:
    with cosmic.connect(rate=RATE, sample="three-dry", seed=2) as rig:
        rig.daqco.disarm_limit("force")  # else it stops everything first, see below
        rig.faults.inject("sensor_saturated")
        campaign = rig.campaign(recipe(tmp_path, "bend test"), tmp_path / "out")
        campaign.run_here()
        assert campaign.phase is CampaignPhase.FAILED
        assert "force sensor" in campaign.end_reason
        assert "cable" in campaign.end_reason, "it says what to look at"
        assert rig.stopped is None
        assert CampaignReader(tmp_path / "out").fibres() == ()


@pytest.mark.slow
def test_a_sensor_beyond_the_limit_that_is_armed_stops_the_campaign(tmp_path: Path) -> None:
    with cosmic.connect(rate=RATE, sample="three-dry", seed=2) as rig:
        rig.faults.inject("sensor_saturated")
        campaign = rig.campaign(recipe(tmp_path, "bend test"), tmp_path / "out")
        campaign.run_here()
        assert campaign.phase is CampaignPhase.STOPPED
        assert "force reached 180 uN, its limit is 150" in campaign.end_reason
        assert rig.stopped is not None
        assert CampaignReader(tmp_path / "out").fibres() == ()
