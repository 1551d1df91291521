"""What a channel may be called."""

import re
from collections.abc import Sequence
from typing import Final

LONGEST: Final = 60
_NAME: Final = re.compile(r"[a-z][a-z0-9_]*(\.[a-z][a-z0-9_]*)?")


def channel_name_problem(name: str, others: Sequence[str]) -> str:
    """Return why a channel cannot be called that; empty when it can."""
    if not name:
        return "type a name, such as force"
    if not _NAME.fullmatch(name):
        return (
            "a name begins with a small letter and has small letters, digits and _ "
            "(and one dot at most), such as probe.force"
        )
    if len(name) > LONGEST:
        return f"the name is longer than {LONGEST} letters"
    return f"another channel is called {name!r}" if name in others else ""
