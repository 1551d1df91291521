"""What the file widget says about names and directories; the rules are the core's."""

from pathlib import Path
from typing import Final

from cosmic.daqco.core.recording_format import SUFFIX
from cosmic.frame.errors import CosmicError
from cosmic.frame.file_names import NameOption, check_base_name, check_directory

_TAILS: Final = {
    NameOption.TIME: "_yyyy-mm-dd_hh-mm-ss",
    NameOption.NUMBER: "_nnn",
    NameOption.NONE: "",
}


def name_problem(base: str) -> str:
    """Return why `base` cannot be the name of a file; empty when it can."""
    try:
        check_base_name(check_base_name(base).removesuffix(SUFFIX))
    except CosmicError as exc:
        return str(exc)
    return ""


def directory_problem(text: str) -> str:
    """Return why recordings cannot go into the directory typed; empty when they can."""
    if not text.strip():
        return "type a directory"
    try:
        check_directory(Path(text))
    except CosmicError as exc:
        return str(exc)
    except (OSError, ValueError, RuntimeError) as exc:  # such as a home that nobody has
        return f"{text}: {exc}"
    return ""


def name_pattern(base: str, option: NameOption) -> str:
    """Return the whole name with the format of what is appended."""
    return f"{base.strip().removesuffix(SUFFIX)}{_TAILS[option]}{SUFFIX}"
