"""``cosmic calibrate``: calibrates the platform without a window, and says what is in force."""

import argparse
import sys
from typing import Final

from cosmic.app.commands.chosen_rig import carry_out, chosen_rig
from cosmic.autonomy.calibrating.registry import (
    CalibrationEntry,
    CalibrationRegistry,
    CalibrationStanding,
)
from cosmic.autonomy.procedures.tree import OPERATION, NodeEvent, NodeState
from cosmic.frame.errors import CosmicError

_ENDS: Final = {NodeState.DONE, NodeState.FAILED}


def run(chosen: argparse.Namespace) -> int:
    """Calibrate, and return the exit code.

    Raises
    ------
    CosmicError
        The configuration is wrong, or there is no such calibration; nothing has moved.
    """
    with chosen_rig(chosen) as rig:
        run = rig.calibrate(anew=chosen.anew, zooms=chosen.zooms)
        run.subscribe(_print_event)
        try:
            carry_out(run)
        except CosmicError as exc:
            sys.stderr.write(f"{exc}\n")
        for each in rig.calibrations.entries:
            sys.stdout.write(f"{line_of(rig.calibrations, each)}\n")
        registry = rig.calibrations
        poor = any(registry.standing(each) is CalibrationStanding.POOR for each in registry.entries)
        return 1 if poor or run.failure is not None else 0


def line_of(registry: CalibrationRegistry, entry: CalibrationEntry) -> str:
    """Return a calibration in one line."""
    quality = entry.problem or f"{entry.residual:.2g} {entry.unit}, at most {entry.largest:g}"
    return f"{entry.name} ({entry.tool}): {registry.standing(entry)}, {quality}"


def _print_event(event: NodeEvent) -> None:
    if event.kind == OPERATION and event.state in _ENDS:
        sys.stderr.write(f"{event.name}: {event.state}\n")
