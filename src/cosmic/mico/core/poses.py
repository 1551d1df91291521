"""Named poses: where some axes stand, under a name, kept in a readable file."""

import logging
import math
import re
import reprlib
import tomllib
from collections.abc import Mapping, MutableMapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from threading import RLock
from typing import Final

import tomlkit
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import Table

from cosmic.frame.config import not_there, read_toml
from cosmic.frame.errors import ConfigError, NotAvailable
from cosmic.frame.kept_file import write_whole

logger = logging.getLogger(__name__)

NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_. -]{0,79}", re.ASCII)
HEAD: Final = "# Named poses: positions of axes, um (deg of a rotary axis), in gate coordinates.\n"


@dataclass(frozen=True, slots=True)
class Pose:
    """Where some axes stand, in gate coordinates and the unit of each."""

    name: str
    positions: Mapping[str, float]


def check_pose_name(name: str) -> str:
    """Return `name`; raises `NotAvailable` where it is none for a pose."""
    if not NAME.fullmatch(name) or name != name.strip():
        raise NotAvailable(
            f"{name[:80]!r} is not a name of a pose: up to 80 letters, digits, spaces and . - _"
        )
    return name


def pose_named(name: str, poses: Mapping[str, Pose]) -> Pose:
    """Return one of some poses; raises `NotAvailable` where it is not among them."""
    if name not in poses:
        known = ", ".join(poses) or "none"
        raise NotAvailable(f"there is no pose {name!r}; known poses: {known}")
    return poses[name]


class PoseBook:
    """The named poses of a platform; any thread.

    Parameters
    ----------
    path : Path or None
        The file; None keeps them in memory. It is made with the first pose.

    Raises
    ------
    ConfigError
        The file is there and wrong.
    """

    def __init__(self, path: Path | None = None) -> None:
        self._path = path
        self._guard = RLock()
        self._poses = read_poses(path) if path is not None and path.exists() else {}

    @property
    def path(self) -> Path | None:
        """The file they are kept in; None while they are kept in memory only."""
        return self._path

    @property
    def poses(self) -> dict[str, Pose]:
        """All poses by name, in the order of the file."""
        with self._guard:
            return {name: _copied(pose) for name, pose in self._poses.items()}

    def __getitem__(self, name: str) -> Pose:
        return pose_named(name, self.poses)

    def put(self, pose: Pose) -> None:
        """Keep a pose, in the place of one of the same name.

        Where the file cannot be written, or is no TOML any more, it stays as it is, all poses stay
        in memory, and `path` is None from then on.

        Raises
        ------
        NotAvailable
            The name is none, or there is no axis to go to.
        """
        check_pose_name(pose.name)
        if not pose.positions:
            raise NotAvailable(f"the pose {pose.name!r} has no axis to go to")
        with self._guard:
            self._poses[pose.name] = _copied(pose)
            self._write(pose.name)

    def remove(self, name: str) -> None:
        """Forget a pose; raises `NotAvailable` where there is none."""
        with self._guard:
            self[name]
            del self._poses[name]
            self._write(name)

    def _write(self, name: str) -> None:
        """Write what became of one pose; the rest of the file stays as the user left it."""
        path = self._path
        if path is None:
            return
        try:
            text = path.read_text(encoding="utf-8") if path.exists() else HEAD
            write_whole(path, _replaced(text, name, self._poses.get(name)))
        except (OSError, ValueError, RecursionError) as exc:
            self._path = None
            logger.warning("%s cannot be written (%s): poses are kept in memory only", path, exc)


def _copied(pose: Pose) -> Pose:
    """Return a pose that changes with no other."""
    return replace(pose, positions=dict(pose.positions))


def read_poses(path: Path) -> dict[str, Pose]:
    """Return the poses in a file; raises `ConfigError`."""
    poses: dict[str, Pose] = {}
    for name, table in read_toml(path).items():
        if not NAME.fullmatch(name) or not isinstance(table, dict) or not table:
            raise ConfigError(f"{path}: {name}: is not a pose: [name] and a position for each axis")
        for axis, value in table.items():
            if not _is_position(value):
                raise ConfigError(f"{path}: {name}.{axis}: {reprlib.repr(value)} is not a position")
        poses[name] = Pose(name, {axis: float(value) for axis, value in table.items()})
    return poses


def _is_position(value: object) -> bool:
    if not isinstance(value, int | float) or isinstance(value, bool):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # a whole number that no float can be
        return False


def pose_misfits(poses: Mapping[str, Pose], kinds: Mapping[str, str]) -> list[str]:
    """Return a line for each axis of `poses` that nothing brings there.

    Parameters
    ----------
    kinds : mapping of str
        "linear", "rotary" or "open-loop" of every positioner, by name.
    """
    return [
        f"{pose.name}.{axis}: {text}"
        for pose in poses.values()
        for axis in pose.positions
        if (text := _misfit(axis, kinds))
    ]


def _misfit(axis: str, kinds: Mapping[str, str]) -> str:
    if axis not in kinds:
        return not_there("positioner", axis, kinds)
    return f"{axis} has no sensor: no pose brings it back" if kinds[axis] == "open-loop" else ""


def _replaced(text: str, name: str, pose: Pose | None) -> str:
    """Return `text` with the section of one pose replaced, added, or taken out.

    Raises
    ------
    ValueError
        It is no TOML, or written in such a way that one pose cannot be changed alone.
    """
    wanted = {other: each for other, each in tomllib.loads(text).items() if other != name}
    if pose is not None:
        wanted[name] = {axis: round(value, 4) for axis, value in pose.positions.items()}
    for edit in (_edited, _written_anew):
        # tomlkit fails in ways of its own at keys with dots, or says something else than it was to.
        with suppress(TOMLKitError, LookupError, tomllib.TOMLDecodeError):
            changed = edit(text, name, pose)
            if tomllib.loads(changed) == wanted:
                return changed
    raise ValueError(f"the pose {name} is written in a way that cannot be changed alone")


def _written_anew(text: str, name: str, pose: Pose | None) -> str:
    """Return `text` with the pose taken out where it was, and written at the end."""
    document = tomlkit.parse(text)
    document.remove(name)
    return _edited(tomlkit.dumps(document), name, pose)


def _edited(text: str, name: str, pose: Pose | None) -> str:
    """Return `text` with the section of one pose changed where it is."""
    document = tomlkit.parse(text)
    section = document.get(name)
    rest = _cut_tail(section) if isinstance(section, Table) else ""
    if section is not None and (pose is None or not isinstance(section, MutableMapping)):
        rest = _hand_on(document, name, rest)
        document.remove(name)
        section = None
    if pose is None:
        return tomlkit.dumps(document) + rest
    if section is None:
        section = tomlkit.table()
        document.append(name, section)
    for axis in [axis for axis in section if axis not in pose.positions]:
        del section[axis]
    for axis, value in pose.positions.items():
        section[axis] = round(value, 4)
    rest = _hand_on(document, name, rest)
    return tomlkit.dumps(document) + rest


def _cut_tail(section: Table) -> str:
    """Take off what stands below the last position: it is said of what follows."""
    body, tail = section.value.body, ""
    while body and body[-1][0] is None:
        tail = body.pop()[1].as_string() + tail
    return tail


def _hand_on(document: tomlkit.TOMLDocument, name: str, text: str) -> str:
    """Put `text` before the section that follows, and return it where none does."""
    names = list(document)
    after = names[names.index(name) + 1 :]
    if not after or not isinstance(following := document[after[0]], Table):
        return text
    following.trivia.indent = text + following.trivia.indent
    return ""
