"""The command line: ``cosmic``, ``cosmic mico``, ``cosmic check``, ``cosmic init``."""

import argparse
import logging
import os
import re
import shutil
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Final

from cosmic.app.cli_calibrate import add_calibrate_command
from cosmic.app.cli_campaign import add_campaign_command
from cosmic.app.commands.stations import (
    add_station_commands,
    line_options,
    make_certificates,
    serve_station,
    stations_of,
)
from cosmic.frame.config import shipped_config_dir
from cosmic.frame.errors import CosmicError
from cosmic.frame.log import set_up_logging

if TYPE_CHECKING:
    from cosmic.app.windows.run_window import WindowOptions

_WINDOW_SIZE: Final = (1600, 1000)
_LOG_THEMSELVES: Final = (None, "mico", "daqco", "vico", "serve")
"""Commands that run on, and say more of it."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Carry out one command and return the exit code: 0 well, 1 failed, 2 not understood."""
    parser = _parser()
    chosen, unknown = parser.parse_known_args(arguments)
    if unknown:
        parser.error(f"unrecognized arguments: {' '.join(unknown)}")
    with ExitStack() as at_end:
        if chosen.command not in _LOG_THEMSELVES:  # warnings alone: the rest is for their output
            at_end.callback(set_up_logging(console=True, console_level=logging.WARNING))
        try:
            return _carry_out(chosen, parser)
        except CosmicError as exc:
            return _fail(str(exc))


def _carry_out(chosen: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    if chosen.command == "check":
        return _check(chosen.platform)
    if chosen.command == "init":
        return _init(chosen.folder)
    if chosen.command == "scene":
        return _scene(chosen)
    if chosen.command == "export":
        return _export(chosen)
    if chosen.command == "certificates":
        return make_certificates(chosen)
    if chosen.command in _BY_THEMSELVES:
        return _BY_THEMSELVES[chosen.command](chosen)
    if chosen.rate is None:
        chosen.rate = 1.0
    if chosen.command == "serve":
        return serve_station(chosen)
    return _window(chosen, parser)


def _fail(text: str) -> int:
    for line in text.splitlines():
        sys.stderr.write(f"cosmic: {line}\n")
    return 1


# The commands


def _check(platform: Path) -> int:
    from cosmic.app.configuration.check import find_mistakes

    mistakes = find_mistakes(platform)
    if mistakes:
        return _fail("\n".join(mistakes))
    sys.stdout.write(f"{platform}: ok\n")
    return 0


def _scene(chosen: argparse.Namespace) -> int:
    from cosmic.app.commands.scene import check_scene, decompose

    if chosen.task == "decompose":
        for line in decompose(chosen.mesh, chosen.folder):
            sys.stdout.write(f"{line}\n")
        return 0
    mistakes, warnings = check_scene(chosen.scene)
    for line in warnings:
        sys.stderr.write(f"cosmic: warning: {line}\n")
    if mistakes:
        return _fail("\n".join(mistakes))
    sys.stdout.write(f"{chosen.scene}: ok\n")
    return 0


def _export(chosen: argparse.Namespace) -> int:
    from cosmic.daqco.api.export import export_file

    told = sys.stderr if sys.stderr.isatty() else None

    def report(fraction: float) -> bool:
        if told is not None:
            told.write(f"\r{chosen.recording.name}: {fraction:4.0%}")
        return True

    written = export_file(
        chosen.recording, chosen.to, chosen.output, report, overwrite=chosen.overwrite
    )
    if told is not None:
        told.write("\n")
    sys.stdout.write(f"{written}\n")
    return 0


def _campaign(chosen: argparse.Namespace) -> int:
    from cosmic.app.commands.campaign import run_campaign

    return run_campaign(chosen)


def _calibrate(chosen: argparse.Namespace) -> int:
    from cosmic.app.commands.calibrate import run_calibrate

    return run_calibrate(chosen)


def _repair(chosen: argparse.Namespace) -> int:
    from cosmic.app.left_open import repair

    return repair(chosen)


_BY_THEMSELVES: Final = {"campaign": _campaign, "calibrate": _calibrate, "repair": _repair}
"""Commands that are loaded when they are called."""


def _init(folder: Path) -> int:
    source = shipped_config_dir()
    files = sorted(path for path in source.rglob("*") if path.is_file())
    there = [folder / path.relative_to(source) for path in files]
    taken = [path for path in there if path.exists()]
    if taken:
        return _fail("\n".join(f"{path}: is there already; nothing was copied" for path in taken))
    try:
        for path, target in zip(files, there, strict=True):
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, target)
    except OSError as exc:
        return _fail(f"{exc.filename or folder}: {exc.strerror or exc}")
    sys.stdout.write(f"{folder}: {len(files)} files; start with: cosmic --config {folder}\n")
    return 0


