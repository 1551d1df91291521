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
    file = record_file(folder, run)
    write_whole(file, json.dumps(page, indent=1, default=str, ensure_ascii=False).encode())
    write_through(record)
    return file


def record_file(folder: Path, run: int) -> Path:
    """Return where it is kept what a run was made with."""
    return folder / RECORD / f"run-{run:04d}.json"


def sha256_of(file: Path) -> str:
    """Return the SHA-256 of a file.

    Raises
    ------
    CampaignError
        It cannot be read.
    """
    try:
        return hashlib.sha256(file.read_bytes()).hexdigest()
    except OSError as exc:
        raise CampaignError(f"{file} cannot be read: {exc.strerror or exc}") from exc


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
    for file in _record_files(folder):
        try:
            found.append(dict(json.loads(file.read_text(encoding="utf-8"))))
        except (OSError, TypeError, ValueError) as exc:
            raise CampaignError(f"{file} cannot be read: {exc}") from exc
    return tuple(found)


def changed_files(folder: Path) -> tuple[str, ...]:
    """Return the copies in a record that are missing, or not what was copied.

    What is wrong with the files that list them, `changed_records` says.
    """
    wrong = []
    for file in _record_files(folder):
        page = _page(file)
        for name, kept in _listed(page).items():
            if "copy" not in kept:
                continue
            try:
                now = sha256_of(folder / kept["copy"])
            except CampaignError:
                now = ""
            if now != kept.get("sha256"):
                wrong.append(f"{name} of run {page.get('run', file.stem)}")
    return tuple(wrong)


def changed_records(folder: Path, kept: Mapping[int, str]) -> tuple[str, ...]:
    """Return which files that say what a run was made with are not as they were written, and how.

    Parameters
    ----------
    kept : mapping of int to str
        SHA-256 by the number of the run; empty where it is not known.
    """
    wanted = {record_file(folder, run): sha256 for run, sha256 in kept.items()}
    others = dict.fromkeys(_record_files(folder), "")
    return tuple(
        f"{file.relative_to(folder).as_posix()}: {wrong}"
        for file, sha256 in sorted((others | wanted).items())
        if (wrong := _wrong_with(file, sha256))
    )


def _wrong_with(file: Path, sha256: str) -> str:
    if not file.exists():
        return "is missing"
    if not _listed(_page(file)):
        return "does not list what the run was made with"
    return "its SHA-256 differs" if sha256 and sha256_of(file) != sha256 else ""


def _record_files(folder: Path) -> list[Path]:
    return sorted((folder / RECORD).glob("run-*.json"))


def _page(file: Path) -> dict[str, Any]:
    """Return what is in such a file; empty where it cannot be read."""
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def _listed(page: Mapping[str, Any]) -> Mapping[str, Mapping[str, str]]:
    files = page.get("files")
    if not isinstance(files, dict) or not all(isinstance(each, dict) for each in files.values()):
        return {}
    return files
