"""How a recording is called: base name, and a time stamp or a number behind it."""

import os
import re
from datetime import datetime
from enum import StrEnum
from pathlib import Path
from typing import Final

SUFFIX: Final = ".h5"
LONGEST: Final = 120
TIME_FORMAT: Final = "yyyy-mm-dd_hhmmss"
NUMBER_FORMAT: Final = "nnn"

_FORBIDDEN: Final = re.compile(r'[/\\:*?"<>|\x00-\x1f]')
_RESERVED: Final = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?", re.IGNORECASE)


class Append(StrEnum):
    """What is appended to the base name."""

    TIME = "time"
    NUMBER = "number"
    NOTHING = "nothing"


def name_problem(base: str) -> str:
    """Return why `base` cannot be the name of a file; empty when it can."""
    found = _FORBIDDEN.search(base)
    if not base.strip():
        return "type a name for the file"
    if found:
        return f"a file name cannot have {found.group()!r}; the directory has a field of its own"
    if base != base.strip() or base.startswith(".") or base.endswith("."):
        return "a file name cannot begin or end with a dot or a blank"
    if _RESERVED.fullmatch(base):
        return f"{base!r} is reserved on Windows"
    if len(base.encode("utf-8")) > LONGEST:
        return f"the name is longer than {LONGEST} bytes"
    return ""


def directory_problem(text: str) -> str:
    """Return why recordings cannot go into the directory typed; empty when they can."""
    if not text.strip():
        return "type a directory"
    folder = Path(text).expanduser()
    try:
        if not folder.is_dir():
            return f"{folder}: there is no such directory"
    except (OSError, ValueError) as exc:
        return f"{folder}: {exc}"
    return "" if os.access(folder, os.W_OK) else f"{folder} cannot be written to"


def name_pattern(base: str, append: Append) -> str:
    """Return the whole name with the format of what is appended."""
    tail = {Append.TIME: f"_{TIME_FORMAT}", Append.NUMBER: f"_{NUMBER_FORMAT}", Append.NOTHING: ""}
    return f"{_stem(base)}{tail[append]}{SUFFIX}"


def file_name(base: str, append: Append, when: datetime, directory: Path) -> str:
    """Return the whole name of a recording that begins now.

    Raises
    ------
    OSError
        The directory cannot be read for the next number.
    """
    if append is Append.TIME:
        return f"{_stem(base)}_{when:%Y-%m-%d_%H%M%S}{SUFFIX}"
    if append is Append.NUMBER:
        return f"{_stem(base)}_{_next_number(_stem(base), directory):03d}{SUFFIX}"
    return f"{_stem(base)}{SUFFIX}"


def _stem(base: str) -> str:
    return base.removesuffix(SUFFIX)


def _next_number(stem: str, directory: Path) -> int:
    pattern = re.compile(rf"{re.escape(stem)}_(\d+){re.escape(SUFFIX)}")
    found = (pattern.fullmatch(each.name) for each in directory.iterdir())
    return max((int(match[1]) for match in found if match), default=0) + 1
