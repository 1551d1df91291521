"""What a campaign was made with, beside its values: files, settings, software, circumstances."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from cosmic.autonomy.campaign.records import CampaignError
from cosmic.autonomy.campaign.store import write_through, write_whole
from cosmic.frame.config import without_tokens

RECORD: Final = "record"
"""Folder with a file for each run, and copies of the files it was made with."""

FILES: Final = "files"
LARGEST_COPY: Final = 2_000_000
"""Bytes; of a larger file, such as a mesh, only the hash is kept."""

NAMED: Final = 12
"""Digits of its hash by which a copy is called."""


@dataclass(frozen=True, slots=True)
class Provenance:
    """What a run is made with.

    Attributes
    ----------
    files : mapping of str to Path
        Configuration files by what they are, such as "platform/platform.toml".
    settings : mapping
        Those in effect, defaults included, by part.
    facts : mapping
        Seed, sample, world, operator, software and the like.
    """

    files: Mapping[str, Path] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    facts: Mapping[str, Any] = field(default_factory=dict)


def write_provenance(folder: Path, run: int, provenance: Provenance, recipe_text: str) -> Path:
    """Write what a run is made with into the folder of its campaign, and return the file.

    Parameters
    ----------
    run : int
        Number of the run.

    Raises
    ------
    CampaignError
        A file cannot be read, or the record not be written.
    """
    record = folder / RECORD
    try:
        (record / FILES).mkdir(parents=True, exist_ok=True)
        contents = {name: _content(path) for name, path in provenance.files.items()}
    except OSError as exc:
        raise CampaignError(f"{record}: what the run is made with is not kept: {exc}") from exc
    contents["recipe.toml"] = recipe_text.encode()
    listed = {name: _kept(record, name, content) for name, content in sorted(contents.items())}
    page = {
        "run": run,
        **provenance.facts,
        "files": listed,
        "settings": dict(provenance.settings),
    }
    file = record / f"run-{run:04d}.json"
    write_whole(file, json.dumps(page, indent=1, default=str, ensure_ascii=False).encode())
    write_through(record)
    return file


def _content(path: Path) -> bytes:
    """Return what is kept of a file: all but the tokens of clients."""
    content = path.read_bytes()
    if path.suffix != ".toml":
        return content
    return without_tokens(content.decode("utf-8", "surrogateescape")).encode(
        "utf-8", "surrogateescape"
    )


def _kept(record: Path, name: str, content: bytes) -> dict[str, str]:
    digest = hashlib.sha256(content).hexdigest()
    if len(content) > LARGEST_COPY:
        return {"sha256": digest}
    plain = Path(name)
    copy = record / FILES / f"{plain.stem}-{digest[:NAMED]}{plain.suffix}"
    if not copy.exists():
        write_whole(copy, content)
    return {"sha256": digest, "copy": f"{RECORD}/{FILES}/{copy.name}"}


def read_provenance(folder: Path) -> tuple[dict[str, Any], ...]:
    """Return what each run of a campaign was made with; empty for one of an earlier program.

    Raises
    ------
    CampaignError
        A file of the record cannot be read.
    """
    found = []
    for file in sorted((folder / RECORD).glob("run-*.json")):
        try:
            found.append(dict(json.loads(file.read_text(encoding="utf-8"))))
        except (OSError, ValueError) as exc:
            raise CampaignError(f"{file} cannot be read: {exc}") from exc
    return tuple(found)


def changed_files(folder: Path) -> tuple[str, ...]:
    """Return the copies in a record that are missing, or not what was copied."""
    wrong = []
    for page in read_provenance(folder):
        for name, kept in page.get("files", {}).items():
            if "copy" not in kept:
                continue
            try:
                now = hashlib.sha256((folder / kept["copy"]).read_bytes()).hexdigest()
            except OSError:
                now = ""
            if now != kept["sha256"]:
                wrong.append(f"{name} of run {page['run']}")
    return tuple(wrong)
