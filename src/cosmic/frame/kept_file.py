"""Files that the program keeps for itself, and that a person can read; whole files in general."""

import errno
import math
import os
import stat
from collections.abc import Mapping
from contextlib import suppress
from datetime import UTC, datetime
from itertools import count
from pathlib import Path
from typing import BinaryIO, Final

import tomlkit
from tomlkit.items import Item

PART: Final = ".part"
"""How the name of a file ends while it is written."""
_numbers: Final = count(1)


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
    that write it at once, in this program or others, the last is kept as a whole.

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
