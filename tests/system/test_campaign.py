"""A campaign on the simulated platform: from the sample to the report, ended and gone on with."""

import csv
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from cosmic.app.panels.campaign.output import write_output
from cosmic.app.rig import Rig
from cosmic.autonomy.campaign.campaign import Campaign, CampaignPhase
from cosmic.autonomy.campaign.recipe import OutputSettings
from cosmic.autonomy.campaign.records import CampaignError, Outcome, Pose
from cosmic.autonomy.campaign.store import CampaignStore
from cosmic.autonomy.campaign.store_read import CampaignReader
from cosmic.autonomy.recorded.steps import RecordedProcedure
from cosmic.frame.errors import ArgumentError, ConfigError
from cosmic.twin.truth import TruthRecord, read_truth
from system.campaign_bench import Bench, bench, wait_for
from system.campaign_trial import Trial
from unit.autonomy.campaign.sample_records import INFO, good

RATE = 20.0
RECIPE = """
procedure = "{procedure}"
[sample]
name = "easy"
[stop]
count = {count}
[parameters.calibration]
heights = false
"""


def recipe(folder: Path, count: int, procedure: str = "bend test") -> Path:
    path = folder / f"{procedure.replace(' ', '-')}-{count}.toml"
    path.write_text(RECIPE.format(count=count, procedure=procedure), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("campaigns")


@pytest.fixture(scope="module")
def plate(home: Path) -> Iterator[Bench]:
    with bench(home, rate=RATE) as made:
        yield made


@pytest.fixture(scope="module")
def rig(plate: Bench) -> Rig:
    return plate.rig


@pytest.fixture(scope="module")
def done(rig: Rig, home: Path) -> Campaign:
    campaign = rig.campaign(recipe(home, 1), home / "one")
    campaign.run_here()
    return campaign


@pytest.fixture
def truth(rig: Rig, home: Path) -> TruthRecord:
    return read_truth(home / "truth.jsonl")


def test_a_fibre_is_measured_and_its_record_agrees_with_the_truth(
    done: Campaign, home: Path, truth: TruthRecord
) -> None:
    assert (done.phase, done.end_reason) == (CampaignPhase.ENDED, "1 fibres done")
    record = CampaignReader(home / "one").fibre(1)
    (number,) = {each.facts["fibre"] for each in truth.of("grasped")}
    true = truth.fibres[number]
    assert record.outcome is Outcome.GOOD
    assert record.bending is not None
    assert record.bending.ei_n_m2 == pytest.approx(true.ei_n_m2, rel=0.1)
    assert record.shape.length_um == pytest.approx(true.length_um, rel=0.02)
    assert record.peak_force_un < 0.8 * 180.0
    assert {each.name for each in record.series} >= {"left.x", "probe.y", "force"}
    assert record.images
    assert any(each.name == "push the spans" for each in record.operations)


def test_the_fibre_was_truly_taken_up_bent_and_put_away(
    done: Campaign, home: Path, truth: TruthRecord
) -> None:
    assert done.over
    (number,) = {each.facts["fibre"] for each in truth.of("grasped")}
    events = [each for each in truth.events if each.facts.get("fibre") == number]
    names = [each.event for each in events]
    assert names[:2] == ["grasped", "lifted"]
    assert set(names[2:-2]) == {"touched", "left"}
    assert names.count("touched") == names.count("left") >= 2
    assert names[-2:] == ["released", "landed"]
    peaks_un = [each.facts["peak_un"] for each in events if each.event == "left"]
    assert all(0.0 < peak_un < 0.8 * 180.0 for peak_un in peaks_un)
    # Each span is pushed; to be slid on the probe a fibre is touched lightly besides.
    spans = len(CampaignReader(home / "one").fibre(1).spans)
    assert spans >= 2
    assert sum(peak_un > 5.0 for peak_un in peaks_un) >= spans
    assert not events[-2].facts["sticks"]
    lay, lies = truth.fibres[number], events[-1].facts
    assert math.dist((lay.x_um, lay.y_um), (lies["x_um"], lies["y_um"])) > 3000.0


def test_every_operation_is_in_the_journal_before_it_is_done(done: Campaign) -> None:
    journal = CampaignReader(done.store.folder).journal()
    names = [each.operation for each in journal]
    assert names.index("close the gripper") < names.index("carry to the probe")
    assert all(each.phase == "begins" for each in journal)
    assert journal[-1].fibre == 1


@pytest.mark.usefixtures("qapp")  # one for all tests of a process: the report would make its own
def test_report_and_table_are_written_without_a_window(done: Campaign) -> None:
    written = write_output(done.store.folder, OutputSettings())
    assert [each.name for each in written] == ["report.html", "report.pdf", "fibres.csv"]
    assert all(each.stat().st_size > 100 for each in written)
    with written[2].open(encoding="utf-8", newline="") as file:
        (row,) = csv.DictReader(file)
    assert row["outcome"] == "good"


def test_a_campaign_that_is_done_is_not_done_again(done: Campaign, rig: Rig, home: Path) -> None:
    again = rig.campaign(recipe(home, 1), done.store.folder)
    again.run_here()
    assert again.end_reason == "1 fibres done"
    assert len(CampaignReader(done.store.folder).fibres()) == 1


def test_another_recipe_is_refused_in_the_folder_of_a_campaign(
    done: Campaign, rig: Rig, home: Path
) -> None:
    with pytest.raises(CampaignError, match="another recipe"):
        rig.campaign(recipe(home, 2), done.store.folder)


def test_a_record_of_real_fibres_is_not_gone_on_with_on_the_twin(rig: Rig, home: Path) -> None:
    asked = recipe(home, 3)
    info = replace(INFO, recipe_text=asked.read_text("utf-8"), hardware="FiberStation", seed=0)
    CampaignStore.create(home / "real", info).close()
    with pytest.raises(CampaignError, match="the platform FiberStation, and this is the digital"):
        rig.campaign(asked, home / "real")


def test_a_defect_of_the_final_analysis_leaves_no_campaign_that_seems_to_run(
    rig: Rig, home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(_store: CampaignStore) -> None:
        raise ValueError("a defect")

    monkeypatch.setattr("cosmic.autonomy.campaign.campaign.finish", broken)
    campaign = rig.campaign(recipe(home, 1), home / "broken")
    with pytest.raises(ValueError, match="a defect"):
        campaign.abort("not now")
    assert campaign.over
    assert campaign.phase is CampaignPhase.FAILED
    assert "not now; program error" in campaign.end_reason
    CampaignStore.open(home / "broken", run=False).close()  # nobody has it any more


def test_a_step_is_made_from_a_pause_between_two_fibres_too(rig: Rig, home: Path) -> None:
    campaign = rig.campaign(recipe(home, 1, "transport"), home / "stepped")
    ended: list[str] = []

    def pause_at_once() -> None:
        if not ended:
            ended.append("paused")
            campaign.pause()

    campaign.on_change(pause_at_once)
    campaign.start()
    wait_for(lambda: campaign.phase is CampaignPhase.PAUSED, "the pause")
    assert campaign.run is None
    campaign.step()
    wait_for(lambda: bool(campaign.times.summary()), "one operation")
    wait_for(lambda: campaign.phase is CampaignPhase.PAUSED, "the rest after it")
    assert [each.count for each in campaign.times.summary()] == [1]
    campaign.abort("seen")
    campaign.join()
    assert campaign.over


def test_a_mean_that_the_final_analysis_makes_less_sure_is_called_that(
    rig: Rig, home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def apart(store: CampaignStore) -> None:
        store.keep_analysis(
            {
                each.number: replace(each.bending, ei_n_m2=5e-11 * 4.0**each.number)
                for each in store.reader.finished()
                if each.bending is not None
            },
            {},
        )

    monkeypatch.setattr("cosmic.autonomy.campaign.campaign.finish", apart)
    path = home / "precise.toml"
    path.write_text(
        'procedure = "bend test"\n[stop]\nprecision_percent = 60.0\nleast = 3\n', "utf-8"
    )
    info = replace(INFO, recipe_text=path.read_text("utf-8"), seed=1)
    with CampaignStore.create(home / "precise", info) as store:
        for _ in range(3):
            number = store.begin_fibre(Pose(300.0, -150.0, 12.0), time_s=1.0)
            store.finish_fibre(good(number, began_s=1.0))
        store.end("evening", time_s=99.0)
    campaign = rig.campaign(path, home / "precise")
    campaign.run_here()
    assert campaign.phase is CampaignPhase.ENDED
    assert "known to +/-" in campaign.shortfall
    assert "fewer" not in campaign.shortfall


def test_a_wrong_recipe_is_refused_with_file_key_and_reason(rig: Rig, home: Path) -> None:
    wrong = recipe(home, 1, "juggle")
    with pytest.raises(ConfigError, match=r"juggle-1\.toml: procedure: .*bend test"):
        rig.campaign(wrong, home / "never")
    assert not (home / "never").exists()


def test_a_folder_without_a_name_is_refused(
    rig: Rig, home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    here = home / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    for empty in ("", " "):
        with pytest.raises(ArgumentError, match="folder is empty; give one by name"):
            rig.campaign(recipe(home, 1), empty)
        with pytest.raises(ArgumentError, match="recipe is empty; give one by name"):
            rig.campaign(empty, home / "never")
        with pytest.raises(ArgumentError, match="folder is empty; give one by name"):
            rig.replay(RecordedProcedure(name="nothing"), folder=empty)
    assert not list(here.iterdir())


@pytest.mark.parametrize("operation", ["close the gripper", "carry to the probe", "push the spans"])
def test_stop_ends_a_campaign_and_its_fibre_can_be_gone_on_with(
    done: Campaign, plate: Bench, operation: str
) -> None:
    assert done.over
    trial = Trial(plate, "bend test", operation)
    trial.stop(moving=True)
    assert [each.outcome for each in trial.fibres()] == [Outcome.INTERRUPTED]
    again = plate.campaign(trial.recipe, trial.folder)
    assert again.phase is CampaignPhase.READY
    again.abort("not now")
    assert (again.phase, again.end_reason) == (CampaignPhase.STOPPED, "not now")
