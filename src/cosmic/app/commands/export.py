"""``cosmic export``: a recording as CSV or TDMS."""

import argparse
import sys

from cosmic.daqco.api.export import export_file


def run(chosen: argparse.Namespace) -> int:
    """Write a recording in another format; raises `CosmicError` where that is not possible."""
    terminal = sys.stderr if sys.stderr.isatty() else None

    def report(fraction: float) -> bool:
        if terminal is not None:
            terminal.write(f"\r{chosen.recording.name}: {fraction:4.0%}")
        return True

    written = export_file(
        chosen.recording, chosen.to, chosen.output, report, overwrite=chosen.overwrite
    )
    if terminal is not None:
        terminal.write("\n")
    sys.stdout.write(f"{written}\n")
    return 0
