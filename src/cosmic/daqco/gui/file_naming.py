"""The name of a recording before it is stamped or numbered."""

from typing import Final

from cosmic.daqco.core.recording_format import SUFFIX
from cosmic.frame.file_names import NameOption

_TAILS: Final = {
    NameOption.TIME: "_yyyy-mm-dd_hh-mm-ss",
    NameOption.NUMBER: "_nnn",
    NameOption.NONE: "",
}


def name_pattern(base: str, option: NameOption) -> str:
    """Return the whole name with the format of what is appended."""
    return f"{base.strip().removesuffix(SUFFIX)}{_TAILS[option]}{SUFFIX}"
