"""`cosmic simulate`: a simulated device where programs of other people can talk to it."""

import argparse
import math
import signal
import sys
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

from cosmic.frame.clock import WALL, RatedClock
from cosmic.frame.errors import ArgumentError
from cosmic.mico.hw.forwarding import build
from cosmic.mico.hw.scu_serial import open_serial_port
from cosmic.mico.hw.sim_scu_pty import End, PortEnd, PseudoTerminal, serve
from cosmic.mico.hw.sim_scu_serial import SimulatedScus
from cosmic.twin.scene import Scene
from cosmic.twin.settings import shipped_settings


def run(chosen: argparse.Namespace) -> int:
    """Carry out what the command line says; returns 0.

    Raises
    ------
    ArgumentError
        What was asked for does not fit together.
    NotAvailable
        A library cannot be built here.
    """
    return _library(chosen) if chosen.device == "library" else _scu_serial(chosen)


def _library(chosen: argparse.Namespace) -> int:
    """Build a shared library that forwards to the simulation, and say where it is."""
    built = build(chosen.make, chosen.out, layout=chosen.layout, rate=chosen.rate, seed=chosen.seed)
    sys.stdout.write(f"{built}\n")
    return 0


def _scu_serial(chosen: argparse.Namespace) -> int:
    """Serve until interrupted, or for as long as was asked."""
    links: list[Path] = chosen.link
    ports: list[str] = chosen.port
    if not (links or ports):
        raise ArgumentError("name one --link or --port for each unit")
    try:
        scene = Scene.from_layout(
            chosen.layout or ",".join(["LLL"] * (len(links) + len(ports))),
            shipped_settings(),
            RatedClock(chosen.rate),
            chosen.seed,
            cold=chosen.cold,
        )
    except ValueError as exc:
        raise ArgumentError(str(exc)) from exc
    scus = SimulatedScus(scene=scene, baud=chosen.baud)
    if len(scus.units) != len(links) + len(ports):
        raise ArgumentError(
            f"{len(scus.units)} units and {len(links) + len(ports)} lines: name one --link or "
            "--port for each unit of the layout"
        )
    with ExitStack() as stack:
        ends: list[End] = [PseudoTerminal(link) for link in links]
        ends += [PortEnd(open_serial_port(port, chosen.baud)) for port in ports]
        for end in ends:
            stack.callback(end.close)
        for unit, where in zip(scus.units, [*links, *ports], strict=True):
            sys.stdout.write(f"SCU {unit.serial} at {where}\n")
        sys.stdout.flush()
        serve(scus.units, ends, _end(chosen.seconds))
    return 0


def _end(seconds: float | None) -> Callable[[], bool]:
    """Return what says that it is over: interrupted, or `seconds` have passed."""
    interrupted: list[int] = []
    for name in ("SIGINT", "SIGTERM"):
        signal.signal(getattr(signal, name), lambda number, _frame: interrupted.append(number))
    until_s = math.inf if seconds is None else WALL.now_s() + seconds
    return lambda: bool(interrupted) or WALL.now_s() >= until_s
