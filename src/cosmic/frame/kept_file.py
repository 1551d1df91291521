"""Files that the program keeps for itself, and that a person can read; whole files in general."""

import errno
import math
import os
import re
import stat
from collections.abc import Generator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from datetime import UTC, datetime
from itertools import count
from pathlib import Path
from typing import BinaryIO, Final

import tomlkit
from tomlkit.items import Item

from cosmic.frame.clock import WALL
from cosmic.frame.platform_services import lock_file, process_exists

PART: Final = ".part"
"""How the name of a file ends while it is written."""
LOCK: Final = ".lock"
"""How the name of the file ends by which programs take turns in changing one."""
WAIT_S: Final = 2.0
"""How long another program is waited for that changes the same file."""
LEFT_S: Final = 60.0
"""A half written file that is older was left by a process that is gone: writing takes far less."""
_LEFT: Final = re.compile(rf".+\.(\d+)-\d+{re.escape(PART)}")
_numbers: Final = count(1)
_cleared: Final[set[Path]] = set()


def open_file(path: Path) -> BinaryIO:
    """Open a file to be read.

    Raises
    ------
    OSError
        It cannot be opened, or is a pipe or a device: reading one may wait, or go on, for ever.
    """
    mode = path.stat().st_mode
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise OSError(errno.EINVAL, "it is a pipe or a device, no file", str(path))
    return path.open("rb")


def write_whole(path: Path, content: str | bytes) -> None:
    """Write a file; the old one stays whole until the new one is on the disk.

    A link stays, and what it leads to is written. Who may read the file stays as it was. Of several
    that write it at once, in this program or others, the last is kept as a whole. At the first
    file in a folder, what processes that were killed have left half written there is removed.

    Parameters
    ----------
    content : str or bytes
        A text is written in UTF-8 with the line ends of the system.

    Raises
    ------
    OSError
        It cannot be written there, it is read-only, its folder is missing, or UTF-8 has no such
        characters; nothing of it is left.
    """
    path = Path(os.path.realpath(path))
    part = path.with_name(f"{path.name}.{os.getpid()}-{next(_numbers)}{PART}")
    mode = _mode_of(path)
    if path.parent not in _cleared:
        _cleared.add(path.parent)
        _remove_left(path.parent)
    text = isinstance(content, str)
    if isinstance(content, str):
        _check_encodable(content, path)
    try:
        with part.open("w" if text else "wb", encoding="utf-8" if text else None) as file:
            if mode is not None:
                part.chmod(mode)  # before there is anything to be read
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    except OSError:
        with suppress(OSError):
            part.unlink(missing_ok=True)
        raise


def _remove_left(folder: Path) -> None:
    """Remove half written files of processes that are gone; never fails."""
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            name = _LEFT.fullmatch(entry.name)
            if name is None or process_exists(int(name[1])):
                continue
            # One on another computer, whose numbers are not known here, is done in that time.
            with suppress(OSError):
                if datetime.now(UTC).timestamp() - entry.stat().st_mtime > LEFT_S:
                    Path(entry).unlink()


@contextmanager
def changing(path: Path) -> Generator[None]:
    """Be the only one who reads, changes and writes a file; other programs and threads wait.

    One that takes too long, and a disk without locks, is not waited for: then the last one wins.
    """
    with ExitStack() as stack:
        with suppress(OSError):  # where none can be made the file cannot be written either
            lock = stack.enter_context(path.with_name(path.name + LOCK).open("ab"))
            late_s = WALL.now_s() + WAIT_S
            while not lock_file(lock.fileno(), alone=True) and WALL.now_s() < late_s:
                WALL.sleep(0.01)
        yield


def _mode_of(path: Path) -> int | None:
    """Return who may do what with a file that is there, None without one; raises `OSError`."""
    try:
        mode = stat.S_IMODE(path.stat().st_mode)
    except FileNotFoundError:
        return None
    if not os.access(path, os.W_OK):  # its folder would let it be replaced all the same
        raise PermissionError(errno.EACCES, "it is read-only", str(path))
    return mode


def _check_encodable(text: str, path: Path) -> None:
    try:
        text.encode("utf-8")
    except UnicodeEncodeError as exc:
        why = f"it would have {text[exc.start]!r}, which UTF-8 cannot say"
        raise OSError(errno.EILSEQ, why, str(path)) from exc


def toml_lines(values: Mapping[str, object]) -> str:
    """Return `key = value` lines; what is None is left out.

    Values are texts, numbers, truth values or dates, or tuples, lists or mappings of them.

    Raises
    ------
    ValueError
        A number is not finite.
    """
    document = tomlkit.document()
    for key, each in values.items():
        if each is not None:
            document.add(key, _item(each))
    return tomlkit.dumps(document)


def _item(value: object) -> Item:
    """Return a value as tomlkit writes it."""
    if isinstance(value, Mapping):
        table = tomlkit.inline_table()
        for key, each in value.items():
            table.append(str(key), _item(each))
        return table
    if isinstance(value, tuple | list):
        array = tomlkit.array()
        array.extend(_item(each) for each in value)
        return array
    if isinstance(value, datetime):
        return tomlkit.item(value.astimezone(UTC).replace(microsecond=0))
    if isinstance(value, float):
        if not math.isfinite(value):
            raise ValueError(f"{value} is not a number to be kept")
        return tomlkit.item(float(value))  # numpy's own says its type
    if isinstance(value, str | bool | int):
        return tomlkit.item(value if isinstance(value, str | bool) else int(value))
    raise TypeError(f"{type(value).__name__} has no form in TOML: {value!r}")
