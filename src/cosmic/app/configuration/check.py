"""What `cosmic check` finds wrong in a platform file and in the twin it names."""

from collections.abc import Iterator
from pathlib import Path

from cosmic.app.configuration.backends import named_backends
from cosmic.app.configuration.network import serving
from cosmic.app.configuration.platform_file import (
    KNOWN_APPLICATIONS,
    PlatformFile,
    load_platform,
    platform_path,
)
from cosmic.app.configuration.references import kept_mistakes, misnamed, recipe_mistakes
from cosmic.app.configuration.scene_fit import misfits
from cosmic.daqco.core.settings import DaqcoSettings
from cosmic.daqco.hw.factory import make_library
from cosmic.daqco.hw.interface import BoardInfo
from cosmic.frame.config import load_model, not_there, read_toml
from cosmic.frame.errors import ConfigError, CosmicError, NotAvailable
from cosmic.frame.plugins import Kind, has_twin, is_simulated, missing_packages, read_options
from cosmic.frame.units import format_quantity
from cosmic.mico.core.motion.settings import PositionerSettings
from cosmic.mico.core.settings import MicoSettings
from cosmic.twin.settings import StageKind, TwinSettings


def find_mistakes(config: str | Path) -> list[str]:
    """Return a line for every mistake, each with file, key and reason; empty when all is well."""
    path = platform_path(config)
    lines: list[str] = []
    file: PlatformFile | None = None
    try:
        file, path = load_platform(config)
    except ConfigError as exc:
        lines += str(exc).splitlines()
    twin_path = path.parent / (file.platform.twin if file else _named_twin(path))
    twin: TwinSettings | None = None
    if file is None or "simulated" in file.mico.backends:
        try:
            twin = load_model(twin_path, TwinSettings)
        except ConfigError as exc:
            lines += str(exc).splitlines()
    if file is not None:
        lines += key_mistakes(file, path)
        lines += misnamed(file, path, KNOWN_APPLICATIONS)
        lines += kept_mistakes(file, path)
        lines += recipe_mistakes(file, path)
        lines += _network_mistakes(file, path)
        lines += _backend_mistakes(file, path) or [
            f"{path}: {each}" for each in (*_mover_mistakes(file), *_board_mistakes(file))
        ]
    if file is not None and twin is not None:
        lines += _twin_mistakes(file, path, twin, twin_path)
    if file is not None and file.platform.scene:
        lines += _scene_mistakes(file, path)
    elif file is not None and file.mico.contact:
        lines.append(f"{path}: mico.contact: needs a scene; name one in platform.scene")
    return lines


def _scene_mistakes(file: PlatformFile, path: Path) -> list[str]:
    # Imported here: what reads meshes takes its time to load.
    from cosmic.mico.core.collision.scene_loader import load_scene

    try:
        return misfits(file, path, load_scene(path.parent / file.platform.scene))
    except ConfigError as exc:
        return str(exc).splitlines()


def _network_mistakes(file: PlatformFile, path: Path) -> list[str]:
    try:
        serving(file.network, file.platform.name, path.parent)
    except ConfigError as exc:
        return [f"{path}: network: {line}" for line in str(exc).splitlines()]
    except NotAvailable as exc:
        return [f"{path}: network.serve: {exc}"] if file.network.serve else []
    return []


def _backend_mistakes(file: PlatformFile, path: Path) -> list[str]:
    lines = [
        f"{path}: platform.requires: {each} is not installed: pip install '{each}'"
        for each in missing_packages(file.platform.requires)
    ]
    for each in named_backends(file):
        try:
            read_options(each.kind, each.name, each.options)
        except ConfigError as exc:
            lines += [f"{path}: {each.section}: {line}" for line in str(exc).splitlines()]
    return lines


def _mover_mistakes(file: PlatformFile) -> Iterator[str]:
    """Yield a line where more than one controller would move the twin."""
    movers = [each for each in file.mico.backends if has_twin(Kind.CONTROLLER, each)]
    if len(movers) > 1:
        yield f"mico: {' and '.join(map(repr, movers))} would both move the twin: leave one"


def _board_mistakes(file: PlatformFile) -> list[str]:
    """Return a line for each board that is there twice, and for each name of one that is not.

    Only simulated backends are asked, for making them opens nothing; which boards a real driver
    lists is known on the computer that they are in, when they are opened.
    """
    settings = file.daqco
    if settings is None:
        return []
    boards: dict[str, BoardInfo] = {}
    lines: list[str] = []
    for each in settings.drivers:
        if not is_simulated(Kind.BOARD, each.backend):
            continue
        try:
            listed = make_library(each.backend, options=each.options).list_boards()
        except CosmicError as exc:
            return [f"daqco: {exc}"]
        lines += [
            f"daqco: two boards are named {info.name!r}, and one of them is of driver "
            f"{each.backend!r}: give the boards of one driver another name"
            for info in listed
            if info.name in boards
        ]
        boards |= {info.name: info for info in listed}
    if all(is_simulated(Kind.BOARD, each.backend) for each in settings.drivers):
        lines += _absent_boards(settings, boards)
    return lines


