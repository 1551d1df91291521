"""The standard on the twin's plate: found, bent, put back, and the scale of the force from it."""

import math
from pathlib import Path

import pytest

import cosmic
from cosmic.autonomy.campaign.analysis import analyse, compare, scale_in
from cosmic.autonomy.campaign.campaign import CampaignPhase
from cosmic.autonomy.campaign.provenance import changed_files, read_provenance
from cosmic.autonomy.campaign.records import STANDARD
from cosmic.autonomy.campaign.store_read import CampaignReader
from cosmic.autonomy.handling.context import HandlingContext
from cosmic.autonomy.handling.standard import NO_STANDARD, ChooseStandard
from cosmic.autonomy.procedures.operation import OperationFailed, Steps
from cosmic.twin.truth import read_truth

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]

RECIPE = """
procedure = "bend test"
[sample]
name = "three-dry"
[stop]
count = 1
[parameters.standard]
ei_n_m2 = 1.789e-10
[parameters.calibration]
heights = false
[output]
html = false
pdf = false
table = false
"""
HOME_UM = (0.0, -3900.0)


def test_the_standard_is_bent_twice_put_back_and_gives_the_scale(tmp_path: Path) -> None:
    recipe = tmp_path / "recipe.toml"
    recipe.write_text(RECIPE, encoding="utf-8")
    with cosmic.connect(
        rate=20.0, seed=3, sample="three-dry", world="friendly", truth=tmp_path / "truth.jsonl"
    ) as rig:
        campaign = rig.campaign(recipe, tmp_path / "out")
        campaign.run_here()
    assert campaign.phase is CampaignPhase.ENDED, campaign.end_reason
    assert not campaign.shortfall
    reader = CampaignReader(tmp_path / "out")
    assert len(reader.fibres(STANDARD)) >= 2
    scale = scale_in(reader.analysis())
    assert scale is not None
    assert scale.verified
    assert abs(scale.off_part) < 3.0 * scale.off_std_part < 0.08
    assert all(each.bending.scale_verified for each in reader.finished() if each.bending)
    assert not compare(reader, analyse(reader)).changed
    truth = read_truth(tmp_path / "truth.jsonl")
    (beam,) = (each for each in truth.fibres if each.role == "standard")
    landed = truth.of("landed", beam.number)
    assert len(landed) >= 2
    for each in landed:
        assert math.dist((each.facts["x_um"], each.facts["y_um"]), HOME_UM) < 400.0
    (page,) = read_provenance(tmp_path / "out")
    assert (page["seed"], page["sample"], page["world"]) == (3, "three-dry", "friendly")
    assert {"platform/platform.toml", "twin/twin.toml", "world/friendly.toml", "recipe.toml"} <= (
        page["files"].keys()
    )
    assert page["settings"]["parameters"]["push"]["fit"]["sensor_un_um"] == 800.0
    assert changed_files(tmp_path / "out") == ()


def test_a_standard_that_lay_too_near_to_others_is_measured_when_its_plate_is_worked_off(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    choose = ChooseStandard.steps

    def too_near_at_first(self: ChooseStandard, work: HandlingContext) -> Steps:
        if not work.shared.finished:
            raise OperationFailed(NO_STANDARD, "the left gripper cannot reach the standard")
        yield from choose(self, work)

    monkeypatch.setattr(ChooseStandard, "steps", too_near_at_first)
    recipe = tmp_path / "recipe.toml"
    text = RECIPE.replace("count = 1", "plates = 2\ncount = 4")
    recipe.write_text(text.replace("1.789e-10", '1.789e-10\nat = ["begin"]'), encoding="utf-8")
    with cosmic.connect(rate=20.0, seed=3, sample="three-dry", world="friendly") as rig:
        campaign = rig.campaign(recipe, tmp_path / "out")
        campaign.run_here()
    assert campaign.phase is CampaignPhase.ENDED, campaign.end_reason
    reader = CampaignReader(tmp_path / "out")
    (standard,) = reader.fibres(STANDARD)
    first = [each for each in reader.finished() if each.plate == 1]
    assert standard.plate == 1
    assert standard.began_s > max(each.ended_s for each in first)
    scale = scale_in(reader.analysis())
    assert scale is not None
    assert scale.verified