def _window(chosen: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    if chosen.screenshot is not None and chosen.offscreen is None:
        parser.error("--screenshot needs --offscreen SECONDS")
    if chosen.offscreen is None and not _display_there():
        return _fail("there is no display; --offscreen SECONDS runs without one")
    # Imported here: what needs no window starts without loading Qt's widgets.
    from cosmic.app.windows.run_window import run_window

    return run_window(_options(chosen))


def _options(chosen: argparse.Namespace) -> "WindowOptions":
    from cosmic.app.windows.run_window import WindowOptions

    size = chosen.size or (_WINDOW_SIZE if chosen.offscreen is not None else None)
    return WindowOptions(
        config=chosen.config,
        only=chosen.command or "",
        rate=chosen.rate,
        cold=chosen.cold,
        sample=chosen.sample,
        truth=chosen.truth,
        offscreen_s=chosen.offscreen,
        screenshot=chosen.screenshot,
        size=size,
        theme=chosen.theme,
        serve=chosen.serve,
        listen=chosen.listen,
        name=chosen.name,
        certificates=chosen.certificates,
        stations=stations_of(chosen),
    )


def _display_there() -> bool:
    """Tell whether a window can be shown; Qt aborts the process where it cannot."""
    if sys.platform != "linux" or os.environ.get("QT_QPA_PLATFORM"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


# The words


def _parser() -> argparse.ArgumentParser:
    platform = _platform_options()
    window = _window_options(platform)
    parser = argparse.ArgumentParser(
        prog="cosmic",
        description="Control software for a microrobotic platform. Without a command: the "
        "operator's window with all applications of the platform file.",
        parents=[window],
    )
    parser.set_defaults(
        config=None,
        rate=None,
        cold=False,
        sample=None,
        truth=None,
        offscreen=None,
        screenshot=None,
        size=None,
        theme=None,
        serve=False,
        listen=None,
        name=None,
        certificates=None,
        connect=None,
    )
    commands = parser.add_subparsers(dest="command", metavar="COMMAND")
    commands.add_parser("mico", help="the window of MiCo alone", parents=[window])
    commands.add_parser("daqco", help="the window of DAQCo alone", parents=[window])
    commands.add_parser("vico", help="the window of ViCo alone", parents=[window])
    check = commands.add_parser("check", help="check a platform file and the twin it names")
    check.add_argument("platform", type=Path, metavar="PLATFORM.toml")
    init = commands.add_parser("init", help="copy the shipped configuration out, to change it")
    init.add_argument("folder", type=Path, metavar="FOLDER")
    scene = commands.add_parser("scene", help="check the scene of a collision model, and more")
    tasks = scene.add_subparsers(dest="task", metavar="TASK", required=True)
    look = tasks.add_parser("check", help="check a scene with its URDF, SRDF and meshes")
    look.add_argument("scene", type=Path, metavar="SCENE.toml")
    split = tasks.add_parser("decompose", help="split a concave mesh into convex pieces")
    split.add_argument("mesh", type=Path, metavar="MESH.stl")
    split.add_argument("folder", type=Path, metavar="FOLDER")
    export = commands.add_parser("export", help="write a recording as CSV or TDMS")
    export.add_argument("recording", type=Path, metavar="RECORDING")
    export.add_argument("--to", choices=("csv", "tdms"), default="csv", help="format; CSV")
    export.add_argument("--output", type=Path, metavar="FILE", help="beside the recording if none")
    export.add_argument("--overwrite", action="store_true", help="replace a file that exists")
    repair = commands.add_parser("repair", help="close recordings that a killed process left open")
    repair.add_argument("recordings", type=Path, nargs="+", metavar="FILE")
    repair.add_argument("--ended", action="store_true", help="take it that nothing writes them")
    add_station_commands(commands, platform)
    add_campaign_command(commands, platform)
    add_calibrate_command(commands, platform)
    return parser


def _platform_options() -> argparse.ArgumentParser:
    # Suppressed defaults, so that an option before the command is not reset by the command.
    options = argparse.ArgumentParser(add_help=False, argument_default=argparse.SUPPRESS)
    add = options.add_argument
    add("--config", type=Path, metavar="PATH", help="a platform.toml or its folder")
    add("--rate", type=float, help="how many times faster than the wall the simulation runs")
    add("--cold", action="store_true", help="start the simulation at power-up, nothing referenced")
    add("--sample", metavar="NAME", help="what lies on the simulated plate, such as forty-dry")
    add("--truth", type=Path, metavar="FILE", help="write what truly happens in the simulation")
    return options


def _window_options(platform: argparse.ArgumentParser) -> argparse.ArgumentParser:
    options = argparse.ArgumentParser(
        add_help=False, argument_default=argparse.SUPPRESS, parents=[platform, line_options()]
    )
    add = options.add_argument
    add("--serve", action="store_true", help="let other programs use what runs here")
    add("--offscreen", type=_seconds, metavar="SECONDS", help="show nothing, close after SECONDS")
    add("--screenshot", type=Path, metavar="FILE", help="with --offscreen: save an image")
    add("--size", type=_size, metavar="WxH", help="size of the window, such as 1600x1000")
    add("--theme", choices=("dark", "light"), help="colours of the window")
    return options


def _seconds(text: str) -> float:
    value = float(text)
    if not 0.0 <= value <= 86_400.0:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of seconds up to a day")
    return value


def _size(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d{3,5})x(\d{3,5})", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"{text!r} is not a size such as 1600x1000")
    return int(match[1]), int(match[2])