def _absent_boards(settings: DaqcoSettings, boards: dict[str, BoardInfo]) -> Iterator[str]:
    """Yield a line for each board and input that is named and not there."""
    named = [(f"channel {each.name!r}", each.board) for each in settings.channel]
    named += [(f"output {each.name!r}", each.board) for each in settings.output]
    if settings.camera_trigger is not None:
        named.append(("camera_trigger", settings.camera_trigger.board))
    for what, board in named:
        if board not in boards:
            yield f"daqco: {what}: {not_there('board', board, boards)}"
    for each in settings.channel:
        if each.board in boards and each.input not in boards[each.board].inputs:
            inputs = boards[each.board].inputs
            yield (
                f"daqco: channel {each.name!r}: {each.board} has no input {each.input!r}; it has "
                f"{inputs[0]} to {inputs[-1]}"
            )


def _named_twin(path: Path) -> str:
    """Return the twin that a file with mistakes names, so that those of both are told at once."""
    try:
        section = read_toml(path).get("platform")
    except ConfigError:
        return "twin.toml"
    name = section.get("twin") if isinstance(section, dict) else None
    return name if isinstance(name, str) else "twin.toml"


def key_mistakes(file: PlatformFile, path: Path) -> list[str]:
    """Return what is wrong with the keys: no such key, or one used twice."""
    # Imported here: only windows and `check` need to know Qt's names of keys.
    from cosmic.mico.gui.key_names import key_text

    used: dict[str, str] = {"Esc": "Escape, which stops"}
    lines: list[str] = []
    wanted = [("platform.stop_key", file.platform.stop_key)]
    for index, each in enumerate(file.mico.positioner):
        wanted.append((f"mico.positioner[{index}].forward_key", each.forward_key))
        wanted.append((f"mico.positioner[{index}].backward_key", each.backward_key))
    for where, name in wanted:
        try:
            key = key_text(name)
        except ValueError as exc:
            lines.append(f"{path}: {where}: {exc}")
            continue
        if key and key in used:
            lines.append(f"{path}: {where}: the key {key!r} is taken by {used[key]}")
        used.setdefault(key, where)
    if not file.platform.stop_key:
        lines.append(f"{path}: platform.stop_key: is empty; a platform needs a stop key")
    return lines


def _twin_mistakes(
    file: PlatformFile, path: Path, twin: TwinSettings, twin_path: Path
) -> list[str]:
    lines: list[str] = []
    simulated = _simulated_devices(file.mico, len(twin.devices))
    for index, each in enumerate(file.mico.positioner):
        if file.mico.controller and each.device not in simulated:
            continue
        stage = _stage_at(each.device - simulated.start, each.channel, twin)
        where = f"{path}: mico.positioner[{index}]"
        if not stage:
            lines.append(
                f"{where}.device: {each.name} is on device {each.device} channel {each.channel}, "
                f"where {twin_path.name} has no stage"
            )
            continue
        lines += _kind_mistakes(each, twin.kinds[twin.stages[stage].kind], stage, where)
    return lines


def _simulated_devices(settings: MicoSettings, there: int) -> range:
    """Return the numbers of the devices that the twin moves, of which `there` are."""
    first = 0
    for each in settings.controllers:
        if each.backend == "simulated":
            return range(first, first + (len(each.serials) or there))
        first += len(each.serials)
    return range(0)


def _stage_at(device: int, channel: int, twin: TwinSettings) -> str:
    if device >= len(twin.devices) or channel >= len(twin.devices[device].channels):
        return ""
    return twin.devices[device].channels[channel]


def _kind_mistakes(
    positioner: PositionerSettings, kind: StageKind, stage: str, where: str
) -> list[str]:
    is_kind = ("rotary" if kind.unit == "deg" else "linear") if kind.sensor else "open-loop"
    if positioner.kind != is_kind:
        return [f"{where}.kind: {positioner.kind}, but the twin's stage {stage} is {is_kind}"]
    if positioner.limits is None:
        return []
    low, high = positioner.limits
    if kind.low <= low and high <= kind.high:
        return []
    unit = positioner.unit
    hard = f"{format_quantity(kind.low, unit)} to {format_quantity(kind.high, unit)}"
    return [
        f"{where}.limits_{unit}: {low:g} to {high:g} reaches beyond the hard stops of the "
        f"twin's stage {stage}, {hard}"
    ]
