"""``cosmic session pack``: one file of all that a session made."""

import argparse
import sys
from pathlib import Path

from cosmic.app.session_pack import pack_session


def run(chosen: argparse.Namespace) -> int:
    """Pack by the options of the command line."""
    sources: list[Path] = list(chosen.sources)
    if chosen.audit:
        from cosmic.app.audit import audit_file

        sources.append(audit_file())
    if chosen.config is not None:
        sources.append(chosen.config)
    packed = pack_session(sources, chosen.output, name=chosen.title)
    for path in packed.unclosed:
        sys.stderr.write(
            f"cosmic: {path}: is cut off, or was not closed by its writer; it is packed as it is. "
            f"Run cosmic repair {path} and pack again\n"
        )
    for path in packed.left_out:
        sys.stderr.write(f"cosmic: {path}: has a private key, and is left out\n")
    size_mb = packed.size_bytes / 1e6
    sys.stdout.write(f"{packed.path}: {packed.files} files, {size_mb:.1f} MB\n")
    return 0
