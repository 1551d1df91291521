"""``cosmic audit``: what was commanded, by whom, with which verdict."""

import argparse
import json
import sys
from datetime import datetime
from pathlib import Path
from typing import Any

from cosmic.frame.audit import read_entries
from cosmic.frame.errors import ConfigError


def run(chosen: argparse.Namespace) -> int:
    """List entries by the options of the command line."""
    from cosmic.app.audit import audit_file

    path: Path = chosen.file or audit_file()
    if not path.is_file():
        raise ConfigError(f"{path}: there is no audit trail; a window or a station writes one")
    for entry in read_entries(path):
        if _meant(entry, chosen):
            line = json.dumps(entry, ensure_ascii=False) if chosen.json else _shown(entry)
            sys.stdout.write(f"{line}\n")
    return 0


def _meant(entry: dict[str, Any], chosen: argparse.Namespace) -> bool:
    for name in ("who", "door", "what", "verdict", "why"):
        wanted = getattr(chosen, name)
        if wanted and wanted.lower() not in str(entry.get(name, "")).lower():
            return False
    since: datetime | None = chosen.since
    return since is None or _time(entry) >= since.astimezone()


def _time(entry: dict[str, Any]) -> datetime:
    try:
        return datetime.fromisoformat(str(entry.get("when"))).astimezone()
    except ValueError:
        return datetime.fromtimestamp(0).astimezone()


def _shown(entry: dict[str, Any]) -> str:
    details = ", ".join(f"{name}={value}" for name, value in entry.get("details", {}).items())
    parts = [entry.get("when"), entry.get("who"), f"({entry.get('door')})", entry.get("what")]
    parts += [details, entry.get("verdict"), entry.get("why")]
    return "  ".join(str(each) for each in parts if each)
