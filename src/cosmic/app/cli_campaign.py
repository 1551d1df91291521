"""The words of the command line that concern campaigns."""

import argparse
from pathlib import Path


def add_campaign_command(
    commands: "argparse._SubParsersAction[argparse.ArgumentParser]",
    platform_options: argparse.ArgumentParser,
) -> None:
    """Add ``cosmic campaign``."""
    campaign = commands.add_parser(
        "campaign",
        help="characterise fibres by a recipe, without a window",
        parents=[platform_options],
    )
    campaign.add_argument("recipe", type=Path, metavar="RECIPE", help="a file, or a shipped name")
    campaign.add_argument("--out", type=Path, required=True, metavar="FOLDER")
    campaign.add_argument("--seed", type=int, help="of all that is random in the twin")
