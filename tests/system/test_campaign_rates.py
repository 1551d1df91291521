"""A campaign takes as long on the platform, and finds the same, however fast the twin runs."""

import math
from pathlib import Path
from statistics import fmean

import pytest

import cosmic
from cosmic.autonomy.bending.result import BendingResult
from cosmic.autonomy.campaign.records import FibreRecord, Outcome
from cosmic.autonomy.campaign.store_read import CampaignReader

RECIPE = """
procedure = "bend test"
[sample]
name = "three-dry"
[stop]
count = 3
[output]
pictures = false
html = false
pdf = false
table = false
"""


def all_fibres(rate: float, folder: Path) -> tuple[FibreRecord, ...]:
    recipe = folder / "three.toml"
    recipe.write_text(RECIPE, encoding="utf-8")
    with cosmic.connect(rate=rate, sample="three-dry", seed=3) as rig:
        rig.campaign(recipe, folder / "out").run_here()
    return CampaignReader(folder / "out").fibres()


def bent(record: FibreRecord) -> BendingResult:
    assert record.outcome is Outcome.GOOD
    assert record.bending is not None
    return record.bending


def half_width(bending: BendingResult) -> float:
    return (bending.ei_high_n_m2 - bending.ei_low_n_m2) / 2.0


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_one_seed_gives_one_result_at_every_rate(tmp_path: Path) -> None:
    first: tuple[FibreRecord, ...] = ()
    for rate in (1.0, 4.0, 20.0):
        folder = tmp_path / f"{rate:g}"
        folder.mkdir()
        found = all_fibres(rate, folder)
        first = first or found
        assert len(found) == 3
        ratios = []
        for record, other in zip(found, first, strict=True):
            one, two = bent(record), bent(other)
            ratios.append(one.ei_n_m2 / two.ei_n_m2)
            difference = abs(one.ei_n_m2 - two.ei_n_m2)
            assert difference <= math.hypot(half_width(one), half_width(two))
            assert record.shape.length_um == pytest.approx(other.shape.length_um, rel=0.01)
            # 15 % where the computer is quiet; at the pace of before it was 20 times as long.
            assert record.duration_s == pytest.approx(other.duration_s, rel=0.5)
        # Noise falls elsewhere in each campaign: one fibre varies by 1.4 %, sometimes by 3.
        assert fmean(ratios) == pytest.approx(1.0, rel=0.05)
