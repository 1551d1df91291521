"""The command line: what may be said; a file in `commands` carries each command out."""

import argparse
import logging
import math
import os
import re
import sys
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from datetime import datetime
from importlib import import_module
from pathlib import Path
from typing import Final

from cosmic.frame.errors import CosmicError
from cosmic.frame.interruption import Interrupted, interruptible
from cosmic.frame.log import set_up_logging
from cosmic.frame.version import __version__

logger = logging.getLogger(__name__)

_WINDOWS: Final = (None, "mico", "daqco", "vico")
_LOG_THEMSELVES: Final = (*_WINDOWS, "serve")
"""Commands that run on, and log more than warnings."""
DEVICE_KINDS: Final = (
    "controller",
    "board",
    "camera",
    "lens",
    "light",
    "input",
    "positioner",
    "procedure",
    "analysis",
    "exporter",
    "application",
    "contact",
)
"""What `cosmic new-device` writes packages for."""
_MOST: Final = 1000
"""Of what is counted: a slip of the key does not measure for days."""
_CONFIG: Final = "a platform.toml or its folder"


def main(arguments: Sequence[str] | None = None) -> int:
    """Carry out one command and return the exit code: 0 success, 1 failure, 2 not understood.

    After a signal that ended it, it is 128 and the number of that: 130 for Ctrl+C.
    """
    parser = _parser()
    chosen, unknown = parser.parse_known_args(arguments)
    if unknown:
        parser.error(f"unrecognized arguments: {' '.join(unknown)}")
    opens_window = chosen.command in _WINDOWS
    if opens_window and chosen.screenshot is not None and chosen.offscreen is None:
        parser.error("--screenshot needs --offscreen SECONDS")
    with ExitStack() as at_end:
        if chosen.command not in _LOG_THEMSELVES:  # warnings alone: the rest is for their output
            at_end.callback(set_up_logging(console=True, console_level=logging.WARNING))
        try:
            # Loaded when called: most commands need no widgets, and none needs all the rest.
            file = "window" if opens_window else chosen.command.replace("-", "_")
            with interruptible():
                carried_out: int = import_module(f"cosmic.app.commands.{file}").run(chosen)
        except CosmicError as exc:
            for line in str(exc).splitlines():
                sys.stderr.write(f"cosmic: {line}\n")
            return 1
        except Interrupted as exc:
            sys.stderr.write(f"cosmic: {exc}\n")
            return exc.exit_code
        except BrokenPipeError:
            # Whoever read has gone, as `head` does: what is left would fail once more at the end.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return 1
        except OSError as exc:
            logger.debug("%s failed", chosen.command, exc_info=True)
            sys.stderr.write(f"cosmic: {_os_words(exc)}\n")
            return 1
        return carried_out


