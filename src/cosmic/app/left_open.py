"""Recordings that a killed process left open are closed at the next start."""

import logging
from pathlib import Path
from typing import Final

from PySide6.QtCore import QStandardPaths

from cosmic.daqco.core.left_behind import Closing, OpenRecordings, Outcome

logger = logging.getLogger(__name__)

_LEVELS: Final = {
    Outcome.CLOSED: logging.WARNING,
    Outcome.UNSURE: logging.WARNING,
    Outcome.IN_USE: logging.DEBUG,
    Outcome.WHOLE: logging.DEBUG,
}


def open_recordings() -> OpenRecordings:
    """Return the notes of this user's open recordings."""
    place = QStandardPaths.StandardLocation.GenericStateLocation
    return OpenRecordings(
        Path(QStandardPaths.writableLocation(place)) / "CoSMic" / "open-recordings"
    )


def close_left_open(notes: OpenRecordings, folders: tuple[Path, ...]) -> list[Closing]:
    """Close what processes that are gone left open, and say so in the log."""
    found = notes.close_left_open(folders)
    for each in found:
        logger.log(_LEVELS[each.outcome], "%s", each.text)
    return found
