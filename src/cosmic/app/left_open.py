"""Recordings that a killed process left open: closed at the next start, or by ``cosmic repair``."""

import argparse
import logging
import sys
from pathlib import Path
from typing import Final

from PySide6.QtCore import QStandardPaths

from cosmic.daqco.core.left_behind import Closing, OpenRecordings, Outcome
from cosmic.daqco.core.left_behind import close_left_open as close_one
from cosmic.frame.errors import RecordingError

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


def repair(chosen: argparse.Namespace) -> int:
    """Carry out ``cosmic repair``: 0 when every file can be opened now, else 1."""
    well = True
    for path in chosen.recordings:
        try:
            done = close_one(path, trusted=chosen.ended)
        except RecordingError as exc:
            sys.stderr.write(f"cosmic: {exc}\n")
            well = False
            continue
        fine = done.outcome in (Outcome.CLOSED, Outcome.WHOLE)
        (sys.stdout if fine else sys.stderr).write(f"{'' if fine else 'cosmic: '}{done.text}\n")
        well = well and fine
    return 0 if well else 1
