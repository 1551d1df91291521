"""A campaign over several plates: a person is asked for each, also after a restart in between."""

from pathlib import Path

import pytest

import cosmic
from cosmic.autonomy.campaign.campaign import Campaign, CampaignPhase
from cosmic.autonomy.campaign.rates import rates_of
from cosmic.autonomy.campaign.store_read import CampaignReader
from cosmic.frame.errors import NotAvailable
from system.campaign_bench import wait_for

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]

RECIPE = """
procedure = "transport"
[sample]
name = "three-dry"
[stop]
plates = 2
[plates]
by = "person"
[parameters.calibration]
heights = false
[output]
html = false
pdf = false
table = false
"""


def until_asked(campaign: Campaign) -> None:
    wait_for(lambda: bool(campaign.request) or campaign.over, "a plate is asked for", 400.0)
    assert "plate 2" in campaign.request, campaign.end_reason


def test_a_person_changes_the_plate_and_a_restart_asks_again(tmp_path: Path) -> None:
    recipe, folder = tmp_path / "plates.toml", tmp_path / "out"
    recipe.write_text(RECIPE, encoding="utf-8")
    with cosmic.connect(rate=20.0, seed=3, sample="three-dry", world="friendly") as rig:
        campaign = rig.campaign(recipe, folder)
        with pytest.raises(NotAvailable, match="no plate is waited for"):
            campaign.confirm_plate()
        campaign.start()
        until_asked(campaign)
        work = campaign.work
        assert work.height_now() >= work.settings.places.travel_um - 2.0
        assert work.tip_now(work.probe)[1] >= work.settings.places.probe_away_y_um - 2.0
        campaign.abort("evening")
        campaign.join()
    assert campaign.phase is CampaignPhase.STOPPED
    reader = CampaignReader(folder)
    assert not reader.plate_changes()[-1].over
    on_first = len(reader.finished())
    assert on_first >= 2
    with cosmic.connect(rate=20.0, seed=3, sample="three-dry", world="friendly") as rig:
        campaign = rig.campaign(recipe, folder)
        campaign.start()
        until_asked(campaign)
        assert len(reader.fibres()) == on_first
        campaign.confirm_plate()
        wait_for(lambda: campaign.over, "the end", 400.0)
        campaign.join()
    assert (campaign.phase, campaign.end_reason) == (CampaignPhase.ENDED, "2 plates worked off")
    (change,) = reader.plate_changes()
    assert (change.plate, change.by, change.over) == (2, "person", True)
    assert {each.plate for each in reader.finished()} == {1, 2}
    rates = rates_of(reader)
    assert rates.plates == 2
    assert rates.seen >= 6  # the glass fibre is seen as well where nobody says that it is no fibre
    assert rates.plates_s > 0.0
