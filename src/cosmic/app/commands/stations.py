"""The words of the command line that concern stations, and their commands."""

import argparse
import sys
from pathlib import Path

from cosmic.app.stations.options import ServeOptions, StationAddress


def line_options() -> argparse.ArgumentParser:
    """Return the options of whoever serves or connects."""
    # Suppressed defaults, so that an option before the command is not reset by the command.
    options = argparse.ArgumentParser(add_help=False, argument_default=argparse.SUPPRESS)
    add = options.add_argument
    add("--listen", metavar="ENDPOINT", help="where to serve, such as tcp/127.0.0.1:7447")
    add("--name", metavar="NAME", help="how others call this station")
    add("--certificates", type=Path, metavar="FOLDER", help="with which to prove who this is")
    add(
        "--connect",
        action="append",
        metavar="NAME=ENDPOINT",
        help="use the applications of another station, such as "
        "fibervision=tcp/127.0.0.1:7448; may be given several times",
    )
    return options


def add_station_commands(
    commands: "argparse._SubParsersAction[argparse.ArgumentParser]",
    platform_options: argparse.ArgumentParser,
) -> None:
    """Add ``cosmic serve`` and ``cosmic certificates``."""
    serve = commands.add_parser(
        "serve", help="a station without a window", parents=[platform_options, line_options()]
    )
    serve.add_argument(
        "--applications", type=_names, default=(), metavar="NAMES", help="such as mico,daqco; all"
    )
    serve.add_argument("--seed", type=int, default=0, help="of all that is random in the twin")
    made = commands.add_parser("certificates", help="make what stations prove who they are with")
    made.add_argument("folder", type=Path, metavar="FOLDER")
    made.add_argument(
        "--stations",
        type=_names,
        required=True,
        metavar="NAMES",
        help="stations and clients, such as fiberstation,fibervision",
    )
    made.add_argument(
        "--address",
        action="append",
        default=[],
        metavar="STATION=HOST",
        help="a name or IP address under which a station is reached; may be given several times",
    )


def stations_of(chosen: argparse.Namespace) -> tuple[StationAddress, ...]:
    """Return the stations that ``--connect`` names; raises `ConfigError`."""
    return tuple(StationAddress.read(each) for each in chosen.connect or ())


def serve_station(chosen: argparse.Namespace) -> int:
    """Carry out ``cosmic serve``."""
    from cosmic.app.commands.serve import serve

    return serve(
        ServeOptions(
            applications=chosen.applications,
            config=chosen.config,
            listen=chosen.listen,
            name=chosen.name,
            certificates=chosen.certificates,
            stations=stations_of(chosen),
            rate=chosen.rate,
            seed=chosen.seed,
            cold=chosen.cold,
            sample=chosen.sample,
            truth=chosen.truth,
        )
    )


def make_certificates(chosen: argparse.Namespace) -> int:
    """Carry out ``cosmic certificates``."""
    from cosmic.app.commands.certificates import make

    for line in make(chosen.folder, chosen.stations, chosen.address):
        sys.stdout.write(f"{line}\n")
    return 0


def _names(text: str) -> tuple[str, ...]:
    return tuple(each.strip() for each in text.split(",") if each.strip())
