"""``cosmic repair``: recordings that a killed process left open."""

import argparse
import sys

from cosmic.daqco.core.left_behind import Outcome, close_left_open
from cosmic.frame.errors import RecordingError


def run(chosen: argparse.Namespace) -> int:
    """Close recordings: 0 when every file can be opened now, else 1."""
    well = True
    for path in chosen.recordings:
        try:
            done = close_left_open(path, trusted=chosen.ended)
        except RecordingError as exc:
            sys.stderr.write(f"cosmic: {exc}\n")
            well = False
            continue
        fine = done.outcome in (Outcome.CLOSED, Outcome.WHOLE)
        (sys.stdout if fine else sys.stderr).write(f"{'' if fine else 'cosmic: '}{done.text}\n")
        well = well and fine
    return 0 if well else 1
