"""Campaigns on a platform, for scripts, the command and the window."""

import platform as computer
from pathlib import Path
from typing import TYPE_CHECKING

import cosmic
from cosmic.app.platform import Platform
from cosmic.app.stop_watch import stopped_since
from cosmic.autonomy.campaign.campaign import Campaign
from cosmic.autonomy.campaign.opening import CampaignHost, open_campaign, read_recipe
from cosmic.autonomy.campaign.recipe import Recipe
from cosmic.autonomy.campaign.records import TWIN
from cosmic.frame.arguments import check_path, checked

if TYPE_CHECKING:
    from cosmic.app.rig import Rig


@checked
def campaign_on(
    rig: "Rig", platform: Platform, recipe: Recipe | str | Path, folder: str | Path
) -> Campaign:
    """Return a campaign that is ready to start; see `Rig.campaign`."""
    for name, value in (("recipe", recipe), ("folder", folder)):
        if not isinstance(value, Recipe):
            check_path(name, value)
    read = recipe if isinstance(recipe, Recipe) else read_recipe(Path(recipe))
    host = CampaignHost(
        rig=rig,
        policy=platform.policy,
        stopped=stopped_since(platform),
        hardware=TWIN if rig.simulated else platform.file.platform.name,
        rate=platform.clock.rate,
        seed=platform.seed if rig.simulated else 0,
        versions={"CoSMic": cosmic.__version__, "Python": computer.python_version()},
    )
    return open_campaign(read, Path(folder), host)
