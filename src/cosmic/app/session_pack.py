"""One record of a session: what was made on a platform, in one file, described as RO-Crate 1.1."""

import hashlib
import json
import mimetypes
import zipfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, Final
from urllib.parse import quote

from cosmic.daqco.core.unclosed_file import is_unclosed
from cosmic.frame.config import without_tokens
from cosmic.frame.errors import RecordingError, RecordingExistsError
from cosmic.frame.version import __version__

METADATA: Final = "ro-crate-metadata.json"
_PIECE_BYTES: Final = 1024 * 1024
_LARGEST_KEY: Final = 100_000
"""Bytes; no file with a private key is larger."""
_KINDS: Final = {
    ".h5": ("application/x-hdf5", "recording: samples, physical values and positions"),
    ".mkv": ("video/x-matroska", "images"),
    ".nut": ("video/x-nut", "images"),
    ".tif": ("image/tiff", "image, or images"),
    ".png": ("image/png", "image"),
    ".csv": ("text/csv", "table"),
    ".toml": ("application/toml", "configuration, recipe or trajectory"),
    ".jsonl": ("application/jsonl", "audit trail"),
    ".log": ("text/plain", "log"),
    ".sqlite": ("application/vnd.sqlite3", "campaign"),
    ".html": ("text/html", "report"),
    ".pdf": ("application/pdf", "report"),
}


@dataclass(frozen=True, slots=True)
class Packed:
    """What was packed.

    Attributes
    ----------
    size_bytes : int
        Of all files together, before they were packed.
    unclosed : tuple of Path
        Recordings that are cut off or were not closed by their writer, packed as they are.
    left_out : tuple of Path
        Files with private keys: who has them could command the platform.
    """

    path: Path
    files: int
    size_bytes: int
    unclosed: tuple[Path, ...] = ()
    left_out: tuple[Path, ...] = ()


def pack_session(sources: Iterable[Path], target: Path, *, name: str = "") -> Packed:
    """Write files, and all that is in folders, into one zip file with its description.

    A session is made to be given away: private keys stay, and tokens in configuration files are
    left empty.

    Parameters
    ----------
    target : Path
        Of the zip file, which must not exist.
    name : str
        Title of the session; the name of the file without it.

    Raises
    ------
    RecordingExistsError
        There is such a file.
    RecordingError
        A source is not there, two have the same name, or the file cannot be written.
    """
    named = dict(_named(sources))
    keys = [inside for inside, path in named.items() if _is_key(path)]
    left_out = tuple(named.pop(inside) for inside in keys)
    found = named
    if not found:
        raise RecordingError("there is nothing to pack")
    if not target.parent.is_dir():
        raise RecordingError(f"{target}: {target.parent} is not a folder; name one that there is")
    if target.exists():
        raise RecordingExistsError(f"{target}: there is such a file; choose another name")
    part = target.with_name(target.name + ".part")
    size_bytes, entities, unclosed = 0, [], []
    try:
        with zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED, allowZip64=True) as file:
            for inside, path in found.items():
                entity = _packed(file, inside, path)
                if path.suffix == ".h5" and is_unclosed(path):
                    unclosed.append(path)
                    entity["description"] += "; not closed by its writer, or cut off"
                size_bytes += int(entity["contentSize"])
                entities.append(entity)
            file.writestr(METADATA, json.dumps(_crate(entities, name or target.stem), indent=2))
        part.replace(target)
    except OSError as exc:
        part.unlink(missing_ok=True)
        raise RecordingError(f"{target}: cannot be written ({exc.strerror or exc})") from exc
    return Packed(target, len(found), size_bytes, tuple(unclosed), left_out)


def _named(sources: Iterable[Path]) -> Iterator[tuple[str, Path]]:
    """Yield each file with its name in the crate."""
    seen: set[str] = set()
    for source in sources:
        if source.is_dir():
            inner = sorted(each for each in source.rglob("*") if each.is_file())
            pairs = [(each.relative_to(source.parent).as_posix(), each) for each in inner]
        elif source.is_file():
            pairs = [(source.name, source)]
        else:
            raise RecordingError(f"{source}: there is no such file or folder")
        for inside, path in pairs:
            if inside in seen or inside == METADATA:
                raise RecordingError(f"{path}: another source is called {inside!r} as well")
            seen.add(inside)
            yield inside, path


def _is_key(path: Path) -> bool:
    small = path.stat().st_size <= _LARGEST_KEY
    return small and b"PRIVATE KEY-----" in path.read_bytes()


def _opened(path: Path) -> BinaryIO:
    """Return what is packed of a file: all but tokens."""
    if path.suffix.lower() != ".toml":
        return path.open("rb")
    text = path.read_bytes().decode("utf-8", "surrogateescape")
    return BytesIO(without_tokens(text).encode("utf-8", "surrogateescape"))


def _packed(file: zipfile.ZipFile, inside: str, path: Path) -> dict[str, Any]:
    """Write one file and return how it is described: what was written, though it may still grow."""
    digest, size_bytes = hashlib.sha256(), 0
    changed = datetime.fromtimestamp(path.stat().st_mtime, UTC)
    with _opened(path) as source, file.open(inside, "w", force_zip64=True) as sink:
        while piece := source.read(_PIECE_BYTES):
            digest.update(piece)
            size_bytes += len(piece)
            sink.write(piece)
    guessed = mimetypes.guess_type(path.name)[0] or "application/octet-stream"
    form, what = _KINDS.get(path.suffix.lower(), (guessed, ""))
    entity: dict[str, Any] = {
        "@id": quote(inside),  # an address, so that spaces and # are coded
        "@type": "File",
        "name": path.name,
        "contentSize": str(size_bytes),
        "encodingFormat": form,
        "dateModified": changed.isoformat(timespec="seconds"),
        "sha256": digest.hexdigest(),
    }
    return entity | ({"description": what} if what else {})


def _crate(entities: list[dict[str, Any]], name: str) -> dict[str, Any]:
    now = datetime.now(UTC).isoformat(timespec="seconds")
    software = {"@id": "#cosmic", "@type": "SoftwareApplication", "name": "CoSMic"}
    return {
        "@context": "https://w3id.org/ro/crate/1.1/context",
        "@graph": [
            {
                "@id": METADATA,
                "@type": "CreativeWork",
                "conformsTo": {"@id": "https://w3id.org/ro/crate/1.1"},
                "about": {"@id": "./"},
            },
            {
                "@id": "./",
                "@type": "Dataset",
                "name": name,
                "description": "A session on a microrobotic platform: recordings, images, "
                "configuration, log and audit trail.",
                "datePublished": now,
                "license": "not stated",
                "hasPart": [{"@id": each["@id"]} for each in entities],
                "mentions": {"@id": "#packed"},
            },
            software | {"softwareVersion": __version__},
            {
                "@id": "#packed",
                "@type": "CreateAction",
                "name": "packed by CoSMic",
                "endTime": now,
                "instrument": {"@id": "#cosmic"},
                "result": {"@id": "./"},
            },
            *entities,
        ],
    }
