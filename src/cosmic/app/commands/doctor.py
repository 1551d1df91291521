"""``cosmic doctor``: what is on this computer, what is missing, and what to do about it."""

import argparse
import dataclasses
import json
import sys
import textwrap
from functools import partial
from pathlib import Path
from typing import Final

from cosmic.app.configuration.platform_file import PlatformFile, load_platform
from cosmic.app.diagnosis import computer
from cosmic.app.diagnosis.finding import Check, Finding, State, carry_out
from cosmic.app.diagnosis.hardware import brought, hardware, network, serial_ports
from cosmic.frame.version import __version__

_MARKS: Final = {State.GOOD: "ok", State.NOTE: "--", State.PROBLEM: "!!"}
_WIDTH: Final = 100
_INDENT: Final = " " * 27


def run(chosen: argparse.Namespace) -> int:
    """Print the page; returns 1 when something that the platform file needs is missing.

    Raises
    ------
    ConfigError
        The platform file is wrong.
    """
    file, path = load_platform(chosen.config)
    found = examine(file)
    if chosen.json:
        page = {
            "version": __version__,
            "platform_file": str(path),
            "problems": sum(each.state is State.PROBLEM for each in found),
            "findings": [dataclasses.asdict(each) for each in found],
        }
        sys.stdout.write(json.dumps(page, indent=2) + "\n")
    else:
        sys.stdout.write(page_text(found, path))
    return int(any(each.state is State.PROBLEM for each in found))


def examine(file: PlatformFile) -> list[Finding]:
    """Carry all checks out, one after the other; takes some seconds. Moves and opens nothing."""
    folder = Path(file.daqco.directory).expanduser() if file.daqco else Path()
    checks: tuple[tuple[str, str, Check, bool], ...] = (
        ("Python", "Python", computer.python, True),
        ("Packages", "packages", computer.packages, False),
        ("Packages", "brought", partial(brought, file), True),
        ("Windows", "Qt", computer.windows, True),
        ("Vendors' libraries", "libraries", partial(hardware, file), False),
        ("Ports", "serial ports", partial(serial_ports, file), False),
        ("Ports", "network", partial(network, file), False),
        ("Time", "clock", computer.clock, True),
        ("Disk", "recordings", partial(computer.disk, folder), True),
        ("Permissions", "priority", computer.permissions, False),
    )
    return [
        finding
        for area, name, check, needed in checks
        for finding in carry_out(area, name, check, needed=needed)
    ]


def page_text(found: list[Finding], path: Path) -> str:
    """Return the page: a line for each finding, below it what to do."""
    lines = [f"CoSMic {__version__}, for {path}"]
    area = ""
    for each in found:
        if each.area != area:
            area = each.area
            lines += ["", area]
        lines.append(f"  {_MARKS[each.state]}  {each.name:<20} {each.found}")
        lines += textwrap.wrap(
            each.advice, _WIDTH, initial_indent=_INDENT, subsequent_indent=_INDENT
        )
    problems = sum(each.state is State.PROBLEM for each in found)
    last = "Nothing that this platform file needs is missing."
    if problems:
        last = f"{problems} to be mended, marked !!"
    return "\n".join([*lines, "", last, ""])
