"""Names of recordings, and whether there is room for one (thesis, DAQFile.1 to 6)."""

import os
import re
import shutil
import unicodedata
from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum
from pathlib import Path
from typing import Final

from cosmic.frame.errors import RecordingError

RESERVE_BYTES: Final = 32 * 1024 * 1024
LONGEST_BASE_BYTES: Final = 200
_SHOWN: Final = 16
FORBIDDEN: Final = '/\\<>:"|?*'
# Windows keeps these for devices, whatever the ending.
DEVICE_NAME: Final = re.compile(r"(?i)^(con|prn|aux|nul|com\d|lpt\d)(\..*)?$")


class NameOption(StrEnum):
    """What is appended to the base name."""

    NONE = "none"
    TIME = "time"
    NUMBER = "number"


@dataclass(frozen=True, slots=True)
class Space:
    """Room for a recording.

    Attributes
    ----------
    free_bytes : int
        On the disk, without the reserve that stays free.
    left_s : float
        How long a recording fits; infinite at no bytes a second.
    """

    free_bytes: int
    left_s: float


def check_base_name(base: str) -> str:
    """Return `base` without spaces around it.

    Raises
    ------
    RecordingError
        It is no name of a file on every system; the text says why.
    """
    name = base.strip()
    if not name:
        raise RecordingError("the recording has no name; give it one")
    if len(name.encode("utf-8", "replace")) > LONGEST_BASE_BYTES:
        raise RecordingError(f"the name is longer than {LONGEST_BASE_BYTES} bytes; shorten it")
    shown = name if len(name) <= _SHOWN else f"{name[:_SHOWN]}…"  # the reason comes after it
    wrong = sorted({each for each in name if each in FORBIDDEN})
    if wrong:
        raise RecordingError(
            f"name {shown!r}: {' '.join(wrong)} cannot be part of a file's name; "
            "a directory belongs into its own field"
        )
    if any(unicodedata.category(each) in {"Cc", "Cs"} for each in name):
        raise RecordingError(f"name {shown!r}: it has characters that cannot be printed")
    if name.startswith(".") or name.endswith("."):
        raise RecordingError(f"name {shown!r}: a full stop cannot be its first or last character")
    if DEVICE_NAME.match(name):
        raise RecordingError(f"name {shown!r}: Windows keeps this name for a device")
    return name


def file_name(
    base: str,
    option: NameOption = NameOption.NONE,
    *,
    suffix: str,
    when: datetime | None = None,
    directory: Path | None = None,
) -> str:
    """Return the whole name of a recording.

    Parameters
    ----------
    suffix : str
        What all recordings of this kind end in, such as ".h5".
    when : datetime, optional
        Local time of the stamp; needed with `NameOption.TIME`.
    directory : Path, optional
        Where numbers in use are looked up; needed with `NameOption.NUMBER`.

    Raises
    ------
    RecordingError
        `base` is no name of a file.
    """
    stem = check_base_name(base).removesuffix(suffix)
    check_base_name(stem)
    if option is NameOption.TIME:
        if when is None:
            raise ValueError("a time stamp needs a time")
        stem = f"{stem}_{when:%Y-%m-%d_%H-%M-%S}"
    elif option is NameOption.NUMBER:
        if directory is None:
            raise ValueError("a number needs a directory to look into")
        stem = f"{stem}_{next_number(stem, directory, suffix):03d}"
    return stem + suffix


def next_number(stem: str, directory: Path, suffix: str) -> int:
    """Return the number after the highest in use for `stem` in `directory`; 1 without any."""
    pattern = re.compile(rf"{re.escape(stem)}_(\d+){re.escape(suffix)}", re.IGNORECASE)
    try:
        names = [each.name for each in directory.iterdir()]
    except OSError:  # `check_directory` says what is wrong with it
        return 1
    found = [int(match[1]) for name in names if (match := pattern.fullmatch(name))]
    return max(found, default=0) + 1


def check_directory(directory: Path) -> Path:
    """Return `directory` as an absolute path.

    Raises
    ------
    RecordingError
        It does not exist, is none, or cannot be written to.
    """
    try:
        whole = directory.expanduser().absolute()
        there = whole.exists()
    except (OSError, RuntimeError) as exc:  # too long a name, a home that nobody has
        raise RecordingError(f"{directory}: can be no directory ({exc}); choose another") from exc
    if not there:
        raise RecordingError(f"directory {whole} does not exist; create it or choose another")
    if not whole.is_dir():
        raise RecordingError(f"{whole} is a file; choose a directory")
    if not os.access(whole, os.W_OK | os.X_OK):
        raise RecordingError(f"directory {whole} cannot be written to; choose another")
    return whole


def name_problem(base: str, suffix: str = "") -> str:
    """Return why `base`, without `suffix`, cannot be the name of a file; empty when it can."""
    try:
        check_base_name(check_base_name(base).removesuffix(suffix))
    except RecordingError as exc:
        return str(exc)
    return ""


def directory_problem(text: str) -> str:
    """Return why nothing can be stored in the directory typed; empty when it can."""
    if not text.strip():
        return "type a directory"
    try:
        check_directory(Path(text))
    except RecordingError as exc:
        return str(exc)
    except (OSError, ValueError, RuntimeError) as exc:  # such as a home that nobody has
        return f"{text}: {exc}"
    return ""


def check_space(directory: Path, bytes_per_s: float) -> Space:
    """Return how much room there is.

    Raises
    ------
    RecordingError
        The disk is full, or cannot be asked.
    """
    space = space_left(directory, bytes_per_s)
    if space.free_bytes <= bytes_per_s:
        raise RecordingError(
            f"{directory}: the disk is full ({space.free_bytes / 1e6:.0f} MB left beside a reserve "
            f"of {RESERVE_BYTES / 1e6:.0f} MB); make room or choose another directory"
        )
    return space


def space_left(directory: Path, bytes_per_s: float) -> Space:
    """Return how much room there is, even if it is none.

    Raises
    ------
    RecordingError
        The disk cannot be asked.
    """
    try:
        free = shutil.disk_usage(directory).free - RESERVE_BYTES
    except (OSError, ValueError) as exc:
        raise RecordingError(
            f"{directory}: cannot be reached ({exc}); is the disk still there?"
        ) from exc
    left_s = max(0.0, free / bytes_per_s) if bytes_per_s > 0.0 else float("inf")
    return Space(max(0, free), left_s)