def _os_words(error: OSError) -> str:
    """Return what the system says, with the path that it is about."""
    where = "" if error.filename is None else f"{os.fsdecode(error.filename)}: "
    return f"{where}{error.strerror or error}"


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="cosmic",
        description="Control software for a microrobotic platform. Without a command: the "
        "operator's window with all applications of the platform file.",
        parents=[_window_options(_platform_options())],
    )
    parser.set_defaults(
        config=None,
        rate=None,
        cold=False,
        sample=None,
        truth=None,
        world=None,
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
    # Others than those above, whose defaults have just been set: a command would set them again.
    platform = _platform_options()
    window = _window_options(platform)
    commands = parser.add_subparsers(dest="command", metavar="COMMAND")
    commands.add_parser("mico", help="the window of MiCo alone", parents=[window])
    commands.add_parser("daqco", help="the window of DAQCo alone", parents=[window])
    commands.add_parser("vico", help="the window of ViCo alone", parents=[window])
    _add_file_commands(commands)
    _add_analysis_commands(commands)
    _add_simulate(commands)
    _add_station_commands(commands, platform)
    _add_procedure_commands(commands, platform)
    return parser


def _add_audit(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    audit = commands.add_parser("audit", help="list who commanded what, and with which verdict")
    audit.add_argument("file", type=Path, nargs="?", metavar="FILE", help="default: this computer")
    for name, what in (
        ("who", "client, or what commanded it here"),
        ("door", "local, gate, station, http or epics"),
        ("what", "the command"),
        ("verdict", "begun, done, refused or failed"),
        ("why", "the reason"),
    ):
        audit.add_argument(f"--{name}", metavar="TEXT", help=f"only where it is in: {what}")
    audit.add_argument("--since", type=_moment, metavar="TIME", help="such as 2026-11-23T08:00")
    audit.add_argument("--json", action="store_true", help="lines of JSON, for programs")


def _add_session(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    session = commands.add_parser("session", help="put together what a session made")
    tasks = session.add_subparsers(dest="task", metavar="TASK", required=True)
    pack = tasks.add_parser("pack", help="one zip file with a description, as RO-Crate")
    pack.add_argument("sources", type=Path, nargs="+", metavar="FILE_OR_FOLDER")
    pack.add_argument("--output", type=Path, required=True, metavar="FILE.zip")
    pack.add_argument("--title", default="", metavar="TEXT", help="title of the session")
    pack.add_argument(
        "--config", type=Path, default=argparse.SUPPRESS, metavar="PATH", help="platform file"
    )
    pack.add_argument("--audit", action="store_true", help="with this computer's audit trail")


def _add_file_commands(
    commands: "argparse._SubParsersAction[argparse.ArgumentParser]",
) -> None:
    """Add the commands that read or write files and move nothing."""
    check = commands.add_parser("check", help="check a platform file and the twin it names")
    check.add_argument("platform", type=Path, metavar="PLATFORM.toml")
    doctor = commands.add_parser(
        "doctor", help="what is on this computer, what is missing, and what to do about it"
    )
    doctor.add_argument(
        "--config", type=Path, default=argparse.SUPPRESS, metavar="PATH", help=_CONFIG
    )
    doctor.add_argument("--json", action="store_true", help="for programs")
    init = commands.add_parser("init", help="copy the shipped configuration out, to change it")
    init.add_argument("folder", type=Path, metavar="FOLDER")
    scene = commands.add_parser("scene", help="check or prepare the scene of a collision model")
    tasks = scene.add_subparsers(dest="task", metavar="TASK", required=True)
    look = tasks.add_parser("check", help="check a scene with its URDF, SRDF and meshes")
    look.add_argument("scene", type=Path, metavar="SCENE.toml")
    split = tasks.add_parser("decompose", help="split a concave mesh into convex pieces")
    split.add_argument("mesh", type=Path, metavar="MESH.stl")
    split.add_argument("folder", type=Path, metavar="FOLDER")
    export = commands.add_parser("export", help="write a recording as CSV, TDMS or another format")
    export.add_argument("recording", type=Path, metavar="RECORDING")
    export.add_argument(
        "--to", default="csv", metavar="FORMAT", help="csv, tdms, or what a package brings"
    )
    export.add_argument(
        "--output", type=Path, metavar="FILE", help="output file (default: beside the recording)"
    )
    export.add_argument("--overwrite", action="store_true", help="replace a file that exists")
    setup = commands.add_parser(
        "setup", help="turn axes that are found and not configured into entries of the files"
    )
    setup.add_argument(
        "--config", type=Path, default=argparse.SUPPRESS, metavar="PATH", help=_CONFIG
    )
    setup.add_argument("--move", action="store_true", help="offer to move each a little")
    setup.add_argument("--write", action="store_true", help="add the entries; comments are kept")
    _add_measure(commands)
    device = commands.add_parser(
        "new-device", help="write a package that brings a device or a method, to change it"
    )
    device.add_argument("kind", choices=DEVICE_KINDS, metavar="KIND", help=", ".join(DEVICE_KINDS))
    device.add_argument("name", metavar="NAME", help="what the platform file will say")
    device.add_argument("--out", type=Path, metavar="FOLDER", help="where (default: here)")
    _add_audit(commands)
    _add_session(commands)
    repair = commands.add_parser("repair", help="close recordings that a killed process left open")
    repair.add_argument("recordings", type=Path, nargs="+", metavar="FILE")
    repair.add_argument("--ended", action="store_true", help="no program writes them any more")


def _path(text: str) -> Path:
    """Return a path; an empty text, such as that of a variable not set, is none."""
    if not text:
        raise argparse.ArgumentTypeError("is empty; name a file or a folder")
    return Path(text)


def _add_measure(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    measure = commands.add_parser("measure", help="measure the fibres on images of any origin")
    measure.add_argument("images", type=_path, nargs="+", metavar="IMAGE", help="files or folders")
    measure.add_argument(
        "--pixel-size-um", type=float, metavar="UM", help="instead of what the files say"
    )
    measure.add_argument(
        "--output", type=_path, metavar="FOLDER", help="results (default: ./measured)"
    )
    measure.add_argument(
        "--every", type=int, default=1, metavar="N", help="of a video each N-th image only"
    )
    measure.add_argument("--overwrite", action="store_true", help="replace results that exist")
    measure.add_argument(
        "--focal-stack",
        action="store_true",
        help="each file shows one thing at several heights of the focus: fibres in space",
    )
    measure.add_argument(
        "--step-um", type=float, metavar="UM", help="between the heights of a focal stack"
    )
    measure.add_argument(
        "--lens-distance-um",
        type=float,
        default=float("inf"),
        metavar="UM",
        help="from the focus to the lens, which looks askew away from its axis",
    )
    correct = commands.add_parser("correct", help="correct the fibres found on an image")
    correct.add_argument("image", type=Path, metavar="IMAGE")
    correct.add_argument(
        "--export", type=Path, metavar="FOLDER", help="write training data and open no window"
    )
    correct.add_argument("--offscreen", type=float, metavar="SECONDS", help="close by itself")
    correct.add_argument("--screenshot", type=Path, metavar="FILE", help="of the last moment")


def _add_analysis_commands(
    commands: "argparse._SubParsersAction[argparse.ArgumentParser]",
) -> None:
    """Add the commands that compute values, and try whether they are true."""
    trial = commands.add_parser(
        "blind-trial", help="measure in a sealed world, freeze the analysis, then open the truth"
    )
    trial.add_argument(
        "--world", choices=("friendly", "realistic", "harsh"), default="realistic", help="of which"
    )
    trial.add_argument("--fibres", type=_count, help="fibres of a session (default: 16)")
    trial.add_argument("--sessions", type=_count, help="sessions, each drawn anew (default: 1)")
    trial.add_argument(
        "--sealed-by", type=Path, metavar="FILE.py", help="program of sealed sessions of your own"
    )
    trial.add_argument(
        "--whole", type=Path, metavar="RECIPE", help="a whole campaign on the twin, with images"
    )
    trial.add_argument("--out", type=Path, metavar="FOLDER", help="of a whole trial")
    recompute = commands.add_parser(
        "recompute", help="compute a campaign's values from its raw files, and say what changed"
    )
    recompute.add_argument("folder", type=Path, metavar="FOLDER")
    recompute.add_argument(
        "--recipe", type=Path, metavar="RECIPE", help="with the settings of another recipe"
    )
    recompute.add_argument(
        "--apply", action="store_true", help="put the new values into record, report and table"
    )
    size = commands.add_parser(
        "sample-size", help="how many good fibres make the mean as precise as wanted"
    )
    size.add_argument("folder", type=Path, nargs="?", metavar="FOLDER", help="spread of a campaign")
    size.add_argument(
        "--spread",
        type=_number("standard deviation of ln(EI) above 0 and below 10", above=0.0, below=10.0),
        metavar="SD",
        help="sd of ln(EI) between fibres",
    )
    size.add_argument(
        "--shared-percent",
        type=_number("half width from 0 to below 1000 %", least=0.0, below=1000.0),
        metavar="P",
        help="half of the 95 %% interval all share",
    )
    size.add_argument(
        "--precision",
        type=_number("half width above 0 and below 1000 %", above=0.0, below=1000.0),
        metavar="P",
        help="half of the wanted 95 %% interval, in per cent",
    )


def _add_simulate(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    simulate = commands.add_parser(
        "simulate", help="a simulated device that programs of other people can talk to"
    )
    kinds = simulate.add_subparsers(dest="device", metavar="DEVICE", required=True)
    scu = kinds.add_parser("scu-serial", help="SCUs with RS-232 firmware and their ASCII protocol")
    scu.add_argument(
        "--link",
        type=Path,
        action="append",
        default=[],
        metavar="PATH",
        help="make a pseudo terminal and link it here (Linux, macOS); once for each unit",
    )
    scu.add_argument(
        "--port",
        action="append",
        default=[],
        metavar="NAME",
        help="speak at a serial port, such as COM5, joined to another one; once for each unit",
    )
    scu.add_argument(
        "--layout",
        default="",
        metavar="LETTERS",
        help='three letters a unit, such as "LLL,RNN": L linear, R rotary, N no sensor',
    )
    scu.add_argument("--rate", type=float, default=1.0, help="simulated seconds a second")
    scu.add_argument("--seed", type=int, default=0, help="seed of the simulation")
    scu.add_argument("--baud", type=int, default=9600, help="speed of the line")
    scu.add_argument("--cold", action="store_true", help="just switched on: nothing is referenced")
    scu.add_argument(
        "--seconds",
        type=_number("number of seconds", least=0.0),
        default=None,
        help="end after so long",
    )
    library = kinds.add_parser(
        "library", help="a shared library in the place of a vendor's, for programs in any language"
    )
    library.add_argument("make", choices=("scu3d", "smaractctl"), help="whose place it takes")
    library.add_argument("--out", type=Path, required=True, metavar="FOLDER", help="where")
    library.add_argument("--layout", default="LLL,LLL,LLN,RNN", help="stages of each device")
    library.add_argument("--rate", type=float, default=1.0, help="simulated seconds a second")
    library.add_argument("--seed", type=int, default=0, help="seed of the simulation")


def _add_station_commands(
    commands: "argparse._SubParsersAction[argparse.ArgumentParser]",
    platform: argparse.ArgumentParser,
) -> None:
    serve = commands.add_parser(
        "serve", help="a station without a window", parents=[platform, _line_options()]
    )
    serve.add_argument(
        "--applications",
        type=_names,
        default=(),
        metavar="NAMES",
        help="such as mico,daqco (default: all)",
    )
    serve.add_argument("--seed", type=int, default=0, help="seed of the simulation")
    serve.add_argument("--http", metavar="ADDRESS", help="serve HTTP there, as 127.0.0.1:8470")
    serve.add_argument("--epics", metavar="PREFIX", help="serve EPICS records, names after PREFIX")
    commands.add_parser("stations", help="list the stations that were used before")
    made = commands.add_parser("certificates", help="make the certificates of stations and clients")
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


def _add_procedure_commands(
    commands: "argparse._SubParsersAction[argparse.ArgumentParser]",
    platform: argparse.ArgumentParser,
) -> None:
    campaign = commands.add_parser(
        "campaign",
        help="characterise fibres by a recipe, without a window",
        parents=[platform, _connect_options()],
    )
    campaign.add_argument("recipe", type=Path, metavar="RECIPE", help="a file, or a shipped name")
    campaign.add_argument("--out", type=_path, required=True, metavar="FOLDER")
    campaign.add_argument("--seed", type=int, help="seed of the simulation")
    plate = commands.add_parser("plate", help="confirm the plate that a running campaign asks for")
    plate.add_argument("folder", type=Path, metavar="FOLDER", help="of the campaign")
    _add_calibrate_force(commands, platform)
    calibrate = commands.add_parser(
        "calibrate",
        help="renew expired calibrations, without a window",
        parents=[platform, _connect_options()],
    )
    calibrate.add_argument(
        "--anew",
        action="append",
        default=[],
        metavar="NAME",
        help="measure this one even if it is fresh",
    )
    calibrate.add_argument(
        "--zooms", action="store_true", help="map every zoom step of the lens as well"
    )


def _add_calibrate_force(
    commands: "argparse._SubParsersAction[argparse.ArgumentParser]",
    platform: argparse.ArgumentParser,
) -> None:
    force = commands.add_parser(
        "calibrate-force",
        help="the scale of the force, against known weights or a reference beam on the plate",
        parents=[platform, _connect_options()],
    )
    against = force.add_mutually_exclusive_group(required=True)
    against.add_argument(
        "--weights", type=_masses, metavar="MG", help="masses in milligrams, such as 1,2,5"
    )
    against.add_argument(
        "--beam",
        type=_number("bending stiffness above 0 in N m2, such as 6e-11", above=0.0),
        metavar="EI",
        help="bending stiffness of a beam, N m2",
    )
    force.add_argument(
        "--expanded-percent",
        type=_number("uncertainty from 0 to below 50 %", least=0.0, below=50.0),
        default=2.0,
        metavar="P",
        help="expanded uncertainty of the masses or of the beam, k = 2",
    )
    force.add_argument("--rounds", type=_count, default=None, help="how often all is measured")
    force.add_argument("--channel", default="force", help="of the weights")
    force.add_argument("--out", type=Path, metavar="FILE", help="write all readings there, as JSON")


def _platform_options() -> argparse.ArgumentParser:
    # Suppressed defaults, so that an option before the command is not reset by the command.
    options = argparse.ArgumentParser(add_help=False, argument_default=argparse.SUPPRESS)
    add = options.add_argument
    add("--config", type=Path, metavar="PATH", help=_CONFIG)
    add("--rate", type=float, help="how many times faster than the wall the simulation runs")
    add("--cold", action="store_true", help="start the simulation at power-up, nothing referenced")
    add("--sample", metavar="NAME", help="sample on the simulated plate, such as forty-dry")
    add("--world", metavar="NAME", help="plain, friendly, realistic, harsh, or a file in worlds/")
    add("--truth", type=Path, metavar="FILE", help="write the ground truth of the simulation")
    return options


def _window_options(platform: argparse.ArgumentParser) -> argparse.ArgumentParser:
    options = argparse.ArgumentParser(
        add_help=False, argument_default=argparse.SUPPRESS, parents=[platform, _line_options()]
    )
    add = options.add_argument
    add("--serve", action="store_true", help="let other programs use what runs here")
    add(
        "--offscreen",
        type=_seconds,
        metavar="SECONDS",
        help="run without a display, close after SECONDS",
    )
    add("--screenshot", type=Path, metavar="FILE", help="with --offscreen: save an image")
    add("--size", type=_size, metavar="WxH", help="size of the window, such as 1600x1000")
    add("--theme", choices=("dark", "light"), help="colours of the window")
    add("--version", action="version", version=f"cosmic {__version__}")
    return options


def _connect_options() -> argparse.ArgumentParser:
    """Return the options of whoever uses other stations."""
    options = argparse.ArgumentParser(add_help=False, argument_default=argparse.SUPPRESS)
    add = options.add_argument
    add("--certificates", type=Path, metavar="FOLDER", help="certificates of this station")
    add(
        "--connect",
        action="append",
        metavar="NAME[=ENDPOINT]",
        help="use the applications of another station, such as "
        "fibervision=tcp/127.0.0.1:7448; the name alone if it was used before; may be given "
        "several times",
    )
    return options


def _line_options() -> argparse.ArgumentParser:
    """Return the options of whoever serves or connects."""
    # Suppressed defaults, so that an option before the command is not reset by the command.
    options = argparse.ArgumentParser(
        add_help=False, argument_default=argparse.SUPPRESS, parents=[_connect_options()]
    )
    add = options.add_argument
    add("--listen", metavar="ENDPOINT", help="endpoint to listen at, such as tcp/127.0.0.1:7447")
    add("--name", metavar="NAME", help="name of this station for others")
    return options


def _names(text: str) -> tuple[str, ...]:
    return tuple(each.strip() for each in text.split(",") if each.strip())


def _masses(text: str) -> tuple[float, ...]:
    try:
        masses = tuple(float(each) for each in text.split(","))
    except ValueError:
        masses = ()
    if not masses or not all(0.0 < each < math.inf for each in masses):
        raise argparse.ArgumentTypeError(f"{text!r} are not masses above 0 such as 1,2,5")
    return masses


def _count(text: str) -> int:
    try:
        value = int(text)
    except ValueError:
        value = 0
    if not 1 <= value <= _MOST:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from 1 to {_MOST}")
    return value


def _number(
    what: str, *, least: float = -math.inf, above: float = -math.inf, below: float = math.inf
) -> Callable[[str], float]:
    """Return what reads a finite number between bounds, and else says that it is no `what`."""

    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not (least <= value < below and above < value):
            raise argparse.ArgumentTypeError(f"{text!r} is no {what}")
        return value

    return read


def _moment(text: str) -> datetime:
    try:
        return datetime.fromisoformat(text)
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not a time such as 2026-11-23T08:00"
        ) from None


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
