"""``cosmic plate``: says to a campaign that runs that the plate is there which it asked for."""

import argparse
import sys

from cosmic.autonomy.campaign.plates import confirm
from cosmic.autonomy.campaign.store_read import CampaignReader


def run(chosen: argparse.Namespace) -> int:
    """Confirm the plate and return the exit code.

    Raises
    ------
    CampaignError
        There is no campaign, or it waits for no plate.
    """
    CampaignReader(chosen.folder).check()
    plate = confirm(chosen.folder)
    sys.stdout.write(f"plate {plate} is confirmed; the campaign goes on\n")
    return 0
