"""Where the probe is beside the jaws is seen again while a campaign runs."""

import math
import shutil
from pathlib import Path

import pytest

import cosmic
from cosmic.autonomy.campaign.storage_format import read_raw
from cosmic.autonomy.campaign.store_read import CampaignReader
from cosmic.twin.truth import read_truth

CONFIG = Path(__file__).resolve().parents[2] / "config"
WORLD = """
about = "A zoom that comes to rest at another scale each time, and nothing else."
[session]
"optics.views.microscope.zoom_scale" = 0.02
"""
RECIPE = """
procedure = "bend test"
[stop]
count = 3
[parameters.calibration]
drift_fibres = 1
[output]
pictures = false
html = false
pdf = false
table = false
"""


@pytest.mark.slow
def test_a_zoom_that_comes_to_rest_at_another_scale_moves_no_span(tmp_path: Path) -> None:
    config, recipe, truth = tmp_path / "config", tmp_path / "three.toml", tmp_path / "truth.jsonl"
    shutil.copytree(CONFIG, config)
    (config / "worlds" / "zoom.toml").write_text(WORLD, encoding="utf-8")
    recipe.write_text(RECIPE, encoding="utf-8")
    with cosmic.connect(
        config, rate=20.0, sample="three-dry", seed=3, world="zoom", truth=truth
    ) as rig:
        rig.campaign(recipe, tmp_path / "out").run_here()
        drift = rig.calibrations.get("drift of the tips", "left")
    assert drift is not None
    stayed_um = math.hypot(drift.values["gripper_x_um"], drift.values["gripper_y_um"])
    assert stayed_um < 3.0, "the scale of the image is no drift of the gripper"
    reader, touched = CampaignReader(tmp_path / "out"), read_truth(truth).of("touched")
    off_um = []
    for record in reader.fibres():
        path, _ = reader.raw_files()[record.number]
        of = [e for e in touched if record.began_s <= e.time_s <= record.ended_s]
        for span in read_raw(path).spans:
            met = [float(e.facts["abscissa_um"]) for e in of]
            off_um.append(min((each - span.nominal_um for each in met), key=abs))
    assert len(off_um) >= 12
    assert max(map(abs, off_um)) < 3.0
