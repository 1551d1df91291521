"""``cosmic init``: the shipped configuration, copied out to be changed."""

import argparse
import shutil
import sys
from pathlib import Path

from cosmic.frame.config import shipped_config_dir
from cosmic.frame.errors import ConfigError


def run(chosen: argparse.Namespace) -> int:
    """Copy the shipped configuration into a folder.

    Raises
    ------
    ConfigError
        A file exists already, and nothing was copied; or the folder cannot be written to.
    """
    folder: Path = chosen.folder
    source = shipped_config_dir()
    files = sorted(path for path in source.rglob("*") if path.is_file())
    targets = [folder / path.relative_to(source) for path in files]
    existing = [path for path in targets if path.exists()]
    if existing:
        raise ConfigError(
            "\n".join(f"{path}: exists already; nothing was copied" for path in existing)
        )
    try:
        for path, target in zip(files, targets, strict=True):
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, target)
    except OSError as exc:
        raise ConfigError(f"{exc.filename or folder}: {exc.strerror or exc}") from exc
    sys.stdout.write(f"{folder}: {len(files)} files; start with: cosmic --config {folder}\n")
    return 0
