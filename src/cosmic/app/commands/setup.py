"""``cosmic setup``: turns axes that are found and not configured into entries of the files."""

import argparse
import re
import shutil
import sys
import tempfile
from collections.abc import Container, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import tomlkit
from tomlkit.items import AoT, InlineTable, Table

from cosmic.app.configuration.platform_file import load_platform
from cosmic.app.connect import connect
from cosmic.app.rig import Rig
from cosmic.frame.config import shipped_config_dir
from cosmic.frame.errors import ConfigError, CosmicError, NotAvailable
from cosmic.frame.kept_file import write_whole
from cosmic.frame.units import AxisUnit
from cosmic.mico.api.application import MicoApplication
from cosmic.mico.api.mico import Mico
from cosmic.mico.hw.interface import Serial

NUDGE: Final[dict[AxisUnit, float]] = {"um": 10.0, "deg": 0.1}
"""How far an axis is moved to see which it is."""
ROOM: Final[dict[AxisUnit, float]] = {"um": 100.0, "deg": 1.0}
"""How far the limits of a new entry lie from where the axis stands."""
_FAR: Final = 1e6
_MADE_UP: Final = re.compile(r"device(\d+)\.channel(\d+)")
"""Name of an axis that was found and is not configured."""
_GUESS: Final = "[G] around where it stood; widen them when its body is in the scene"
_NOT_READ: Final = "[G] around 0: where it stands was not read; cosmic setup reads it"


@dataclass(frozen=True, slots=True)
class FoundAxis:
    """An axis with a sensor that the controller has and the platform file lacks.

    Attributes
    ----------
    name : str
        What its entry calls it, until somebody knows better.
    position : float or None
        Where it stands, in `unit`; None: not read yet.
    """

    name: str
    device: int
    channel: int
    kind: str
    unit: AxisUnit
    position: float | None = None


def run(chosen: argparse.Namespace) -> int:
    """Show what is found and not configured, move it where asked, and write the entries.

    Raises
    ------
    ConfigError
        The platform file is wrong, or may not be changed.
    NotConnectedError
        No device answers.
    """
    _, path = load_platform(chosen.config)
    if chosen.write and path.parent.resolve() == shipped_config_dir():
        raise ConfigError(f"{path}: ships with CoSMic; copy it with cosmic init FOLDER first")
    found, serials, silent = found_axes(path)
    sys.stdout.write(_without_sensor(silent))
    if not found:
        sys.stdout.write("Every axis that was found is configured.\n")
        return 0
    found = list(_looked_at(path, found, move=chosen.move))
    platform, scene, urdf = new_texts(path, found, serials)
    if not chosen.write:
        sys.stdout.write(f"\n{path}, to be added (--write adds it):\n\n{entries(found)}\n")
        return 0
    for file, text in ((path, platform), scene, urdf):
        if text:
            write_whole(file, text)
            sys.stdout.write(f"{file}: written\n")
    return 0


def _without_sensor(silent: Sequence[tuple[int, int]]) -> str:
    """Say at which channels an axis without sensor may be, and how it is written down."""
    if not silent:
        return ""
    listed = ", ".join(f"device {device} channel {channel}" for device, channel in silent)
    device, channel = silent[0]
    return (
        f"No sensor answers at {listed}. Whether anything is connected there, such as a gripper "
        "without sensor, nobody can ask: write it into the platform file by hand, as\n\n"
        f'[[mico.positioner]]\nname = "gripper"\ndevice = {device}\nchannel = {channel}\n'
        'kind = "open-loop"\n\n'
    )


def found_axes(
    path: Path,
) -> tuple[list[FoundAxis], tuple[Serial, ...], list[tuple[int, int]]]:
    """Open the controllers and look what no entry names.

    Returns
    -------
    tuple
        The axes with a sensor, the serial numbers of all devices, and device and channel where
        no sensor answers.
    """
    file, _ = load_platform(path)
    with connect(path, applications=("mico",)) as rig:
        found = unnamed_axes(rig.mico, file.mico.kinds)
        application = rig.mico.application
        if not isinstance(application, MicoApplication):
            raise NotAvailable("axes are set up at the station that has them")
        controller, devices = application.manager.controller, application.manager.devices
        serials = controller.find_devices()
    taken = {(each.device, each.channel) for each in found}
    taken |= {(each.device, each.channel) for each in file.mico.positioner}
    places = [(d, c) for d in sorted(devices) for c in range(controller.capabilities.channels)]
    return found, serials, [place for place in places if place not in taken]


def unnamed_axes(mico: Mico, configured: Container[str]) -> list[FoundAxis]:
    """Return the axes that were found and that nobody has named; no position is read of them."""
    found: list[FoundAxis] = []
    for name in mico.names:
        place = _MADE_UP.fullmatch(name)
        if place is None or name in configured:
            continue
        axis = mico[name]
        device, channel = int(place[1]), int(place[2])
        found.append(FoundAxis(name, device, channel, axis.kind.value, axis.unit))
    return found


