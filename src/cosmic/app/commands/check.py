"""``cosmic check``: whether a platform file and what it names can be used."""

import argparse
import sys

from cosmic.app.configuration.check import find_mistakes
from cosmic.frame.errors import ConfigError


def run(chosen: argparse.Namespace) -> int:
    """Check a platform file; raises `ConfigError` with a line for each mistake."""
    mistakes = find_mistakes(chosen.platform)
    if mistakes:
        raise ConfigError("\n".join(mistakes))
    sys.stdout.write(f"{chosen.platform}: ok\n")
    return 0
