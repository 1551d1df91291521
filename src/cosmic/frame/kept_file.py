"""Files that the program keeps for itself, and that a person can read; whole files in general."""

import math
import os
from collections.abc import Mapping
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

PART: Final = ".part"
"""What follows the name of a file while it is written."""


def write_whole(path: Path, content: str | bytes) -> None:
    """Write a file; the old one stays whole until the new one is on the disk.

    Parameters
    ----------
    content : str or bytes
        A text is written in UTF-8 with the line ends of the system.

    Raises
    ------
    OSError
        It cannot be written there, or its folder is missing; nothing of it is left.
    """
    part = path.with_name(path.name + PART)
    text = isinstance(content, str)
    try:
        with part.open("w" if text else "wb", encoding="utf-8" if text else None) as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    except OSError:
        with suppress(OSError):
            part.unlink(missing_ok=True)
        raise


def toml_lines(values: Mapping[str, object]) -> str:
    """Return `key = value` lines; what is None is left out.

    Raises
    ------
    ValueError
        A number is not finite.
    """
    return "".join(f"{key} = {toml(each)}\n" for key, each in values.items() if each is not None)


def toml(value: object) -> str:
    """Return a value as TOML: a text, number, truth value or date, or a tuple, list or mapping.

    Raises
    ------
    ValueError
        A number is not finite.
    """
    if isinstance(value, Mapping):
        # Quoted, for a name may hold a point.
        pairs = (f"{toml(str(key))} = {toml(each)}" for key, each in value.items())
        return "{ " + ", ".join(pairs) + " }"
    if isinstance(value, tuple | list):
        return f"[{', '.join(toml(each) for each in value)}]"
    if isinstance(value, str):
        return '"' + "".join(_character(each) for each in value) + '"'
    if isinstance(value, datetime):
        return value.astimezone(UTC).isoformat(timespec="seconds").replace("+00:00", "Z")
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(int(value))
    if not isinstance(value, float):
        raise TypeError(f"{type(value).__name__} has no form in TOML: {value!r}")
    if not math.isfinite(value):
        raise ValueError(f"{value} is not a number to be kept")
    # repr keeps every digit, so that what is read is what was measured; numpy's own says its type.
    return repr(float(value))


def _character(one: str) -> str:
    if one in '"\\':
        return "\\" + one
    return one if one.isprintable() else f"\\U{ord(one):08X}"