def _looked_at(path: Path, found: Sequence[FoundAxis], *, move: bool) -> Iterator[FoundAxis]:
    """Read where the axes stand, and move those that the operator agrees to; yield each."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "platform"
        # An editor's lock file is a link to nothing.
        shutil.copytree(path.parent, copy, ignore_dangling_symlinks=True)
        file = copy / path.name
        document = _parsed(file)
        document["platform"]["scene"] = ""
        _append(document, [replace(each, position=0.0) for each in found], room=_FAR)
        file.write_text(tomlkit.dumps(document), encoding="utf-8")
        with connect(file, applications=("mico",)) as rig:
            for each in found:
                axis = rig.mico[each.name]
                position = axis.position_um if each.unit == "um" else axis.angle_deg
                here = replace(each, position=position or 0.0)
                sys.stdout.write(
                    f"device {here.device} channel {here.channel}: {here.kind}, position "
                    f"{position or 0.0:.1f} {here.unit}\n"
                )
                if move:
                    _nudge(rig, here)
                yield here


def _nudge(rig: Rig, axis: FoundAxis) -> None:
    """Move an axis there and back, where the operator agrees."""
    shift = NUDGE[axis.unit]
    sys.stdout.write(
        f"  Move it by {shift:g} {axis.unit} there and back? "
        "Nothing checks what it may touch. [y/N] "
    )
    sys.stdout.flush()
    if sys.stdin.readline().strip().lower() not in ("y", "yes"):
        return
    try:
        rig.mico[axis.name].move_by(shift, consent=True)
        rig.mico[axis.name].move_by(-shift, consent=True)
    except CosmicError as exc:
        sys.stdout.write(f"  {exc}\n")
    else:
        sys.stdout.write("  moved\n")


def entries(found: Sequence[FoundAxis]) -> str:
    """Return the entries of a platform file for axes that were found."""
    document = tomlkit.document()
    document["mico"] = tomlkit.table(is_super_table=True)
    _append(document, found)
    return tomlkit.dumps(document)


def new_texts(
    path: Path, found: Sequence[FoundAxis], serials: Sequence[Serial]
) -> tuple[str, tuple[Path, str], tuple[Path, str]]:
    """Return the platform file, the scene and its URDF with entries for all; comments are kept.

    A body that nobody has measured stands half a metre away, where it touches nothing: put it where
    it is before the limits are widened.
    """
    document = _parsed(path)
    _append(document, found)
    mico = document["mico"]
    if not mico.get("serials") and not mico.get("controller"):
        mico["serials"] = list(serials)
    scene = str(document["platform"].get("scene", ""))
    if not scene:
        return tomlkit.dumps(document), (path, ""), (path, "")
    scene_path = path.parent / scene
    drives = _parsed(scene_path)
    listed = _tables(drives, "drive")
    for each in found:
        drive = tomlkit.table()
        drive["axis"] = each.name
        drive["joint"] = _joint(each)
        listed.append(drive)
    urdf = scene_path.parent / str(drives["urdf"])
    model = urdf.read_text(encoding="utf-8")
    root = _root_link(model)
    bodies = "".join(_body(each, root, number) for number, each in enumerate(found))
    return (
        tomlkit.dumps(document),
        (scene_path, tomlkit.dumps(drives)),
        (urdf, model.replace("</robot>", f"{bodies}</robot>")),
    )


def _append(
    document: tomlkit.TOMLDocument, found: Sequence[FoundAxis], room: float | None = None
) -> None:
    if isinstance(document["mico"], InlineTable):
        there = document.pop("mico")
        document["mico"] = tomlkit.table()
        document["mico"].update(there)
    listed = _tables(document["mico"], "positioner")
    for each in found:
        entry = tomlkit.table()
        entry["name"] = each.name
        entry["device"] = each.device
        entry["channel"] = each.channel
        entry["kind"] = each.kind
        reach = ROOM[each.unit] if room is None else room
        here = each.position or 0.0
        limits = tomlkit.item([round(here - reach, 1), round(here + reach, 1)])
        limits.comment(_GUESS if each.position is not None else _NOT_READ)
        entry[f"limits_{each.unit}"] = limits
        listed.append(entry)


def _parsed(path: Path) -> tomlkit.TOMLDocument:
    text = path.read_text(encoding="utf-8")
    # What is added to a last line without an end would stand in it.
    return tomlkit.parse(text if text.endswith("\n") else f"{text}\n")


def _tables(holder: tomlkit.TOMLDocument | Table, key: str) -> AoT:
    """Return a list of sections to which one can be added; one in a line is rewritten."""
    listed = holder.get(key)
    if isinstance(listed, AoT):
        return listed
    holder.pop(key, None)
    made = tomlkit.aot()
    for each in listed or ():
        section = tomlkit.table()
        section.update(each)
        made.append(section)
    holder[key] = made
    return made


def _joint(axis: FoundAxis) -> str:
    return axis.name.replace(".", "_")


def _root_link(model: str) -> str:
    """Return the link of a URDF that is no joint's child."""
    from lxml import etree

    robot = etree.fromstring(model.encode("utf-8"))
    children = {each.get("link") for each in robot.iter("child")}
    names = [str(each.get("name")) for each in robot.iter("link")]
    return next(each for each in names if each not in children)


def _body(axis: FoundAxis, root: str, number: int) -> str:
    name = _joint(axis)
    turns = axis.unit == "deg"
    kind, reach = ("revolute", 3.1416) if turns else ("prismatic", 0.05)
    return f"""  <!-- [G] {axis.name}: put body and joint where they are, on what carries them. -->
  <link name="{name}_body">
    <collision><origin xyz="0 0 0"/><geometry><box size="0.002 0.002 0.002"/></geometry></collision>
  </link>
  <joint name="{name}" type="{kind}">
    <parent link="{root}"/><child link="{name}_body"/>
    <origin xyz="0.5 {0.2 * number:g} 0"/><axis xyz="{"0 0 1" if turns else "1 0 0"}"/>
    <limit lower="-{reach:g}" upper="{reach:g}" effort="1" velocity="1"/>
  </joint>
"""
