"""``cosmic certificates``: what stations prove their identity with."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from cosmic.app.configuration.network import require_network
from cosmic.frame.errors import ConfigError


def run(chosen: argparse.Namespace) -> int:
    """Make certificates and print where they are; see `make`."""
    for line in make(chosen.folder, chosen.stations, chosen.address):
        sys.stdout.write(f"{line}\n")
    return 0


def make(folder: Path, stations: Sequence[str], addresses: Sequence[str]) -> list[str]:
    """Make certificates and return what to print, a line each.

    Parameters
    ----------
    stations : sequence of str
        Names of stations and clients.
    addresses : sequence of str
        ``STATION=HOST`` for each name or IP address under which a station is reached.

    Raises
    ------
    ConfigError
        A name is none, there are certificates of that name already, or the folder cannot be
        written to.
    NotAvailable
        What stations need is not installed.
    """
    require_network()
    from cosmic.frame.network.certificates import make_certificates

    if not stations:
        raise ConfigError("--stations: name at least one, such as fiberstation,fibervision")
    if len(stations) != len(set(stations)):
        raise ConfigError(f"--stations: a name is listed twice: {', '.join(stations)}")
    try:
        made = make_certificates(folder, *stations, addresses=_by_station(addresses))
    except OSError as exc:
        raise ConfigError(f"{exc.filename or folder}: {exc.strerror or exc}") from exc
    lines = [f"{files.certificate.parent}: for {name}" for name, files in made.items()]
    return [
        *lines,
        "Copy each folder to its own computer and name it there in the platform file: "
        '[network] certificates = "FOLDER".',
        f"Keep {folder / 'authority'} where no station runs: its key makes further certificates.",
    ]


def _by_station(addresses: Sequence[str]) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for each in addresses:
        station, equals, host = each.partition("=")
        if not (station and equals and host):
            raise ConfigError(f"--address {each}: it reads STATION=HOST")
        found.setdefault(station, []).append(host)
    return found
