"""`Owner`: what a process that was forked must not use, for it belongs to another. Free of Qt.

A fork copies the memory, and shares every pipe, line and device, but takes no thread along: what
such a process sent would go nowhere, or into the middle of what the other one says.
"""

import os
from typing import Final

FORKED: Final = (
    "this process was forked from the one that drives the platform, and cannot command it: do that "
    "there, or start a process with multiprocessing's 'spawn' and reach the platform as a station"
)


class Owner:
    """The process that made something."""

    __slots__ = ("_pid",)

    def __init__(self) -> None:
        self._pid = os.getpid()

    @property
    def here(self) -> bool:
        """False in a process that was forked from it."""
        return os.getpid() == self._pid
