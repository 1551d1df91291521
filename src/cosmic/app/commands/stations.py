"""``cosmic stations``: the stations that were used before."""

import argparse
import sys

from cosmic.app.stations.address import known_stations


def run(_chosen: argparse.Namespace) -> int:
    """Print each station as ``--connect`` takes it; raises `ConfigError` where none can be read."""
    for name, endpoint in known_stations().items():
        sys.stdout.write(f"{name}={endpoint}\n")
    return 0
