"""What the camera found of axes, noted in the platform file; comments and all else stay there."""

from pathlib import Path

import tomlkit
from tomlkit.container import Container
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import InlineTable, Item, Table

from cosmic.autonomy.stage_check import AxisCheck, StageReport
from cosmic.frame.config import shipped_config_dir
from cosmic.frame.errors import ConfigError
from cosmic.frame.kept_file import write_whole


def note_axes(path: Path, report: StageReport, when: str) -> None:
    """Write how well axes repeat into their entries of a platform file.

    Parameters
    ----------
    when : str
        Stands in the comment beside the numbers.

    Raises
    ------
    ConfigError
        It ships with CoSMic and stays as it is, or it is no platform file any more.
    OSError
        It cannot be read or written.
    """
    if path.parent.resolve() == shipped_config_dir():
        raise ConfigError(f"{path} ships with CoSMic and stays as it is; cosmic init copies it")
    found = {each.axis: each for each in report.axes}
    try:
        document = tomlkit.parse(path.read_text(encoding="utf-8"))
        entries = [each for each in document["mico"]["positioner"] if each["name"] in found]
        for entry in entries:
            _note(entry, found[entry["name"]], when)
        text = tomlkit.dumps(document)
    except (TOMLKitError, KeyError, TypeError, UnicodeDecodeError) as exc:
        raise ConfigError(f"{path}: {exc}") from exc
    missing = sorted(set(found) - {str(each["name"]) for each in entries})
    if missing:
        raise ConfigError(f"{path} has no entry for {', '.join(missing)}")
    write_whole(path, text)


def _note(entry: Table | InlineTable, found: AxisCheck, when: str) -> None:
    numbers = {"repeatability_um": found.repeatability_um, "backlash_um": found.backlash_um}
    if isinstance(entry, InlineTable):  # a comment would end its line
        entry.update({key: round(value, 3) for key, value in numbers.items()})
        return
    below = _taken_off(entry.value)
    for key, value in numbers.items():
        item = tomlkit.item(round(value, 3))
        item.comment(f"seen by the camera, {when}")
        entry[key] = item
    entry.value.body.extend(below)


def _taken_off(table: Container) -> list[tuple[None, Item]]:
    """Take off what stands below the last key, such as a comment on the entry that follows."""
    below: list[tuple[None, Item]] = []
    while table.body and table.body[-1][0] is None:
        below.insert(0, (None, table.body.pop()[1]))
    return below
