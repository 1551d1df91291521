"""The words of the command line that concern calibrations."""

import argparse


def add_calibrate_command(
    commands: "argparse._SubParsersAction[argparse.ArgumentParser]",
    platform_options: argparse.ArgumentParser,
) -> None:
    """Add ``cosmic calibrate``."""
    calibrate = commands.add_parser(
        "calibrate",
        help="calibrate what is not fresh, without a window",
        parents=[platform_options],
    )
    calibrate.add_argument(
        "--anew", action="append", default=[], metavar="NAME", help="measure this one in any case"
    )
    calibrate.add_argument(
        "--zooms", action="store_true", help="the map at every step of the lens as well"
    )
